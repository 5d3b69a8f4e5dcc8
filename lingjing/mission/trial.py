"""`trial`: errors that playing a mission would raise, found by making its instances without playing them.

Every mode is tried at the default settings, then with every setting of its sweeps. Where a draw can fail, because of a
requirement or because its places are crowded, the instances of further seeds are made too. Errors that depend on the
machine, a map or a plug-in are not examined. Nor is a mission with very many members, because the check must stay fast.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from typing import NamedTuple

import msgspec

from lingjing.errors import LingjingError, MissionError, hint_of
from lingjing.mission import elements, geometry2d, model
from lingjing.mission import expression as ex
from lingjing.mission.alternatives import with_alternatives
from lingjing.mission.conditions.spread import places
from lingjing.mission.draws import crowding, line_of, outline
from lingjing.mission.evaluate import Area, Scope, number
from lingjing.mission.instance import Instance
from lingjing.mission.instance_entities import DRAWN_MOST, FARTHEST_M, NodeError, count_of, holds
from lingjing.mission.instantiate import instantiate, parameters
from lingjing.mission.kinds import engine_kind, lacks, reach_m, scene_faults, spoken
from lingjing.mission.requirements import depended
from lingjing.mission.tiers import setting_number, settings_of_tier
from lingjing.sums import total

_MAX_MEMBERS = 2_000
"""A mission with more entities or agents is not tried (chosen)."""

_MAX_COMBINATIONS = 64
"""The largest number of combinations of a sweep's values that are tried (chosen); of a larger sweep, each value is
tried once."""

_FURTHER_SEEDS = range(1, 10)
"""Seeds that are tried besides 0 where a draw can fail (chosen: those that are played first)."""

_MOST_FURTHER = 40_000
"""The most members that are drawn with further seeds in one mode (chosen: some 4 s). A sweep of many values of a large
mission is tried with seed 0 alone beyond them."""

_CROWDED = 0.4
"""The share of its room from which on a draw of places can fail (chosen: below the 0.7 at which it fails in a large
region, because the edges of a small one waste room)."""

_MAX_FAULTS = 20
"""The largest number of declarations with errors that are reported at once (chosen)."""


class TrialFault(msgspec.Struct, frozen=True):
    """An error of an instance."""

    code: str
    """The diagnostic code."""
    path: str
    """The node: `<mission>/boat/speed_mps`."""
    message: str
    hint: str = ""


def trial(mission: model.Mission) -> tuple[TrialFault, ...]:
    """All errors of a mission's instances, each once, with the modes if not all modes have it."""
    modes_of_fault: dict[TrialFault, list[str]] = {}
    modes = mission.modes.allowed
    for mode in modes:
        for fault in dict.fromkeys(_in_mode(mission, mode)):
            modes_of_fault.setdefault(fault, []).append(mode)
    return tuple(
        fault
        if len(where) == len(modes)
        else msgspec.structs.replace(fault, message=f"in {' and '.join(where)} mode, {fault.message}")
        for fault, where in modes_of_fault.items()
    )


# -- private


def _in_mode(mission: model.Mission, mode: str) -> Iterator[TrialFault]:
    further: list[_Draws] = []
    default_faults = tuple(_with_settings(mission, mode, {}, further, _MAX_FAULTS))
    yield from default_faults
    reported: set[tuple[str, str]] = set()
    tried = [_values(mission, mode, {})]
    for settings in () if default_faults else _swept(mission, mode):
        values = _values(mission, mode, settings)
        if values is not None and values in tried:
            continue
        tried.append(values)
        chosen = ", ".join(f"{name} = {value:g}" for name, value in settings.items())
        for fault in _with_settings(mission, mode, settings, further):
            if (
                fault.code,
                fault.path,
            ) not in reported:  # the first value at fault stands for all
                reported.add((fault.code, fault.path))
                yield msgspec.structs.replace(fault, message=f"with {chosen}, {fault.message}")


