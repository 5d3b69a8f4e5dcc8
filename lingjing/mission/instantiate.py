"""`instantiate`: a mission, a seed, a mode and settings become one `Instance`, the reset specification.

Order of evaluation: settings, mode, clock and budget, the sizes of all groups, regions, scene, the entities' places and
properties, regions around entities, grids, agents, messages, bus, events and constraints, texts. A draw's stream is
named `<mission>/<node>/<property>`, so that the drawn value depends on the seed and that name alone. Rules, unlocks,
stages and the success condition stay expressions.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from collections.abc import Set as AbstractSet
from typing import NamedTuple

import msgspec

from lingjing.errors import ErrorCollector, Fault, MissionError, UsageError
from lingjing.mission import expression as ex
from lingjing.mission import grid as grids
from lingjing.mission import instance_agents, instance_rules, model
from lingjing.mission.alternatives import with_alternatives
from lingjing.mission.clock import clock_fault
from lingjing.mission.conditions.declared_values import deadlines_s
from lingjing.mission.conditions.spread import numbers
from lingjing.mission.draws import draw
from lingjing.mission.evaluate import (
    Area,
    Interval,
    Place,
    Scope,
    Value,
    area,
    describe,
    evaluate,
    flag_of,
    number,
    whole,
)
from lingjing.mission.expression_text import spell
from lingjing.mission.instance import Budget, Cell, Clock, Entity, Instance, Option, Region, SceneSpec, Weather
from lingjing.mission.instance_entities import DrawnGroup, at_path, datum, entities, holds, member_ids, single
from lingjing.mission.interactions import unrestricted_unlocks
from lingjing.mission.kinds import SEA_M, scene_kind
from lingjing.mission.languages import ORIGINAL, in_language
from lingjing.mission.requirements import requirements_of
from lingjing.mission.seeding import integer, redrawn_path
from lingjing.mission.tiers import RESERVED_SWITCHES, reserved_switch_error, with_tier
from lingjing.mission.values import as_number, is_finite
from lingjing.mission.wording import PromptFiller
from lingjing.suggest import nearest, nearest_or

_FLAGS = ("effects",)
"""The fields of a weather that are true or false."""
REDRAWS = 100
"""The largest number of times that draws are repeated for requirements (chosen)."""
_MAX_CELLS = 10_000
"""The largest number of cells of a grid (chosen)."""


def instantiate(
    mission: model.Mission,
    *,
    seed: int = 0,
    mode: str | None = None,
    settings: Mapping[str, float] | None = None,
    tier: int = 0,
    language: str = ORIGINAL,
    is_chosen: bool = False,
) -> Instance:
    """Apply seed, mode, tier, language and settings (SI values by parameter name, over those of the tier) to a mission.

    Equal arguments give equal instances in every process. If the draws do not meet a requirement, those on which it
    depends are drawn anew, at most `REDRAWS` times. `is_chosen`: the alternatives are in place and the switches folded
    for this mode and these settings (`with_alternatives`). Raises `UsageError` with all errors of mode and settings
    (faults at `mode`, `tier`, `language` and `settings.NAME`), `MissionError` if the mission cannot be evaluated or a
    requirement is not met.
    """
    mission = in_language(mission, language)
    redraws: dict[str, int] = {}
    hidden_redraws: dict[str, int] = {}
    settings = with_tier(mission, tier, choose_mode(mission, mode), settings or {}) if tier else settings
    requirements = requirements_of(mission)
    drawn = _drawn(mission, seed, mode, settings or {}, redraws, hidden_redraws, is_chosen=is_chosen)
    for repetition in itertools.count():
        scope = drawn.whole_scope
        with at_path(f"{mission.name}/require"):
            requirement = requirements.unmet(drawn.members, scope)
            if requirement is None:
                break
            repeated = requirements.repeated_draws(requirement)
            names = repeated.names - set(settings or ())
            if not names or repetition == REDRAWS:
                with at_path(f"{mission.name}/require/{1 + mission.requirements.index(requirement)}"):
                    raise _unmet_error(requirement, seed, sorted(names), hidden_only=repeated.hidden_only)
            counts = hidden_redraws if repeated.hidden_only else redraws
            counts |= {name: counts.get(name, 0) + 1 for name in names}
        if names.isdisjoint(parameter.name for parameter in mission.parameters):
            drawn = _drawn_again(drawn, seed, names, redraws, hidden_redraws)
        else:
            drawn = _drawn(mission, seed, mode, settings or {}, redraws, hidden_redraws, is_chosen=is_chosen)
    return _instance(drawn, scope, seed, tier, language)


def _unmet_error(requirement: model.Requirement, seed: int, names: list[str], *, hidden_only: bool) -> MissionError:
    condition = f"`{spell(requirement.condition)}` does not hold, because {requirement.reason}"
    if not names:
        return MissionError(f"{condition}: it depends on nothing that is drawn", hint="change the declared values")
    drawn = " and ".join(f"`{name}`" for name in names)
    message = f"seed {seed} meets the requirement in none of {REDRAWS + 1} draws of {drawn}: {condition}"
    others = "; public values are not drawn anew, because they would tell something about hidden ones"
    return MissionError(message, hint=f"widen what is drawn, or loosen the requirement{others if hidden_only else ''}")


class _Drawn(NamedTuple):
    """The part of an instance that requirements read."""

    mission: model.Mission
    """The mission with its alternatives in place."""
    scope: Scope
    """Params, mode, tick, the ids of all groups, and the regions that depend on no drawn place."""
    scene: SceneSpec
    clock: Clock
    groups: dict[str, DrawnGroup]
    """The existing groups, in the order of their declarations."""

    @property
    def members(self) -> tuple[Entity, ...]:
        """All entities of the existing groups."""
        return tuple(entity for group in self.groups.values() for entity in group.members)

    @property
    def whole_scope(self) -> Scope:
        """The scope with the regions around entities. Raises `MissionError` if one has no outline."""
        return msgspec.structs.replace(self.scope, areas=_areas(self.mission, self.scope, self.members))


def _drawn(
    mission: model.Mission,
    seed: int,
    mode: str | None,
    settings: Mapping[str, float],
    redraws: Mapping[str, int],
    hidden_redraws: Mapping[str, int],
    *,
    is_chosen: bool,
) -> _Drawn:
    """The draws, with those of some names repeated: name → the number of discarded draws, and of those that are
    discarded for the hidden values alone."""
    repeated = {name: redraws.get(name, 0) + hidden_redraws.get(name, 0) for name in {*redraws, *hidden_redraws}}
    chosen, values = choose_settings(mission, mode, settings, seed, repeated)
    scope = Scope(parameters=values, mode=chosen)
    if not is_chosen:
        mission = with_alternatives(mission, scope)
    clock = _clock(mission, scope)
    scope = msgspec.structs.replace(scope, tick_s=clock.tick_s)
    areas = _areas(mission, scope)
    scene = scene_spec(mission, msgspec.structs.replace(scope, areas=areas), seed)
    scope = msgspec.structs.replace(scope, members=_members(mission, scope))
    instance_rules.check_members(mission, scope)
    scope = msgspec.structs.replace(scope, areas=areas)
    groups = _groups(mission, scope, seed, scene.datum_m, redraws, hidden_redraws)
    return _Drawn(mission, scope, scene, clock, groups)


def _drawn_again(
    drawn: _Drawn,
    seed: int,
    names: AbstractSet[str],
    redraws: Mapping[str, int],
    hidden_redraws: Mapping[str, int],
) -> _Drawn:
    """The draws with those of some groups repeated. No group depends on the places of others."""
    mission = msgspec.structs.replace(
        drawn.mission, groups=tuple(group for group in drawn.mission.groups if group.name in names)
    )
    groups = _groups(mission, drawn.scope, seed, drawn.scene.datum_m, redraws, hidden_redraws)
    return drawn._replace(groups=drawn.groups | groups)


def _instance(drawn: _Drawn, scope: Scope, seed: int, tier: int, language: str) -> Instance:
    mission, members = drawn.mission, drawn.members
    agents = instance_agents.agents(mission, scope)
    fill = PromptFiller(mission, scope, members, language)
    instance = Instance(
        mission=mission.name,
        title=mission.title,
        goal=fill(mission.goal),
        language=language,
        seed=seed,
        tier=tier,
        settings=_shown_settings(mission, scope.parameters),
        scene=drawn.scene,
        clock=drawn.clock,
        budget=_budget(mission, scope),
        weather=_weather(mission, scope, seed),
        regions=tuple(_region(region, scope) for region in mission.regions),
        cells=_cells(mission, scope),
        entities=members,
        agents=tuple(fill.agent(spec) for spec in agents),
        messages=instance_agents.messages(mission, scope, agents),
        comms=instance_agents.comms(mission, scope, agents),
        rules=mission.rules,
        unlocks=mission.unlocks + unrestricted_unlocks(members, mission.unlocks),
        stages=instance_rules.stages(mission, scope),
        relations=tuple(relation for relation in mission.relations if holds(relation.when, scope)),
        success=mission.success,
        failure=mission.failure,
        limits=instance_rules.limits(mission, scope),
        permits=instance_rules.permits(mission, scope),
        constraints=instance_rules.constraints(mission, scope),
        inspections=instance_rules.inspections(mission, scope),
        events=instance_rules.events(
            mission, scope, seed, lambda properties: _weather(mission, scope, seed, properties)
        ),
        reveals=instance_rules.reveals(mission, scope),
        redrawn=tuple(name for group in drawn.groups.values() for name in group.anew),
        hidden_settings=tuple(param.name for param in mission.parameters if param.hidden),
    )
    with at_path(f"{mission.name}/stages"):
        deadlines_s(instance)  # raises an error for one without a value
    return instance


def _shown_settings(mission: model.Mission, values: Mapping[str, float]) -> dict[str, float]:
    """The settings that the instance holds: all but switches that are off by default and off here, so that a mission
    with new switches gives the instances of before."""
    absent = {param.name for param in mission.parameters if param.default == ex.Flag(False)}
    return {name: value for name, value in values.items() if value or name not in absent}


def choose_settings(
    mission: model.Mission,
    mode: str | None,
    settings: Mapping[str, float],
    seed: int = 0,
    redraws: Mapping[str, int] = {},
) -> tuple[str, dict[str, float]]:
    """The mode and every parameter's value. Raises `UsageError` and `MissionError` like `instantiate`."""
    errors = ErrorCollector()
    chosen = errors.attempt(lambda: choose_mode(mission, mode), mission.modes.default)
    values = errors.attempt(lambda: parameters(mission, chosen, settings, seed, redraws), {})
    errors.check()
    return chosen, values


