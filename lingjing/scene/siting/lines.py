"""Sites on a line: the deck of a bridge over water, or a pipeline."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import cos, hypot, radians, sin
from typing import Any

from lingjing.mission import expression as ex
from lingjing.mission.geometry2d import Vector2, bounds
from lingjing.mission.instance import Vector
from lingjing.scene.camera_geometry import turn_deg
from lingjing.scene.lines import line_length, point_at, project, section
from lingjing.scene.siting.city_view import CityView
from lingjing.scene.siting.layout import LINES, Layout, points, position_exprs
from lingjing.scene.siting.rewriting import Placement
from lingjing.scene.siting.walking import WalkGrid

LEAST_BRIDGE_M, LEAST_WET_M = 80.0, 30.0
"""Shortest bridge, and its shortest part over water, metres (chosen: a fracture's gap of 8 m and spans beside it)."""
END_M = 8.0
"""Distance of targets from the ends of their part of a line, metres (chosen)."""
LEAST_PIPE_M, MOST_PIPE_M = 60.0, 160.0
"""Shortest and longest section of a pipeline, metres (chosen: a dog in its middle has at most 100 m to each end)."""
WINDOW_M = 40.0
"""Step between sections of a long pipeline, metres (chosen)."""
BESIDE_M = 14.0
"""Distance at which bodies begin beside a pipeline, metres (chosen)."""
REACHED_M = 4.0
"""Largest distance of walkable ground from a pipeline, metres: a leak is sealed from 5 m."""
AREA_M = 25.0
"""Margin of the area around a pipeline, metres (chosen)."""


def line_sites(layout: Layout, view: CityView) -> Iterator[Placement]:
    """Yield placements, the best first."""
    if layout.line is None:
        return
    option, _ = layout.line
    if LINES[option] == "bridge":
        yield from _bridge_sites(layout, view)
    else:
        yield from _pipe_sites(layout, view)


def line_need(layout: Layout, view: CityView) -> str:
    """Return the need of such a site, with the city's numbers."""
    if layout.line is not None and LINES[layout.line[0]] == "bridge":
        wet = max((_wet(path, view)[1] - _wet(path, view)[0] for path in view.bridges), default=0.0)
        longest = max(map(line_length, view.bridges), default=0.0)
        return (
            f"a bridge of at least {LEAST_BRIDGE_M:g} m with {LEAST_WET_M:g} m of it over water "
            f"(its longest bridge has {longest:.0f} m, the longest part over water {max(wet, 0.0):.0f} m)"
        )
    longest = max(map(line_length, view.pipes), default=0.0)
    return (
        f"a pipeline in the open (man_made=pipeline) of at least {LEAST_PIPE_M:g} m that a dog can walk along "
        f"(its longest has {longest:.0f} m)"
    )


# -- bridges


def _bridge_sites(layout: Layout, view: CityView) -> Iterator[Placement]:
    paths = [path for path in view.bridges if line_length(path) >= LEAST_BRIDGE_M]
    wet = {path: _wet(path, view) for path in paths}
    for path in sorted(paths, key=lambda path: (wet[path][0] - wet[path][1], path)):
        start, end = wet[path]
        if end - start < LEAST_WET_M:
            return
        length = line_length(path)
        if start < length - end:  # the inspection begins on land
            path, start, end = path[::-1], length - end, length - start
        most = layout.line and line_length([(x, y, 0.0) for x, y in layout.line[1]])
        first = max(0.0, min(start - 0.15 * (most or length), length))
        last = min(length, max(end, first + LEAST_BRIDGE_M), first + (most or length))
        part = section(path, first, last)
        yield _along(layout, part, (start - first + END_M, min(end, last) - first - END_M))


def _wet(path: tuple[Vector, ...], view: CityView) -> tuple[float, float]:
    """The longest part of a path over water, as lengths along it; (0, 0) without one."""
    import shapely

    line = shapely.LineString([point[:2] for point in path])
    parts = [p for p in shapely.get_parts(line.intersection(view.water)) if p.geom_type == "LineString" and p.length]
    if not parts:
        return 0.0, 0.0
    longest = max(parts, key=lambda part: part.length)
    ends = sorted(line.project(shapely.Point(end)) for end in (longest.coords[0], longest.coords[-1]))
    return ends[0], ends[1]


# -- pipes


def _pipe_sites(layout: Layout, view: CityView) -> Iterator[Placement]:
    for path in view.pipes:
        length = line_length(path)
        if length < LEAST_PIPE_M:
            return
        span = min(length, MOST_PIPE_M)
        windows = max(1, int((length - span) / WINDOW_M) + 1)
        for window in sorted(range(windows), key=lambda k: abs(k - (windows - 1) / 2)):
            part = section(path, window * WINDOW_M, window * WINDOW_M + span)
            placed = _beside_pipe(layout, view, part)
            if placed is not None:
                yield placed


def _beside_pipe(layout: Layout, view: CityView, part: tuple[Vector, ...]) -> Placement | None:
    """A placement along a section of a pipeline, if a dog reaches all of it; else None."""
    length = line_length(part)
    west, south, east, north = bounds([point[:2] for point in part])
    margin = AREA_M + 15.0
    grid = WalkGrid(view, (west - margin, south - margin, east + margin, north + margin))
    stops = [point_at(part, at)[0][:2] for at in range(int(END_M), int(length - END_M) + 1, 5)]
    for share in (0.5, 0.4, 0.6):
        (x, y, _), heading = point_at(part, share * length)
        for side in (90.0, -90.0):
            angle = radians(heading + side)
            cell = grid.nearest_free((x + BESIDE_M * sin(angle), y + BESIDE_M * cos(angle)), 8.0)
            if cell is None:
                continue
            lengths = grid.lengths_from(cell, 1.6 * length)
            if all(grid.nearest_free(stop, REACHED_M, lengths) for stop in stops):
                dog = grid.place(cell)
                flown = grid.nearest_free((dog[0] + 8.0 * sin(angle), dog[1] + 8.0 * cos(angle)), 8.0)
                return _at_pipe(layout, part, dog, grid.place(flown or cell), (heading + side + 180.0) % 360.0)
    return None


def _at_pipe(layout: Layout, part: tuple[Vector, ...], dog: Vector2, uav: Vector2, facing_deg: float) -> Placement:
    placed = _along(layout, part, (END_M, line_length(part) - END_M))
    west, south, east, north = bounds([*(point[:2] for point in part), dog, uav])
    box = (
        (west - AREA_M, south - AREA_M), (east + AREA_M, south - AREA_M),
        (east + AREA_M, north + AREA_M), (west - AREA_M, north + AREA_M),
    )  # fmt: skip
    plain = {r.name: box for r in layout.mission.regions if isinstance(r.shape, ex.Call) and r.shape.function == "box"}
    places: dict[str, Any] = {g.name: (dog,) for g in layout.assets("quadruped")}
    places |= {g.name: (uav,) for g in layout.assets("multirotor")}
    headings = {g.name: (facing_deg,) for g in layout.assets("quadruped")}
    return Placement(
        shift=placed.shift, regions=plain, lines=placed.lines, places={**placed.places, **places},
        headings_deg=headings, along=placed.along,
    )  # fmt: skip


# -- both


def _along(layout: Layout, part: tuple[Vector, ...], zone: tuple[float, float]) -> Placement:
    """The mission's line laid along a path; targets on it lie in the `zone`, metres along the path."""
    assert layout.line is not None
    option, line = layout.line
    flat = [(x, y, 0.0) for x, y in line]
    whole, length = line_length(flat), line_length(part)
    shift = partial(_shifted, flat, whole, part, length)
    lines: dict[tuple[Vector2 | None, ...], tuple[Vector2, ...]] = {}
    lines[line] = tuple((round(x, 2), round(y, 2)) for x, y, _ in part)
    places: dict[str, Any] = {}
    for group in layout.on(LINES[option]):
        drawn = [expr for expr in position_exprs(group) if isinstance(expr, ex.Draw)]
        for expr in drawn:
            written = points(expr)
            if expr.distribution == "sites_along":
                inner = section(part, *zone) if written != line else part
                lines[written] = tuple((round(x, 2), round(y, 2)) for x, y, _ in inner)
            elif written:
                at = [project(line, *place).at_m for place in written]
                low, high = min(at), max(at)
                spread = [zone[0] + (a - low) / max(high - low, 1.0) * (zone[1] - zone[0]) for a in at]
                places[group.name] = tuple(point_at(part, a)[0][:2] for a in spread)
    headings: dict[str, tuple[float, ...]] = {}
    for group in layout.assets("multirotor"):
        starts = layout.starts(group)
        if len(starts) == 1 and project(line, *starts[0]).off_m < 1.0:
            (x, y, z), heading = point_at(part, max(1.0, project(line, *starts[0]).at_m / whole * length))
            places[group.name] = ((x, y, z + 0.2),)
            headings[group.name] = (heading,)
    return Placement(shift=shift, lines=lines, places=places, headings_deg=headings, along=min(1.0, length / whole))


def _shifted(line: list[Vector], whole_m: float, part: tuple[Vector, ...], length_m: float, place: Vector2) -> Vector2:
    """The place at the same share of the line and on the same side of it."""
    near = project(line, *place)
    (x, y, _), heading = point_at(part, near.at_m / whole_m * length_m)
    (on_x, on_y, _), declared = point_at(line, near.at_m)
    off = hypot(place[0] - on_x, place[1] - on_y)
    if off < 0.01:
        return round(x, 2), round(y, 2)
    from lingjing.scene.camera_geometry import bearing_deg

    angle = radians(heading + turn_deg(bearing_deg((on_x, on_y), place), declared))
    return round(x + off * sin(angle), 2), round(y + off * cos(angle), 2)