def _values(mission: model.Mission, mode: str, settings: Mapping[str, float]) -> dict[str, float] | None:
    """The parameters' values with these settings; None if they cannot be evaluated."""
    try:
        return parameters(mission, mode, settings)
    except LingjingError:
        return None


def _with_settings(
    mission: model.Mission, mode: str, settings: Mapping[str, float], further: list[_Draws], most: int = 1
) -> Iterator[TrialFault]:
    """Errors with these settings. A declaration with an error is left out and the rest tried again, until `most` errors
    are reported. `further`: the draws of which further seeds were tried in this mode."""
    try:
        entities, agents = _sizes(mission, mode, settings)
        if entities > DRAWN_MOST and any(group.cameras for group in mission.groups):
            hint = f"a mission with cameras has at most {DRAWN_MOST}"
            yield TrialFault("LJ0507", mission.name, f"there are {entities} entities for cameras to draw", hint)
        if entities + agents > _MAX_MEMBERS:
            return
        instance = instantiate(mission, mode=mode, settings=settings)
    except NodeError as error:
        yield TrialFault("LJ0507", error.path, error.message, hint_of(error))
        rest = _without(mission, error.path) if most > 1 else None
        if rest is not None:
            yield from _with_settings(rest, mode, settings, further, most - 1)
    except LingjingError as error:
        yield TrialFault("LJ0507", mission.name, str(error), hint_of(error))
    else:
        yield from _of_draws(mission, instance)
        yield from _of_scene(mission, instance)
        yield from _of_further_seeds(mission, instance, settings, further)


def _without(mission: model.Mission, path: str) -> model.Mission | None:
    """The mission without the property, camera or option of a path, or with a grid of one cell. None if other
    declarations may depend on it."""
    owner, _, name = path.partition("/")[2].partition("/")
    owner = owner.partition("[")[0]
    if owner == "scene" and name:
        options = tuple(option for option in mission.scene.options if option.name != name)
        return msgspec.structs.replace(mission, scene=msgspec.structs.replace(mission.scene, options=options))
    if any(grid.name == owner for grid in mission.grids):
        grids = tuple(_small(grid) if grid.name == owner else grid for grid in mission.grids)
        return msgspec.structs.replace(mission, grids=grids)
    if not name or not any(group.name == owner for group in mission.groups):
        return None
    groups = tuple(_without_part(group, name) if group.name == owner else group for group in mission.groups)
    return msgspec.structs.replace(mission, groups=groups) if groups != mission.groups else None


def _without_part(group: model.Group, name: str) -> model.Group:
    """The group without the property or the camera; a position is replaced by the origin."""
    if name == "position":
        moved = (msgspec.structs.replace(p, value=_ORIGIN) if p.name == name else p for p in group.properties)
        return msgspec.structs.replace(group, properties=tuple(moved))
    properties = tuple(prop for prop in group.properties if prop.name != name)
    cameras = tuple(camera for camera in group.cameras if camera.name != name)
    return msgspec.structs.replace(group, properties=properties, cameras=cameras)


def _small(grid: model.Grid) -> model.Grid:
    return msgspec.structs.replace(grid, rows=ex.Number(1.0), columns=ex.Number(1.0))


_ORIGIN = ex.Point((ex.Number(0.0, "m"), ex.Number(0.0, "m")))


def _sizes(mission: model.Mission, mode: str, settings: Mapping[str, float]) -> tuple[int, int]:
    """The numbers of entities and of agents."""
    scope = Scope(parameters=parameters(mission, mode, settings), mode=mode)
    entities = [(group.count, group.when) for group in mission.groups]
    agents = [(agent.count, agent.when) for agent in mission.agents]
    try:
        numbers = [
            sum(count_of(count, scope) for count, guard in part if holds(guard, scope)) for part in (entities, agents)
        ]
    except MissionError:
        return 0, 0  # `instantiate` reports the error with its place
    return numbers[0], numbers[1]


