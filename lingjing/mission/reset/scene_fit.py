"""Fit of the scene to the document: the template's scene is moved and widened if it does not reach all places.

A document with all places in its template's scene keeps that scene. Otherwise `_translate_mission` moves the template
as a whole, so that its own places, regions and lines keep their relative positions. A scene with a structure (a shore,
a bridge, a compound, a pipeline) is moved so that the structure has the same position relative to the document's
targets, or else its assets. Any other scene is centred on the document's places. Then the built-up square is widened in
whole blocks until it holds all places.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeVar

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Entity, Instance, SceneSpec
from lingjing.mission.instantiate import instantiate
from lingjing.mission.kinds import LINE_MOST_M, builtin_scenes, engine_kind, extent_m
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.row_goals import GOALS
from lingjing.mission.reset.template import FREE

_MARGIN_M = 60.0
"""Distance between the placed entities and the edge of the built-up square, metres (chosen): a street and a roof are
near."""

_MAX_BLOCKS = 24
"""The largest number of blocks on a side of the square (chosen); in a larger square the blocks are larger."""

_SITE_M = 40.0
"""Distance by which a city reaches beyond its site, metres (`lingjing.scene.districts.district.frame`)."""
_BRIDGE_M = 200.0
"""Distance by which a city reaches beyond its bridge, metres (the same source)."""

_STRUCTURES = ("inside", "homes", "pipeline", "shore", "bridge")
"""Scene options that define a structure."""
_BY_ITSELF = ("bay", "coastal")
"""Kinds of scenes that have a shore without an option."""


class _GroundBox(NamedTuple):
    """West, south, east and north, metres."""

    west: float
    south: float
    east: float
    north: float

    @property
    def middle(self) -> Vector2:
        """The middle of the box."""
        return (self.west + self.east) / 2.0, (self.south + self.north) / 2.0

    def holds(self, other: _GroundBox) -> bool:
        """True if another box lies within this one."""
        return (
            self.west <= other.west
            and self.south <= other.south
            and other.east <= self.east
            and other.north <= self.north
        )


class _Square(NamedTuple):
    """The built-up square of a scene, metres."""

    centre: Vector2
    """East and north of its middle."""
    extent_m: float
    """Its side."""
    spacing: Vector2
    """Distance of its streets, east and north."""


def fit_template(template: model.Mission, mission: model.Mission, parsed: Parsed) -> model.Mission | None:
    """The template with a scene that reaches all places of the document; None if its own does, or if no scene would.

    `mission` is the template with the document's places. Changes are noted.
    """
    kind = builtin_scenes().get(template.scene.kind)
    if kind is None or "centre" not in kind.options or any(o.name == "centre" for o in template.scene.options):
        return None
    try:
        placed, plain = instantiate(mission, seed=0), instantiate(template, seed=0)
    except LingjingError:  # the error is reported when the mission is played
        return None
    bodies = [body for body in placed.entities if body.id in parsed.placed and not engine_kind(body.engine).anywhere]
    if not bodies:
        return None
    box, reach = _around([*(body.position[:2] for body in bodies), *_outlines(placed, plain)]), _reach(plain.scene)
    if reach is None or reach.holds(box):
        return None
    by = _translation(bodies, plain, box)
    if "extent" not in kind.options:
        if not _GroundBox(*(edge + by[k % 2] for k, edge in enumerate(reach))).holds(box):
            return None
        parsed.notes.append(f"{_beyond_scene(parsed, box, template)} is moved to ({by[0]:g} m, {by[1]:g} m)")
        return _with_options(_translate_mission(template, by), (_centre(by),))
    square = _square(plain.scene, box, by, structured=_is_structured(plain.scene))
    most = kind.options["extent"].high
    farthest = max(map(abs, square.centre)) + square.extent_m / 2.0
    if (most is not None and square.extent_m > most) or farthest > LINE_MOST_M:
        widest = f"at most {most:g} m wide and within {LINE_MOST_M:g} m of X = Y = 0"
        parsed.notes.append(f"{_beyond_scene(parsed, box, template)} cannot reach them: it is {widest}")
        return None
    longer = _scale_budgets(template, square.extent_m / (extent_m(plain.scene) or square.extent_m))
    parsed.notes.append(
        f"{_beyond_scene(parsed, box, template)} is {square.extent_m:g} m wide and moved to "
        f"({square.centre[0]:g} m, {square.centre[1]:g} m){_budget_note(template, longer)}"
    )
    return _widen_scene(_translate_mission(longer, by), plain.scene, square)


def _translate_mission(template: model.Mission, by: Vector2) -> model.Mission:
    """The mission with all its own places moved by `by` metres east and north."""
    changed: model.Mission = _translate_part(template, by)
    return changed


# -- where to ---------------------------------------------------------------------------------------------------------


def _translation(bodies: Sequence[Entity], plain: Instance, box: _GroundBox) -> Vector2:
    """The translation of the template, whole metres."""
    if not _is_structured(plain.scene):
        return float(round(box.middle[0])), float(round(box.middle[1]))
    targets = [body for body in bodies if body.role == "target"]
    chosen = targets or bodies
    groups = {body.group for body in chosen}
    own = [body.position[:2] for body in plain.entities if body.group in groups]
    here = _around(body.position[:2] for body in chosen).middle
    there = _around(own).middle if own else (0.0, 0.0)
    return float(round(here[0] - there[0])), float(round(here[1] - there[1]))


def _square(scene: SceneSpec, box: _GroundBox, by: Vector2, *, structured: bool) -> _Square:
    """The built-up square that holds a box, and the template's own square if it has a structure."""
    extent, spacing = extent_m(scene) or 0.0, _spacing(scene)
    held = _GroundBox(box.west - _MARGIN_M, box.south - _MARGIN_M, box.east + _MARGIN_M, box.north + _MARGIN_M)
    if structured:
        half = extent / 2.0
        own = (by[0] - half, by[1] - half), (by[0] + half, by[1] + half)
        held = _around([*_corners(held), *own])
    centre = _nearest_crossing(held.middle[0], by[0], spacing[0]), _nearest_crossing(held.middle[1], by[1], spacing[1])
    wanted = max(extent, 2.0 * max(abs(edge - centre[k % 2]) for k, edge in enumerate(held)))
    if wanted == extent:
        return _Square(centre, extent, spacing)
    coarser = max(1, math.ceil(wanted / (_MAX_BLOCKS * max(spacing))))
    spacing = spacing[0] * coarser, spacing[1] * coarser
    step = 2.0 * max(spacing)
    return _Square(centre, step * math.ceil(wanted / step - 1e-9), spacing)


