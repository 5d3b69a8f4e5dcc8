"""What an episode is played with, checked before anything is built: every fault of its options in one error.

A fault does not keep the others from being found: what is refused is left out, and the rest is checked as if it had
not been given. What would then be said of something only because of such a gap is not said.
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
from lingjing.play.option_sharing import engine_options, evaluator_options
from lingjing.play.options import PlayOptions
from lingjing.play.policies import AssignedPolicy, assign_policies
from lingjing.play.recorded_calls import check_calls
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.host import PluginHost
from lingjing.plugins.policy import PolicyPlugin
from lingjing.processes.fork_client import ForkServerClient
from lingjing.trace.seals import read_key


@dataclass(frozen=True, slots=True)
class Preparation:
    """An episode that can begin.

    `instance` has its engines' options and is not placed in its city yet; `assigned` are the policies by agent; `key`
    signs the trace, if it is not empty; `places` are the JSON paths at which a document places entities, by their ids.
    """

    instance: Instance
    assigned: dict[str, AssignedPolicy]
    evaluators: tuple[EvaluatorPlugin, ...]
    evaluator_options: dict[str, dict[str, GivenOption]]
    key: bytes = b""
    places: Mapping[str, str] = field(default_factory=dict)


def prepare(
    options: PlayOptions,
    mission: Mission | None,
    host: PluginHost,
    given: Mapping[str, PolicyPlugin],
    errors: ErrorCollector | None = None,
    server: ForkServerClient | None = None,
) -> Preparation:
    """Draw the instance and find who plays and who scores.

    `mission` is None where it has errors; `given` are policies that have been loaded already, by their names in the
    options; `errors` holds what reading the options has found. With a `server` no code of a policy's file runs in this
    process. Raises `UsageError` that tells all of it: of mode,
    settings, scene, engines and their options, policies and theirs, roles, evaluators and theirs.
    `MissionError` for a mission that cannot be evaluated, if that is all there is.
    """
    errors = errors or ErrorCollector()
    instance = _drawn(options, mission, errors) if mission is not None else None
    used: tuple[str, ...] = ()
    if instance is not None:
        scene = instance.scene.kind
        errors.attempt(lambda: host.scene(scene), None)
        used = errors.attempt(partial(_engines, instance, host), ())
    told = errors.attempt(lambda: engine_options(options.engine_args, host, used), {})
    assigned = assign_policies(instance, mission, options, host, given, errors, server)
    evaluators, evaluator_told = _evaluators(options, host, errors)
    key = errors.attempt(lambda: read_key(options.sign) if options.sign is not None else b"", b"")
    errors.attempt(lambda: check_calls(options), None)
    errors.check()
    if instance is None or mission is None:
        raise AssertionError("without an instance there is an error")
    instance = replace(instance, engine_options=told)
    return Preparation(instance, assigned, evaluators, evaluator_told, key, mission.origin.places)


def _engines(instance: Instance, host: PluginHost) -> tuple[str, ...]:
    return select_engines(instance, host).names


def _drawn(options: PlayOptions, mission: Mission, errors: ErrorCollector) -> Instance | None:
    """The instance; where mode or settings are refused, that without them, if there is one."""
    try:
        return instantiate(mission, seed=options.seed, mode=options.mode, settings=options.settings)
    except MissionError as error:
        errors.add(error)
        return None
    except UsageError as error:
        errors.add(error)
        refused = {fault.where for fault in error.faults}
    settings = {name: value for name, value in options.settings.items() if f"settings.{name}" not in refused}
    mode = None if "mode" in refused else options.mode
    follow = ErrorCollector()  # what can only follow from the gaps is not told
    return follow.attempt(lambda: instantiate(mission, seed=options.seed, mode=mode, settings=settings), None)


def _evaluators(
    options: PlayOptions, host: PluginHost, errors: ErrorCollector
) -> tuple[tuple[EvaluatorPlugin, ...], dict[str, dict[str, GivenOption]]]:
    """Who scores, and what each is told; the options of one that is refused are not looked at."""
    found = {name: errors.attempt(partial(host.evaluator, name), None) for name in dict.fromkeys(options.evaluators)}
    for name in found:
        if options.evaluators.count(name) > 1:
            errors.add(UsageError(f"evaluator `{name}` is named twice", hint="name each evaluator once"))
    scoring = {name: plugin for name, plugin in found.items() if plugin is not None}
    unknown = found.keys() - scoring.keys()
    given = {key: value for key, value in options.evaluator_args.items() if key.partition(".")[0] not in unknown}
    told = errors.attempt(lambda: evaluator_options(given, scoring), {})
    return tuple(scoring.values()), told
