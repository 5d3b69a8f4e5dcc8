"""The agent-scaffold contract: the replaceable parts of an agent that decides with a chat model.

At each boundary an agent over a chat model (policy `react`) makes one request and reads one step from the answer. Four
parts decide what is in the request and what becomes of the answer:

- `PromptBuilder`  writes the system text, once an episode, and the text of the state, once a boundary
- `Memory`         keeps earlier turns and notes, and puts them into later requests
- `AnswerParser`   says which form an answer has, and reads the step from it
- `Deliberation`   may make further requests before the decision, and adds their results to the state

A *scaffold* is a function from a `ScaffoldContext` to `AgentParts`. The context holds the parts of `react`, so that a
scaffold can keep some, replace some and build on others. The option `scaffold` of `react` chooses one by its name.
The loop around the parts stays that of `react`: deadlines, pictures, crops, repairs, retries, records and bills.

The parts of one agent live for one episode. The same inputs must give the same texts: a replay sends each request again
and compares it with the record. `lingjing.plugins.conformance.check_scaffold` tests these promises.
See `docs/scaffolds.md` and ADR 0032.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.decisions import JsonSchema
from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation, Picture
from lingjing.trace.records import UnitBox

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

NO_MEMBERS: Mapping[str, object] = {}


class StepError(Exception):
    """An answer that cannot be used. The text states the fault in words that a model can act on."""


@dataclass(frozen=True, slots=True)
class Crop:
    """A part of a picture that the model requests enlarged before it decides."""

    frame: str
    """The id of a picture of the same request."""
    box: UnitBox
    """x_min, y_min, x_max, y_max as shares of the whole picture."""


@dataclass(frozen=True, slots=True)
class ModelStep:
    """The content of one answer."""

    decision: Decision
    memory: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Lines that the model wants to keep, by the name of their field."""
    crop: Crop | None = None
    """The part of a picture that the model requests instead of a decision; None for a decision."""


@dataclass(frozen=True, slots=True)
class ImageFile:
    """An image of a request."""

    frame: str
    """The id of the picture that it shows."""
    part: UnitBox
    """The part of the picture that it shows, as shares."""
    jpeg: bytes
    pixels: int


@dataclass(frozen=True, slots=True)
class Situation:
    """The inputs of one request."""

    observation: Observation
    """The observation, without what the options of the policy leave out."""
    inbox: Inbox
    pictures: tuple[Picture, ...] = ()
    """The pictures that the model receives, in order."""
    images: tuple[ImageFile, ...] = ()
    """Their JPEG files in the order of the request: whole pictures and tiles."""
    commands: Mapping[int, Action] = field(default_factory=dict)
    """The agent's earlier commands, by the boundary at which they were admitted."""
    members: Mapping[str, object] = field(default_factory=dict)
    """Members that the state's JSON object gets as they are: those of the deliberation and the memory, then those of
    the loop. A member without a value (None, "", an empty list) is left out."""


@dataclass(frozen=True, slots=True)
class Turn:
    """A finished boundary: the text of the state, the answer, and the decision that was made of it."""

    tick: int
    state: str
    answer: str
    """The answer without the reasoning that precedes it."""
    step: ModelStep
    decision: Decision
    """The decision as it is sent: the loop may have withheld the command of `step`."""
    images: tuple[ImageFile, ...] = ()


@dataclass(frozen=True, slots=True)
class MemoryLimits:
    """The room for earlier turns in a request."""

    tokens: int
    images: int


class PromptBuilder(Protocol):
    """The part that writes the texts of a request."""

    def system(self, first: Observation, memory: str, answer: str) -> str:
        """Return the system text. `first` is the first observation; `memory` and `answer` are the instructions of the
        memory and of the parser, "" for none, which the text must contain."""
        ...

    def state(self, situation: Situation) -> str:
        """Return the text of one boundary. It must not depend on earlier calls."""
        ...


class Memory(Protocol):
    """The part that keeps what later requests need."""

    @property
    def instructions(self) -> str:
        """The text that explains the memory to the model; "" for none."""
        ...

    def begin(self, limits: MemoryLimits) -> None:
        """Called once, before the first request."""
        ...

    def turns(self) -> tuple[ChatMessage, ...]:
        """Return earlier turns for the next request: a user message, its answer, and so on."""
        ...

    def members(self) -> Mapping[str, object]:
        """Return the members that the next state gets."""
        ...

    def record(self, turn: Turn) -> None:
        """Keep a finished boundary. Not called where no decision was made."""
        ...


class AnswerParser(Protocol):
    """The part that reads a step from an answer."""

    @property
    def instructions(self) -> str:
        """The text that describes the form of an answer to the model; "" if the schema is enough."""
        ...

    @property
    def schema(self) -> JsonSchema | None:
        """The JSON Schema that the service is given, if it keeps answers to one; None for free text."""
        ...

    def parse(self, text: str) -> ModelStep:
        """Return the step of an answer. Raises `StepError` for an answer that cannot be used."""
        ...

    def repair(self, fault: str) -> str:
        """Return the text that requests another answer, after a `StepError` with the text `fault`."""
        ...


class ModelQuestion(Protocol):
    """A request to the agent's own model, within the time of the decision. It is recorded and billed like the others.

    Raises `lingjing.plugins.backbone.ModelError` for a failed call; a deliberation lets it pass, so that the loop
    handles it.
    """

    async def __call__(self, messages: Sequence[ChatMessage], schema: JsonSchema | None = None) -> str:
        """Return the answer's text without the reasoning that precedes it."""
        ...


class Deliberation(Protocol):
    """The part that thinks before the decision."""

    async def think(self, situation: Situation, ask: ModelQuestion) -> Mapping[str, object]:
        """Return members for the state of this boundary; `ask` makes further requests."""
        ...


class NoDeliberation:
    """The deliberation of an agent that decides at once."""

    async def think(self, situation: Situation, ask: ModelQuestion) -> Mapping[str, object]:
        """Return no members."""
        return NO_MEMBERS


@dataclass(frozen=True, slots=True)
class AgentParts:
    """The parts of one agent. `dataclasses.replace` replaces some of them."""

    prompt: PromptBuilder
    memory: Memory
    parser: AnswerParser
    deliberation: Deliberation = field(default_factory=NoDeliberation)


@dataclass(frozen=True, slots=True)
class ScaffoldContext:
    """The inputs from which a scaffold builds the parts of one agent for one episode."""

    brief: Brief
    """The brief, without what the options of the policy leave out."""
    react: AgentParts
    """The parts of `react`."""


@dataclass(frozen=True, slots=True)
class ScaffoldPlugin:
    """The declaration of a scaffold through the hook `lingjing_scaffolds`."""

    name: str
    """The value of `react`'s option `scaffold` that chooses it."""
    build: Callable[..., AgentParts]
    """Takes a `ScaffoldContext`, and an object of the model `options` if there is one."""
    summary: str = ""
    options: type[PluginOptions] | str | None = None
    """The model of its options, as a class or as `package.module:Class`; the option `scaffold_args` of `react` has
    their values as a JSON object."""


__all__ = [
    "NO_MEMBERS", "AgentParts", "AnswerParser", "Crop", "Deliberation", "ImageFile", "Memory", "MemoryLimits",
    "ModelQuestion", "ModelStep", "NoDeliberation", "PromptBuilder", "ScaffoldContext", "ScaffoldPlugin", "Situation",
    "StepError", "Turn", "UnitBox",
]  # fmt: skip
