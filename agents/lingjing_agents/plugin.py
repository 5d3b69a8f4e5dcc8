"""The plug-ins of this distribution in the entry-point group `lingjing`. Policies are imported when they are used."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from lingjing.plugins.backbone import BackbonePlugin
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.frame_detector import DetectorPlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.model_access import AskerPlugin
from lingjing.plugins.policy import PolicyPlugin
from lingjing.plugins.prompts import PromptPlugin
from lingjing.plugins.scaffold import ScaffoldPlugin
from lingjing.plugins.writers import WriterPlugin

_RULES = ("lingjing_agents.heuristic.policy", "cv2", "numpy.ma")
_TRUTH = ("lingjing_agents.oracle",)
_MODEL = ("lingjing_agents.react.policy", "jsonschema", "cv2", "numpy.ma")
"""The modules that every agent of these policies imports. `numpy.unique` imports `numpy.ma` at its first call."""


@hookimpl
def lingjing_policies() -> Iterable[PolicyPlugin]:
    """Return the ten reference policies and two policies with planted faults."""
    return (
        PolicyPlugin(
            name="idle",
            factory=_Deferred("idle", "IdlePolicy"),
            summary="never acts: a mission that it wins needs no agents",
            imports=("lingjing_agents.idle",),
        ),
        PolicyPlugin(
            name="random",
            factory=_Deferred("chance", "RandomPolicy"),
            summary="valid verbs with random arguments: the floor of every table",
            imports=("lingjing_agents.chance",),
        ),
        PolicyPlugin(
            name="heuristic",
            factory=_Deferred("heuristic.policy", "HeuristicPolicy"),
            summary="sweeps its cells and finds people in the pixels",
            imports=_RULES,
        ),
        PolicyPlugin(
            name="sweep",
            factory=_Deferred("sweep", "SweepPolicy"),
            summary="the paper's plain lawn-mower: one picture a cell, one pass",
            imports=("lingjing_agents.sweep", "cv2", "numpy.ma"),
        ),
        PolicyPlugin(
            name="learned",
            factory=_Deferred("heuristic.policy", "learned_policy"),
            summary="the heuristic's rules, with detectors trained on frames where one ships",
            imports=_RULES,
        ),
        PolicyPlugin(
            name="oracle",
            factory=_Deferred("oracle", "OraclePolicy"),
            privileged=True,
            summary="reads the truth: shows that a mission can be won",
            imports=_TRUTH,
        ),
        PolicyPlugin(
            name="react",
            factory=_Deferred("react.policy", "react_policy"),
            options="lingjing_agents.react.options:ReactOptions",
            calls=True,
            probe=_Deferred("llm.probing", "probe_model"),
            estimate=_Deferred("react.call_profile", "estimate_calls"),
            broker=_Deferred("react.brokering", "open_broker"),
            summary="perceives, reasons and acts over a chat model",
            imports=_MODEL,
        ),
        PolicyPlugin(
            name="reader",
            factory=_Deferred("reader.policy", "ReaderPolicy"),
            options="lingjing_agents.reader.policy:ReaderOptions",
            calls=True,
            estimate=_Deferred("react.call_profile", "estimate_calls"),
            summary="plays from the requests of `react` alone, with the shipped colour rules",
            imports=(*_MODEL, "lingjing_agents.reader.player"),
        ),
        PolicyPlugin(
            name="sighted-reader",
            factory=_Deferred("reader.policy", "SightedReaderPolicy"),
            options="lingjing_agents.reader.policy:SightedOptions",
            calls=True,
            estimate=_Deferred("react.call_profile", "estimate_calls"),
            privileged=True,
            summary="plays from the requests of `react` and the true boxes of their pictures",
            imports=(*_MODEL, "lingjing_agents.reader.player"),
        ),
        PolicyPlugin(
            name="scripted",
            factory=_Deferred("replay", "ScriptedPolicy"),
            options="lingjing_agents.replay:ScriptOptions",
            summary="replays decisions from a JSON file",
            imports=("lingjing_agents.replay",),
        ),
        PolicyPlugin(
            name="faulty-oracle",
            factory=_Deferred("faulty.policy", "faulty_oracle"),
            options="lingjing_agents.faulty.options:FaultyOptions",
            privileged=True,
            summary="the oracle with planted faults, to measure what finds them",
            imports=_TRUTH,
        ),
        PolicyPlugin(
            name="faulty-heuristic",
            factory=_Deferred("faulty.policy", "faulty_heuristic"),
            options="lingjing_agents.faulty.options:FaultyOptions",
            summary="the heuristic with planted faults",
            imports=_RULES,
        ),
    )


@hookimpl
def lingjing_models() -> Iterable[ModelPlugin]:
    """Return the chat models of `models.toml` and of the user's own list, for `react`."""
    from lingjing_agents.llm.models import known_models

    return known_models()