def _swept(mission: model.Mission, mode: str) -> Iterator[dict[str, float]]:
    """The settings of every tier and of every sweep of this mode."""
    for tier in mission.tiers:
        yield settings_of_tier(mission, tier.level, mode)
    scope = Scope(parameters=parameters(mission, mode, {}), mode=mode)
    for sweep in mission.sweeps:
        try:
            if not holds(sweep.when, scope):
                continue
            columns = [[setting_number(value, scope) for value in column] for column in sweep.values]
        except MissionError:
            continue
        most = max((len(column) for column in columns), default=0)
        rows: Iterator[tuple[float, ...]] = itertools.product(*columns)
        if math.prod(len(column) for column in columns) > _MAX_COMBINATIONS:
            turns = range(min(most, _MAX_COMBINATIONS))
            rows = iter([tuple(column[turn % len(column)] for column in columns) for turn in turns])
        for row in rows:
            yield dict(zip(sweep.parameters, row, strict=True))


def _of_draws(mission: model.Mission, instance: Instance) -> Iterator[TrialFault]:
    """Errors of places beyond the scene that another seed could draw."""
    areas = {region.name: Area(region.polygon) for region in instance.regions if region.polygon}
    scope = Scope(parameters=instance.settings, mode=instance.mode, areas=areas, tick_s=instance.clock.tick_s)
    groups = {entity.group for entity in instance.entities}
    for group in mission.groups:
        for prop in group.properties if group.name in groups else ():
            if prop.name != "position" or not isinstance(prop.value, ex.Draw):
                continue
            try:
                where = places(prop.value, scope, group.name)
            except MissionError:
                continue
            most = FARTHEST_M if engine_kind(group.engine).anywhere else reach_m(instance.scene) or FARTHEST_M
            if any(abs(metres) > most for outline in where.outlines for point in outline for metres in point[:2]):
                message = f"a place that `{group.name}` may be drawn at is beyond the scene"
                hint = f"coordinates are metres from the scene's origin, {most:g} at most to every side here"
                yield TrialFault("LJ0507", f"{mission.name}/{group.name}/position", message, hint)


class _Draws(NamedTuple):
    """The draws of some settings that can fail. Equal ones fail with the same seeds."""

    requirements: tuple[model.Requirement, ...]
    """The requirements that the switches leave open."""
    declarations: tuple[model.Parameter | model.RegionDeclaration | model.Group, ...]
    """The crowded groups, and all declarations on which these groups and the requirements depend."""
    values: tuple[float, ...]
    """The values of the params among the declarations, then the sizes of the groups."""


def _of_further_seeds(
    mission: model.Mission, instance: Instance, settings: Mapping[str, float], tried: list[_Draws]
) -> Iterator[TrialFault]:
    """The error of the first further seed without an instance, if a draw can fail. Draws that were `tried` with other
    settings are left out."""
    members = len(instance.entities) * len(_FURTHER_SEEDS)
    if tried and members * (1 + len(tried)) > _MOST_FURTHER:
        return
    draws = _draws(mission, instance, settings)
    if draws is None or draws in tried:
        return
    tried.append(draws)
    for seed in _FURTHER_SEEDS:
        try:
            instantiate(mission, seed=seed, mode=instance.mode, settings=settings)
        except LingjingError as error:
            path, message = (error.path, error.message) if isinstance(error, NodeError) else (mission.name, str(error))
            named = message if message.startswith("seed ") else f"with seed {seed}, {message}"
            yield TrialFault("LJ0507", path, named, hint_of(error))
            return


