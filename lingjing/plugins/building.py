"""Scenes and evaluators built from their declarations, and held to their contracts.

Whatever a stranger's code raises or returns, the error names the scene or evaluator and the plug-in that offers it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any, get_args

from msgspec.structs import replace

from lingjing.errors import InfrastructureError, LingjingError, PluginError
from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins.evaluator import Evaluation, Evaluator, EvaluatorPlugin
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import one_line
from lingjing.scene.city import City
from lingjing.trace.records import AdjudicatedEvent, Reason

_REASONS = ("", *get_args(Reason))


def build_city(spec: SceneSpec, host: PluginHost) -> City:
    """The city of a scene. Raises `UsageError` if nobody offers it, `PluginError` if who does cannot build it."""
    plugin = host.scene(spec.kind)
    failed = f"scene `{spec.kind}` of plug-in `{host.sources['lingjing_scenes', spec.kind]}` failed"
    try:
        city = plugin.build(spec)
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{failed}: {one_line(error)}", hint="correct its `build`") from error
    if not isinstance(city, City):
        raise PluginError(f"{failed}: it built {_kind(city)}, no City", hint="correct its `build`")
    return city


def build_evaluators(
    plugins: Iterable[EvaluatorPlugin], instance: Instance, host: PluginHost
) -> tuple[Evaluator[Any], ...]:
    """The evaluators of an episode; what they answer is checked.

    Raises `PluginError` if one cannot be built. Their `evaluate` raises `InfrastructureError` if it fails or its answer
    is not as `Evaluation` says.
    """
    return tuple(_build_evaluator(plugin, instance, host) for plugin in plugins)


def _build_evaluator(plugin: EvaluatorPlugin, instance: Instance, host: PluginHost) -> Evaluator[Any]:
    owner = f"evaluator `{plugin.name}` of plug-in `{host.sources['lingjing_evaluators', plugin.name]}`"
    try:
        made = plugin.build(instance)
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{owner} cannot be built: {one_line(error)}", hint="correct its `build`") from error
    if not callable(getattr(made, "evaluate", None)):
        raise PluginError(f"{owner} built {_kind(made)}, which has no method `evaluate`", hint="correct its `build`")
    return _CheckedEvaluator(owner, made)


class _CheckedEvaluator:
    """An evaluator whose failures and wrong answers are infrastructure faults that name it."""

    def __init__(self, owner: str, evaluator: Evaluator[Any]) -> None:
        self._owner = owner
        self._evaluator = evaluator

    def evaluate(self, standing: Any, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        try:
            found: object = self._evaluator.evaluate(standing, events)
        except (Exception, SystemExit) as error:
            raise self._fault(f"failed at tick {standing.tick}: {one_line(error)}") from error
        if not isinstance(found, Evaluation):
            raise self._fault(f"answered {_kind(found)} at tick {standing.tick}, no Evaluation")
        wrong = _wrong(found)
        if wrong:
            raise self._fault(f"broke its contract at tick {standing.tick}: {wrong}")
        return replace(found, reward=float(found.reward))

    def _fault(self, message: str) -> InfrastructureError:
        return InfrastructureError(f"{self._owner} {message}", hint="correct its `evaluate`")


def _wrong(found: Evaluation) -> str:
    """What of an answer is not as declared; "" if nothing. A reward that is no number is outside 0..1 as well."""
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


def _kind(value: object) -> str:
    return "None" if value is None else f"a value of type `{type(value).__name__}`"


__all__ = ["build_city", "build_evaluators"]
