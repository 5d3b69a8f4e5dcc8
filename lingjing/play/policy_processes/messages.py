"""The messages between the player of an episode and the process of one agent's policy: one msgpack document each.

The player sends requests, and the policy's process sends one answer to each. A second channel carries the requests for
the record of model calls. The process runs foreign code: the player decodes its messages strictly, and no decoded value
is executed.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import msgspec

from lingjing.errors import (
    Fault,
    ForeignCodeError,
    InfrastructureError,
    LingjingError,
    MissionError,
    PluginError,
    UsageError,
    hint_of,
)
from lingjing.mission.instance import GivenOption, Instance, Weather
from lingjing.option_listing import OptionSpec
from lingjing.play.policy_files import PolicyDeclaration
from lingjing.play.policy_processes.pictures import PicturePart
from lingjing.plugins.calls import MissingCallError, ModelQuestion, SpendingLimitError
from lingjing.plugins.policy import Brief, Inbox
from lingjing.processes.walls.report import WallReport
from lingjing.trace.calls import CallRequest, CallResult
from lingjing.trace.records import (
    Absent,
    BodyState,
    CellView,
    Decision,
    EntityView,
    EventView,
    FrameInfo,
    Route,
    Usage,
)

ErrorKind = Literal[
    "UsageError",
    "MissionError",
    "PluginError",
    "ForeignCodeError",
    "InfrastructureError",
    "SpendingLimitError",
    "MissingCallError",
]
"""The classes of this project's errors that a message can hold."""
_KINDS: dict[ErrorKind, type[LingjingError]] = {
    "SpendingLimitError": SpendingLimitError,
    "MissingCallError": MissingCallError,
    "InfrastructureError": InfrastructureError,
    "ForeignCodeError": ForeignCodeError,
    "PluginError": PluginError,
    "MissionError": MissionError,
    "UsageError": UsageError,
}
"""The classes by kind, subclasses first, because `raised` uses the first match."""


