"""The checks of an agent scaffold: its parts keep their promises, with plain parts in the place of `react`'s."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import msgspec

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.conformance.case import ConformanceError, require, run_all
from lingjing.plugins.conformance.samples import sample_brief, sample_observations
from lingjing.plugins.decisions import DecisionFormat, JsonSchema
from lingjing.plugins.foreign_errors import one_line
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.plugins.lookup import scaffold_builder
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Receipt
from lingjing.plugins.scaffold import (
    AgentParts,
    MemoryLimits,
    ModelStep,
    ScaffoldContext,
    ScaffoldPlugin,
    Situation,
    StepError,
    Turn,
)

NO_OP = '{"thought": "", "command": null, "messages": []}'
"""An answer in the form of `react`: no command and no messages."""

UNUSABLE = ("", "I would go east.", "{", "[1, 2]", '{"thought": 5}', "</think>", "\ud800")
"""Answers that models give: prose, cut JSON, other JSON, the end of a reasoning alone, half a character."""

LIMITS = MemoryLimits(tokens=2000, images=2)


@dataclass(frozen=True, slots=True)
class ScaffoldCase:
    """The inputs of the checks of a scaffold."""

    plugin: ScaffoldPlugin
    brief: Brief
    observations: tuple[Observation, ...]
    answers: tuple[str, ...]
    """Good answers in the form of the scaffold's parser."""
    arguments: Mapping[str, object] = field(default_factory=dict)

    def parts(self) -> AgentParts:
        """Return the parts of one agent."""
        plugin = self.plugin

        hook = staticmethod(hookimpl(lambda: (plugin,), specname="lingjing_scaffolds"))
        host = PluginHost(entry_points=False, extra=(type(plugin.name, (), {"lingjing_scaffolds": hook}),))
        return scaffold_builder(plugin.name, self.arguments, host)(ScaffoldContext(self.brief, plain_parts(self.brief)))


def check_scaffold(
    plugin: ScaffoldPlugin,
    brief: Brief | None = None,
    observations: Sequence[Observation] = (),
    *,
    answers: Sequence[str] = (NO_OP,),
    arguments: Mapping[str, object] | None = None,
) -> None:
    """Run every check of a scaffold; one `ConformanceError` lists all that failed.

    `answers` are good answers in the form of its parser, `arguments` its options. Without a brief it plays a sample.
    """
    brief = brief or sample_brief()
    shown = tuple(observations) or sample_observations(brief)
    case = ScaffoldCase(plugin, brief, shown, tuple(answers), arguments or {})
    run_all(f"scaffold `{plugin.name}`", SCAFFOLD_CHECKS, case)


def check_texts(case: ScaffoldCase) -> None:
    """Check that the system text has the instructions of memory and parser, and that a state's text repeats."""
    parts = case.parts()
    memory, answer = parts.memory.instructions, parts.parser.instructions
    system: object = parts.prompt.system(case.observations[0], memory, answer)
    _require_text("prompt.system", system)
    for name, text in (("memory", memory), ("parser", answer)):
        require(text in str(system), f"prompt.system: the instructions of the {name} are left out")
    for observation in case.observations:
        situation = Situation(observation, Inbox())
        state = parts.prompt.state(situation)
        _require_text("prompt.state", state)
        require(state == parts.prompt.state(situation), "prompt.state: the text differs in a second call")


def check_parser(case: ScaffoldCase) -> None:
    """Check that good answers become steps, that others raise `StepError` only, and that the schema is valid."""
    parser = case.parts().parser
    if parser.schema is not None:
        _require_json("parser.schema", parser.schema)
    for text in case.answers:
        step = _parsed(parser.parse, text)
        require(step is not None, f"parser.parse: the good answer {text!r} is rejected")
    for text in UNUSABLE:
        _parsed(parser.parse, text)
    require(isinstance(parser.repair("a fault"), str), "parser.repair: no text")


