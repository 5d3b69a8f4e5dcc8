"""The places of a mission as it declares them, and their roles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf

from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Scope, number
from lingjing.mission.geometry2d import Extent, Vector2, bounds
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Group, Mission

LINES = {"bridge": "bridge", "pipeline": "pipe"}
"""Scene option with a line as its value → the surface that the line's targets are `on`."""
GROUNDS = ("inside", "homes")
"""Scene options with a region for walking as their value."""


@dataclass(frozen=True, slots=True)
class Layout:
    """The parts of a mission that siting reads."""

    mission: Mission
    instance: Instance
    """The mission's default instance, for the outlines of regions and the default sizes of groups."""
    line: tuple[str, tuple[Vector2, ...]] | None
    """Option of the scene and its line, metres; None without one."""
    ground: str
    """Name of the region that is walked in; "" without one."""
    has_route: bool
    """True if the mission inspects the route of a vehicle."""

    def group(self, name: str) -> Group:
        """The group of that name."""
        return next(group for group in self.mission.groups if group.name == name)

    def surface(self, group: Group) -> str:
        """The surface that the members of a group are `on`; "" if they declare none."""
        value = next((prop.value for prop in group.properties if prop.name == "on"), None)
        return value.name if isinstance(value, ex.Symbol) else ""

    def on(self, surface: str) -> tuple[Group, ...]:
        """The targets on a surface."""
        return tuple(g for g in self.mission.groups if g.role == "target" and self.surface(g) == surface)

    def assets(self, engine: str) -> tuple[Group, ...]:
        """The assets of an engine."""
        return tuple(g for g in self.mission.groups if g.role == "asset" and g.engine == engine)

    @property
    def ceiling_m(self) -> float:
        """The elevation up to which all flying assets may fly, metres; inf without one."""
        tops = (entity.properties.get("band_high_m") for entity in self.instance.entities if entity.role == "asset")
        return min((float(top) for top in tops if isinstance(top, int | float)), default=inf)

    def starts(self, group: Group) -> tuple[Vector2, ...]:
        """The places that a group declares, metres; none for drawn ones."""
        return tuple(place for expr in position_exprs(group) if not isinstance(expr, ex.Draw) for place in points(expr))

    def region(self, name: str) -> Extent:
        """The box around a region, metres."""
        return bounds(next(region.polygon for region in self.instance.regions if region.name == name))

    def extent(self) -> Extent:
        """The box around all regions, or else around all entities, metres."""
        corners = [corner for region in self.instance.regions for corner in region.polygon]
        return bounds(corners or [entity.position[:2] for entity in self.instance.entities])


def read_layout(mission: Mission) -> Layout:
    """Read a mission. Raises `MissionError` if it cannot be evaluated."""
    options = {option.name: option.value for option in mission.scene.options}
    line = next(((name, points(options[name])) for name in LINES if name in options), None)
    ground = next((value for name in GROUNDS if isinstance(value := options.get(name), ex.Ref)), None)
    return Layout(
        mission=mission,
        instance=instantiate(mission),
        line=line,
        ground="" if ground is None else ground.name,
        has_route=any(inspection.destination is not None for inspection in mission.inspections),
    )


def position_exprs(group: Group) -> Iterator[ex.Expr]:
    """Yield the expressions of a group's position: the declared one and its alternatives."""
    for prop in (*group.properties, *(p for alternative in group.alternatives for p in alternative.properties)):
        if prop.name == "position":
            yield prop.value


def points(expr: ex.Expr) -> tuple[Vector2, ...]:
    """The places written in an expression, in reading order, metres."""
    return tuple(place for part in ex.parts(expr) if isinstance(part, ex.Point) and (place := point(part)) is not None)


def point(expr: ex.Point) -> Vector2 | None:
    """East and north of a written place, metres; None if it depends on parameters."""
    if any(isinstance(part, ex.Ref) for part in ex.parts(expr)):
        return None
    return number(expr.items[0], Scope()), number(expr.items[1], Scope())