def _nearest_crossing(middle: float, origin: float, spacing: float) -> float:
    """The crossing of main streets nearest to a middle. Main streets are every second one, counted from the origin."""
    return origin + 2.0 * spacing * round((middle - origin) / (2.0 * spacing))


def _spacing(scene: SceneSpec) -> Vector2:
    """The distance of a scene's streets, east and north, metres."""
    extent = extent_m(scene) or 0.0
    usual = max(2.0, round(extent / 200.0))
    columns, rows = (scene.options.get(name, usual) for name in ("blocks_columns", "blocks_rows"))
    return extent / float(columns or usual), extent / float(rows or usual)  # type: ignore[arg-type]


def _reach(scene: SceneSpec) -> _GroundBox | None:
    """The area of a scene's city according to its text; None if only the built city has it."""
    kind, extent = builtin_scenes()[scene.kind], extent_m(scene)
    if extent is None:
        return None
    half = extent / 2.0 + kind.outskirts_m
    boxes = [_GroundBox(-half, -half, half, half)]
    for name, beyond in (("inside", _SITE_M), ("pipeline", _SITE_M + 15.0), ("bridge", _BRIDGE_M)):
        line = scene.options.get(name)
        points = [point for point in line if isinstance(point, tuple)] if isinstance(line, tuple) else []
        if points and not (name == "pipeline" and scene.options.get("inside")):
            west, south, east, north = _around(points)
            boxes.append(_GroundBox(west - beyond, south - beyond, east + beyond, north + beyond))
    return _around(corner for box in boxes for corner in _corners(box))


def _is_structured(scene: SceneSpec) -> bool:
    return scene.kind in _BY_ITSELF or any(scene.options.get(name) for name in _STRUCTURES)


def _outlines(placed: Instance, plain: Instance) -> list[Vector2]:
    """The corners of the regions that the document defines."""
    own = {region.name: region.polygon for region in plain.regions}
    return [corner for region in placed.regions if own.get(region.name) != region.polygon for corner in region.polygon]


def _around(points: Iterable[Sequence[float]]) -> _GroundBox:
    eastings, northings = zip(*((point[0], point[1]) for point in points), strict=True)
    return _GroundBox(min(eastings), min(northings), max(eastings), max(northings))


def _corners(box: _GroundBox) -> tuple[Vector2, Vector2]:
    return (box.west, box.south), (box.east, box.north)


def _beyond_scene(parsed: Parsed, box: _GroundBox, template: model.Mission) -> str:
    reach = f"({box.west:.0f} m, {box.south:.0f} m) to ({box.east:.0f} m, {box.north:.0f} m)"
    return (
        f"{parsed.path}: places reach from {reach}, beyond the scene of template '{template.name}': "
        f"its scene `{template.scene.kind}`"
    )


