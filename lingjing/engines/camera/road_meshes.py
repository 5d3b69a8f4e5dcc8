"""Meshes of roads, junctions, pavements and painted areas: flat strips and sheets in layers.

A lane's strip holds the place of a point on it (`at`: metres left of its middle, metres from its start) and the paint
on it (`style`: half its width, its length, a code of its edge lines, a code of its ends). A shader draws the markings
from these. Overlapping areas of one height have layers of their own, later ones above earlier ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt
import shapely

from lingjing.engines.camera.classes import CLASSES
from lingjing.engines.camera.mesh_rows import Floats, MeshPart, Style, joined, quads, rows, sheet
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.geometry2d import Polygon
from lingjing.scene.city import Junction, Lane, PaintedArea, Road

SURFACES: dict[str, tuple[LinearRgb, Style]] = {
    "ground": ((0.205, 0.200, 0.182), (9.0, 0.0, 0.45, 0.50)),
    "park": ((0.085, 0.125, 0.040), (9.0, 0.0, 0.60, 0.35)),
    "grass": ((0.090, 0.130, 0.038), (9.0, 0.0, 0.60, 0.25)),
    "forest": ((0.045, 0.075, 0.024), (9.0, 0.0, 0.80, 0.30)),
    "plaza": ((0.360, 0.335, 0.300), (1.5, 0.30, 0.22, 0.0)),
    "sidewalk": ((0.330, 0.320, 0.300), (0.75, 0.22, 0.20, 0.0)),
    "parking": ((0.105, 0.107, 0.112), (9.0, 0.0, 0.40, 0.0)),
    "asphalt": ((0.085, 0.087, 0.092), (9.0, 0.0, 0.40, 0.0)),
    "industrial": ((0.235, 0.225, 0.210), (6.0, 0.30, 0.45, 0.12)),
    "residential": ((0.225, 0.220, 0.200), (9.0, 0.0, 0.45, 0.60)),
    "commercial": ((0.285, 0.272, 0.252), (2.4, 0.20, 0.28, 0.0)),
    "sand": ((0.420, 0.330, 0.210), (9.0, 0.0, 0.30, 0.0)),
    "concrete": ((0.300, 0.300, 0.290), (6.0, 0.35, 0.30, 0.0)),
    "pitch": ((0.070, 0.145, 0.050), (9.0, 0.0, 0.25, 0.0)),
}
"""Surface → (colour, (spacing of joints in metres, their strength, contrast of grain, share of bare patches));
chosen."""

IDS = {
    "park": "grass",
    "forest": "grass",
    "pitch": "grass",
    "ground": "ground",
    "asphalt": "road",
    "parking": "road",
    "plaza": "sidewalk",
}
"""Semantic class of a surface that has neither its own class nor `concrete`."""

CYCLE_RED: LinearRgb = (0.20, 0.075, 0.055)
"""Linear colour of cycle lanes (chosen)."""

KERB_M = 0.2
"""Width of kerb stones, metres (chosen)."""

TOP_AREA = 6.0
"""Highest layer of areas."""

PAVED_OVER = 0.5
"""Layer of paving above soil of the same layer, which may belong to another tile."""
JUNCTION_LAYER, LANE_LAYER, WALK_LAYER, KERB_LAYER = 7.0, 8.0, 12.0, 13.0
"""Layers above all areas, so that roads cover areas and walkways cover roads."""

NONE, EDGE, DASHES, CENTRE = 0, 1, 2, 3
"""Codes of lines at a lane's edge, as in the shader."""

ZEBRA_START, ZEBRA_END, STOP_END = 1, 2, 4
"""Bits of the code of a lane's ends, as in the shader."""

BESIDE_M = 1.5
"""Distance within which the left edges of two directions are one line, metres (chosen)."""
DIVIDED = ("motorway", "trunk", "primary", "secondary")
"""Kinds of roads with a separate carriageway for each direction. Their inner line is yellow too."""
QUIET = ("service", "footway", "path", "living_street", "track", "cycleway", "steps", "pedestrian")
"""Kinds of roads without painted lines."""


def surface_id(surface: str) -> int:
    """Return the id that a surface is drawn with."""
    for name in (surface, IDS.get(surface, "concrete"), "concrete"):
        if name in CLASSES:
            return CLASSES[name]
    return 0