def choose_mode(mission: model.Mission, mode: str | None) -> str:
    """The mode to play in. Raises `UsageError` if the mission does not have it."""
    chosen = mission.modes.default if mode is None else mode
    if chosen not in mission.modes.allowed:
        allowed = mission.modes.allowed
        hint = nearest_or(chosen, allowed, f"choose one of {', '.join(allowed)}")
        raise _usage("mode", f"mission '{mission.name}' has no mode '{chosen}'", hint)
    return chosen


def parameters(
    mission: model.Mission,
    mode: str,
    settings: Mapping[str, float],
    seed: int = 0,
    redraws: Mapping[str, int] = {},
) -> dict[str, float]:
    """Every parameter's value: the setting if there is one, else the drawn or declared value, within its bounds.

    Raises `UsageError` with all errors of the settings, `MissionError` for a default that cannot be evaluated.
    """
    errors = ErrorCollector()
    names = tuple(parameter.name for parameter in mission.parameters)
    for name in settings:
        if name in RESERVED_SWITCHES and name not in names:
            errors.add(reserved_switch_error(name))
        elif name not in names:
            message = f"mission '{mission.name}' has no parameter '{name}'"
            errors.add(_usage(f"settings.{name}", message, _suggestion(name, names)))
    values: dict[str, float] = {}
    for parameter in mission.parameters:
        scope = Scope(parameters=dict(values), mode=mode)
        try:
            values[parameter.name] = _parameter(
                mission, parameter, settings.get(parameter.name), scope, seed, redraws.get(parameter.name, 0)
            )
        except UsageError as error:
            errors.add(error)
        except MissionError:
            if not errors.errors:  # otherwise a rejected setting may be its only cause
                raise
    errors.check()
    return values


