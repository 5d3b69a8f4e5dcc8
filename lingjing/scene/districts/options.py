"""Options of a district in a mission (`scene residential { extent = 500 m, … }`), checked and with defaults."""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.mission.geometry2d import Polygon, Vector2
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import builtin_scenes, centre_m, check_scene, extent_m
from lingjing.scene.districts.rectangles import Rect, bounds

_SPACING_M = {"city": 250.0}
"""Default spacing of streets, metres; 200 m for kinds that are not listed."""


@dataclass(frozen=True, slots=True)
class DistrictPlan:
    """The plan of a district. Lines and areas are relative to its centre, about which it is laid out."""

    kind: str
    """Kind of the scene."""
    layout: int
    """Seed of everything that stays the same from episode to episode."""
    seed: int
    """Seed of the floating objects, which may change with the episode. 0 where nothing floats: inland, and in a whole
    city, which is built once."""
    origin: tuple[float, float]
    """Latitude and longitude of the frame's origin, degrees."""
    datum_m: float
    """Elevation of the water, metres."""
    extent_m: float
    """Side of the built-up square, metres."""
    spacing: tuple[float, float]
    """Spacing of the streets east and north, metres."""
    height_m: tuple[float, float]
    """Lowest and greatest building height, metres."""
    outskirts_m: float
    """Width of the belt of trees around the square, metres."""
    inside: Polygon = ()
    """Outline of an area without public streets (a compound, a factory); empty without one."""
    homes: Polygon = ()
    """Outline of an area with blocks of dwellings of different colours, in any kind of district; empty without
    one."""
    detached: bool = False
    """True if those dwellings are small houses in gardens, not long ones."""
    pipeline: Polygon = ()
    """Line of the pipeline; empty without one."""
    shore: Polygon = ()
    """Shore line with land to its left; empty without one."""
    bridge: Polygon = ()
    """Line of the bridge; empty without one."""
    deck_m: float = 0.0
    """Elevation of the bridge's deck, metres."""
    centre: Vector2 = (0.0, 0.0)
    """Place of the district's centre, metres."""

    @property
    def half_m(self) -> float:
        """Distance from the centre to the edge of the built-up square, metres."""
        return self.extent_m / 2.0

    @property
    def site(self) -> Rect | None:
        """The box around `inside` or the pipeline, without public streets; None without either."""
        if self.inside:
            return bounds(self.inside)
        return bounds(self.pipeline).inset(-15.0) if self.pipeline else None


def plan(spec: SceneSpec) -> DistrictPlan:
    """The plan of a spec. Raises `UsageError` for an option that the district does not know or that has no meaning."""
    check_scene(spec)
    kind = builtin_scenes()[spec.kind]
    extent = extent_m(spec) or 0.0
    default = max(2.0, round(extent / _SPACING_M.get(spec.kind, 200.0)))
    rows = _number(spec, "blocks_rows", default)
    columns = _number(spec, "blocks_columns", default)
    low, high = kind.default("height")
    low = _number(spec, "height_low_m", low)
    shore = _line(spec, "shore") or _default_shore(spec.kind, extent)
    return DistrictPlan(
        kind=spec.kind,
        layout=spec.layout,
        seed=spec.seed if shore and spec.kind != "city" else 0,
        origin=spec.origin,
        datum_m=spec.datum_m,
        extent_m=extent,
        spacing=(extent / round(columns), extent / round(rows)),
        height_m=(low, _number(spec, "height_high_m", max(low, high))),
        outskirts_m=kind.outskirts_m,
        inside=_line(spec, "inside"),
        homes=_line(spec, "homes"),
        detached=_number(spec, "detached", 0.0) > 0.0,
        pipeline=_line(spec, "pipeline"),
        shore=shore,
        bridge=_line(spec, "bridge"),
        deck_m=_number(spec, "deck_m", sum(kind.default("deck"))),
        centre=centre_m(spec),
    )


# -- private


def _number(spec: SceneSpec, name: str, default: float) -> float:
    value = spec.options.get(name, default)
    return float(value) if isinstance(value, int | float) else default


def _line(spec: SceneSpec, name: str) -> Polygon:
    value = spec.options.get(name, ())
    points = (point for point in value if isinstance(point, tuple)) if isinstance(value, tuple) else ()
    east, north = centre_m(spec)
    return tuple(points) if (east, north) == (0.0, 0.0) else tuple((x - east, y - north) for x, y in points)


def _default_shore(kind: str, extent: float) -> Polygon:
    """A gently curved shore with land in the west, for a coast or a city that declares none."""
    half = extent / 2.0
    if kind == "city":
        return ((0.74 * half, -half), (0.8 * half, -0.2 * half), (0.76 * half, 0.4 * half), (0.82 * half, half))
    if kind != "coastal":
        return ()
    return ((-0.05 * half, -half), (0.02 * half, -0.3 * half), (-0.03 * half, 0.35 * half), (0.06 * half, half))