def areas(painted: Sequence[PaintedArea]) -> tuple[MeshPart, MeshPart]:
    """Return painted areas with joints and without, the topmost first, which is drawn first and hides those below."""
    boxes = [shapely.Polygon(area.polygon).bounds if len(area.polygon) > 2 else None for area in painted]
    layers: list[float] = []
    for k, box in enumerate(boxes):
        under = [layers[j] for j in range(k) if box and boxes[j] and _touch(box, boxes[j])]
        layers.append(min(max(under, default=0.0) + 1.0, TOP_AREA))
    order = sorted(range(len(painted)), key=lambda k: (-layers[k], -k))
    jointed = [SURFACES.get(area.surface, SURFACES["concrete"])[1][1] > 0.0 for area in painted]
    shown = [k for k in order if boxes[k] is not None]
    return (joined(_area(painted[k], layers[k] + PAVED_OVER) for k in shown if jointed[k]),
            joined(_area(painted[k], layers[k]) for k in shown if not jointed[k]))  # fmt: skip


def _touch(a: tuple[float, ...], b: tuple[float, ...] | None) -> bool:
    return b is not None and a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _area(area: PaintedArea, layer: float) -> MeshPart:
    colour, style = SURFACES.get(area.surface, SURFACES["concrete"])
    return sheet([area.polygon, *area.holes], area.top_m, colour, surface_id(area.surface), style=style, layer=layer)


def junctions(crossroads: Iterable[Junction]) -> MeshPart:
    """Return the asphalt of junctions, without markings."""
    style = (0.0, 0.0, 0.0, 0.0)
    parts = []
    for junction in crossroads:
        if len(junction.polygon) < 3:
            continue
        ring = junction.polygon
        parts.append(sheet([ring], junction.elevation_m, SURFACES["asphalt"][0], surface_id("asphalt"), style=style,
                           layer=JUNCTION_LAYER))  # fmt: skip
    return joined(parts)


Middles = npt.NDArray[np.float64]
"""Rows (n, 4): the middle of each road's left edge (east, north) and its direction there."""


def middles_of(roads: Iterable[Road]) -> Middles:
    """Return the middles of roads that vehicles use."""
    middles = [_middle(road) for road in roads]
    return np.array([row for row in middles if row is not None]).reshape(-1, 4)


def _middle(road: Road) -> tuple[float, float, float, float] | None:
    driven = [lane for lane in road.lanes if lane.kind != "foot" and len(lane.shape) > 1]
    if not driven:
        return None
    left, _, along = _edges(driven[-1])
    half = float(along[-1]) / 2.0
    k = min(int(np.searchsorted(along, half)), len(along) - 1)
    share = (half - along[k - 1]) / max(float(along[k] - along[k - 1]), 1e-9)
    at, step = left[k - 1] + (left[k] - left[k - 1]) * share, left[k] - left[k - 1]
    length = max(float(np.hypot(step[0], step[1])), 1e-9)
    return float(at[0]), float(at[1]), float(step[0]) / length, float(step[1]) / length


def _two_way(road: Road, middles: Middles) -> bool:
    """Return whether another road runs in the opposite direction along this one's left edge."""
    mine = _middle(road)
    if mine is None or not len(middles):
        return False
    close = np.hypot(middles[:, 0] - mine[0], middles[:, 1] - mine[1]) < BESIDE_M
    against = middles[:, 2] * mine[2] + middles[:, 3] * mine[3] < -0.7
    return bool((close & against).any())


def lanes(roads: Iterable[Road], crossings: Sequence[Polygon], middles: Middles) -> MeshPart:
    """Return the driving lanes of roads.

    `crossings` are the outlines of junctions with pedestrian crossings. `middles` are those of the roads around.
    """
    near = [shapely.Polygon(ring).buffer(1.5) for ring in crossings if len(ring) > 2]
    tree = shapely.STRtree(near)
    parts = []
    for number, road in enumerate(roads):
        if road.tunnel:
            continue
        driven = [lane for lane in road.lanes if lane.kind != "foot"]
        divided = road.kind in DIVIDED and len(driven) > 1
        inner = CENTRE if divided or _two_way(road, middles) else EDGE
        for place, lane in enumerate(driven):
            part = _lane(road, lane, place, driven, inner, tree)
            part.vertices["layer"] += float(number % 4)  # overlapping roads in different layers do not flicker
            parts.append(part)
    return joined(parts)


def pavements(roads: Iterable[Road]) -> MeshPart:
    """Return the walkways along roads with their kerb stones."""
    colour, style = SURFACES["sidewalk"]
    number = surface_id("sidewalk")
    parts = []
    for road in roads:
        for lane in road.lanes:
            if lane.kind == "foot" and not road.tunnel and len(lane.shape) > 1:
                left, right, _ = _edges(lane)
                parts.append(_ribbon(left, right, colour, style, number))
                for side, turn in ((left, -1.0), (right, 1.0)):
                    parts.append(_kerb(side, turn, number))
    return joined(parts)


