"""Inspect AI's own ReAct agent with its instant model (`mockllm`), a tool call a turn: run by `harness.py` in an
environment of its own. Prints milliseconds of CPU a turn, as the difference of two lengths: without the start."""

from __future__ import annotations

import sys
import tempfile
import time

from inspect_ai import Task, eval  # noqa: A004 - its own name
from inspect_ai.agent import react
from inspect_ai.dataset import Sample
from inspect_ai.model import ModelOutput, _model, get_model
from inspect_ai.tool import Tool, tool

STATE = "state " * 200

_model.count_text_tokens = lambda text: len(text) // 4  # its own fetches a vocabulary; cheaper, so in its favour


@tool
def step() -> Tool:
    async def execute(thought: str) -> str:
        """Do one step.

        Args:
            thought: Why.
        """
        return STATE

    return execute


def cpu_s(samples: int, turns: int) -> float:
    """Return the CPU seconds of an evaluation with this number of samples and turns, its log included."""

    def outputs():
        while True:
            yield ModelOutput.for_tool_call("mockllm/model", "step", {"thought": "nothing to do"})

    model = get_model("mockllm/model", custom_outputs=outputs())
    task = Task(
        dataset=[Sample(input=f"sample {number}", target="x") for number in range(samples)],
        solver=react(prompt="the rules " * 1000, tools=[step()]),
        message_limit=2 * turns + 2,
    )
    with tempfile.TemporaryDirectory() as folder:
        started = time.process_time()
        (log,) = eval(task, model=model, log_dir=folder, display="none", max_samples=samples)
        spent = time.process_time() - started
        assert log.samples is not None
        made = sum(message.role == "assistant" for sample in log.samples for message in sample.messages)
    assert abs(made - samples * turns) <= samples, (made, log.status)
    return spent


def main() -> None:
    samples, turns = int(sys.argv[1]), int(sys.argv[2])
    cpu_s(1, 2)  # everything is imported by then
    short = cpu_s(samples, 2)
    print(1e3 * (cpu_s(samples, turns) - short) / (samples * (turns - 2)))


if __name__ == "__main__":
    main()
