"""What a mission says about a district: the options of `scene residential { extent = 500 m, … }`, checked."""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.mission.geometry2d import Polygon, Vector2
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import builtin_scenes, centre_m, check_scene, extent_m
from lingjing.scene.districts.rectangles import Rect, bounds

_SPACING_M = {"city": 250.0}


@dataclass(frozen=True, slots=True)
class DistrictPlan:
    """A district to build: square of `extent_m` about `centre`, streets every `spacing` metres east and north.

    `layout` feeds the streams of what stays from episode to episode, `seed` those of what an episode's seed may change:
    what floats on the water (0 where nothing does: inland, and in a whole city, which is built once). `inside` is an
    area without public streets (a compound, a factory), `homes` one whose blocks hold dwellings of different colours
    whatever the rest of the district is, `pipeline`, `shore` and `bridge` are lines; empty where the mission names
    none. All of these are relative to the centre: the district is laid out about 0 and carried there. `height_m` is the
    range of building heights, `deck_m` the elevation of the bridge's deck, `outskirts_m` how far trees stand around the
    square.
    """

    kind: str
    layout: int
    seed: int
    origin: tuple[float, float]
    datum_m: float
    extent_m: float
    spacing: tuple[float, float]
    height_m: tuple[float, float]
    outskirts_m: float
    inside: Polygon = ()
    homes: Polygon = ()
    pipeline: Polygon = ()
    shore: Polygon = ()
    bridge: Polygon = ()
    deck_m: float = 0.0
    centre: Vector2 = (0.0, 0.0)

    @property
    def half_m(self) -> float:
        """From the centre to the edge of the built-up square."""
        return self.extent_m / 2.0

    @property
    def site(self) -> Rect | None:
        """The box around `inside` or the pipeline, which public streets keep out of."""
        if self.inside:
            return bounds(self.inside)
        return bounds(self.pipeline).inset(-15.0) if self.pipeline else None


def plan(spec: SceneSpec) -> DistrictPlan:
    """The plan of a spec. Raises `UsageError` for an option that the district does not know or that makes no sense."""
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
    """A gently curved shore, land in the west, for a coast or a city that names none."""
    half = extent / 2.0
    if kind == "city":
        return ((0.74 * half, -half), (0.8 * half, -0.2 * half), (0.76 * half, 0.4 * half), (0.82 * half, half))
    if kind != "coastal":
        return ()
    return ((-0.05 * half, -half), (0.02 * half, -0.3 * half), (-0.03 * half, 0.35 * half), (0.06 * half, half))
