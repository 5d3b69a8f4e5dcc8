"""How one episode is to be played: one value for the command line, Python, worker processes and studies."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from typing import Annotated, Any, Literal, TypedDict

import msgspec

from lingjing.errors import UsageError
from lingjing.mission.faults import lines_of, schema_faults
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
    engine that each names (`camera.quality`). `seed` draws the instance, `policy_seed` starts the policies' own random
    streams and tells them nothing about it. `mode` None is the mission's own; `settings` are values of its parameters
    in SI units. `evaluators` score it: the mean of their scores counts, and the first that says so ends the episode.
    `world` says where the engines run, `blank_pictures` hands the policies black pictures, `overview` draws
    `overview.png`.
    """

    mission: str
    policy: str = "heuristic"
    policies_for: dict[str, str] = {}
    policy_args: dict[str, str] = {}
    engine_args: dict[str, str] = {}
    seed: Seed = 0
    policy_seed: Seed = 0
    mode: str | None = None
    settings: dict[str, float] = {}
    evaluators: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("mission",)
    world: Literal["process", "inline"] = "process"
    blank_pictures: bool = False
    overview: bool = True


class Changes(TypedDict, total=False):
    """The options as `lingjing.run` takes them: a policy may also be what makes one."""

    policy: PolicySpec
    policies_for: Mapping[str, PolicySpec]
    policy_args: Mapping[str, object]
    engine_args: Mapping[str, object]
    seed: int
    policy_seed: int
    mode: str | None
    settings: Mapping[str, float]
    evaluators: Sequence[str]
    world: Literal["process", "inline"]
    blank_pictures: bool
    overview: bool


def read_options(text: str | bytes, path: str) -> dict[str, object]:
    """The options that a JSON file gives, each of them right by itself; the mission may be left out.

    Raises `UsageError` that tells every fault with its JSON path.
    """
    try:
        given = msgspec.json.decode(text)
    except msgspec.DecodeError as error:
        raise UsageError(f"{path} is not JSON: {error}") from error
    checked_options({"mission": "", **given} if isinstance(given, dict) else given, path)
    return dict(given)


def checked_options(given: object, path: str = "") -> PlayOptions:
    """Plain values as options. Raises `UsageError` that tells every fault of theirs."""
    try:
        return msgspec.convert(given, PlayOptions)
    except msgspec.ValidationError as error:
        faults = schema_faults(given, PlayOptions)
        said = lines_of(faults, path) or str(error)
        raise UsageError(said, hint=faults[0].hint if faults else "", faults=faults) from None


def options_of(
    mission: Mission | str | PathLike[str], changes: Changes
) -> tuple[PlayOptions, Mission, dict[str, PolicyPlugin]]:
    """What `lingjing.run` was called with: the options, the compiled mission, and the policies given as objects, by the
    names that the options have for them."""
    made: dict[str, PolicyPlugin] = {}
    unknown = sorted(set(changes) - set(PlayOptions.__struct_fields__))
    if unknown:
        raise TypeError(f"run() got an unexpected keyword argument '{unknown[0]}'")
    plain = {
        **changes,
        "mission": mission.name if isinstance(mission, Mission) else _path(mission),
        "policies_for": _mapped(changes.get("policies_for"), lambda spec: _named(spec, made)),
        "policy_args": _mapped(changes.get("policy_args"), str),
        "engine_args": _mapped(changes.get("engine_args"), str),
        "settings": _mapped(changes.get("settings"), lambda value: value),
    }
    if "policy" in changes:
        plain["policy"] = _named(changes["policy"], made)
    options = checked_options(plain)
    return options, mission if isinstance(mission, Mission) else compiled(options), made


def compiled(options: PlayOptions) -> Mission:
    """The mission that the options name. Raises `UsageError` if there is none, `MissionError` if it has errors."""
    from lingjing.dsl.loading.load import load_mission

    return load_mission(options.mission)


def _mapped(given: object, value_of: Callable[[Any], object]) -> object:
    """A mapping with its values made plain, None an empty one; anything else is left for the check to refuse."""
    return {name: value_of(value) for name, value in given.items()} if isinstance(given, Mapping) else given or {}


def _path(given: object) -> str:
    if not isinstance(given, str | PathLike):
        raise UsageError(
            f"a mission is due, this is {type(given).__name__!r}",
            hint="give what `lingjing.compile` returns, a file's name, or a shipped mission's",
        )
    return fspath(given)


def _named(spec: object, made: dict[str, PolicyPlugin]) -> str:
    """The name that stands for a policy in the options; one given as a class or a function is added to `made`."""
    if isinstance(spec, str):
        return spec
    plugin = _plugin(spec)
    taken = [name for name, one in made.items() if one.name == plugin.name]
    name = next((one for one in taken if made[one].factory is plugin.factory), "")
    name = name or (f"{plugin.name} ({len(taken) + 1})" if taken else plugin.name)
    made[name] = plugin
    return name


def _plugin(factory: object) -> PolicyPlugin:
    """A class or function given from Python; its attribute `privileged` counts as its declaration."""
    if not callable(factory):
        raise UsageError(
            f"{factory!r} is not a policy",
            hint="give a policy's name, FILE.py:CLASS, a class, or a function that makes one",
        )
    return policy_of(factory, getattr(factory, "__qualname__", type(factory).__name__))
