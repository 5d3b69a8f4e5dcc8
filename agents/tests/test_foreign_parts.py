"""Faulty parts and backbones of plug-ins in the policy `react`: an error names the plug-in, the part and its line."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from agents.tests.agent_kit import Inbox, brief, observe, react, view
from lingjing.errors import InfrastructureError, PluginError
from lingjing.plugins import lookup
from lingjing.plugins.backbone import BackbonePlugin, ModelCompletion, ServiceAccess
from lingjing.plugins.conformance import ConformanceError, check_scaffold, sample_brief, sample_observations
from lingjing.plugins.conformance.scaffolds import NO_OP, plain_parts
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import NoDecisionError, UsageError
from lingjing.plugins.scaffold import AgentParts, MemoryLimits, ScaffoldContext, ScaffoldPlugin, Situation, StepError
from lingjing.testing import PluginHost

HERE = view("uav[1]", (306.0, -620.0, 96.5))
CONTEXT = ScaffoldContext(sample_brief(), plain_parts(sample_brief()))
OWNER = "scaffold `mine` of plug-in `Acme`"


def host_of(**hooks: Callable[[], object]) -> PluginHost:
    """A host with the plug-in `Acme`, which offers these."""
    members = {name: staticmethod(hookimpl(hook, specname=name)) for name, hook in hooks.items()}
    return PluginHost(extra=(type("Acme", (), members),))


def built(build: Callable[[ScaffoldContext], Any]) -> AgentParts:
    """The parts of the scaffold `mine`."""
    host = host_of(lingjing_scaffolds=lambda: [ScaffoldPlugin(name="mine", build=build)])
    return lookup.scaffold_builder("mine", {}, host)(CONTEXT)


class Broken:
    """Every part at once; each method raises."""

    @property
    def instructions(self) -> str:
        raise KeyError("instructions")

    @property
    def schema(self) -> object:
        raise KeyError("schema")

    def __getattr__(self, name: str) -> Callable[..., object]:
        def fail(*arguments: object) -> object:
            raise KeyError(name)

        return fail


SITUATION = Situation(sample_observations(sample_brief())[0], Inbox())
CALLS: dict[str, Callable[[AgentParts], object]] = {
    "prompt.system": lambda parts: parts.prompt.system(SITUATION.observation, "", ""),
    "prompt.state": lambda parts: parts.prompt.state(SITUATION),
    "memory.instructions": lambda parts: parts.memory.instructions,
    "memory.begin": lambda parts: parts.memory.begin(MemoryLimits(tokens=1, images=1)),
    "memory.turns": lambda parts: parts.memory.turns(),
    "memory.members": lambda parts: parts.memory.members(),
    "memory.record": lambda parts: parts.memory.record(None),  # type: ignore[arg-type]
    "parser.instructions": lambda parts: parts.parser.instructions,
    "parser.schema": lambda parts: parts.parser.schema,
    "parser.parse": lambda parts: parts.parser.parse("{}"),
    "parser.repair": lambda parts: parts.parser.repair("a fault"),
    "deliberation.think": lambda parts: asyncio.run(parts.deliberation.think(SITUATION, None)),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("call", CALLS)
def test_the_error_of_a_part_names_its_scaffold_and_its_line(call: str) -> None:
    parts = built(lambda context: AgentParts(Broken(), Broken(), Broken(), Broken()))  # type: ignore[arg-type]
    message = (
        rf"^{OWNER}: {call} raised KeyError: '{call.partition('.')[2]}' \(agents/tests/test_foreign_parts.py:\d+\)"
    )
    with pytest.raises(PluginError, match=message):
        CALLS[call](parts)


class Mute:
    """Every part at once; each method returns 3."""

    instructions = schema = 3

    def __getattr__(self, name: str) -> Callable[..., object]:
        return lambda *arguments: 3


@pytest.mark.parametrize("call", sorted(CALLS.keys() - {"memory.begin", "memory.record", "parser.schema"}))
def test_a_part_that_returns_a_wrong_type_is_named(call: str) -> None:
    parts = built(lambda context: AgentParts(Mute(), Mute(), Mute(), Mute()))  # type: ignore[arg-type]
    due = "raised TypeError" if call == "deliberation.think" else "returned a value of type `int`, and a"
    with pytest.raises(PluginError, match=f"^{OWNER}: {call} {due}"):
        CALLS[call](parts)


def test_the_parts_of_react_are_not_wrapped_and_a_step_error_passes_unchanged() -> None:
    class Strict:
        instructions, schema, extra = "", None, 7

        def parse(self, text: str) -> object:
            raise StepError("not one line")

    parts = built(lambda context: replace(context.react, parser=Strict()))  # type: ignore[arg-type]
    assert parts.prompt is CONTEXT.react.prompt and parts.memory is CONTEXT.react.memory
    assert parts.parser.extra == 7  # type: ignore[attr-defined]
    with pytest.raises(StepError, match="not one line"):
        parts.parser.parse("{}")


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda context: None, f"^{OWNER} built None, no AgentParts"),
        (lambda context: context.rect, rf"^{OWNER} cannot be built: AttributeError: .*'rect' \(agents/tests"),
    ],
)
def test_a_scaffold_that_cannot_be_built_is_named(build: Callable[[ScaffoldContext], Any], message: str) -> None:
    with pytest.raises(PluginError, match=message):
        built(build)
    with pytest.raises(ConformanceError, match="scaffold `mine` breaks its contract: texts, parser, memory, "):
        check_scaffold(ScaffoldPlugin(name="mine", build=build), answers=(NO_OP,))


# -- backbones


class Model:
    """A backbone that answers, or raises, as `answer` says."""

    def __init__(self, answer: Callable[[], object]) -> None:
        self._answer = answer

    async def complete(self, request: object, timeout_s: float) -> object:
        return self._answer()


def fail() -> object:
    return {}["weights"]


def install(monkeypatch: pytest.MonkeyPatch, answer: Callable[[], object], **declared: Any) -> None:
    offered = [BackbonePlugin(name="mine", factory=lambda access: Model(answer), **declared)]  # type: ignore[arg-type]
    host = host_of(lingjing_backbones=lambda: offered)
    monkeypatch.setattr(lookup, "PluginHost", type("Installed", (PluginHost,), {"__new__": lambda cls: host}))


async def played(ticks: int) -> list[BaseException]:
    """The errors of `react` over the backbone at its first boundaries."""
    policy = react(model="m", client="mine", deadline="600")
    await policy.reset(brief())
    errors: list[BaseException] = []
    for tick in range(ticks):
        with pytest.raises((NoDecisionError, InfrastructureError)) as caught:
            await policy.act(observe("scout[1]", tick, HERE), Inbox())
        errors.append(caught.value)
    return errors


@pytest.mark.parametrize(
    ("answer", "problem"),
    [
        (fail, "failed: KeyError: 'weights' (agents/tests/test_foreign_parts.py:"),
        (lambda: "yes", "returned a value of type `str`, no ModelCompletion"),
    ],
)
async def test_the_error_of_a_failing_backbone_names_the_backbone_and_not_the_service(
    answer: Callable[[], object], problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, answer)
    first, _, last = await played(3)
    assert str(first).startswith(f"backbone `mine` of plug-in `Acme` {problem}")
    assert isinstance(last, InfrastructureError) and "service" not in str(last)
    assert f"got no answer 3 ticks in a row: backbone `mine` of plug-in `Acme` {problem}" in str(last)
    assert last.hint.startswith("correct the backbone")


def test_a_model_that_the_backbone_does_not_serve_is_a_usage_error(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, lambda: ModelCompletion("{}", "stop"), models=("large-7b", "small-1b"))
    for model, hint in (("larg-7b", "did you mean `large-7b`?"), ("x", "its models: large-7b, small-1b")):
        with pytest.raises(UsageError, match=f"option `client` is `mine`, which serves no model `{model}`") as caught:
            react(model=model, client="mine")
        assert caught.value.faults[0].hint == hint
        assert str(caught.value).endswith(hint) and caught.value.hint == ""
    assert react(model="small-1b", client="mine")
    assert lookup.backbone_models("mine") == ("large-7b", "small-1b")
    assert lookup.open_backbone("mine", ServiceAccess("")) is not None