class PolicyMessage(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """The base of all requests and answers. The tag is the class name."""


class TruthConstants(msgspec.Struct, frozen=True, kw_only=True):
    """The part of `Privileged` that stays the same during an episode. `city` is encoded by `held_cities.packed`."""

    instance: Instance
    city: msgspec.Raw


class ExaminePolicies(PolicyMessage, frozen=True, kw_only=True):
    """Load policies, and share the options among them."""

    specs: tuple[str, ...]
    """The names and files of the policies."""
    arguments: dict[str, GivenOption]
    """All options of policies."""
    whole: bool
    """True if these are all policies of the request. Otherwise no options are shared."""
    walled: bool = False
    """True if the process is behind walls, and may load every installed plug-in without a trial."""


class DeclarePolicy(PolicyMessage, frozen=True, kw_only=True):
    """Load the policy of a file, and return its declaration."""

    spec: str
    listed: bool
    """True to return the list of its options too."""
    walled: bool = False
    """True if the process is behind walls, and may load every installed plug-in without a trial."""


class CheckOptions(PolicyMessage, frozen=True, kw_only=True):
    """Check the options of a declared policy."""

    spec: str
    arguments: dict[str, GivenOption]


class LoadPolicy(PolicyMessage, frozen=True, kw_only=True):
    """Load and build one policy."""

    spec: str
    """Its name or file."""
    source: str
    """The plug-in that offers it; "" for a file."""
    arguments: dict[str, GivenOption]
    """Its options."""
    seed: int
    """The seed of the global random generators."""
    as_given: bool = False
    """True if an examination has found that its factory receives the options unchanged."""
    brokered: bool = False
    """True if the second channel leads to a broker of model calls (`ModelCalls.broker`)."""
    replaying: bool = False
    """True if every answer of a model comes from a record (`ModelCalls.replaying`)."""
    capped: bool = False
    """True if money is limited (`ModelCalls.capped`)."""
    truth: TruthConstants | None = None
    """The constant truth; None unless the policy is privileged."""
    makers: tuple[str, ...] = ()
    """The plug-ins that make or wrap it."""


class ResetPolicy(PolicyMessage, frozen=True, kw_only=True):
    """Call `reset` with a brief."""

    brief: Brief


class TruthNow(msgspec.Struct, frozen=True, kw_only=True):
    """The part of `Privileged` that changes from boundary to boundary."""

    states: tuple[BodyState, ...]
    frames: tuple[FrameInfo, ...]
    achieved: tuple[tuple[str, tuple[str, ...]], ...]
    emitted: tuple[tuple[str, tuple[str, ...]], ...]
    routes: tuple[Route, ...]
    inspected: dict[str, tuple[int, ...]]
    used: dict[str, int]
    forbidden: tuple[tuple[str, str], ...]


class HandOverPictures(PolicyMessage, frozen=True, kw_only=True):
    """Descriptors of slots that the packet of the next `ActPolicy` has no room for. It has no answer."""


class ActPolicy(PolicyMessage, frozen=True, kw_only=True):
    """Call `act`. The fields are those of `Observation`.

    Descriptors of new slots come with this message, or with a `HandOverPictures` before it.
    """

    agent: str
    tick: int
    time_s: float
    entities: tuple[EntityView, ...]
    cells: tuple[CellView, ...]
    events: tuple[EventView, ...]
    pictures: tuple[PicturePart, ...]
    absent: tuple[Absent, ...]
    weather: Weather
    truth: TruthNow | None
    inbox: Inbox


class CancelCall(PolicyMessage, frozen=True, kw_only=True):
    """Cancel the call at its next wait, because its time is over. The call still sends its answer."""


class ClosePolicy(PolicyMessage, frozen=True, kw_only=True):
    """Run the exit functions, and end the process."""


PolicyRequest = (
    ExaminePolicies
    | DeclarePolicy
    | CheckOptions
    | LoadPolicy
    | ResetPolicy
    | HandOverPictures
    | ActPolicy
    | CancelCall
    | ClosePolicy
)


class ExaminedPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """An examined policy."""

    name: str
    """Its name."""
    privileged: bool
    """True if it receives the truth."""
    arguments: dict[str, GivenOption]
    """Its share of the options."""
    as_given: bool
    """True if its factory receives these options unchanged (`plugins.loading.takes_as_given`)."""
    fingerprint: dict[str, str]
    """Values that decide its behaviour beside the options."""
    source: str = ""
    """The plug-in that offers it; "" for a file."""
    calls: bool = False
    """True if it calls chat models."""


class WallsBuilt(PolicyMessage, frozen=True, kw_only=True):
    """The walls stand. The first message of a process behind walls, sent before it executes foreign code."""

    report: WallReport


class RaisedError(PolicyMessage, frozen=True, kw_only=True):
    """An error of this project's classes. `detail` is its class and text if a policy has raised it."""

    kind: ErrorKind
    message: str
    detail: str = ""
    hint: str = ""
    faults: tuple[Fault, ...] = ()


class PoliciesExamined(PolicyMessage, frozen=True, kw_only=True):
    """The loaded policies by their names in the request, and every error."""

    found: dict[str, ExaminedPolicy]
    errors: tuple[RaisedError, ...]


class PolicyDeclared(PolicyMessage, frozen=True, kw_only=True):
    """The declaration of a policy. `listed` are its options for display, if requested."""

    declaration: PolicyDeclaration
    listed: tuple[OptionSpec, ...] = ()


class OptionsChecked(PolicyMessage, frozen=True, kw_only=True):
    """Every fault of the options."""

    faults: tuple[Fault, ...]


class CallEnded(PolicyMessage, frozen=True, kw_only=True):
    """The policy is built, or `reset` has returned."""


class DecisionMade(PolicyMessage, frozen=True, kw_only=True):
    """The decision of `act`, as plain values. `kept` are the slots of pictures that the policy still holds."""

    decision: Decision
    kept: tuple[int, ...] = ()


class CallFailed(PolicyMessage, frozen=True, kw_only=True):
    """A call without a decision."""

    kept: tuple[int, ...] = ()
    """The slots of pictures that the policy still holds."""
    reason: Literal["policy_error", "malformed", "policy_timeout"]
    """The kind of failure."""
    detail: str
    """The failure in words."""
    usage: Usage | None = None
    """The cost of the call; None if the policy reports none."""


PolicyAnswerMessage = (
    WallsBuilt
    | PoliciesExamined
    | PolicyDeclared
    | OptionsChecked
    | CallEnded
    | DecisionMade
    | CallFailed
    | RaisedError
)


class BrokerStart(PolicyMessage, frozen=True, kw_only=True):
    """The argument of a broker's process."""

    spec: str
    """The policy that asks."""
    arguments: dict[str, GivenOption]
    """The options of the policy."""
    replaying: bool
    capped: bool


class BrokerOpened(PolicyMessage, frozen=True, kw_only=True):
    """The first message of a broker, if it can make calls; else it sends the error."""


class AskBroker(PolicyMessage, frozen=True, kw_only=True):
    """Ask the model."""

    number: int
    """The number of the question, from 0."""
    question: ModelQuestion


class CancelQuestion(PolicyMessage, frozen=True, kw_only=True):
    """Stop waiting for the answer to a question."""

    number: int


class QuestionAnswered(PolicyMessage, frozen=True, kw_only=True):
    """The result of a question, or the error in its place."""

    number: int
    result: CallResult | None = None
    abandoned: bool = False
    """True if a replay abandons the call here as well."""
    error: RaisedError | None = None


BrokerRequest = AskBroker | CancelQuestion
BrokerAnswer = BrokerOpened | QuestionAnswered | RaisedError


class BeginModelCall(PolicyMessage, frozen=True, kw_only=True):
    """Call `ModelCalls.begin`."""

    request: CallRequest


class EndModelCall(PolicyMessage, frozen=True, kw_only=True):
    """Call `ModelCalls.end`."""

    request: CallRequest
    result: CallResult


class ModelCallKnown(PolicyMessage, frozen=True, kw_only=True):
    """The answer to `BeginModelCall` and `EndModelCall`: a recorded result, or None.

    `abandoned`: the kernel had stopped waiting for the recorded call.
    """

    result: CallResult | None = None
    abandoned: bool = False


ModelCallRequest = BeginModelCall | EndModelCall
ModelCallAnswer = ModelCallKnown | RaisedError

DecodedT = TypeVar("DecodedT")

_ENCODER = msgspec.msgpack.Encoder()


def encoded(message: PolicyMessage) -> bytes:
    """Return the message as bytes."""
    return _ENCODER.encode(message)


def raised(error: LingjingError) -> RaisedError:
    """Return an error as a message. Its kind is the nearest class that the receiver knows."""
    kind: ErrorKind = next((name for name, known in _KINDS.items() if isinstance(error, known)), "UsageError")
    return RaisedError(kind=kind, message=str(error), hint=hint_of(error), faults=tuple(error.faults))


def own_failure(error: LingjingError) -> ForeignCodeError:
    """Return the error as a failure of the code that has raised it, whatever its class."""
    return ForeignCodeError(str(error), hint=hint_of(error), faults=error.faults)


def error_of(message: RaisedError) -> LingjingError:
    """Return the error of a message."""
    return _KINDS[message.kind](message.message, hint=message.hint, faults=message.faults)
