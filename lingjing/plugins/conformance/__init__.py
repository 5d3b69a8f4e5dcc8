"""The conformance kit: checks of the promises of each kind of plug-in, for the tests of plug-in authors.

In a test of your own plug-in:

    case = EngineCase(plugin, instance, city, commands=(…))

    @pytest.mark.parametrize("check", ENGINE_CHECKS, ids=check_name)
    def test_engine(check): check(case)

or `check_engine(plugin, instance, city, …)` for all at once; `case_of(plugin, mission, {resource: (verb, arguments)})`
makes a case of a mission. The commands of a case should be admissible and take a while; they are submitted at time 0.
`check_body(mission, entity)` tests the body that an entity's type declares: pictures show it at its size, and other
bodies collide with it. `check_evaluator(plugin, instance)`, `check_scene(spec)` and `check_kinds(entry_point)` test the
other kinds, `check_scaffold(plugin)` and `check_backbone(plugin, model)` the parts of an agent over a chat model. A
check makes its own objects from the plug-in's factory and raises `ConformanceError` with one sentence.

`case` (the inputs of a check, one run of an engine) → `boundaries` (the checks of each boundary) → `engines`,
`requests` and `described` (the checks of an engine, its commands and its `kinds.json`); `policies`, `evaluators`,
`scaffolds`, `backbones`, `bodies` (a type's body) and `providers` (scenes, files of kinds) hold the checks of the other
kinds. `samples` has a brief for checks without a mission.
"""

from lingjing.plugins.conformance.backbones import BACKBONE_CHECKS, BackboneCase, check_backbone
from lingjing.plugins.conformance.bodies import BODY_CHECKS, BodyCase, check_body, check_can_be_hit, check_is_seen
from lingjing.plugins.conformance.case import ConformanceError, EngineCase, Run, case_of, check_name, instance_of
from lingjing.plugins.conformance.described import check_speed, check_words
from lingjing.plugins.conformance.engines import (
    ENGINE_CHECKS,
    check_advance,
    check_capture,
    check_close,
    check_cuts,
    check_engine,
    check_fork,
    check_options,
    check_ready,
    check_repeatable,
    check_strangers,
    check_values,
)
from lingjing.plugins.conformance.evaluators import check_evaluator
from lingjing.plugins.conformance.policies import (
    POLICY_CHECKS,
    PolicyCase,
    check_decisions,
    check_policy,
    check_same_decisions,
)
from lingjing.plugins.conformance.providers import check_kinds, check_scene
from lingjing.plugins.conformance.requests import (
    UNKNOWN_RESOURCE,
    UNKNOWN_VERB,
    check_admission,
    check_arguments,
    check_busy,
    check_commands,
    check_preemption,
    check_receipts,
    check_refusals,
)
from lingjing.plugins.conformance.samples import sample_brief, sample_observations
from lingjing.plugins.conformance.scaffolds import SCAFFOLD_CHECKS, ScaffoldCase, check_scaffold

__all__ = [
    "BACKBONE_CHECKS",
    "BODY_CHECKS",
    "ENGINE_CHECKS",
    "POLICY_CHECKS",
    "SCAFFOLD_CHECKS",
    "UNKNOWN_RESOURCE",
    "UNKNOWN_VERB",
    "BackboneCase",
    "BodyCase",
    "ConformanceError",
    "EngineCase",
    "PolicyCase",
    "Run",
    "ScaffoldCase",
    "case_of",
    "check_admission",
    "check_advance",
    "check_arguments",
    "check_backbone",
    "check_body",
    "check_busy",
    "check_can_be_hit",
    "check_capture",
    "check_close",
    "check_commands",
    "check_cuts",
    "check_decisions",
    "check_engine",
    "check_evaluator",
    "check_fork",
    "check_is_seen",
    "check_kinds",
    "check_name",
    "check_options",
    "check_policy",
    "check_preemption",
    "check_ready",
    "check_receipts",
    "check_refusals",
    "check_repeatable",
    "check_same_decisions",
    "check_scaffold",
    "check_scene",
    "check_speed",
    "check_strangers",
    "check_values",
    "check_words",
    "instance_of",
    "sample_brief",
    "sample_observations",
]  # fmt: skip
