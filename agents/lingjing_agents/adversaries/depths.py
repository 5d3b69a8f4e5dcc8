"""`DepthReader`: the adversary that measures, and sees no colour and no class.

It has the rules of the heuristic inside. Its pictures are black, and its detectors read the depth image from above,
along the public lines of the mission's text. At tier 0 a gap in a deck, spray and vehicles are plain there.

- a fracture: the part of the bridge where the depth is that of the water;
- a leak: a body beside the pipe that is as high as spray;
- a jam: bodies of the size of vehicles;
- a person in the water: a body that rises as far above the water as a life vest, which no rival does;
- a fire on a roof: a surface that is uneven from pixel to pixel, as flames are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lingjing.plugins.geometry import world_to_pixel
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Picture, Policy
from lingjing_agents.adversaries.guesses import black
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.heuristic.target_types import ANY_VEHICLE, Detector
from lingjing_agents.perception.depth_points import heights
from lingjing_agents.perception.images import FloatArray, opencv
from lingjing_agents.perception.people_at_sea import FoundBox

BRIDGE: tuple[GroundPoint, ...] = ((-150.0, 0.0), (400.0, 30.0), (1000.0, 20.0))
PIPE: tuple[GroundPoint, ...] = ((-60.0, -40.0), (-60.0, 40.0), (20.0, 40.0), (20.0, -30.0), (60.0, -30.0))
"""The axes of the bridge and of the pipe in the shipped missions' texts, metres."""
DECK_M = 12.0
"""Elevation of the deck, metres (from the mission's text)."""
STRIDE_PX = 2
"""Sampling interval of the depth image, pixels (chosen)."""
BESIDE_M = 4.0
"""Half of the deck's width that is read, metres (chosen: inside of the railings)."""
BIN_M = 0.5
"""Length of the parts of the deck, metres (chosen)."""
GAP_M = (3.0, 20.0)
"""Shortest and longest gap, metres (chosen)."""
FRACTURE_M = (8.8, 8.2)
"""Least length and half of the width of a fracture's box, metres (measured in the shipped mission)."""
SPRAY_M = (0.12, 4.6)
"""Heights of spray above the ground, metres (measured in the shipped mission, with a margin)."""
HIGH_SPRAY_M = 2.0
"""Height that spray exceeds and the pipe does not, metres."""
PIPE_M, NEAR_PIPE_M = 0.95, 7.5
"""Half of the pipe's width, and the distance from its axis up to which spray reaches, metres."""
SPRAY_SIDE_M = (2.0, 10.0)
"""Least and greatest length of spray, metres."""
UNEVEN_M, HIGH_SHARE, TOUCHES_M = 0.3, 0.08, 2.6
"""Least standard deviation of spray's heights, share of it above `HIGH_SPRAY_M`, and distance of its nearest part from
the pipe, metres.
"""
VEHICLE_M, VEHICLE_LONG_M, VEHICLE_WIDE_M = (0.6, 3.6), (2.8, 14.0), (1.2, 5.0)
"""Least and greatest height, length and width of vehicles, metres."""
AFLOAT_M = 0.03
"""Height above the water from which a body floats, metres (chosen: the depth image has no waves)."""
PERSON_HIGH_M, PERSON_LONG_M = (0.27, 0.38), (0.5, 2.2)
"""Heights of a person in the water, and the lengths of one, metres (measured in the shipped mission)."""
FINE_M, COARSE_M, ROUGH_SHARE = 0.03, 2.5, 0.35
"""Difference of a pixel's depth from its neighbours' mean from which it is uneven, and from which it is an edge of a
building, metres; share of uneven pixels around one in flames (chosen).
"""
AROUND_PX = 15
"""Side of the square in which that share is taken, pixels (chosen)."""
FLAMES_M, FLAMES_HIGH_M, ROOF_M = (3.5, 13.0), (0.3, 5.5), 8.0
"""Sides of flames, their least and greatest height above the roof, and least elevation of a roof, metres (measured in
the shipped mission, with a margin).
"""
MARGIN_PX = 25
"""Width of the rim in which the roof's elevation is read, pixels (chosen)."""
FAR_M = 1e5
"""The depth of pixels without one, metres."""
DOWN_DEG = 80.0
"""Least tilt of a picture from above, degrees."""


class _Thing(NamedTuple):
    """A connected part of a picture."""

    box: FoundBox
    sides_m: tuple[float, float]
    cells: npt.NDArray[np.bool_]


class DepthReader:
    """Reads the depth of pictures from above."""

    async def reset(self, brief: Brief) -> None:
        """Give the heuristic the detectors."""
        finders: tuple[tuple[str, Detector], ...] = (
            ("fracture", find_gap), ("leak", find_spray), ("person", find_afloat), ("building_fire", find_flames),
        )  # fmt: skip
        known = {name: find for name in brief.classes for word, find in finders if word in name}
        self._wrapped: Policy = HeuristicPolicy({ANY_VEHICLE: find_vehicles, **known})
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the heuristic's decision on pictures without colours and classes."""
        pictures = tuple(replace(black(picture), depth=picture.depth) for picture in observation.pictures)
        return await self._wrapped.act(replace(observation, pictures=pictures), inbox)


