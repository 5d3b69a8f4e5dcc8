"""The default implementations of the hooks that make policies and evaluators: a plug-in that comes last.

Plug-ins come before it (`firstresult`: the first that returns an object decides) or around it (`wrapper=True`).
See ADR 0033.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.evaluator import Evaluator, EvaluatorPlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import Policy, PolicyPlugin

if TYPE_CHECKING:
    from lingjing.mission.instance import Instance
    from lingjing.plugins.options import PluginOptions


@hookimpl(trylast=True)
def lingjing_make_policy(declaration: PolicyPlugin, options: PluginOptions, calls: ModelCalls) -> Policy:
    """Call the factory of the declaration."""
    if not declaration.options:
        from lingjing.plugins.options import given_parameters

        return declaration.factory(**given_parameters(options))
    return declaration.factory(options, calls) if declaration.calls else declaration.factory(options)


@hookimpl(trylast=True)
def lingjing_make_evaluator(
    declaration: EvaluatorPlugin, instance: Instance, options: PluginOptions | None
) -> Evaluator[Any]:
    """Call `build` of the declaration."""
    return declaration.build(instance) if options is None else declaration.build(instance, options)


__all__ = ["lingjing_make_evaluator", "lingjing_make_policy"]
