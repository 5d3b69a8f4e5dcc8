"""Evaluators built from their declarations, and held to their contract.

Whatever a stranger's code raises or returns, the error names the evaluator and the plug-in that offers it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from lingjing.errors import InfrastructureError, LingjingError, PluginError
from lingjing.mission.instance import GivenOption, Instance
from lingjing.plugins.building import kind_of_value
from lingjing.plugins.evaluator import Evaluation, Evaluator, EvaluatorPlugin, answer_fault
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import one_line
from lingjing.trace.records import AdjudicatedEvent


def build_evaluators(
    plugins: Iterable[EvaluatorPlugin],
    instance: Instance,
    host: PluginHost,
    told: Mapping[str, Mapping[str, GivenOption]] | None = None,
) -> tuple[Evaluator[Any], ...]:
    """The evaluators of an episode; what they answer is checked. `told` are the options of each, by its name.

    Raises `UsageError` for options that an evaluator does not take, `PluginError` if one cannot be built. Their
    `evaluate` raises `InfrastructureError` if it fails or its answer is not as `Evaluation` says.
    """
    return tuple(_build_evaluator(plugin, instance, host, (told or {}).get(plugin.name, {})) for plugin in plugins)


def _build_evaluator(
    plugin: EvaluatorPlugin, instance: Instance, host: PluginHost, told: Mapping[str, GivenOption]
) -> Evaluator[Any]:
    owner = f"evaluator `{plugin.name}` of plug-in `{host.sources['lingjing_evaluators', plugin.name]}`"
    options: tuple[object, ...] = ()
    if plugin.options:
        from lingjing.plugins.options import PluginOptions, declared_model, read_options

        asked = f"evaluator `{plugin.name}`"
        options = (read_options(declared_model(plugin.options, asked) or PluginOptions, told, asked),)
    try:
        made = plugin.build(instance, *options)
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise PluginError(f"{owner} cannot be built: {one_line(error)}", hint="correct its `build`") from error
    if not callable(getattr(made, "evaluate", None)):
        raise PluginError(
            f"{owner} built {kind_of_value(made)}, which has no method `evaluate`", hint="correct its `build`"
        )
    return _CheckedEvaluator(owner, made)


class _CheckedEvaluator:
    """An evaluator whose failures and wrong answers are infrastructure faults that name it."""

    def __init__(self, owner: str, evaluator: Evaluator[Any]) -> None:
        self._owner = owner
        self._evaluator = evaluator

    def evaluate(self, state: Any, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        try:
            found: object = self._evaluator.evaluate(state, events)
        except (Exception, SystemExit) as error:
            raise self._fault(f"failed at tick {state.tick}: {one_line(error)}") from error
        if not isinstance(found, Evaluation):
            raise self._fault(f"answered {kind_of_value(found)} at tick {state.tick}, no Evaluation")
        wrong = answer_fault(found)
        if wrong:
            raise self._fault(f"broke its contract at tick {state.tick}: {wrong}")
        return replace(found, reward=float(found.reward))

    def _fault(self, message: str) -> InfrastructureError:
        return InfrastructureError(f"{self._owner} {message}", hint="correct its `evaluate`")
