"""The hooks a plug-in may implement; pluggy project name and entry-point group are both `lingjing`.

Hooks return values and mutate nothing. Built-in engines, scenes and the reference agents come through the same door.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pluggy

from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins.backbone import BackbonePlugin
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.evaluator import Evaluator, EvaluatorPlugin
from lingjing.plugins.frame_detector import DetectorPlugin
from lingjing.plugins.policy import Policy, PolicyPlugin
from lingjing.plugins.prompts import PromptPlugin
from lingjing.plugins.scaffold import ScaffoldPlugin
from lingjing.scene.city import City

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

hookspec = pluggy.HookspecMarker("lingjing")
hookimpl = pluggy.HookimplMarker("lingjing")


@dataclass(frozen=True, slots=True)
class ScenePlugin:
    """How a scene provider is declared: `name` is what a mission names after `scene`; `build` must be a pure
    function of the spec. The spec's options are declared in the plug-in's file of kinds (`lingjing.mission.kinds`)."""

    name: str
    build: Callable[[SceneSpec], City]
    summary: str = ""


@hookspec
def lingjing_api_version() -> str:  # type: ignore[empty-body]
    """Fires when the plug-in is registered, before any other hook: the `lingjing.plugins.contract.API_VERSION` that it
    was written for. A plug-in without this hook is taken for one of version 1.0."""


@hookspec
def lingjing_engines() -> Iterable[EnginePlugin]:  # type: ignore[empty-body]
    """Fires once when the host is built: the engines this plug-in offers."""


@hookspec
def lingjing_policies() -> Iterable[PolicyPlugin]:  # type: ignore[empty-body]
    """Fires once when the host is built: the policies this plug-in offers."""


@hookspec
def lingjing_scenes() -> Iterable[ScenePlugin]:  # type: ignore[empty-body]
    """Fires once when the host is built: the scene providers this plug-in offers."""


@hookspec
def lingjing_evaluators() -> Iterable[EvaluatorPlugin]:  # type: ignore[empty-body]
    """Fires once when the host is built: the evaluators this plug-in offers."""


@hookspec
def lingjing_models() -> Iterable[ModelPlugin]:  # type: ignore[empty-body]
    """Fires once when the models are asked for, by a suite or a list: the chat models this plug-in knows."""


@hookspec
def lingjing_prompts() -> Iterable[PromptPlugin]:  # type: ignore[empty-body]
    """Fires once when prompts are asked for: the policies of this plug-in that have some."""


@hookspec
def lingjing_detectors() -> Iterable[DetectorPlugin]:  # type: ignore[empty-body]
    """Fires once when detectors are asked for: what this plug-in offers that tells whether a frame shows a target."""


@hookspec
def lingjing_backbones() -> Iterable[BackbonePlugin]:  # type: ignore[empty-body]
    """Return the chat-model backbones of this plug-in. Called once, when a backbone is looked up or listed."""


@hookspec
def lingjing_scaffolds() -> Iterable[ScaffoldPlugin]:  # type: ignore[empty-body]
    """Return the agent scaffolds of this plug-in. Called once, when a scaffold is looked up or listed."""


@hookspec(firstresult=True)
def lingjing_make_policy(declaration: PolicyPlugin, options: PluginOptions, calls: ModelCalls) -> Policy:  # type: ignore[empty-body]
    """Return the policy object of one agent, or None to leave it to the next plug-in.

    `options` are the checked options, `calls` the record of model calls. The default calls the declaration's factory.
    An implementation with `wrapper=True` may return another policy around the one that it receives from `yield`.
    """


@hookspec(firstresult=True)
def lingjing_make_evaluator(  # type: ignore[empty-body]
    declaration: EvaluatorPlugin, instance: Instance, options: PluginOptions | None
) -> Evaluator[Any]:
    """Return the evaluator of one episode, or None to leave it to the next plug-in.

    `options` are the checked options, None if the declaration has no model of them. The default calls the declaration's
    `build`. An implementation with `wrapper=True` may return another evaluator around the one that it receives.
    """


__all__ = [
    "ScenePlugin", "hookimpl", "hookspec", "lingjing_api_version", "lingjing_backbones", "lingjing_detectors",
    "lingjing_engines", "lingjing_evaluators", "lingjing_make_evaluator", "lingjing_make_policy", "lingjing_models",
    "lingjing_policies", "lingjing_prompts", "lingjing_scaffolds", "lingjing_scenes",
]  # fmt: skip