@hookimpl
def lingjing_backbones() -> Iterable[BackbonePlugin]:
    """Return the two backbones of `llm`."""
    return (
        BackbonePlugin(
            name="direct",
            factory=_Deferred("llm.asking", "direct_backbone"),
            summary="the OpenAI chat protocol over HTTP",
        ),
        BackbonePlugin(
            name="litellm",
            factory=_Deferred("llm.asking", "litellm_backbone"),
            summary="every service that litellm speaks to",
        ),
    )


@hookimpl
def lingjing_askers() -> Iterable[AskerPlugin]:
    """Return the access to the models of `llm`, for policies of others."""
    return (
        AskerPlugin(
            name="llm",
            factory=_Deferred("llm.own_calls", "open_asker"),
            serve=_Deferred("llm.model_server", "LoopbackModel"),
            summary="the models of models.toml and every OpenAI-compatible service",
        ),
    )


@hookimpl
def lingjing_scaffolds() -> Iterable[ScaffoldPlugin]:
    """Return the scaffolds beside that of `react` itself."""
    return (
        ScaffoldPlugin(
            name="plan-manage-act",
            build=_Deferred("scaffolds.plan_manage_act", "plan_manage_act"),
            options="lingjing_agents.scaffolds.plan_manage_act:PlanOptions",
            summary="a planner and a manager before the decision",
        ),
        ScaffoldPlugin(
            name="reflective-memory",
            build=_Deferred("scaffolds.reflective_memory", "reflective_memory"),
            options="lingjing_agents.scaffolds.reflective_memory:LessonOptions",
            summary="a lesson from each failed request",
        ),
    )


@hookimpl
def lingjing_detectors() -> Iterable[DetectorPlugin]:
    """Return the detectors that decide whether a frame shows a target."""
    return (
        DetectorPlugin(
            name="colours",
            factory=_Deferred("frame_detectors", "colour_detector"),
            knows=_Deferred("frame_detectors", "colour_rules_know"),
            summary="the heuristic's rules of colours and shapes",
        ),
        DetectorPlugin(
            name="learned",
            factory=_Deferred("frame_detectors", "trained_detector"),
            knows=_Deferred("frame_detectors", "learned_knows"),
            summary="the detector trained on frames",
        ),
        DetectorPlugin(
            name="model",
            factory=_Deferred("frame_detectors", "model_detector"),
            summary="a chat model, asked for yes or no (options: model=NAME and those of `react` for its service)",
        ),
    )


@hookimpl
def lingjing_prompts() -> Iterable[PromptPlugin]:
    """Return the prompts of `react`."""
    return (
        PromptPlugin(
            name="react",
            policy="react",
            option="prompt",
            shipped=_Deferred("react.prompt_files", "shipped_texts"),
            check=_Deferred("react.prompt_files", "check_text"),
            reviser=_Deferred("react.prompt_reviser", "make_reviser"),
            summary="what a chat model is told beside what it may command and say",
        ),
    )


@hookimpl
def lingjing_writers() -> Iterable[WriterPlugin]:
    """Return the writer of missions over `llm`."""
    return (
        WriterPlugin(
            name="chat",
            factory=_Deferred("mission_writer", "make_writer"),
            summary="a chat model that writes missions (options: model=NAME and those of `react` for its service)",
        ),
    )


@dataclass(frozen=True, slots=True)
class _Deferred:
    """A function or class of a module that is imported at the first call."""

    module: str
    """The module, relative to `lingjing_agents`."""
    attribute: str
    """The name of the function or class."""

    def __call__(self, *arguments: Any) -> Any:
        """Import the module and return the result of the call."""
        return getattr(import_module(f"lingjing_agents.{self.module}"), self.attribute)(*arguments)
