"""The scene comes to the document: the template's scene is moved and widened where it does not reach what is placed.

A document whose places all lie in its template's scene keeps that scene. Else the template is carried to the document
as a whole (`carried`): its own places, regions and lines keep their positions relative to each other. A scene with a
structure (a shore, a bridge, a compound, a pipeline) is put so that the structure lies at what the document places as
the template has it: its targets, else its assets. Any other scene gets the document's middle as its centre. Then the
built-up square is widened, in whole blocks, until it holds everything.
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

MARGIN_M = 60.0
"""The built-up square reaches this far beyond what is placed, so that a street and a roof are near it."""

BLOCKS_MOST = 24
"""A square has at most so many blocks to a side: beyond, they are larger."""

SITE_M, BRIDGE_M = 40.0, 200.0
"""A city reaches so far beyond its site and its bridge (`lingjing.scene.districts.district.frame`)."""

_STRUCTURES = ("inside", "homes", "pipeline", "shore", "bridge")
_BY_ITSELF = ("bay", "coastal")
"""Kinds of scenes that have a shore without naming one."""


class GroundBox(NamedTuple):
    """West, south, east and north, metres."""

    west: float
    south: float
    east: float
    north: float

    @property
    def middle(self) -> Vector2:
        """The middle of the box."""
        return (self.west + self.east) / 2.0, (self.south + self.north) / 2.0

    def holds(self, other: GroundBox) -> bool:
        """True if another box lies within this one."""
        return (
            self.west <= other.west
            and self.south <= other.south
            and other.east <= self.east
            and other.north <= self.north
        )


class _Square(NamedTuple):
    """The built-up square of a scene: its middle, its side, and how far its streets lie apart, metres."""

    centre: Vector2
    extent_m: float
    spacing: Vector2


def fitted_template(template: model.Mission, mission: model.Mission, parsed: Parsed) -> model.Mission | None:
    """The template with a scene that reaches all that the document places; None where its own does, or where no scene
    would. `mission` is the template with the document's places in it. What is changed is noted."""
    kind = builtin_scenes().get(template.scene.kind)
    if kind is None or "centre" not in kind.options or any(o.name == "centre" for o in template.scene.options):
        return None
    try:
        placed, plain = instantiate(mission, seed=0), instantiate(template, seed=0)
    except LingjingError:  # what is wrong with the mission is told by whoever plays it
        return None
    bodies = [one for one in placed.entities if one.id in parsed.placed and not engine_kind(one.engine).anywhere]
    if not bodies:
        return None
    box, reach = _around([*(one.position[:2] for one in bodies), *_outlines(placed, plain)]), _reach(plain.scene)
    if reach is None or reach.holds(box):
        return None
    by = _way(bodies, plain, box)
    if "extent" not in kind.options:
        if not GroundBox(*(edge + by[k % 2] for k, edge in enumerate(reach))).holds(box):
            return None
        parsed.notes.append(f"{_said(parsed, box, template)} is put around ({by[0]:g} m, {by[1]:g} m)")
        return _with_options(carried(template, by), (_centre(by),))
    square = _square(plain.scene, box, by, structured=_is_structured(plain.scene))
    most = kind.options["extent"].high
    farthest = max(map(abs, square.centre)) + square.extent_m / 2.0
    if (most is not None and square.extent_m > most) or farthest > LINE_MOST_M:
        widest = f"at most {most:g} m wide and within {LINE_MOST_M:g} m of X = Y = 0"
        parsed.notes.append(f"{_said(parsed, box, template)} cannot reach them: it is {widest}")
        return None
    longer = _lengthened(template, square.extent_m / (extent_m(plain.scene) or square.extent_m))
    parsed.notes.append(
        f"{_said(parsed, box, template)} is {square.extent_m:g} m wide and put around "
        f"({square.centre[0]:g} m, {square.centre[1]:g} m){_longer_in_words(template, longer)}"
    )
    return _widened(carried(longer, by), plain.scene, square)


def carried(template: model.Mission, by: Vector2) -> model.Mission:
    """The mission with every place that it names itself `by` metres farther east and north."""
    changed: model.Mission = _carried(template, by)
    return changed


# -- where to ---------------------------------------------------------------------------------------------------------


def _way(bodies: Sequence[Entity], plain: Instance, box: GroundBox) -> Vector2:
    """How far the template is carried, whole metres."""
    if not _is_structured(plain.scene):
        return float(round(box.middle[0])), float(round(box.middle[1]))
    targets = [one for one in bodies if one.role == "target"]
    chosen = targets or bodies
    groups = {one.group for one in chosen}
    own = [one.position[:2] for one in plain.entities if one.group in groups]
    here = _around(one.position[:2] for one in chosen).middle
    there = _around(own).middle if own else (0.0, 0.0)
    return float(round(here[0] - there[0])), float(round(here[1] - there[1]))


def _square(scene: SceneSpec, box: GroundBox, by: Vector2, *, structured: bool) -> _Square:
    """The built-up square that holds a box, and the template's own square where it has a structure."""
    extent, spacing = extent_m(scene) or 0.0, _spacing(scene)
    held = GroundBox(box.west - MARGIN_M, box.south - MARGIN_M, box.east + MARGIN_M, box.north + MARGIN_M)
    if structured:
        half = extent / 2.0
        own = (by[0] - half, by[1] - half), (by[0] + half, by[1] + half)
        held = _around([*_corners(held), *own])
    centre = _aligned(held.middle[0], by[0], spacing[0]), _aligned(held.middle[1], by[1], spacing[1])
    wanted = max(extent, 2.0 * max(abs(edge - centre[k % 2]) for k, edge in enumerate(held)))
    if wanted == extent:
        return _Square(centre, extent, spacing)
    coarser = max(1, math.ceil(wanted / (BLOCKS_MOST * max(spacing))))
    spacing = spacing[0] * coarser, spacing[1] * coarser
    step = 2.0 * max(spacing)
    return _Square(centre, step * math.ceil(wanted / step - 1e-9), spacing)