def scene_spec(mission: model.Mission, scope: Scope, seed: int) -> SceneSpec:
    """The scene with its options evaluated: `datum_m` and `origin` (degrees) as fields, the rest for the provider."""
    path = f"{mission.name}/scene"
    options = {o.name: single(o, scope, seed=seed, path=f"{path}/{o.name}") for o in mission.scene.options}
    with at_path(path):
        level = _number(options.pop("datum_m", _usual_datum(mission.scene.kind, options)), "datum_m")
        spec = SceneSpec(kind=mission.scene.kind, datum_m=level, seed=integer(seed, path))
        origin = _origin(options.pop("origin")) if "origin" in options else spec.origin
        layout = integer(round(_number(options.pop("layout", 0.0), "layout")), f"{path}/layout")
        return SceneSpec(
            kind=spec.kind,
            datum_m=level,
            origin=origin,
            options={name: _option(value, level) for name, value in options.items()},
            seed=spec.seed,
            layout=layout,
        )


def _usual_datum(kind: str, options: Mapping[str, Value]) -> float:
    """The default elevation of the water, metres: below the ground, which is at 0, in a scene with a shore, else 0."""
    known = scene_kind(kind)
    shored = known is not None and (known.shore == "own" or (known.shore == "given" and "shore" in options))
    return SEA_M if shored else 0.0


