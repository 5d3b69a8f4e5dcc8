"""The messages between the player of an episode and the process of one agent's policy: one msgpack document each.

The player sends requests, a policy's process answers each with one answer. On a second channel the process asks for the
record of its model calls. The process runs a stranger's code: the player decodes what comes from there strictly, and
nothing that it decodes is code.
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
)
from lingjing.mission.instance import GivenOption, Instance, Weather
from lingjing.option_listing import OptionSpec
from lingjing.play.policy_files import PolicyDeclaration
from lingjing.play.policy_processes.pictures import PicturePart
from lingjing.plugins.calls import MissingCallError, SpendingLimitError
from lingjing.plugins.policy import Brief, Inbox
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
_KINDS: dict[ErrorKind, type[LingjingError]] = {
    "SpendingLimitError": SpendingLimitError,
    "MissingCallError": MissingCallError,
    "InfrastructureError": InfrastructureError,
    "ForeignCodeError": ForeignCodeError,
    "PluginError": PluginError,
    "MissionError": MissionError,
    "UsageError": UsageError,
}


class PolicyMessage(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of all requests and answers; the tag is the class name."""


class TruthConstants(msgspec.Struct, frozen=True, kw_only=True):
    """The part of `Privileged` that one episode does not change. `city` is encoded by `held_cities.packed`."""

    instance: Instance
    city: msgspec.Raw


class ExaminePolicies(PolicyMessage, frozen=True, kw_only=True):
    """Load the policies of these names and files, and share the options among them unless they are not all that were
    asked for (`whole`)."""

    specs: tuple[str, ...]
    arguments: dict[str, GivenOption]
    whole: bool


class DeclarePolicy(PolicyMessage, frozen=True, kw_only=True):
    """Load the policy of a file and return its declaration, with the list of its options if they are to be `listed`."""

    spec: str
    listed: bool


class CheckOptions(PolicyMessage, frozen=True, kw_only=True):
    """Check options of a policy that has been declared."""

    spec: str
    arguments: dict[str, GivenOption]


class LoadPolicy(PolicyMessage, frozen=True, kw_only=True):
    """Load and build one policy. `source` is the plug-in that offers it, "" for a file; `makers` are those that make or
    wrap it; `seed` starts the global random
    generators; `replaying` and `capped` are those of its `ModelCalls`; `memory_bytes` bounds what it may allocate;
    `truth` is for a privileged policy."""

    spec: str
    source: str
    arguments: dict[str, GivenOption]
    seed: int
    replaying: bool = False
    capped: bool = False
    truth: TruthConstants | None = None
    makers: tuple[str, ...] = ()


class ResetPolicy(PolicyMessage, frozen=True, kw_only=True):
    """Call `reset`."""

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
    """Descriptors of slots of the next `ActPolicy`, whose own packet has no room for them. Not answered."""


class ActPolicy(PolicyMessage, frozen=True, kw_only=True):
    """Call `act`. The fields are those of `Observation`; descriptors come along, or have come before, for those of the
    `pictures` whose slots are new."""

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
    """The time of the call is over: cancel it where it waits. It is answered all the same."""


class ClosePolicy(PolicyMessage, frozen=True, kw_only=True):
    """Run what was registered for the end of the process, and end."""


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
    """The name of a policy, its share of the options, and what decides beside these (its fingerprint)."""

    name: str
    privileged: bool
    arguments: dict[str, GivenOption]
    fingerprint: dict[str, str]


class RaisedError(PolicyMessage, frozen=True, kw_only=True):
    """An error of this project's kinds; `detail` is its class and text where a policy has raised it."""

    kind: ErrorKind
    message: str
    detail: str = ""
    hint: str = ""
    faults: tuple[Fault, ...] = ()


class PoliciesExamined(PolicyMessage, frozen=True, kw_only=True):
    """The policies that could be loaded, by their names in the request, and every error."""

    found: dict[str, ExaminedPolicy]
    errors: tuple[RaisedError, ...]


class PolicyDeclared(PolicyMessage, frozen=True, kw_only=True):
    """The declaration of a policy; `listed` are its options as people read them, if they were asked for."""

    declaration: PolicyDeclaration
    listed: tuple[OptionSpec, ...] = ()


class OptionsChecked(PolicyMessage, frozen=True, kw_only=True):
    """Everything that is wrong with the options."""

    faults: tuple[Fault, ...]


class CallEnded(PolicyMessage, frozen=True, kw_only=True):
    """The policy is built, or has taken its brief."""


class DecisionMade(PolicyMessage, frozen=True, kw_only=True):
    """The answer of `act`, made plain. `kept` are the slots of pictures that the policy still holds."""

    decision: Decision
    kept: tuple[int, ...] = ()


class CallFailed(PolicyMessage, frozen=True, kw_only=True):
    """The call gave nothing: why, and what it spent all the same. `kept` as in `DecisionMade`."""

    kept: tuple[int, ...] = ()
    reason: Literal["policy_error", "malformed", "policy_timeout"]
    detail: str
    usage: Usage | None = None


PolicyAnswerMessage = (
    PoliciesExamined | PolicyDeclared | OptionsChecked | CallEnded | DecisionMade | CallFailed | RaisedError
)


class BeginModelCall(PolicyMessage, frozen=True, kw_only=True):
    """`ModelCalls.begin`."""

    request: CallRequest


class EndModelCall(PolicyMessage, frozen=True, kw_only=True):
    """`ModelCalls.end`."""

    request: CallRequest
    result: CallResult


class ModelCallKnown(PolicyMessage, frozen=True, kw_only=True):
    """The answer to both: a recorded result, or None. `abandoned`: the kernel gave the recorded call up."""

    result: CallResult | None = None
    abandoned: bool = False


ModelCallRequest = BeginModelCall | EndModelCall
ModelCallAnswer = ModelCallKnown | RaisedError

DecodedT = TypeVar("DecodedT")

_ENCODER = msgspec.msgpack.Encoder()


def encoded(message: PolicyMessage) -> bytes:
    """The message as it travels."""
    return _ENCODER.encode(message)


def raised(error: LingjingError) -> RaisedError:
    """An error as it travels: of the nearest kind that the other side knows."""
    kind: ErrorKind = next((name for name, known in _KINDS.items() if isinstance(error, known)), "UsageError")
    return RaisedError(kind=kind, message=str(error), hint=error.hint, faults=tuple(error.faults))


def own_failure(error: LingjingError) -> ForeignCodeError:
    """The error as the failure of the code that has raised it, whatever it says it is."""
    return ForeignCodeError(str(error), hint=error.hint, faults=error.faults)


def error_of(message: RaisedError) -> LingjingError:
    """The error that has travelled."""
    return _KINDS[message.kind](message.message, hint=message.hint, faults=message.faults)
