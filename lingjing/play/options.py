"""The options of one episode: one value for the command line, Python, worker processes and studies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from pathlib import PurePath
from typing import Annotated, Any, Literal, TypedDict

import msgspec

from lingjing.decoding import converted, from_json
from lingjing.errors import ErrorCollector, Fault, UsageError
from lingjing.mission.faults import lines_of, schema_faults
from lingjing.mission.instance import GivenOption
from lingjing.mission.model import Mission
from lingjing.plugins.loading import policy_of
from lingjing.plugins.policy import Policy, PolicyPlugin

Seed = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
"""A seed: 0 to 2⁶³ - 1, the non-negative values of a signed 64-bit integer."""

PolicySpec = str | Callable[..., Policy]
"""A policy's name, `FILE.py:CLASS`, or a callable that returns a policy object."""


class PlayOptions(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The options that decide an episode. Processes exchange them as JSON.

    >>> options = lingjing.PlayOptions(mission="first.ljs", policy="random", overview=False)
    >>> with lingjing.Session() as session:
    ...     session.play(options).policy
    'random'
    """

    mission: str
    """The path of a mission's file, or the name of a shipped mission."""
    policy: str = "heuristic"
    """The policy of every agent that `policies_for` does not name."""
    policies_for: dict[str, str] = {}
    """Policies by role, agent or agent id."""
    policy_args: dict[str, GivenOption] = {}
    """Options of policies. Each policy receives those that its model declares; a value is any JSON."""
    engine_args: dict[str, GivenOption] = {}
    """Options of engines, as `ENGINE.OPTION` (`camera.quality`)."""
    evaluator_args: dict[str, GivenOption] = {}
    """Options of evaluators, as `EVALUATOR.OPTION`."""
    scene: str = ""
    """A map or a built city in which the mission's places are found; "" to play in the mission's own scene."""
    seed: Seed = 0
    """The seed from which the instance is drawn."""
    salt: str = ""
    """The secret file that decides, with the seed, the instance of a sealed split; "" for the instance of the seed."""
    policy_seed: Seed = 0
    """The seed of the policies' own random streams. It does not affect the instance."""
    mode: str | None = None
    """The communication mode; None for the mission's default."""
    tier: int = 0
    """The tier in which the mission is played."""
    language: str = "en"
    """The language of goal, prompts, rules and requests, by its code."""
    settings: dict[str, float] = {}
    """Values of the mission's parameters, SI units; they replace those of the tier."""
    evaluators: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("mission",)
    """The evaluators. The mean of their scores counts; the first one that is done ends the episode."""
    world: Literal["process", "inline"] = "process"
    """The place of the engines: processes of their own, or this process."""
    blank_pictures: bool = False
    """True if policies receive black pictures."""
    swap_pictures: bool = False
    """True if policies receive the pictures of the neighbouring seed: 1 for 0, 0 for 1, 3 for 2, …"""
    isolate: Literal["no", "yes", "strict"] = "no"
    """The walls around each policy's process: none, those that the kernel offers, or all or no episode."""
    policy_files: tuple[str, ...] = ()
    """Further files and folders that policies behind walls may read."""
    overview: bool = True
    """True to draw `overview.png`."""
    sign: str | None = None
    """The file of the key that signs the trace; None for an unsigned trace."""
    calls: Literal["record", "replay", "live"] = "record"
    """The handling of chat-model calls: recorded beside the trace, answered from a record, or made without a record."""
    calls_from: str = ""
    """The record to replay: a trace, its folder, or the folder of a run's episodes; "" without a replay."""
    max_cost: float | None = None
    """The limit of the cost of model calls, US dollars; None for no limit."""
    max_tokens: int | None = None
    """The limit of the tokens of model calls; None for no limit."""
    ledger: str = ""
    """The file that counts cost and tokens of all episodes that name it; "" to count in this process."""


_NOT_DECIDING = frozenset(
    {"mission", "seed", "salt", "policy_seed", "mode", "tier", "language", "evaluators", "world", "overview", "sign",
     "calls", "calls_from", "max_cost", "max_tokens", "ledger", "policy_files"}
)  # fmt: skip
"""The options that a trace's header names by itself, and those that decide no episode."""


def deciding_options(options: PlayOptions) -> dict[str, GivenOption]:
    """Return the options other than the defaults that decide an episode, as JSON data without places of files.

    Mission, seeds, mode, tier, language and evaluators are left out: a trace's header names them by itself.
    """
    plain = msgspec.to_builtins(without_places(options), order="deterministic")
    usual = msgspec.to_builtins(PlayOptions(mission=""), order="deterministic")
    return {name: value for name, value in plain.items() if name not in _NOT_DECIDING and value != usual[name]}


def without_places(options: PlayOptions) -> PlayOptions:
    """Return the options without places of files. Policy files are reduced to their names."""
    return msgspec.structs.replace(
        options,
        salt="",
        calls_from="",
        ledger="",
        scene=PurePath(options.scene).name,
        policy=without_folder(options.policy),
        policies_for={role: without_folder(policy) for role, policy in options.policies_for.items()},
    )


def without_folder(policy: str) -> str:
    """Return a policy's name, for a policy file without its folder: `agent.py:Agent`."""
    return policy.rpartition("/")[2] if policy.partition(":")[0].endswith(".py") else policy


class Changes(TypedDict, total=False):
    """The options as arguments of `lingjing.run`. A policy may also be a class, or a function that makes a policy."""

    policy: PolicySpec
    policies_for: Mapping[str, PolicySpec]
    policy_args: Mapping[str, object]
    engine_args: Mapping[str, object]
    evaluator_args: Mapping[str, object]
    scene: str | PathLike[str]
    seed: int
    salt: str | PathLike[str]
    policy_seed: int
    mode: str | None
    tier: int
    language: str
    settings: Mapping[str, float]
    evaluators: Sequence[str]
    world: Literal["process", "inline"]
    blank_pictures: bool
    swap_pictures: bool
    isolate: Literal["no", "yes", "strict"]
    policy_files: Sequence[str]
    overview: bool
    sign: str | PathLike[str] | None
    calls: Literal["record", "replay", "live"]
    calls_from: str | PathLike[str]
    max_cost: float | None
    max_tokens: int | None
    ledger: str | PathLike[str]


def read_options(text: str | bytes, path: str, errors: ErrorCollector | None = None) -> dict[str, object]:
    """Return the valid options of a JSON file. The mission may be absent.

    Raises `UsageError` that lists every fault with its JSON path. With `errors` the faults are added there instead, and
    the valid options are returned.
    """
    collected = ErrorCollector() if errors is None else errors
    document: object = {}
    try:
        document = from_json(text)
    except msgspec.DecodeError as error:
        collected.add(UsageError(f"{path} is not JSON: {error}"))
    valid = _valid_options({"mission": "", **document} if isinstance(document, dict) else document, path, collected)
    if errors is None:
        collected.check()
    return {name: value for name, value in valid.items() if isinstance(document, dict) and name in document}


def checked_options(values: object, errors: ErrorCollector | None = None) -> PlayOptions:
    """Return options from plain values. Raises `UsageError` that lists every fault.

    With `errors` the faults are added there instead, and each invalid value is replaced by its default.
    """
    collected = ErrorCollector() if errors is None else errors
    valid = {"mission": "", **_valid_options(values, "", collected)}
    if errors is None:
        collected.check()
    return converted(valid, PlayOptions)


def options_of(
    mission: Mission | str | PathLike[str], changes: Changes, errors: ErrorCollector | None = None
) -> tuple[PlayOptions, Mission | None, dict[str, PolicyPlugin]]:
    """Return the options, the compiled mission, and the policies given as objects, by their names in the options.

    Raises `UsageError` or `MissionError` that lists every fault. With `errors` the faults are added there instead: each
    invalid value is replaced by its default, and a mission with errors is None. Raises `TypeError` for an unknown
    argument.
    """
    collected = ErrorCollector() if errors is None else errors
    made: dict[str, PolicyPlugin] = {}
    unknown = sorted(set(changes) - set(PlayOptions.__struct_fields__))
    if unknown:
        raise TypeError(f"run() got an unexpected keyword argument '{unknown[0]}'")

    def named(field: str, spec: object) -> object:
        return collected.attempt(lambda: _named(spec, made, field), None)

    plain = {
        **changes,
        "mission": mission.name if isinstance(mission, Mission) else collected.attempt(lambda: _path(mission), ""),
        "policies_for": _mapped(changes.get("policies_for"), lambda spec: named("policies_for", spec)),
        **{name: _mapped(changes.get(name), _as_json) for name in ("policy_args", "engine_args", "evaluator_args")},
        "settings": _mapped(changes.get("settings"), lambda value: value),
        **{name: fspath(path) for name, path in changes.items() if isinstance(path, PathLike)},
    }
    if "policy" in changes:
        plain["policy"] = named("policy", changes["policy"])
    for name in ("policy", "policies_for"):  # `_plugin` has reported the fault; a fault of JSON would repeat it
        if any(fault.where == name for fault in collected.faults):
            del plain[name]
    options = checked_options(plain, collected)
    if isinstance(mission, Mission):
        compiled_mission: Mission | None = mission
    else:
        compiled_mission = collected.attempt(lambda: compiled(options), None) if options.mission else None
    if errors is None:
        collected.check()
    return options, compiled_mission, made


def compiled(options: PlayOptions) -> Mission:
    """Return the mission of the options. Raises `UsageError` if there is none, `MissionError` if it has errors."""
    from lingjing.dsl.loading.load import load_mission

    return load_mission(options.mission)


def _mapped(mapping: object, value_of: Callable[[Any], object]) -> object:
    """Return a mapping with plain values, and `{}` for None. Other values are returned for the check to reject."""
    return {name: value_of(value) for name, value in mapping.items()} if isinstance(mapping, Mapping) else mapping or {}


def _as_json(value: object) -> object:
    """Return an option's value as JSON data. A value without a JSON form, such as a path, becomes its text."""
    try:
        return msgspec.to_builtins(value, str_keys=True, order="deterministic")
    except (TypeError, ValueError, msgspec.MsgspecError):
        return str(value)


def _path(mission: object) -> str:
    if not isinstance(mission, str | PathLike):
        raise UsageError(
            f"expected a mission, not {type(mission).__name__!r}",
            hint="give what `lingjing.compile` returns, a file's name, or a shipped mission's",
        )
    return fspath(mission)


def _valid_options(values: object, path: str, errors: ErrorCollector) -> dict[str, object]:
    """Return the valid options, and add a `UsageError` to `errors` for each fault.

    Of a mapping only the invalid entries are left out; of any other field the whole value.
    """
    try:
        converted(values, PlayOptions)
    except msgspec.ValidationError as error:
        for fault in schema_faults(values, PlayOptions) or (Fault("", str(error)),):
            errors.add(UsageError(lines_of([fault], path), hint=fault.hint, faults=(fault,)))
        if not isinstance(values, dict):
            return {}
        return {name: valid for name, value in values.items() if (valid := _valid_part(name, value)) is not None}
    return values if isinstance(values, dict) else {}


def _valid_part(name: str, value: object) -> object:
    """Return the valid part of a field's value; None if no part is valid."""
    if name not in PlayOptions.__struct_fields__:
        return None
    if isinstance(value, dict):
        return {key: entry for key, entry in value.items() if _fits(name, {key: entry})}
    return value if _fits(name, value) else None


def _fits(name: str, value: object) -> bool:
    """Return True if the field accepts the value."""
    try:
        converted({"mission": "", name: value}, PlayOptions)
    except msgspec.ValidationError:
        return False
    return True


def _named(spec: object, made: dict[str, PolicyPlugin], field: str) -> str:
    """Return the name of a policy in the options.

    A policy given as a class or a function is added to `made`; the same callable keeps its name.
    """
    if isinstance(spec, str):
        return spec
    plugin = _plugin(spec, field)
    namesakes = [name for name, other in made.items() if other.name == plugin.name]
    name = next((namesake for namesake in namesakes if made[namesake].factory is plugin.factory), "")
    name = name or (f"{plugin.name} ({len(namesakes) + 1})" if namesakes else plugin.name)
    made[name] = plugin
    return name


def _plugin(factory: object, field: str) -> PolicyPlugin:
    """Return the declaration of a class or function. Its attribute `privileged` is the declared value."""
    if not callable(factory):
        message = f"{factory!r} is not a policy"
        hint = "give a policy's name, FILE.py:CLASS, a class, or a function that makes one"
        raise UsageError(message, hint=hint, faults=(Fault(field, message, hint),))
    return policy_of(factory, getattr(factory, "__qualname__", type(factory).__name__))