def _option(value: Value, level: float) -> Option:
    """A scene's option as plain data."""
    if isinstance(value, Area):
        return value.polygon
    if isinstance(value, tuple) and value and all(isinstance(item, Place) for item in value):
        return tuple((item.east, item.north) for item in value if isinstance(item, Place))
    return datum(value, level)


def _parameter(
    mission: model.Mission, parameter: model.Parameter, setting: float | None, scope: Scope, seed: int, redraw: int
) -> float:
    with at_path(f"{mission.name}/{parameter.name}"):
        if setting is None and isinstance(parameter.default, ex.Draw):
            path = redrawn_path(f"{mission.name}/param/{parameter.name}", redraw)
            return as_number(draw(parameter.default, scope, seed=seed, path=path, count=1).values[0])
        if setting is None:
            if isinstance(parameter.default, ex.Flag):
                return float(parameter.default.value)
            value = number(parameter.default, scope)
            fault = _bound_fault(parameter, value, scope)
            if fault:
                raise MissionError(f"the default {value:g} {fault}")
            return value
        if not is_finite(setting):
            raise _setting_error(parameter, f"= {setting!r} is not a number", f"give '{parameter.name}' a number")
        fault = _bound_fault(parameter, float(setting), scope)
        if fault:
            raise _setting_error(parameter, f"= {setting:g} {fault}", parameter.doc)
    return float(setting)


def _setting_error(parameter: model.Parameter, message: str, hint: str) -> UsageError:
    return _usage(f"settings.{parameter.name}", f"{parameter.name} {message}", hint)


def _usage(where: str, message: str, hint: str) -> UsageError:
    return UsageError(message, hint=hint, faults=(Fault(where, message, hint),))


