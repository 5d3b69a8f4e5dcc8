"""The hooks that a plug-in may implement. The name of the pluggy project and the entry-point group are both `lingjing`.

Hooks return values and change nothing. The built-in engines and scenes and the reference agents use the same hooks.
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
from lingjing.plugins.model_access import AskerPlugin
from lingjing.plugins.policy import Policy, PolicyPlugin
from lingjing.plugins.prompts import PromptPlugin
from lingjing.plugins.scaffold import ScaffoldPlugin
from lingjing.plugins.writers import WriterPlugin
from lingjing.scene.city import City

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

hookspec = pluggy.HookspecMarker("lingjing")
hookimpl = pluggy.HookimplMarker("lingjing")


@dataclass(frozen=True, slots=True)
class ScenePlugin:
    """The declaration of a scene through the hook `lingjing_scenes`."""

    name: str
    """The name that a mission gives after `scene`."""
    build: Callable[[SceneSpec], City]
    """Returns the city of a spec; a pure function. The plug-in's `kinds.json` declares the options of the spec
    (`lingjing.mission.kinds`)."""
    summary: str = ""


@hookspec
def lingjing_api_version() -> str:  # type: ignore[empty-body]
    """Return the `lingjing.plugins.contract.API_VERSION` that the plug-in was written for. Called when the plug-in is
    registered, before any other hook. A plug-in without this hook counts as one of version 1.0."""


@hookspec
def lingjing_engines() -> Iterable[EnginePlugin]:  # type: ignore[empty-body]
    """Return the engines of this plug-in. Called once, when the host is built."""


@hookspec
def lingjing_policies() -> Iterable[PolicyPlugin]:  # type: ignore[empty-body]
    """Return the policies of this plug-in. Called once, when the host is built."""


@hookspec
def lingjing_scenes() -> Iterable[ScenePlugin]:  # type: ignore[empty-body]
    """Return the scenes of this plug-in. Called once, when the host is built."""


@hookspec
def lingjing_evaluators() -> Iterable[EvaluatorPlugin]:  # type: ignore[empty-body]
    """Return the evaluators of this plug-in. Called once, when the host is built."""


@hookspec
def lingjing_models() -> Iterable[ModelPlugin]:  # type: ignore[empty-body]
    """Return the chat models of this plug-in. Called once, when a suite or a list needs the models."""


@hookspec
def lingjing_prompts() -> Iterable[PromptPlugin]:  # type: ignore[empty-body]
    """Return the prompts of this plug-in's policies. Called once, when prompts are needed."""


@hookspec
def lingjing_detectors() -> Iterable[DetectorPlugin]:  # type: ignore[empty-body]
    """Return the detectors of this plug-in. Called once, when detectors are needed."""


@hookspec
def lingjing_backbones() -> Iterable[BackbonePlugin]:  # type: ignore[empty-body]
    """Return the chat-model backbones of this plug-in. Called once, when a backbone is looked up or listed."""


@hookspec
def lingjing_askers() -> Iterable[AskerPlugin]:  # type: ignore[empty-body]
    """Return the accesses to models of this plug-in. Called once, when a policy of its own calls a model."""


@hookspec
def lingjing_scaffolds() -> Iterable[ScaffoldPlugin]:  # type: ignore[empty-body]
    """Return the agent scaffolds of this plug-in. Called once, when a scaffold is looked up or listed."""


@hookspec
def lingjing_writers() -> Iterable[WriterPlugin]:  # type: ignore[empty-body]
    """Return the writers of missions of this plug-in. Called once, when a writer is looked up or listed."""


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
    "ScenePlugin", "hookimpl", "hookspec", "lingjing_api_version", "lingjing_askers", "lingjing_backbones",
    "lingjing_detectors", "lingjing_engines", "lingjing_evaluators", "lingjing_make_evaluator", "lingjing_make_policy",
    "lingjing_models", "lingjing_policies", "lingjing_prompts", "lingjing_scaffolds", "lingjing_scenes",
    "lingjing_writers",
]  # fmt: skip