def _draws(mission: model.Mission, instance: Instance, settings: Mapping[str, float]) -> _Draws | None:
    """The draws that can fail with these settings; None if there are none."""
    values = parameters(mission, instance.mode, settings)
    areas = {region.name: Area(region.polygon) for region in instance.regions if region.polygon}
    scope = Scope(parameters=values, mode=instance.mode, areas=areas, tick_s=instance.clock.tick_s)
    chosen = with_alternatives(mission, scope)
    requirements = tuple(each for each in chosen.requirements if each.condition != ex.Flag(True))
    counts = Counter(entity.group for entity in instance.entities)
    varying = {each.name for each in chosen.parameters if isinstance(each.default, ex.Draw)}
    crowded = [
        group
        for group in chosen.groups
        if counts[group.name] and (_varies(chosen, group, varying) or _is_crowded(group, scope, counts[group.name]))
    ]
    if not requirements and not crowded:
        return None
    names = depended(
        chosen, (*(each.condition for each in requirements), *(ex.Ref(each.name, "group") for each in crowded))
    )
    params = tuple(each for each in chosen.parameters if each.name in names)
    groups = tuple(each for each in chosen.groups if each.name in names)
    return _Draws(
        requirements,
        (*params, *(each for each in chosen.regions if each.name in names), *groups),
        (*(values[param.name] for param in params), *(float(counts[group.name]) for group in groups)),
    )


def _varies(mission: model.Mission, group: model.Group, varying: AbstractSet[str]) -> bool:
    """True if a group's places have a distance between them, and their number, room or distance depends on a param that
    each seed draws (`varying`): then seed 0 does not show how crowded they can be."""
    draws = [prop.value for prop in group.properties if isinstance(prop.value, ex.Draw)]
    is_apart = any(name == "apart" for draw in draws for name, _ in draw.named)
    return is_apart and bool(varying) and bool(depended(mission, (ex.Ref(group.name, "group"),)) & varying)


def _is_crowded(group: model.Group, scope: Scope, count: int) -> bool:
    """True if the places of a group need so much of their room that a seed may have none for them, or if their room
    depends on more than the declarations."""
    try:
        return any(
            max(crowding(prop.value, scope, count), _tightness(prop.value, scope, count)) >= _CROWDED
            for prop in group.properties
            if isinstance(prop.value, ex.Draw)
        )
    except MissionError:
        return True


def _tightness(expr: ex.Draw, scope: Scope, count: int) -> float:
    """Return the share that `count` places fill of the room less its margin `clear`, like `crowding`.

    For a line that turns back beside itself the room is the diagonal of its bounding box. The share is 0 if the places
    need no distance between them.
    """
    named = {name: number(value, scope) for name, value in expr.named if name in ("apart", "clear")}
    apart, clear = named.get("apart", 0.0), named.get("clear", 0.0)
    if count < 2 or apart <= 0.0:
        return 0.0
    if expr.distribution == "sites_along":
        west, south, east, north = geometry2d.bounds(line_of(expr, scope))
        return count * apart / max(math.dist((west, south), (east, north)) - 2.0 * clear, 1e-9)
    if not (polygon := outline(expr, scope)):
        return 0.0
    edge_m = total(math.dist(a, b) for a, b in itertools.pairwise((*polygon, *polygon[:1])))
    return count * apart**2 / max(abs(geometry2d.signed_area(polygon)) - clear * edge_m, 1e-9)


def _of_scene(mission: model.Mission, instance: Instance) -> Iterator[TrialFault]:
    faults = tuple(scene_faults(instance.scene))
    for fault in faults:
        yield TrialFault("LJ0508", f"{mission.name}/scene/{fault.option}", fault.message, fault.hint)
    kind = instance.scene.kind
    for entity in instance.entities:
        for name, message, hint in elements.faults(entity.properties) if engine_kind(entity.engine).orbits else ():
            yield TrialFault("LJ0507", f"{mission.name}/{entity.group}/{name}", message, hint)
        surface = entity.properties.get("on")
        wanted = str(surface) if surface is not None else engine_kind(entity.engine).stands_on
        if wanted and not faults and lacks(instance.scene, wanted):
            path = f"{mission.name}/{entity.group}{'/on' if surface is not None else ''}"
            message = f"`{entity.group}` is on {spoken(wanted)}, and the scene `{kind}` has none"
            yield TrialFault("LJ0509", path, message, "choose a scene that has one, or another place")