def _aligned(middle: float, origin: float, spacing: float) -> float:
    """The crossing of main streets nearest to a middle: those are every second one from the origin on."""
    return origin + 2.0 * spacing * round((middle - origin) / (2.0 * spacing))


def _spacing(scene: SceneSpec) -> Vector2:
    """How far the streets of a scene lie apart, east and north."""
    extent = extent_m(scene) or 0.0
    usual = max(2.0, round(extent / 200.0))
    columns, rows = (scene.options.get(name, usual) for name in ("blocks_columns", "blocks_rows"))
    return extent / float(columns or usual), extent / float(rows or usual)  # type: ignore[arg-type]


def _reach(scene: SceneSpec) -> GroundBox | None:
    """How far a scene's city reaches, by its text; None where only the city tells."""
    kind, extent = builtin_scenes()[scene.kind], extent_m(scene)
    if extent is None:
        return None
    half = extent / 2.0 + kind.outskirts_m
    boxes = [GroundBox(-half, -half, half, half)]
    for name, beyond in (("inside", SITE_M), ("pipeline", SITE_M + 15.0), ("bridge", BRIDGE_M)):
        line = scene.options.get(name)
        points = [point for point in line if isinstance(point, tuple)] if isinstance(line, tuple) else []
        if points and not (name == "pipeline" and scene.options.get("inside")):
            west, south, east, north = _around(points)
            boxes.append(GroundBox(west - beyond, south - beyond, east + beyond, north + beyond))
    return _around(corner for box in boxes for corner in _corners(box))


def _is_structured(scene: SceneSpec) -> bool:
    return scene.kind in _BY_ITSELF or any(scene.options.get(name) for name in _STRUCTURES)


def _outlines(placed: Instance, plain: Instance) -> list[Vector2]:
    """The corners of the regions that the document gives."""
    own = {region.name: region.polygon for region in plain.regions}
    return [corner for region in placed.regions if own.get(region.name) != region.polygon for corner in region.polygon]


def _around(points: Iterable[Sequence[float]]) -> GroundBox:
    eastings, northings = zip(*((point[0], point[1]) for point in points), strict=True)
    return GroundBox(min(eastings), min(northings), max(eastings), max(northings))


def _corners(box: GroundBox) -> tuple[Vector2, Vector2]:
    return (box.west, box.south), (box.east, box.north)


def _said(parsed: Parsed, box: GroundBox, template: model.Mission) -> str:
    reach = f"({box.west:.0f} m, {box.south:.0f} m) to ({box.east:.0f} m, {box.north:.0f} m)"
    return (
        f"{parsed.path}: places reach from {reach}, beyond the scene of template '{template.name}': "
        f"its scene `{template.scene.kind}`"
    )


# -- the template there ------------------------------------------------------------------------------------------------


def _carried(value: Any, by: Vector2) -> Any:
    """Any part of the graph with its points moved."""
    if isinstance(value, ex.Point):
        return value if _is_degrees(value) else ex.Point(_moved_items(value.items, by))
    if isinstance(value, tuple):
        return tuple(_carried(item, by) for item in value)
    if isinstance(value, msgspec.Struct):
        parts = {name: getattr(value, name) for name in value.__struct_fields__}
        changed = {name: new for name, old in parts.items() if (new := _carried(old, by)) is not old and new != old}
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


def _widened(template: model.Mission, scene: SceneSpec, square: _Square) -> model.Mission:
    """The template with another built-up square; where its streets are all there is, its boxes grow as its square."""
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
    regions = tuple(msgspec.structs.replace(region, shape=_grown(region.shape, grown)) for region in widened.regions)
    return msgspec.structs.replace(widened, regions=regions)


def _lengthened(template: model.Mission, factor: float) -> model.Mission:
    """The template with as many times the ticks, in whole and in each stage, as its square is wider: ways are longer.
    Missions that are for documents of any width have a budget of their own."""
    if template.name in (GOALS, *dict(FREE)):
        return template
    stages = tuple(msgspec.structs.replace(one, ticks=_multiplied(one.ticks, factor)) for one in template.stages)
    budget = msgspec.structs.replace(template.budget, ticks=_multiplied(template.budget.ticks, factor))
    return msgspec.structs.replace(template, stages=stages, budget=budget)


E = TypeVar("E", bound=ex.Expr | None)


def _multiplied(ticks: E, factor: float) -> E | ex.Number:
    return ex.Number(float(math.ceil(ticks.value * factor - 1e-9))) if isinstance(ticks, ex.Number) else ticks


def _longer_in_words(template: model.Mission, longer: model.Mission) -> str:
    before, after = template.budget.ticks, longer.budget.ticks
    if before == after or not isinstance(before, ex.Number) or not isinstance(after, ex.Number):
        return ""
    return f"; for its longer ways the budget of {before.value:g} ticks is {after.value:g}"


def _grown(shape: ex.Expr, by_m: float) -> ex.Expr:
    """A box that reaches farther to every side; any other shape as it is."""
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
