"""A mission as a task of Inspect: its agents answer the requests of `react`, and its log holds their runs."""

import json
from pathlib import Path
from typing import Any

import pytest

import lingjing
from tests.bench.suite_kit import TRIP

inspect_ai: Any = pytest.importorskip("inspect_ai", reason="inspect_ai is not installed: run `make frameworks`")
task: Any = pytest.importorskip("lingjing.bench.inspect_task").mission
NOOP = json.dumps({"thought": "nothing to do", "command": None, "messages": []})


@pytest.fixture
def mission(tmp_path: Path) -> str:
    path = tmp_path / "short.ljs"
    path.write_text(TRIP.replace("policy <= 8 s", "policy <= 120 s"))
    return str(path)


def evaluated(task: Any, tmp_path: Path, answers: list[str]) -> Any:
    from inspect_ai.model import ModelOutput, ModelUsage, get_model

    outputs = [ModelOutput.from_content("mockllm/model", text) for text in answers]
    for output in outputs:  # otherwise the model fetches a vocabulary to count tokens
        output.usage = ModelUsage(input_tokens=100, output_tokens=20, total_tokens=120)
    (log,) = inspect_ai.eval(
        task,
        model=get_model("mockllm/model", memoize=False, custom_outputs=outputs),
        log_dir=str(tmp_path / "logs"),
        display="none",
    )
    return log


def test_the_evaluated_model_plays_and_the_log_has_its_calls_and_the_engines_score(
    mission: str, tmp_path: Path
) -> None:
    from inspect_ai.log import read_eval_log

    named = task(mission=mission, seeds="2", out=str(tmp_path / "runs"), respondent="lingjing/one_call")
    log = evaluated(named, tmp_path, [NOOP] * 20)
    assert log.status == "success", log.error
    again = read_eval_log(log.location)
    assert again.samples is not None and [sample.metadata["seed"] for sample in again.samples] == [0, 1]
    for sample in again.samples:
        trace = lingjing.read(tmp_path / "runs" / sample.id / "trace.mcap")
        assert trace.outcome is not None
        score = sample.scores["adjudicated"]
        assert score.value == {"success": float(trace.outcome.success), "score": trace.outcome.score}
        calls = [event for event in sample.events if event.event == "model"]
        assert len(calls) == trace.outcome.ticks == score.metadata["metrics"]["calls"]
        assert calls[0].input[0].role == "system" and calls[0].output.completion == NOOP
    assert {name for score in again.results.scores for name in score.metrics} >= {"mean", "stderr"}


def test_any_inspect_agent_can_answer_and_a_failed_call_is_repeated(mission: str, tmp_path: Path) -> None:
    """The agent sends the boat to the swimmer with its first answer, and fails at its second call."""
    from inspect_ai.agent import Agent, AgentState, agent
    from inspect_ai.model import ModelOutput

    requests: list[list[tuple[str, str]]] = []
    sailing = {"verb": "moveTo", "arguments": {"x": 12.4, "y": -1299.8}}

    @agent
    def scripted() -> Agent:
        async def execute(state: AgentState) -> AgentState:
            requests.append([(message.role, message.text) for message in state.messages])
            number = len(requests)
            if number == 2:
                raise ValueError("no idea")
            answer = {"thought": f"answer {number}", "command": sailing if number == 1 else None, "messages": []}
            state.output = ModelOutput.from_content("none", json.dumps(answer))
            return state

        return execute

    log = evaluated(task(mission=mission, seeds="0-0", respondent=scripted(), out=str(tmp_path / "runs")), tmp_path, [])
    assert log.status == "success", log.error
    trace = lingjing.read(tmp_path / "runs" / log.samples[0].id / "trace.mcap")
    assert trace.outcome is not None and trace.outcome.success
    assert len(requests) == trace.outcome.ticks + 1 == 3
    assert [[role for role, _ in request] for request in requests[:2]] == [
        ["system", "user"], ["system", "user", "assistant", "user"],
    ]  # fmt: skip
    assert [json.loads(request[-1][1])["tick"] for request in requests[:2]] == [0, 1]
    assert requests[2] == requests[1], "the failed request is sent again"
    decisions = [record for boundary in trace.boundaries for record in boundary.decisions]
    assert [record.decision.thought for record in decisions] == ["answer 1", "answer 3"]
    assert [record.substituted for record in decisions] == ["", ""]
    commands = [command for boundary in trace.boundaries for command in boundary.commands]
    assert [(command.verb, command.resource) for command in commands if command.origin == "agent"] == [
        ("moveTo", "boat")
    ]


@pytest.mark.timeout(120)
def test_a_sample_that_ends_early_ends_its_episode(mission: str, tmp_path: Path) -> None:
    import asyncio

    from inspect_ai.agent import Agent, AgentState, agent

    @agent
    def silent() -> Agent:
        async def execute(state: AgentState) -> AgentState:
            await asyncio.Event().wait()
            return state

        return execute

    limited = task(mission=mission, seeds="0-0", respondent=silent(), out=str(tmp_path / "runs"))
    limited.time_limit = 8
    log = evaluated(limited, tmp_path, [])
    assert log.samples[0].limit is not None and log.samples[0].limit.type == "time"
    assert not list(tmp_path.glob("runs/*/trace.mcap")), "the episode has not come to its end"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mission": "ssrr"}, "ssr"),
        ({"mission": "ssr", "seeds": "5-2"}, "neither a number of seeds"),
        ({"mission": "ssr", "mode": "single"}, "single"),
        ({"mission": "ssr", "tier": 7}, "tier 7"),
    ],
)
def test_a_wrong_argument_is_named(arguments: dict[str, str], message: str) -> None:

    with pytest.raises(lingjing.UsageError, match=message):
        task(**arguments)