def _lane(
    road: Road, lane: Lane, place: int, driven: Sequence[Lane], inner: int, crossings: shapely.STRtree
) -> MeshPart:
    if len(lane.shape) < 2:
        return joined(())
    left, right, along = _edges(lane)
    count = len(along)
    half, length = lane.width_m / 2.0, float(along[-1])
    colour = CYCLE_RED if lane.kind == "bicycle" else SURFACES["asphalt"][0]
    style = (half, length, _lines(road, place, driven, inner), _ends(road, lane, crossings))
    position = np.stack([left, right], axis=1).reshape(-1, 3)
    across = np.tile([half, -half], count)
    at = np.column_stack([across, np.repeat(along, 2)])
    number = surface_id("asphalt")
    vertices = rows(position, (0.0, 0.0, 1.0), colour, number, at=at, style=style, layer=LANE_LAYER)
    base = 2 * np.arange(count - 1, dtype=np.uint32)[:, None]
    return MeshPart(vertices, (base + np.array([0, 1, 3, 0, 3, 2], np.uint32)).ravel())


def _lines(road: Road, place: int, driven: Sequence[Lane], inner: int) -> float:
    """Return the code of the lines at a lane's left and right edge: left + 4 right; `inner` is the line at the road's
    left."""
    if road.kind in QUIET:
        return float(NONE)
    if place < len(driven) - 1:
        left = DASHES if driven[place + 1].kind == driven[place].kind else EDGE
    else:
        left = inner
    if place > 0:
        right = DASHES if driven[place - 1].kind == driven[place].kind else EDGE
    else:
        right = EDGE
    return float(left + 4 * right)


def _ends(road: Road, lane: Lane, crossings: shapely.STRtree) -> float:
    if road.kind in QUIET or road.bridge or lane.kind == "bicycle":
        return 0.0
    start, end = (shapely.Point(lane.shape[k][:2]) for k in (0, -1))
    at_start, at_end = (len(crossings.query(point, predicate="intersects")) > 0 for point in (start, end))
    if shapely.length(shapely.LineString([p[:2] for p in lane.shape])) < 14.0:
        return 0.0
    return float(at_start * ZEBRA_START + at_end * (ZEBRA_END + STOP_END))


def _edges(lane: Lane) -> tuple[Floats, Floats, Floats]:
    """Return (left edge, right edge, metres along) of a lane at the points of its centre line."""
    path = np.asarray(lane.shape, np.float64)
    step = np.diff(path[:, :2], axis=0)
    length = np.linalg.norm(step, axis=1)
    keep = np.concatenate([[True], length > 1e-3])
    path = path[keep]
    if len(path) < 2:
        path = np.stack([path[0], path[0] + (0.01, 0.0, 0.0)])
    step = np.diff(path[:, :2], axis=0)
    length = np.linalg.norm(step, axis=1)
    side = np.column_stack([-step[:, 1], step[:, 0]]) / length[:, None]
    mitre = np.concatenate([side[:1], side[:-1] + side[1:], side[-1:]])
    norm = np.linalg.norm(mitre, axis=1, keepdims=True)
    mitre = mitre / np.maximum(norm, 1e-6)
    cosine = np.einsum("ij,ij->i", mitre, np.concatenate([side[:1], side]))
    mitre /= np.maximum(cosine, 0.5)[:, None]
    offset = np.column_stack([mitre, np.zeros(len(path))]) * lane.width_m / 2.0
    return path + offset, path - offset, np.concatenate([[0.0], np.cumsum(length)])


def _ribbon(left: Floats, right: Floats, colour: LinearRgb, style: Style, number: int) -> MeshPart:
    position = np.stack([left[:-1], right[:-1], right[1:], left[1:]], axis=1).reshape(-1, 3)
    vertices = rows(position, (0.0, 0.0, 1.0), colour, number, at=position[:, :2], style=style, layer=WALK_LAYER)
    return MeshPart(vertices, quads(len(left) - 1))


def _kerb(line: Floats, turn: float, number: int) -> MeshPart:
    """Return the kerb stones along one edge of a walkway, which lies left (`turn` 1) or right (-1) of the line."""
    step = np.diff(line[:, :2], axis=0)
    side = turn * np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(np.linalg.norm(step, axis=1), 1e-6)[:, None]
    inwards = np.column_stack([side, np.zeros(len(side))]) * KERB_M
    position = np.stack([line[:-1], line[1:], line[1:] + inwards, line[:-1] + inwards], axis=1).reshape(-1, 3)
    vertices = rows(position, (0.0, 0.0, 1.0), (0.40, 0.40, 0.385), number, style=(9.0, 0.0, 0.2, 0.0),
                    layer=KERB_LAYER)  # fmt: skip
    return MeshPart(vertices, quads(len(line) - 1))