def find_gap(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
    """Return the box of the part of the deck where the picture shows the water below."""
    points = _points(picture)
    if points is None:
        return ()
    for first, last in pairwise(BRIDGE):
        along, across = _along(points, first, last)
        on_deck = (np.abs(across) <= BESIDE_M) & (along >= 0.0) & (along <= math.dist(first, last))
        numbers = (along[on_deck] / BIN_M).astype(int)
        if not numbers.size:
            continue
        seen = np.bincount(numbers)
        low = np.bincount(numbers, weights=points[2].ravel()[on_deck.ravel()] < DECK_M - 0.5)
        open_parts = np.flatnonzero((seen > 0) & (low >= 0.6 * np.maximum(seen, 1)))
        if open_parts.size and GAP_M[0] <= (open_parts[-1] - open_parts[0] + 1) * BIN_M <= GAP_M[1]:
            middle = (open_parts[0] + open_parts[-1] + 1) / 2.0 * BIN_M
            half = max(FRACTURE_M[0], (open_parts[-1] - open_parts[0] + 1) * BIN_M + 0.6) / 2.0
            box = _box(picture, first, last, (middle - half, middle + half), FRACTURE_M[1])
            if box is not None:
                return (box,)
    return ()


def find_spray(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
    """Return the boxes of the two greatest things beside the pipe that are as high as spray and as uneven."""
    points = _points(picture)
    if points is None:
        return ()
    away = np.min([_away(points, first, last) for first, last in pairwise(PIPE)], axis=0)
    high = points[2]
    pipe = (away < PIPE_M) | ((away < 2.4 * PIPE_M) & (high < HIGH_SPRAY_M))
    mask = (high > SPRAY_M[0]) & (high < SPRAY_M[1]) & (away < NEAR_PIPE_M) & ~pipe
    sprays = []
    for thing in _things(picture, points, mask, close_m=0.9):
        high_m, near_m = points[2][thing.cells], away[thing.cells]
        uneven_m, share_m2 = float(np.std(high_m)), thing.sides_m[0] * thing.sides_m[1]
        if (
            SPRAY_SIDE_M[0] <= max(thing.sides_m) <= SPRAY_SIDE_M[1]
            and uneven_m > UNEVEN_M
            and np.mean(high_m > HIGH_SPRAY_M) > HIGH_SHARE
            and near_m.min() < TOUCHES_M
        ):
            sprays.append((uneven_m * share_m2, thing.box))
    return tuple(box for _, box in sorted(sprays, key=lambda pair: -pair[0])[:2])


def find_vehicles(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
    """Return the boxes of the things that have the height, length and width of vehicles."""
    points = _points(picture)
    if points is None:
        return ()
    mask = (points[2] > VEHICLE_M[0]) & (points[2] < VEHICLE_M[1])
    return tuple(
        thing.box
        for thing in _things(picture, points, mask)
        if VEHICLE_LONG_M[0] < max(thing.sides_m) < VEHICLE_LONG_M[1]
        and VEHICLE_WIDE_M[0] < min(thing.sides_m) < VEHICLE_WIDE_M[1]
    )


def find_afloat(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
    """Return the boxes of the bodies on the water that are as high and as long as a person."""
    points = _points(picture, 1)
    if points is None:
        return ()
    above = points[2] - level_m
    return tuple(
        thing.box
        for thing in _things(picture, points, (above > AFLOAT_M) & (above < 2.0), close_m=0.4)
        if PERSON_HIGH_M[0] < above[thing.cells].max() < PERSON_HIGH_M[1]
        and PERSON_LONG_M[0] < max(thing.sides_m) < PERSON_LONG_M[1]
    )


def find_flames(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
    """Return the boxes of the three most uneven things on roofs that are as wide and as high as flames."""
    points = _points(picture, 1)
    if points is None:
        return ()
    cv2 = opencv()
    uneven = np.abs(cv2.Laplacian(points[2].astype(np.float32), cv2.CV_32F, ksize=1))
    share = cv2.boxFilter(((uneven > FINE_M) & (uneven < COARSE_M)).astype(np.float32), -1, (AROUND_PX, AROUND_PX))
    found = []
    for thing in _things(picture, points, share > ROUGH_SHARE):
        flames = _on_roof(picture, points, thing)
        if flames is not None and all(FLAMES_M[0] < side < FLAMES_M[1] for side in flames.sides_m):
            found.append((float(share[flames.cells].mean()), flames.box))
    return tuple(box for _, box in sorted(found, key=lambda pair: -pair[0])[:3])


def _on_roof(picture: Picture, points: FloatArray, thing: _Thing) -> _Thing | None:
    """Return the part of a picture around a thing that rises from the roof below it; None if no roof is there."""
    rows, columns = (np.flatnonzero(thing.cells.any(axis=axis)) for axis in (1, 0))
    window = tuple(slice(max(0, int(cells[0]) - MARGIN_PX), int(cells[-1]) + MARGIN_PX) for cells in (rows, columns))
    part = points[(slice(None), *window)]
    rim = np.concatenate([part[2][:8].ravel(), part[2][-8:].ravel(), part[2][:, :8].ravel(), part[2][:, -8:].ravel()])
    core_m = float(np.median(points[2][thing.cells]))
    near = np.round(rim[(rim < core_m + 0.5) & (rim > core_m - FLAMES_HIGH_M[1])], 1)
    if not near.size:
        return None
    levels, counts = np.unique(near, return_counts=True)
    roof_m = float(levels[counts.argmax()])
    if roof_m < ROOF_M:
        return None
    mask = np.zeros(thing.cells.shape, np.bool_)
    mask[window] = (part[2] > roof_m + FLAMES_HIGH_M[0]) & (part[2] < roof_m + FLAMES_HIGH_M[1])
    opened = opencv().morphologyEx(mask.astype(np.uint8), opencv().MORPH_OPEN, np.ones((7, 7), np.uint8)) > 0
    shared = [(int((other.cells & thing.cells).sum()), other) for other in _things(picture, points, opened)]
    most, flames = max(shared, key=lambda pair: pair[0], default=(0, thing))
    return flames if most else None


def _points(picture: Picture, stride_px: int = STRIDE_PX) -> FloatArray | None:
    """Return east, north and elevation (3, rows, columns; metres), with the ground at 0; None without depth or for
    another view.
    """
    if picture.depth is None or picture.pose.tilt_deg < DOWN_DEG:
        return None
    depth = np.where(np.isfinite(picture.depth), picture.depth, np.float32(FAR_M))
    points = heights(depth, picture.pose, 0.0, stride_px)
    rows, columns = (len(range(stride_px // 2, side, stride_px)) for side in picture.depth.shape)
    shaped: FloatArray = np.moveaxis(points.reshape(rows, columns, 3), 2, 0)
    return shaped


def _along(points: FloatArray, first: GroundPoint, last: GroundPoint) -> tuple[FloatArray, FloatArray]:
    """Return the distance of points along a line from its beginning, and to its left."""
    length = math.dist(first, last)
    east, north = (last[0] - first[0]) / length, (last[1] - first[1]) / length
    x, y = points[0] - first[0], points[1] - first[1]
    return x * east + y * north, y * east - x * north


def _away(points: FloatArray, first: GroundPoint, last: GroundPoint) -> FloatArray:
    """Return the distance of points from a line."""
    along, across = _along(points, first, last)
    beyond = np.maximum(0.0, np.maximum(-along, along - math.dist(first, last)))
    distance: FloatArray = np.hypot(across, beyond)
    return distance


def _things(
    picture: Picture, points: FloatArray, mask: npt.NDArray[np.bool_], close_m: float = 0.0
) -> Iterator[_Thing]:
    """Yield each connected part of a mask that the picture holds completely."""
    cv2 = opencv()
    cell_m = float(np.median(np.hypot(*np.diff(points[:2], axis=2))))
    drawn = mask.astype(np.uint8)
    if close_m:
        side = max(3, int(close_m / cell_m) | 1)
        drawn = cv2.morphologyEx(drawn, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(drawn, connectivity=8)
    rows, columns = mask.shape
    for number, (left, top, width, height, _) in enumerate(stats[1:].tolist(), 1):
        if left > 0 and top > 0 and left + width < columns and top + height < rows:
            box = left / columns, top / rows, (left + width) / columns, (top + height) / rows
            yield _Thing(FoundBox(box, 0.9), (width * cell_m, height * cell_m), (labels == number) & mask)


def _box(
    picture: Picture, first: GroundPoint, last: GroundPoint, ends_m: tuple[float, float], half_m: float
) -> FoundBox | None:
    """Return the box of a part of the deck; None if the picture does not hold it completely."""
    length = math.dist(first, last)
    east, north = (last[0] - first[0]) / length, (last[1] - first[1]) / length
    corners = [
        world_to_pixel(
            picture.pose,
            (first[0] + along * east - side * north, first[1] + along * north + side * east, DECK_M),
        )
        for along in ends_m
        for side in (-half_m, half_m)
    ]
    if any(corner is None for corner in corners):
        return None
    us, vs = zip(*(corner[:2] for corner in corners if corner is not None), strict=True)
    width, height = picture.pose.width, picture.pose.height
    box = min(us) / width, min(vs) / height, max(us) / width, max(vs) / height
    return FoundBox(box, 0.9) if min(box) >= 0.0 and max(box) <= 1.0 else None
