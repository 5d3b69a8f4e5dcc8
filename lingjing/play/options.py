"""How one episode is to be played: one value for the command line, Python, worker processes and studies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from typing import Annotated, Any, Literal, TypedDict

import msgspec

from lingjing.errors import ErrorCollector, Fault, UsageError
from lingjing.mission.faults import lines_of, schema_faults
from lingjing.mission.instance import GivenOption
from lingjing.mission.model import Mission
from lingjing.plugins.loading import policy_of
from lingjing.plugins.policy import Policy, PolicyPlugin

Seed = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]

PolicySpec = str | Callable[..., Policy]
"""A policy's name, `FILE.py:CLASS`, or anything that returns a policy object when called."""


class PlayOptions(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """All that decides an episode, as JSON wherever it travels.

    `mission` is the path of a file or the name of a shipped mission. `policy` plays every agent; `policies_for`
    overrides it by role, agent or agent id; `policy_args` go to every policy that takes them, `engine_args` to the
    engine that each names (`camera.quality`), `evaluator_args` likewise; a value
    is any JSON. `seed` draws the instance, `policy_seed` starts the policies' own random
    streams and tells them nothing about it. `mode` None is the mission's own; `settings` are values of its parameters
    in SI units. `evaluators` score it: the mean of their scores counts, and the first that says so ends the episode.
    `world` says where the engines run, `blank_pictures` hands the policies black pictures, `overview` draws
    `overview.png`, `sign` is the file of the key that the trace is signed with.

    `calls` says what becomes of questions to chat models: they are recorded beside the trace, answered from the record
    that `calls_from` names (a trace, its folder, or the folder of a run's episodes), or asked without a record.
    `max_cost` (US dollars) and `max_tokens` limit what they may take; with a `ledger` file all episodes that name it
    are counted together.
    """

    mission: str
    policy: str = "heuristic"
    policies_for: dict[str, str] = {}
    policy_args: dict[str, GivenOption] = {}
    engine_args: dict[str, GivenOption] = {}
    evaluator_args: dict[str, GivenOption] = {}
    seed: Seed = 0
    policy_seed: Seed = 0
    mode: str | None = None
    settings: dict[str, float] = {}
    evaluators: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("mission",)
    world: Literal["process", "inline"] = "process"
    blank_pictures: bool = False
    overview: bool = True
    sign: str | None = None
    calls: Literal["record", "replay", "live"] = "record"
    calls_from: str = ""
    max_cost: float | None = None
    max_tokens: int | None = None
    ledger: str = ""


class Changes(TypedDict, total=False):
    """The options as `lingjing.run` takes them: a policy may also be what makes one."""

    policy: PolicySpec
    policies_for: Mapping[str, PolicySpec]
    policy_args: Mapping[str, object]
    engine_args: Mapping[str, object]
    evaluator_args: Mapping[str, object]
    seed: int
    policy_seed: int
    mode: str | None
    settings: Mapping[str, float]
    evaluators: Sequence[str]
    world: Literal["process", "inline"]
    blank_pictures: bool
    overview: bool
    sign: str | PathLike[str] | None
    calls: Literal["record", "replay", "live"]
    calls_from: str | PathLike[str]
    max_cost: float | None
    max_tokens: int | None
    ledger: str | PathLike[str]


def read_options(text: str | bytes, path: str, errors: ErrorCollector | None = None) -> dict[str, object]:
    """The options that a JSON file gives, each of them right by itself; the mission may be left out.

    Raises `UsageError` that tells every fault with its JSON path. With `errors` it goes there, and what is right is
    returned.
    """
    found = ErrorCollector() if errors is None else errors
    given: object = {}
    try:
        given = msgspec.json.decode(text)
    except msgspec.DecodeError as error:
        found.add(UsageError(f"{path} is not JSON: {error}"))
    read = _right({"mission": "", **given} if isinstance(given, dict) else given, path, found)
    if errors is None:
        found.check()
    return {name: value for name, value in read.items() if isinstance(given, dict) and name in given}


def checked_options(given: object, errors: ErrorCollector | None = None) -> PlayOptions:
    """Plain values as options. Raises `UsageError` that tells every fault of theirs.

    With `errors` it goes there, and what is refused counts as not given.
    """
    found = ErrorCollector() if errors is None else errors
    right = {"mission": "", **_right(given, "", found)}
    if errors is None:
        found.check()
    return msgspec.convert(right, PlayOptions)


def options_of(
    mission: Mission | str | PathLike[str], changes: Changes, errors: ErrorCollector | None = None
) -> tuple[PlayOptions, Mission | None, dict[str, PolicyPlugin]]:
    """What `lingjing.run` was called with: the options, the compiled mission, and the policies given as objects, by the
    names that the options have for them.

    Raises `UsageError` or `MissionError` that tells every fault. With `errors` it goes there, what is refused counts as
    not given, and a mission that has errors is None.
    """
    found = ErrorCollector() if errors is None else errors
    made: dict[str, PolicyPlugin] = {}
    unknown = sorted(set(changes) - set(PlayOptions.__struct_fields__))
    if unknown:
        raise TypeError(f"run() got an unexpected keyword argument '{unknown[0]}'")

    def named(field: str, spec: object) -> object:
        return found.attempt(lambda: _named(spec, made, field), None)

    plain = {
        **changes,
        "mission": mission.name if isinstance(mission, Mission) else found.attempt(lambda: _path(mission), ""),
        "policies_for": _mapped(changes.get("policies_for"), lambda spec: named("policies_for", spec)),
        **{name: _mapped(changes.get(name), _as_json) for name in ("policy_args", "engine_args", "evaluator_args")},
        "settings": _mapped(changes.get("settings"), lambda value: value),
        **{name: fspath(path) for name, path in changes.items() if isinstance(path, PathLike)},
    }
    if "policy" in changes:
        plain["policy"] = named("policy", changes["policy"])
    for name in ("policy", "policies_for"):  # what is no policy has been told in other words than those of JSON
        if any(fault.where == name for fault in found.faults):
            del plain[name]
    options = checked_options(plain, found)
    if isinstance(mission, Mission):
        compiled_mission: Mission | None = mission
    else:
        compiled_mission = found.attempt(lambda: compiled(options), None) if options.mission else None
    if errors is None:
        found.check()
    return options, compiled_mission, made


def compiled(options: PlayOptions) -> Mission:
    """The mission that the options name. Raises `UsageError` if there is none, `MissionError` if it has errors."""
    from lingjing.dsl.loading.load import load_mission

    return load_mission(options.mission)


def _mapped(given: object, value_of: Callable[[Any], object]) -> object:
    """A mapping with its values made plain, None an empty one; anything else is left for the check to refuse."""
    return {name: value_of(value) for name, value in given.items()} if isinstance(given, Mapping) else given or {}


def _as_json(value: object) -> object:
    """A value of an option as JSON has it; what JSON has no words for, such as a path, as its text."""
    try:
        return msgspec.to_builtins(value, str_keys=True, order="deterministic")
    except (TypeError, ValueError, msgspec.MsgspecError):
        return str(value)


def _path(given: object) -> str:
    if not isinstance(given, str | PathLike):
        raise UsageError(
            f"a mission is due, this is {type(given).__name__!r}",
            hint="give what `lingjing.compile` returns, a file's name, or a shipped mission's",
        )
    return fspath(given)


def _right(given: object, path: str, errors: ErrorCollector) -> dict[str, object]:
    """The options that are right by themselves; a `UsageError` for each fault of the others goes to `errors`.

    Of a mapping the entries that are wrong are left out, of the rest the whole field.
    """
    try:
        msgspec.convert(given, PlayOptions)
    except msgspec.ValidationError as error:
        for fault in schema_faults(given, PlayOptions) or (Fault("", str(error)),):
            errors.add(UsageError(lines_of([fault], path), hint=fault.hint, faults=(fault,)))
        if not isinstance(given, dict):
            return {}
        return {name: right for name, value in given.items() if (right := _right_value(name, value)) is not None}
    return given if isinstance(given, dict) else {}


def _right_value(name: str, value: object) -> object:
    """What is right of a field's value, None if nothing is."""
    if name not in PlayOptions.__struct_fields__:
        return None
    if isinstance(value, dict):
        return {key: one for key, one in value.items() if _fits(name, {key: one})}
    return value if _fits(name, value) else None


def _fits(name: str, value: object) -> bool:
    try:
        msgspec.convert({"mission": "", name: value}, PlayOptions)
    except msgspec.ValidationError:
        return False
    return True


def _named(spec: object, made: dict[str, PolicyPlugin], field: str) -> str:
    """The name that stands for a policy in the options; one given as a class or a function is added to `made`."""
    if isinstance(spec, str):
        return spec
    plugin = _plugin(spec, field)
    taken = [name for name, one in made.items() if one.name == plugin.name]
    name = next((one for one in taken if made[one].factory is plugin.factory), "")
    name = name or (f"{plugin.name} ({len(taken) + 1})" if taken else plugin.name)
    made[name] = plugin
    return name


def _plugin(factory: object, field: str) -> PolicyPlugin:
    """A class or function given from Python; its attribute `privileged` counts as its declaration."""
    if not callable(factory):
        message = f"{factory!r} is not a policy"
        hint = "give a policy's name, FILE.py:CLASS, a class, or a function that makes one"
        raise UsageError(message, hint=hint, faults=(Fault(field, message, hint),))
    return policy_of(factory, getattr(factory, "__qualname__", type(factory).__name__))