# -- the template there ------------------------------------------------------------------------------------------------


def _translate_part(value: Any, by: Vector2) -> Any:
    """Any part of a mission with its points moved."""
    if isinstance(value, ex.Point):
        return value if _is_degrees(value) else ex.Point(_moved_items(value.items, by))
    if isinstance(value, tuple):
        return tuple(_translate_part(item, by) for item in value)
    if isinstance(value, msgspec.Struct):
        parts = {name: getattr(value, name) for name in value.__struct_fields__}
        changed = {
            name: new for name, old in parts.items() if (new := _translate_part(old, by)) is not old and new != old
        }
        return msgspec.structs.replace(value, **changed) if changed else value
    return value


def _is_degrees(point: ex.Point) -> bool:
    return any(isinstance(item, ex.Number) and item.unit == "deg" for item in point.items)


def _moved_items(items: tuple[ex.Expr, ...], by: Vector2) -> tuple[ex.Expr, ...]:
    moved: list[ex.Expr] = []
    for item, metres in zip(items[:2], by, strict=True):
        if isinstance(item, ex.Number):
            moved.append(msgspec.structs.replace(item, value=item.value + metres))
        else:
            moved.append(ex.Binary("+", item, ex.Number(metres, "m")))
    return (*moved, *items[2:])


def _widen_scene(template: model.Mission, scene: SceneSpec, square: _Square) -> model.Mission:
    """The template with another built-up square. Without a structure, its boxes grow with the square."""
    columns, rows = (round(square.extent_m / gap) for gap in square.spacing)
    options = (
        model.Property(name="extent_m", value=ex.Number(square.extent_m, "m"), unit="m"),
        _centre(square.centre),
        model.Property(name="blocks_rows", value=ex.Number(float(rows))),
        model.Property(name="blocks_columns", value=ex.Number(float(columns))),
    )
    widened = _with_options(template, options)
    if _is_structured(scene):
        return widened
    grown = (square.extent_m - (extent_m(scene) or 0.0)) / 2.0
    regions = tuple(
        msgspec.structs.replace(region, shape=_enlarge_box(region.shape, grown)) for region in widened.regions
    )
    return msgspec.structs.replace(widened, regions=regions)


def _scale_budgets(template: model.Mission, factor: float) -> model.Mission:
    """The template with the ticks of its budget and its stages multiplied by the factor, because ways are longer.
    Missions for documents of any width have a budget of their own."""
    if template.name in (GOALS, *dict(FREE)):
        return template
    stages = tuple(msgspec.structs.replace(stage, ticks=_multiplied(stage.ticks, factor)) for stage in template.stages)
    budget = msgspec.structs.replace(template.budget, ticks=_multiplied(template.budget.ticks, factor))
    return msgspec.structs.replace(template, stages=stages, budget=budget)


E = TypeVar("E", bound=ex.Expr | None)


def _multiplied(ticks: E, factor: float) -> E | ex.Number:
    return ex.Number(float(math.ceil(ticks.value * factor - 1e-9))) if isinstance(ticks, ex.Number) else ticks


def _budget_note(template: model.Mission, longer: model.Mission) -> str:
    before, after = template.budget.ticks, longer.budget.ticks
    if before == after or not isinstance(before, ex.Number) or not isinstance(after, ex.Number):
        return ""
    return f"; for longer ways the budget of {before.value:g} ticks is {after.value:g}"


def _enlarge_box(shape: ex.Expr, by_m: float) -> ex.Expr:
    """A box enlarged on every side; any other shape unchanged."""
    corners = shape.arguments if isinstance(shape, ex.Call) and shape.function == "box" else ()
    values = [
        tuple(item.value for item in corner.items if isinstance(item, ex.Number))
        for corner in corners
        if isinstance(corner, ex.Point)
    ]
    if len(values) != 2 or any(len(value) != 2 for value in values):
        return shape
    (west, south), (east, north) = values
    points = ((west - by_m, south - by_m), (east + by_m, north + by_m))
    return ex.Call("box", tuple(ex.Point((ex.Number(x, "m"), ex.Number(y, "m"))) for x, y in points))


def _centre(place: Vector2) -> model.Property:
    point = ex.Point((ex.Number(place[0], "m"), ex.Number(place[1], "m")))
    return model.Property(name="centre", value=ex.Sequence((point,)))


def _with_options(template: model.Mission, options: Sequence[model.Property]) -> model.Mission:
    names = {option.name for option in options}
    kept = tuple(option for option in template.scene.options if option.name not in names)
    return msgspec.structs.replace(template, scene=msgspec.structs.replace(template.scene, options=(*kept, *options)))
