"""The evaluator contract: an evaluator scores a committed boundary and decides if the episode is over."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar, get_args

import msgspec

from lingjing.trace.records import AdjudicatedEvent, BodyState, Reason

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions


class Evaluation(msgspec.Struct, frozen=True):
    """The answer of an evaluator at one boundary."""

    reward: float
    """The score, 0 to 1 (r in the paper)."""
    done: bool
    """True if the episode is over (d in the paper)."""
    reason: Reason | Literal[""] = ""
    """The reason for the end; "" before it."""
    detail: str = ""
    """One sentence where the reason leaves the cause open."""


class EpisodeState(Protocol):
    """The state of an episode at a boundary.

    `states` holds the states of all entities by id, hidden ones included. `achieved` maps (rule, binding) to the time
    at which the rule became true, seconds. `stages` maps (stage, subject) to the tick at which the stage was done; the
    subject is "" for a stage without one.
    """

    @property
    def tick(self) -> int: ...  # noqa: D102 - a field
    @property
    def time_s(self) -> float: ...  # noqa: D102
    @property
    def states(self) -> Mapping[str, BodyState]: ...  # noqa: D102
    @property
    def achieved(self) -> Mapping[tuple[str, tuple[str, ...]], float]: ...  # noqa: D102
    @property
    def stages(self) -> Mapping[tuple[str, str], int]: ...  # noqa: D102


_REASONS = ("", *get_args(Reason))

EpisodeStateT_contra = TypeVar("EpisodeStateT_contra", contravariant=True)


class Evaluator(Protocol[EpisodeStateT_contra]):
    """One evaluator of the paper's set E. It must be a pure function of its arguments: it keeps nothing from one
    boundary to the next, since an episode may be forked."""

    def evaluate(self, state: EpisodeStateT_contra, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        """Return the score and the end at a boundary. `events` are those of the rules that became true at it."""
        ...


@dataclass(frozen=True, slots=True)
class EvaluatorPlugin:
    """The declaration of an evaluator through the hook `lingjing_evaluators`."""

    name: str
    """The value of `--evaluator` that chooses it."""
    build: Callable[..., Evaluator[Any]]
    """Takes the instance, and an object of the model `options` if there is one; returns the evaluator of the episode.
    Evaluators of plug-ins receive an `EpisodeState`. The built-in one, `mission`, receives the kernel's context."""
    summary: str = ""
    options: type[PluginOptions] | str | None = None
    """The model of its options (`--evaluator-arg NAME.OPTION=VALUE`), as a class or as `package.module:Class`."""


def answer_fault(found: Evaluation) -> str:
    """Return the fault of an answer against `Evaluation`; "" if there is none."""
    reward: Any = found.reward
    done: Any = found.done
    detail: Any = found.detail
    if isinstance(reward, bool) or not isinstance(reward, Real) or not 0.0 <= float(reward) <= 1.0:
        return f"its reward is {reward!r}, not a number in 0..1"
    if not isinstance(done, bool):
        return f"its `done` is {done!r}, neither True nor False"
    if found.reason not in _REASONS:
        return f"its reason is {found.reason!r}, none of {', '.join(_REASONS[1:])}"
    return "" if isinstance(detail, str) else f"its detail is {detail!r}, no text"


__all__ = ["EpisodeState", "Evaluation", "Evaluator", "EvaluatorPlugin", "answer_fault"]
