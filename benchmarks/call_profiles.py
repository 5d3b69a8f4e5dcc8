"""The measured model calls of one episode in each column, which `react` reckons prices with.

`python -m benchmarks.call_profiles RUNS [--columns ssr-star …] [--seeds N] [--write]`

A server on loopback stands for the model: it answers by the rules of `heuristic`, from the text of the requests alone,
with a thought and a plan of usual length. Each column is played under `RUNS` unless its record is there, with N seeds
(1), of which the episode of median length counts. With `--write` the profiles replace those of the package.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
from lingjing_agents.llm.picture_tokens import jpeg_size
from lingjing_agents.react.call_profile import PROFILES, ColumnProfile, RoleProfile
from lingjing_agents.react.token_bound import message_bound, token_bound

import lingjing
from agents.tests.chat_server import Reply, reading_model, serve
from lingjing.bench.columns import Column, columns, shipped
from lingjing.mission.instantiate import instantiate
from lingjing.mission.tiers import USUAL, tiers_of
from lingjing.trace.call_store import CALLS_NAME, CallReader
from lingjing.trace.calls import RecordedCall

MODEL = "gpt-5.4"
"""The model of the list that the server stands for: the budget of its requests is that of all listed ones."""

FIRST_SEED = 1001
"""The first seed of the played episodes. Chosen outside of the seeds of all shipped suites."""

THOUGHT = (
    "The picture shows open water north of the boat and two bright marks near its right edge that may be people. "
    "The last receipt says that the command is still running, so that no other one can begin before it has ended. "
    "I report what I see, keep to my cell, and look at the next one at the following tick. "
)
"""The reasoning of an answer, 290 letters: three sentences, the most that the prompt permits. Chosen, because the rules
of `heuristic` write no reasoning."""

PLAN = ("finish the cell where I am and take a picture of it", "report every find once, then go to the next cell")
"""The lines that the model keeps. Chosen."""


class WordyModel:
    """The model that answers from the text of its requests, with a thought and a plan."""

    def __init__(self) -> None:
        self._model = reading_model()

    def __call__(self, request: dict[str, Any]) -> Reply:
        """Return the answer to a request."""
        reply = self._model(request)
        reply.step = {**reply.step, "thought": THOUGHT.strip(), "plan": list(PLAN)}
        return reply


def main() -> int:
    """Play, and print or store the profiles."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path)
    parser.add_argument("--columns", nargs="+", metavar="MISSION-MODE")
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--seeds", metavar="N", type=int, default=1)
    args = parser.parse_args()
    profiles = msgspec.json.decode(PROFILES.read_bytes(), type=dict[str, ColumnProfile]) if PROFILES.exists() else {}
    for path in shipped():
        for column in columns([path]):
            if args.columns and column.name not in args.columns:
                continue
            seeds = range(FIRST_SEED, FIRST_SEED + args.seeds)
            played = [_profile(column, seed, args.runs / f"{column.name}-{seed}") for seed in seeds]
            profiles[column.name] = sorted(played, key=lambda profile: profile.ticks)[len(played) // 2]
            print(column.name, *(profile.ticks for profile in played), profiles[column.name], flush=True)
    if args.write:
        PROFILES.write_bytes(msgspec.json.format(msgspec.json.encode(profiles), indent=1) + b"\n")
    return 0


def _profile(column: Column, seed: int, folder: Path) -> ColumnProfile:
    """Return the profile of one episode, which is played into the folder unless it is there."""
    mission = lingjing.compile(column.path)
    tier = USUAL if USUAL in tiers_of(mission) else 0
    if not (folder / "profile.json").is_file():
        _play(column, tier, seed, folder)
    measured = json.loads((folder / "profile.json").read_text())
    instance = instantiate(mission, seed=seed, mode=column.mode, tier=tier)
    roles = {agent.id: agent.role for agent in instance.agents}
    return ColumnProfile(
        tier=tier, seed=seed, ticks=measured["ticks"], budget=instance.budget.ticks, cpu_s=measured["cpu_s"],
        roles=tuple(_roles(folder / CALLS_NAME, roles)),
    )  # fmt: skip


def _play(column: Column, tier: int, seed: int, folder: Path) -> None:
    """Play the column into the folder, and store its ticks and the CPU of its processes."""
    before, started = _cpu_s(), time.monotonic()
    with serve(WordyModel()) as server:
        report = lingjing.run(
            column.path, mode=column.mode, seed=seed, tier=tier, policy="react", overview=False, out=folder,
            policy_args={"model": MODEL, "base_url": server.url, "encoding": "paper"},
        )  # fmt: skip
    measured = {
        "ticks": report.ticks, "cpu_s": round(_cpu_s() - before, 1), "wall_s": round(time.monotonic() - started, 1),
        "success": report.success, "reason": report.reason,
    }  # fmt: skip
    (folder / "profile.json").write_text(json.dumps(measured))


def _cpu_s() -> float:
    """Return the CPU seconds of this process and of its children that have ended. The server counts as well."""
    parts = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(part.ru_utime + part.ru_stime for part in parts)


def _roles(record: Path, role_of: dict[str, str]) -> Iterator[RoleProfile]:
    """Yield the profile of each role."""
    with closing(CallReader(record)) as reader:
        calls = [call for call in reader.calls() if call.tick >= 0]
        sizes = {name: jpeg_size(reader.content(bytes.fromhex(name))) for call in calls for name in call.pictures}
    for role in dict.fromkeys(role_of.values()):
        agents = [agent for agent, own in role_of.items() if own == role]
        yield _role(role, [[call for call in calls if call.agent == agent] for agent in agents], sizes)


def _role(role: str, agents: list[list[RecordedCall]], sizes: dict[str, tuple[int, int]]) -> RoleProfile:
    calls = [call for own in agents for call in own]
    late = [call for own in agents for call in own[2 * len(own) // 3 :]]
    pictures: dict[str, int] = {}
    for call in calls:
        for name in call.pictures:
            size = "{}x{}".format(*sizes[name])
            pictures[size] = pictures.get(size, 0) + 1
    return RoleProfile(
        role=role, agents=len(agents), calls=len(calls), schema=_schema(calls[0]),
        system=sum(_bound(call.messages[:1]) for call in calls),
        history=sum(_bound(call.messages[1:-1]) for call in calls),
        state=sum(_bound(call.messages[-1:]) for call in calls),
        late_calls=len(late),
        late_history=sum(_bound(call.messages[1:-1]) for call in late),
        late_state=sum(_bound(call.messages[-1:]) for call in late),
        repeated=sum(_repeated(own) for own in agents),
        answer=sum(message_bound(call.result.text) for call in calls if call.result is not None),
        pictures=pictures,
    )  # fmt: skip


def _schema(call: RecordedCall) -> int:
    """Return the tokens of the JSON Schema in a system text: the only line that begins an object of this kind."""
    lines = _text(call.messages[0]).splitlines()
    return sum(token_bound(line) for line in lines if line.startswith('{"type":"object"'))


def _bound(messages: tuple[bytes, ...]) -> int:
    return sum(message_bound(_text(message)) for message in messages)


def _text(message: bytes) -> str:
    content = msgspec.json.decode(message)["content"]
    return content if isinstance(content, str) else content[0]["text"]


def _repeated(calls: list[RecordedCall]) -> int:
    """Return the tokens of the beginnings that requests share with the ones before."""
    total = 0
    for before, call in pairwise(calls):
        same = 0
        while same < min(len(before.messages), len(call.messages)) and before.messages[same] == call.messages[same]:
            same += 1
        total += _bound(call.messages[:same])
    return total


if __name__ == "__main__":
    sys.exit(main())