def _bound_fault(parameter: model.Parameter, value: float, scope: Scope) -> str:
    """`is outside of its range 1..10`, or "" if the value is allowed."""
    if isinstance(parameter.default, ex.Draw):
        low, high = numbers(parameter.default, scope)
        whole_only = parameter.default.distribution == "integer" and value != int(value)
        if low <= value <= high and not whole_only:
            return ""
        return f"cannot be drawn: its values lie in {low:g}..{high:g}{', in whole numbers' if whole_only else ''}"
    if parameter.is_switch:
        return "" if value in (0.0, 1.0) else "is neither true (1) nor false (0)"
    if parameter.bounds is None:
        return ""
    unit = _unit(parameter.default)
    bounds = evaluate(parameter.bounds, scope)
    match bounds:
        case Interval(low=low, high=high):
            if not low <= value <= high:
                return f"is outside of its range {low:g}{unit}..{high:g}{unit}"
        case tuple():
            if value not in bounds:
                allowed = ", ".join(f"{item:g}{unit}" for item in bounds if isinstance(item, float))
                return f"is none of the allowed {allowed}"
        case _:
            raise MissionError(f"bounds are a range or a list, not {describe(bounds)}")
    return ""


def _unit(expr: ex.Expr) -> str:
    return f" {expr.unit}" if isinstance(expr, ex.Number) and expr.unit else ""


def _suggestion(name: str, names: Iterable[str]) -> str:
    known = tuple(names)
    close = nearest(name, known)
    listed = f"it has {', '.join(known)}" if known else "it has none"
    return f"did you mean '{close}'? {listed}" if close else listed


def _clock(mission: model.Mission, scope: Scope) -> Clock:
    with at_path(f"{mission.name}/clock"):
        tick, sync = number(mission.clock.tick, scope), number(mission.clock.sync, scope)
        fault = clock_fault(tick, sync)
        if fault:
            raise MissionError(fault, hint="choose sync so that it divides tick")
        return Clock(tick_s=tick, sync_s=sync)


def _budget(mission: model.Mission, scope: Scope) -> Budget:
    with at_path(f"{mission.name}/budget"):
        limits = mission.budget
        budget = Budget(
            ticks=whole(limits.ticks, scope),
            policy_s=number(limits.policy, scope),
            engine_s=number(limits.engine, scope),
            capture_s=number(limits.capture, scope),
            tokens=None if limits.tokens is None else whole(limits.tokens, scope),
            money_usd=None if limits.money is None else number(limits.money, scope),
            messages=None if limits.messages is None else whole(limits.messages, scope),
        )
        if budget.ticks < 1 or min(budget.policy_s, budget.engine_s, budget.capture_s) <= 0:
            raise MissionError("every limit must be above 0", hint="budget { ticks <= 60, policy <= 90 s, … }")
        return budget


def _weather(
    mission: model.Mission, scope: Scope, seed: int, properties: tuple[model.Property, ...] | None = None
) -> Weather:
    path = f"{mission.name}/weather"
    values: dict[str, float | bool] = {}
    for prop in mission.weather if properties is None else properties:
        if prop.name not in Weather.__struct_fields__:
            with at_path(path):
                raise MissionError(f"there is no '{prop.name}'", hint=_suggestion(prop.name, Weather.__struct_fields__))
        value = single(prop, scope, seed=seed, path=f"{path}/{prop.name}")
        with at_path(path):
            values[prop.name] = _flag(value, prop.name) if prop.name in _FLAGS else _number(value, prop.name)
    return Weather(**values)  # type: ignore[arg-type]


def _areas(mission: model.Mission, scope: Scope, placed: tuple[Entity, ...] = ()) -> dict[str, Area]:
    """The regions in order. Regions around entities are left out until the entities are `placed`, and regions made of
    roads always, because only the built city can evaluate them. Regions of the scope are kept."""
    areas: dict[str, Area] = {}
    later: set[str] = set()
    spots = {entity.id: Place(*entity.position) for entity in placed}
    for region in mission.regions:
        if region.name in scope.areas:
            areas[region.name] = scope.areas[region.name]
            continue
        leaves = ex.leaves(region.shape)
        waits = any(isinstance(leaf, ex.Ref) and leaf.kind in ("group", "entity") for leaf in leaves) and not placed
        if waits or _is_on_map(region.shape) or any(isinstance(x, ex.Ref) and x.name in later for x in leaves):
            later.add(region.name)
            continue
        with at_path(f"{mission.name}/{region.name}"):
            areas[region.name] = area(region.shape, msgspec.structs.replace(scope, areas=areas, places=spots))
    return areas


