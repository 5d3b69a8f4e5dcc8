"""What a mission says about a district: the options of `scene residential { extent = 500 m, … }`, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.errors import UsageError
from lingjing.mission.instance import SceneSpec
from lingjing.scene.city import Polygon
from lingjing.scene.districts.boxes import Box, bounds

KINDS = ("residential", "industrial", "commercial", "campus", "logistics", "coastal")

_KNOWN = {
    "extent_m": "extent",
    "blocks_rows": "blocks",
    "blocks_columns": "blocks",
    "height_low_m": "height",
    "height_high_m": "height",
    "inside": "inside",
    "homes": "homes",
    "pipeline": "pipeline",
    "shore": "shore",
    "bridge": "bridge",
    "deck_m": "deck",
    "traffic": "traffic",
    "datum": "datum",
}
"""Lowered names and how an author spells them. `traffic` is read by the road engine, `datum` by everybody."""

_HEIGHTS = {
    "residential": (9.0, 24.0),
    "industrial": (6.0, 14.0),
    "commercial": (12.0, 70.0),
    "campus": (9.0, 24.0),
    "logistics": (6.0, 20.0),
    "coastal": (8.0, 40.0),
    "city": (9.0, 90.0),
}
_SPACING_M = {"city": 250.0}
_EXTENT_M = {"city": 3000.0}
EXTENT_MOST_M = 12_000.0
DRY_M = 1.0
"""The sea lies at least this far under the ground, which is at elevation 0."""


@dataclass(frozen=True, slots=True)
class Plan:
    """A district to build: square of `extent_m` about the origin, streets every `spacing` metres east and north.

    `layout` feeds the streams of what stays from episode to episode, `seed` those of what an episode's seed may change:
    what floats on the water (nothing in a whole city, which is built once). `inside` is an area without public streets
    (a compound, a factory), `homes` one whose blocks hold dwellings of different colours whatever the rest of the
    district is, `pipeline`, `shore` and `bridge` are lines; empty where the mission names none. `height_m` is the range
    of building heights, `deck_m` the elevation of the bridge's deck.
    """

    kind: str
    layout: int
    seed: int
    origin: tuple[float, float]
    datum_m: float
    extent_m: float
    spacing: tuple[float, float]
    height_m: tuple[float, float]
    inside: Polygon = ()
    homes: Polygon = ()
    pipeline: Polygon = ()
    shore: Polygon = ()
    bridge: Polygon = ()
    deck_m: float = 12.0

    @property
    def half_m(self) -> float:
        """From the origin to the edge of the built-up square."""
        return self.extent_m / 2.0

    @property
    def site(self) -> Box | None:
        """The box around `inside` or the pipeline, which public streets keep out of."""
        if self.inside:
            return bounds(self.inside)
        return bounds(self.pipeline).inset(-15.0) if self.pipeline else None


def plan(spec: SceneSpec) -> Plan:
    """The plan of a spec. Raises `UsageError` for an option that the district does not know or that makes no sense."""
    unknown = sorted(set(spec.options) - set(_KNOWN))
    if unknown:
        known = ", ".join(dict.fromkeys(_KNOWN.values()))
        raise UsageError(f"scene `{spec.kind}` has no option `{unknown[0]}`", hint=f"known: {known}")
    extent = _number(spec, "extent_m", _EXTENT_M.get(spec.kind, 800.0), 150.0, EXTENT_MOST_M)
    default = max(2.0, round(extent / _SPACING_M.get(spec.kind, 200.0)))
    rows = _number(spec, "blocks_rows", default, 1, 100)
    columns = _number(spec, "blocks_columns", default, 1, 100)
    low, high = _HEIGHTS[spec.kind]
    low = _number(spec, "height_low_m", low, 2.5, 400.0)
    made = Plan(
        kind=spec.kind,
        layout=spec.layout,
        seed=0 if spec.kind == "city" else spec.seed,
        origin=spec.origin,
        datum_m=spec.datum_m,
        extent_m=extent,
        spacing=(extent / round(columns), extent / round(rows)),
        height_m=(low, _number(spec, "height_high_m", max(low, high), low, 400.0)),
        inside=_line(spec, "inside", 3),
        homes=_line(spec, "homes", 3),
        pipeline=_line(spec, "pipeline", 2),
        shore=_line(spec, "shore", 2) or _default_shore(spec.kind, extent),
        bridge=_line(spec, "bridge", 2),
        deck_m=_number(spec, "deck_m", 12.0, 6.0, 80.0),
    )
    _refuse_contradictions(spec, made)
    return made


# -- private


def _number(spec: SceneSpec, name: str, default: float, low: float, high: float) -> float:
    value = spec.options.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise UsageError(f"scene `{spec.kind}`: `{_KNOWN[name]}` is {value!r}", hint=f"give {low:g} to {high:g}")
    return float(value)


def _line(spec: SceneSpec, name: str, least: int) -> Polygon:
    value = spec.options.get(name, ())
    numbers = value if isinstance(value, tuple | list) else (value,)
    if not numbers:
        return ()
    good = all(isinstance(item, int | float) and not isinstance(item, bool) and math.isfinite(item) for item in numbers)
    if not good or len(numbers) % 2 or len(numbers) < 2 * least:
        raise UsageError(
            f"scene `{spec.kind}`: `{name}` is no line of {least} or more points",
            hint="write [(0 m, 0 m), (10 m, 0 m)]",
        )
    flat = [float(item) for item in numbers if isinstance(item, int | float)]
    return tuple(zip(flat[::2], flat[1::2], strict=True))


def _default_shore(kind: str, extent: float) -> Polygon:
    """A gently curved shore, land in the west, for a coast or a city that names none."""
    half = extent / 2.0
    if kind == "city":
        return ((0.74 * half, -half), (0.8 * half, -0.2 * half), (0.76 * half, 0.4 * half), (0.82 * half, half))
    if kind != "coastal":
        return ()
    return ((-0.05 * half, -half), (0.02 * half, -0.3 * half), (-0.03 * half, 0.35 * half), (0.06 * half, half))


def _refuse_contradictions(spec: SceneSpec, made: Plan) -> None:
    if made.shore and made.datum_m > -DRY_M:
        raise UsageError(
            f"scene `{spec.kind}`: the sea at {made.datum_m:g} m would flood the ground, which is at 0 m",
            hint="write: datum = sea level at -3 m",
        )
    if made.bridge and not made.shore:
        raise UsageError(f"scene `{spec.kind}` has no `bridge`", hint="a bridge needs a shore: scene coastal { … }")
    if made.kind == "city" and (made.inside or made.pipeline or made.bridge):
        raise UsageError("scene `city` knows extent, blocks and height only", hint="use one district for a site")