def check_memory(case: ScaffoldCase) -> None:
    """Check that turns are pairs of a user message and an answer, that members are JSON, and that no room means no
    turns."""
    for limits in (LIMITS, MemoryLimits(tokens=0, images=0)):
        memory = case.parts().memory
        memory.begin(limits)
        for tick in range(3):
            memory.record(Turn(tick, f'{{"tick":{tick}}}', case.answers[0], ModelStep(Decision()), Decision()))
        roles = [message.role for message in memory.turns()]
        require(roles == ["user", "assistant"] * (len(roles) // 2), f"memory.turns: the roles are {', '.join(roles)}")
        require(limits.tokens > 0 or not roles, "memory.turns: there are turns without room for tokens")
        _require_json("memory.members", memory.members())


def check_deliberation(case: ScaffoldCase) -> None:
    """Check that the deliberation returns JSON members for good and for unusable answers."""
    for text in (*case.answers, *UNUSABLE):
        _played(case, (text,))


def check_same_requests(case: ScaffoldCase) -> None:
    """Check that the same inputs and answers give the same requests, so that a replay is possible."""
    require(_played(case, case.answers) == _played(case, case.answers), "the same inputs give other requests")


SCAFFOLD_CHECKS: tuple[Callable[[ScaffoldCase], None], ...] = (
    check_texts,
    check_parser,
    check_memory,
    check_deliberation,
    check_same_requests,
)
"""Every check of a scaffold."""


def _parsed(parse: Callable[[str], ModelStep], text: str) -> ModelStep | None:
    try:
        step = parse(text)
    except StepError:
        return None
    except Exception as error:
        raise ConformanceError(f"parser.parse: {text!r}: {one_line(error)}; it must raise a StepError") from error
    return step


def _require_text(where: str, text: object) -> None:
    require(isinstance(text, str) and bool(text.strip()), f"{where}: the text is empty or not a string")


def _played(case: ScaffoldCase, answers: Sequence[str]) -> list[tuple[ChatMessage, ...]]:
    """Play the observations with rejected requests between them. Returns every request."""
    parts, requests = case.parts(), list[tuple[ChatMessage, ...]]()

    async def ask(messages: Sequence[ChatMessage], schema: JsonSchema | None = None) -> str:
        request = tuple(messages)
        messages_alone = all(isinstance(message, ChatMessage) for message in request)
        right = bool(request) and messages_alone and request[-1].role == "user"
        require(right, "deliberation.think: a request does not end with a user message")
        requests.append(request)
        return answers[len(requests) % len(answers)]

    async def play() -> None:
        memory = parts.memory
        system = parts.prompt.system(case.observations[0], memory.instructions, parts.parser.instructions)
        memory.begin(LIMITS)
        for observation in case.observations:
            situation = Situation(observation, _rejected(case.brief, observation), members=memory.members())
            thoughts = await parts.deliberation.think(situation, ask)
            _require_json("deliberation.think", thoughts)
            members = {**thoughts, **situation.members}
            state = parts.prompt.state(Situation(observation, situation.inbox, members=members))
            requests.append((ChatMessage("system", system), *memory.turns(), ChatMessage("user", state)))
            step = _parsed(parts.parser.parse, answers[0]) or ModelStep(Decision())
            memory.record(Turn(observation.tick, state, answers[0], step, step.decision))

    asyncio.run(play())
    return requests


def _rejected(brief: Brief, observation: Observation) -> Inbox:
    resource = brief.resources[0].id if brief.resources else brief.agent
    receipt = Receipt(
        request=f"c{observation.tick}-1", sender=brief.agent, resource=resource, by="kernel", status="rejected",
        tick=observation.tick, time_s=observation.time_s, reason="bad_argument", detail="a sample",
    )  # fmt: skip
    return Inbox(receipts=(receipt,) if observation.tick else ())


def _require_json(where: str, members: Mapping[str, object]) -> None:
    try:
        msgspec.json.encode(dict(members))
    except (TypeError, ValueError) as error:
        require(False, f"{where}: the members are not a JSON object ({error})")


# -- plain parts


def plain_parts(brief: Brief) -> AgentParts:
    """Return the simplest parts that keep the promises; they stand for those of `react`."""
    return AgentParts(_PlainPrompt(brief), _PlainMemory(), _PlainParser(brief))


@dataclass(frozen=True, slots=True)
class _PlainPrompt:
    brief: Brief

    def system(self, first: Observation, memory: str, answer: str) -> str:
        lead = f"You are `{self.brief.agent}`. {self.brief.goal}"
        return "\n\n".join(text for text in (lead, memory, answer) if text)

    def state(self, situation: Situation) -> str:
        receipts = [receipt.status for receipt in situation.inbox.receipts]
        state = {"tick": situation.observation.tick, "receipts": receipts, **situation.members}
        return msgspec.json.encode(state).decode()


class _PlainMemory:
    instructions = ""

    def __init__(self) -> None:
        self._limits = MemoryLimits(tokens=0, images=0)
        self._turns: tuple[ChatMessage, ...] = ()

    def begin(self, limits: MemoryLimits) -> None:
        self._limits = limits

    def turns(self) -> tuple[ChatMessage, ...]:
        return self._turns if self._limits.tokens else ()

    def members(self) -> Mapping[str, object]:
        return {}

    def record(self, turn: Turn) -> None:
        self._turns = (ChatMessage("user", turn.state), ChatMessage("assistant", turn.answer))


class _PlainParser:
    instructions = "Answer with one JSON object."

    def __init__(self, brief: Brief) -> None:
        self._form = DecisionFormat(brief)

    @property
    def schema(self) -> JsonSchema:
        return self._form.schema

    def parse(self, text: str) -> ModelStep:
        try:
            answer = self._form.completed(json.loads(text))
        except (ValueError, RecursionError) as error:
            raise StepError(f"it is not JSON: {error}") from error
        faults = self._form.faults(answer)
        if faults:
            raise StepError("; ".join(faults))
        return ModelStep(self._form.decision(answer))

    def repair(self, fault: str) -> str:
        return f"Answer again: {fault}"


__all__ = [
    "NO_OP", "SCAFFOLD_CHECKS", "ScaffoldCase", "check_deliberation", "check_memory", "check_parser",
    "check_same_requests", "check_scaffold", "check_texts", "plain_parts",
]  # fmt: skip
