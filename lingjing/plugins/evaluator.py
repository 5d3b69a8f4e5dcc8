"""The evaluator contract: what scores a committed boundary and says whether the episode is over."""

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
    """r and d of the paper: the score (0..1) and whether the episode is over. With `done` comes the reason and, where
    the reason leaves it open, what it was."""

    reward: float
    done: bool
    reason: Reason | Literal[""] = ""
    detail: str = ""


class EpisodeState(Protocol):
    """What has come to pass by a boundary. `states` are all entities' by id, the hidden ones' too; `achieved` maps
    (rule, binding) to the time at which it became true, in seconds; `stages` maps (stage, subject) to the tick at which
    it was done, the subject being "" for a stage without one."""

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
        """The score and the flag at a boundary, `events` being those of the rules that came true at it."""
        ...


@dataclass(frozen=True, slots=True)
class EvaluatorPlugin:
    """How an evaluator is declared: `build` makes the one of an instance. A plug-in's takes an `EpisodeState`; the
    built-in one, `mission`, reads the mission's own conditions and needs the kernel's whole context for that.

    `options` is the model of what it can be told (`--evaluator-arg NAME.OPTION=VALUE`), as a class or, so that nothing
    heavy is loaded before it is needed, as `package.module:Class`. With a model `build` takes an object of it as well:
    `build(instance, options)`.
    """

    name: str
    build: Callable[..., Evaluator[Any]]
    summary: str = ""
    options: type[PluginOptions] | str | None = None


def answer_fault(found: Evaluation) -> str:
    """What of an answer is not as `Evaluation` says; "" if nothing. A reward that is no number is outside 0..1 too."""
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
