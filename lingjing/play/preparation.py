"""The checks of an episode before anything is built: one error lists every fault of its options.

A fault does not hide the others: an invalid value is left out, and the rest is checked as if it were absent. Faults
that only follow from such a gap are not reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial

from msgspec.structs import replace

from lingjing.errors import ErrorCollector, MissionError, UsageError
from lingjing.kernel.world.selection import select_engines
from lingjing.mission.instance import GivenOption, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.mission.salts import instance_seed
from lingjing.play.option_sharing import engine_options, evaluator_options
from lingjing.play.options import PlayOptions
from lingjing.play.policies import AssignedPolicy, assign_policies
from lingjing.play.policy_processes.servers import PolicyServer
from lingjing.play.recorded_calls import check_calls
from lingjing.play.siting import sited_mission
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.host import PluginHost
from lingjing.plugins.policy import PolicyPlugin
from lingjing.trace.seals import read_key


@dataclass(frozen=True, slots=True)
class Preparation:
    """An episode that can begin."""

    instance: Instance
    """The instance with its engines' options. It is not placed in its city yet."""
    assigned: dict[str, AssignedPolicy]
    """The policies by agent."""
    evaluators: tuple[EvaluatorPlugin, ...]
    """The evaluators, in the order of the options."""
    evaluator_options: dict[str, dict[str, GivenOption]]
    """The options by evaluator and name."""
    key: bytes = b""
    """The key that signs the trace; empty for an unsigned trace."""
    places: Mapping[str, str] = field(default_factory=dict)
    """The JSON paths at which a document places entities, by entity id."""
    swapped: Instance | None = None
    """The instance of the neighbouring seed, for its pictures; None without `swap_pictures`."""


def prepare(
    options: PlayOptions,
    mission: Mission | None,
    host: PluginHost,
    loaded: Mapping[str, PolicyPlugin],
    errors: ErrorCollector | None = None,
    server: PolicyServer | None = None,
) -> Preparation:
    """Draw the instance, and find the policies and the evaluators.

    `mission` is None if it has errors. `loaded` are loaded policies by their names in the options. `errors` holds the
    faults that reading the options has found. With a `server` no code of a policy's file runs in this process.

    A mission that is to be played in a city from a map gets its places there.

    Raises `UsageError` that lists every fault: of mode, settings, scene, engines, policies, roles, evaluators and the
    options of each. Raises `MissionError` if the only fault is a mission that cannot be evaluated.
    """
    errors = errors or ErrorCollector()
    if mission is not None:
        declared = mission
        mission = errors.attempt(lambda: sited_mission(declared, options.scene, host), None)
    instance = _drawn(options, mission, errors) if mission is not None else None
    used: tuple[str, ...] = ()
    if instance is not None:
        scene = instance.scene.kind
        errors.attempt(lambda: host.scene(scene), None)
        used = errors.attempt(partial(_engines, instance, host), ())
    options_by_engine = errors.attempt(lambda: engine_options(options.engine_args, host, used), {})
    assigned = assign_policies(instance, mission, options, host, loaded, errors, server)
    evaluators, options_by_evaluator = _evaluators(options, host, errors)
    key = errors.attempt(lambda: read_key(options.sign) if options.sign is not None else b"", b"")
    errors.attempt(lambda: check_calls(options), None)
    errors.check()
    if instance is None or mission is None:
        raise AssertionError("without an instance there is an error")
    instance = replace(instance, engine_options=options_by_engine)
    swapped: Instance | None = None
    if options.swap_pictures:
        neighbour = _drawn(replace(options, seed=options.seed ^ 1), mission, errors)
        errors.check()
        swapped = replace(neighbour, engine_options=options_by_engine) if neighbour is not None else None
    return Preparation(instance, assigned, evaluators, options_by_evaluator, key, mission.origin.places, swapped)


def _engines(instance: Instance, host: PluginHost) -> tuple[str, ...]:
    return select_engines(instance, host).names


def _drawn(options: PlayOptions, mission: Mission, errors: ErrorCollector) -> Instance | None:
    """Return the instance. If mode or settings are rejected, return one without them; None if there is none."""
    seed = errors.attempt(lambda: instance_seed(options.salt, options.seed), options.seed)
    try:
        return instantiate(
            mission,
            seed=seed,
            mode=options.mode,
            settings=options.settings,
            tier=options.tier,
            language=options.language,
        )
    except MissionError as error:
        errors.add(error)
        return None
    except UsageError as error:
        errors.add(error)
        refused = {fault.where for fault in error.faults}
    settings = {name: value for name, value in options.settings.items() if f"settings.{name}" not in refused}
    mode = None if "mode" in refused else options.mode
    tier = 0 if "tier" in refused else options.tier
    follow = ErrorCollector()  # its faults may follow from the gaps, so they are dropped
    return follow.attempt(lambda: instantiate(mission, seed=seed, mode=mode, settings=settings, tier=tier), None)


def _evaluators(
    options: PlayOptions, host: PluginHost, errors: ErrorCollector
) -> tuple[tuple[EvaluatorPlugin, ...], dict[str, dict[str, GivenOption]]]:
    """Return the evaluators and their options. Options of an unknown evaluator are not checked."""
    plugins = {name: errors.attempt(partial(host.evaluator, name), None) for name in dict.fromkeys(options.evaluators)}
    for name in plugins:
        if options.evaluators.count(name) > 1:
            errors.add(UsageError(f"evaluator `{name}` is named twice", hint="name each evaluator once"))
    scoring = {name: plugin for name, plugin in plugins.items() if plugin is not None}
    unknown = plugins.keys() - scoring.keys()
    arguments = {key: value for key, value in options.evaluator_args.items() if key.partition(".")[0] not in unknown}
    options_by_evaluator = errors.attempt(lambda: evaluator_options(arguments, scoring), {})
    return tuple(scoring.values()), options_by_evaluator