def _region(region: model.RegionDeclaration, scope: Scope) -> Region:
    known = scope.areas.get(region.name)
    if known is not None:
        return Region(name=region.name, polygon=known.polygon, hidden=region.hidden)
    return Region(name=region.name, polygon=(), on_map=region.shape, hidden=region.hidden)


def _is_on_map(shape: ex.Expr) -> bool:
    """True if a region is made of the map's roads."""
    return any(isinstance(part, ex.Call) and part.function in ("road", "along") for part in ex.parts(shape))


def _cells(mission: model.Mission, scope: Scope) -> tuple[Cell, ...]:
    cells: list[Cell] = []
    hidden_regions = {region.name for region in mission.regions if region.hidden}
    for grid in mission.grids:
        with at_path(f"{mission.name}/{grid.name}"):
            region = area(ex.Ref(grid.region, "region"), scope)
            rows, columns, overlap = whole(grid.rows, scope), whole(grid.columns, scope), number(grid.overlap, scope)
            if rows < 1 or columns < 1 or rows * columns > _MAX_CELLS:
                raise MissionError(f"{rows} by {columns} cells", hint=f"1 by 1 up to {_MAX_CELLS} cells are possible")
            if not 0 <= overlap <= 1:
                raise MissionError(f"an overlap of {overlap:.0%}", hint="choose 0 % to 100 %")
            hidden = grid.region in hidden_regions
            seen = grid.seen is not None and flag_of(grid.seen, scope)
            cells.extend(grids.cells(grid.name, region.polygon, rows, columns, overlap, hidden=hidden, seen=seen))
    return tuple(cells)


def _members(mission: model.Mission, scope: Scope) -> dict[str, tuple[str, ...]]:
    ids: dict[str, tuple[str, ...]] = {}
    for group in mission.groups:
        with at_path(f"{mission.name}/{group.name}"):
            if holds(group.when, scope):
                ids[group.name] = member_ids(group.name, group.count, scope)
    return ids


def _groups(
    mission: model.Mission,
    scope: Scope,
    seed: int,
    datum_m: float,
    redraws: Mapping[str, int],
    hidden_redraws: Mapping[str, int],
) -> dict[str, DrawnGroup]:
    """The existing groups with their members."""
    dormant = instance_rules.dormant(mission, scope) if mission.events else frozenset()
    groups = {}
    for group in mission.groups:
        if group.name not in scope.members:
            continue
        drawn = entities(
            group,
            scope,
            mission=mission.name,
            seed=seed,
            datum_m=datum_m,
            template_draw=mission.origin.draws.get(group.name),
            redraw=redraws.get(group.name, 0),
            hidden_redraw=hidden_redraws.get(group.name, 0),
        )
        members = (msgspec.structs.replace(e, dormant=True) if e.id in dormant else e for e in drawn.members)
        groups[group.name] = drawn._replace(members=tuple(members))
    return groups


def _number(value: Value, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, float):
        raise MissionError(f"'{name}' is a number, not {describe(value)}")
    return value


def _flag(value: Value, name: str) -> bool:
    if not isinstance(value, bool):
        raise MissionError(f"'{name}' is true or false, not {describe(value)}")
    return value


def _origin(value: Value) -> tuple[float, float]:
    match value:
        case Place(east=latitude, north=longitude, elevation=None):
            pass
        case (float() as latitude, float() as longitude):
            pass
        case _:
            raise MissionError(f"'origin' is (latitude, longitude), not {describe(value)}")
    if not (-85 <= latitude <= 85 and -180 <= longitude <= 180):
        raise MissionError(
            f"'origin' = ({latitude:g}, {longitude:g}) lies outside of the map",
            hint="give latitude (-85..85) and longitude (-180..180) in degrees",
        )
    return latitude, longitude
