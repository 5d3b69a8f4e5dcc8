"""The cost of a model agent's turn without the model and the picture.

It compares the CPU of `react` with an instant model, live and recorded, with that of Inspect AI's ReAct agent with its
own instant model on the same number of turns.

Ours is the CPU of the agent's thread from the observation to the checked decision: prompt and state as text, limits,
secrets blanked, the record, the answer checked against its JSON Schema. Inspect's is its process's CPU a turn, with its
log. Neither goes over HTTP, which is measured by itself, against a server in another process.
"""

from __future__ import annotations

import asyncio
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.guard import GuardedClient
from lingjing_agents.llm.redaction import Redactor
from lingjing_agents.react.options import ReactOptions
from lingjing_agents.react.policy import ReactPolicy

import lingjing
from lingjing.plugins.backbone import ChatMessage, ChatRequest, ModelCompletion
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.policy import Decision, Inbox, Observation

HERE = Path(__file__).resolve().parent
FOREIGN_PYTHON = HERE.parent / ".venv-inspect" / "bin" / "python"
AGENTS, TICKS = 5, 60
NOTHING = '{"thought": "nothing to do", "command": null, "messages": []}'
LOOK = '{"thought": "I look", "command": {"verb": "takePhoto", "arguments": {}, "resource": "%s"}, "messages": []}'
SERVER = """
import sys
from agents.tests.chat_server import Reply, serve
with serve([Reply()]) as server:
    print(server.url, flush=True)
    sys.stdin.read()
"""

turns: list[float] = []


class InstantClient:
    """A model that answers at once."""

    def __init__(self, answer: str) -> None:
        self.answer = answer

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        return ModelCompletion(self.answer, "stop", 1000, 20)


class Measured(ReactPolicy):
    """`react` with an instant model; stores the CPU time of each turn."""

    options = ReactOptions
    calls = True
    looks = False

    def __init__(self, options: ReactOptions, calls: ModelCalls) -> None:
        super().__init__(options, calls)
        self._instant = InstantClient(NOTHING)
        self._model._client = GuardedClient(self._instant, Redactor(("sk-a-key-of-some-length-0123456789",)))

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        resource = self._brief.resources[0] if self._brief.resources else None
        if self.looks and resource is not None and resource.cameras:
            self._instant.answer = LOOK % resource.id
        started = time.thread_time()
        decision = await super().act(observation, inbox)
        turns.append(time.thread_time() - started)
        return decision


class Looking(Measured):
    """A `Measured` policy that requests and receives a picture at every turn."""

    options = ReactOptions
    calls = True
    looks = True


def ours(policy: type[Measured], calls: str) -> list[float]:
    """Return the CPU milliseconds of each turn of one episode of the sea rescue."""
    turns.clear()
    with tempfile.TemporaryDirectory() as folder:
        report = lingjing.run(
            "ssr",
            mode="star",
            policy=policy,
            policy_args={"model": "m", "base_url": "http://localhost:1/v1"},
            calls=calls,
            overview=False,
            out=Path(folder) / "run",
        )
    assert report.metrics is not None
    assert report.metrics.substitutions == 0
    assert report.metrics.calls == len(turns) == AGENTS * TICKS
    return [1e3 * turn for turn in turns]


def over_http(pictures: int) -> list[float]:
    """Return the CPU milliseconds of each exchange with a local server: 15 kB of text, and pictures of 100 kB."""
    picture = bytes(range(256)) * 400
    messages = (ChatMessage("system", "x" * 12_000), ChatMessage("user", "y" * 3_000, (picture,) * pictures))
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", SERVER], cwd=HERE.parent, **pipes) as server:
        client = DirectClient(server.stdout.readline().strip())

        async def exchanges() -> list[float]:
            spent = []
            for _ in range(100):
                started = time.thread_time()
                await client.complete(ChatRequest("m", messages), 60)
                spent.append(1e3 * (time.thread_time() - started))
            return spent

        spent = asyncio.run(exchanges())
        server.stdin.close()
    return spent


def main() -> None:
    """Print the table."""
    print("| CPU a turn, ms | median | mean | turns |")
    print("| --- | --- | --- | --- |")
    for name, policy, calls in (
        ("react, live", Measured, "live"),
        ("react, recorded", Measured, "record"),
        ("react, recorded, with a 1080p picture", Looking, "record"),
    ):
        spent = ours(policy, calls)
        print(f"| {name} | {statistics.median(spent):.2f} | {statistics.mean(spent):.2f} | {len(spent)} |")
    command = [str(FOREIGN_PYTHON), str(HERE / "inspect_side.py"), str(AGENTS), str(TICKS)]
    mean = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-1])
    print(f"| Inspect AI, with its log | - | {mean:.2f} | {AGENTS * TICKS} |")
    for pictures in (0, 2):
        spent = over_http(pictures)
        print(f"| HTTP, {pictures} pictures | {statistics.median(spent):.2f} | {statistics.mean(spent):.2f} | 100 |")


if __name__ == "__main__":
    main()
