"""The evaluators of plug-ins: built from their declarations, their results checked.

Errors from foreign code name the evaluator and the plug-in that offers it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from msgspec.structs import replace

from lingjing.errors import InfrastructureError, LingjingError, PluginError
from lingjing.mission.instance import GivenOption, Instance
from lingjing.plugins.evaluator import Evaluation, Evaluator, EvaluatorPlugin, answer_fault
from lingjing.plugins.foreign_errors import kind_of_value, one_line
from lingjing.plugins.host import PluginHost
from lingjing.trace.records import AdjudicatedEvent


def build_evaluators(
    plugins: Iterable[EvaluatorPlugin],
    instance: Instance,
    host: PluginHost,
    options: Mapping[str, Mapping[str, GivenOption]] | None = None,
) -> tuple[Evaluator[Any], ...]:
    """Return the evaluators of an episode, with checked results. `options` are the user's options by evaluator name.

    Raises `UsageError` for options that an evaluator does not accept and `PluginError` if one cannot be built.
    `evaluate` of a returned evaluator raises `InfrastructureError` if the evaluator fails or its result violates
    `Evaluation`.
    """
    return tuple(_build_evaluator(plugin, instance, host, (options or {}).get(plugin.name, {})) for plugin in plugins)


def _build_evaluator(
    plugin: EvaluatorPlugin, instance: Instance, host: PluginHost, values: Mapping[str, GivenOption]
) -> Evaluator[Any]:
    owner = f"evaluator `{plugin.name}` of plug-in `{host.sources['lingjing_evaluators', plugin.name]}`"
    makers = host.makers("lingjing_make_evaluator")
    if makers:
        owner += f" (plug-ins that make evaluators: {', '.join(makers)})"
    options = None
    if plugin.options:
        from lingjing.plugins.options import PluginOptions, declared_model, read_options

        subject = f"evaluator `{plugin.name}`"
        options = read_options(declared_model(plugin.options, subject) or PluginOptions, values, subject)
    try:
        made = host.make_evaluator(plugin, instance, options)
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
    """An evaluator that raises `InfrastructureError` with its name for exceptions and invalid results."""

    def __init__(self, owner: str, evaluator: Evaluator[Any]) -> None:
        self._owner = owner
        self._evaluator = evaluator

    def evaluate(self, state: Any, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        try:
            evaluation: object = self._evaluator.evaluate(state, events)
        except (Exception, SystemExit) as error:
            raise self._fault(f"failed at tick {state.tick}: {one_line(error)}") from error
        if not isinstance(evaluation, Evaluation):
            raise self._fault(f"returned {kind_of_value(evaluation)} at tick {state.tick}, no Evaluation")
        wrong = answer_fault(evaluation)
        if wrong:
            raise self._fault(f"broke its contract at tick {state.tick}: {wrong}")
        return replace(evaluation, reward=float(evaluation.reward))

    def _fault(self, message: str) -> InfrastructureError:
        return InfrastructureError(f"{self._owner} {message}", hint="correct its `evaluate`")
