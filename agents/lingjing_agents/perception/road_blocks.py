"""Places of queues that stand on both sides of a street, in a nadir picture.

A blocked place has a queue on each side: one ends a little beyond it, the other begins a little before it. Ordinary
queues, such as the vehicles that wait at a crossing or behind a block, stand on one side. So the place is the middle
between the two fronts, and both must be in the picture. `find_blocks` looks along the legs of a route in the pixels,
`blocks_of_vehicles` among the boxes of vehicles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lingjing.plugins.geometry import box_to_plane, world_to_pixel
from lingjing.plugins.policy import CameraPose
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import ByteImage, ImageBox, runs
from lingjing_agents.perception.road_queues import SPLIT_M, STEP_M, corners, moved_leg, occupied, strip_along

OWN_M = (1.1, 0.0, -1.1, -3.3)
"""Offsets in metres to the right of the line at which vehicles drive along it."""
OTHER_M = (-3.3, -4.4, -6.6, -7.7, -9.9)
"""Offsets in metres at which vehicles may drive against it: of two lanes the near ones drive along it."""
ASIDE_M = 2.5
"""Least distance in metres between two lanes. Chosen: less than a lane's width."""
VEHICLE_M, USUAL_M = 3.0, 6.5
"""Shortest vehicle, and the length of a vehicle with its gap, in metres. Chosen."""
GAPS_M = (6.0, 9.0, 13.0)
"""Largest gaps in metres between two standing vehicles of a queue, each tried. Measured: gaps are 2 m to 12 m, and the
stripes of a crossing are as near to the next vehicle."""
HALF_VEHICLE_M = 2.5
"""Half the length in metres of a boxed vehicle along a street. Chosen: its box is longer if the street is aslant."""
BESIDE_M = 1.5
"""Largest sideways distance of a boxed vehicle from its lane in metres. Chosen: less than half a lane."""
STRIPE, STRIPES = 12.0, 2.0
"""Difference of a stripe from the mean across a lane in grey levels, and the mean number of edges. Chosen."""
SAME_M = 15.0
"""Largest distance in metres between the places that two pairs of lanes show of one block. Chosen."""
UNLIKELY_M = 3.0
"""Difference of the overlap from the usual in metres that counts as much as a vehicle. Chosen."""
MOST = 8
"""Number of vehicles beyond which a pair of queues is no more certain. Chosen."""
BORDER_M = 3.0
"""Distance from the edge of the picture in metres within which contrasts are those of the edge. Chosen."""
FEWEST = 3
"""Least number of vehicles of the longer of the two queues. Chosen."""
OVERLAP_M, TOLERANCE_M = 12.0, 9.0
"""Usual length in metres over which the two queues stand side by side, and its tolerance. Chosen."""
SHOWN_M = 40.0
"""Length in metres of each queue in its box. Chosen."""
EDGE_M = 14.0
"""Distance from the edge of the picture, in metres, within which another vehicle may be cut off. Chosen."""


@dataclass(frozen=True, slots=True)
class RoadBlock:
    """A blocked place of a street, or the end of a queue near which there may be one."""

    place: GroundPoint
    """East and north in metres."""
    box: ImageBox
    """Normalised x0, y0, x1, y1 of the queues."""
    vehicles: int
    """Number of vehicles."""
    certain: bool
    """True if both fronts are in the picture; else another picture over `place` decides."""


@dataclass(frozen=True, slots=True)
class _Queue:
    """A queue on one lane, along a leg: beginning and end in metres, offset of the lane, number of vehicles."""

    start_m: float
    end_m: float
    offset_m: float
    vehicles: int


_Queues = Callable[[tuple[GroundPoint, GroundPoint], float], "list[_Queue]"]
"""A function of a leg and a lane's offset to the right of it in metres that returns the queues on that lane."""


def find_blocks(
    rgb: ByteImage, pose: CameraPose, level_m: float, line: tuple[GroundPoint, ...]
) -> tuple[RoadBlock, ...]:
    """Return the blocks in a nadir picture (height, width, 3) along `line` (east, north; m): certain ones first."""
    if not rgb.any():
        return ()
    return _along(line, pose, level_m, lambda leg, offset: _queues(rgb, pose, level_m, leg, offset))


def blocks_of_vehicles(
    boxes: Iterable[ImageBox], pose: CameraPose, level_m: float, line: tuple[GroundPoint, ...]
) -> tuple[RoadBlock, ...]:
    """Return the blocks that the boxes of vehicles in a nadir picture show along `line` (east, north; m), as
    `find_blocks` does.
    """
    places = [place[:2] for box in boxes if (place := box_to_plane(pose, box, level_m)) is not None]
    return _along(line, pose, level_m, lambda leg, offset: _queues_of(places, leg, offset))


def _along(line: tuple[GroundPoint, ...], pose: CameraPose, level_m: float, queues: _Queues) -> tuple[RoadBlock, ...]:
    blocks = [block for leg in pairwise(corners(line)) for block in _on_leg(queues, pose, level_m, leg)]
    return tuple(sorted(blocks, key=lambda block: (not block.certain, -block.vehicles, block.place)))


def _on_leg(
    queues: _Queues, pose: CameraPose, level_m: float, leg: tuple[GroundPoint, GroundPoint]
) -> Iterator[RoadBlock]:
    own, other = ([queue for offset in offsets for queue in queues(leg, offset)] for offsets in (OWN_M, OTHER_M))
    pairs = [
        (a, b)
        for a in own
        for b in other
        if a.offset_m - b.offset_m >= ASIDE_M
        and abs(a.end_m - b.start_m - OVERLAP_M) <= TOLERANCE_M
        and max(a.vehicles, b.vehicles) >= FEWEST
    ]
    if pairs:
        best = max(pairs, key=_likelihood)
        near = [pair for pair in pairs if abs(_middle(pair) - _middle(best)) <= SAME_M]
        # The foremost vehicle of a lane may be dark: the farthest front of all lanes counts.
        at_m = (max(own.end_m for own, _ in near) + min(other.start_m for _, other in near)) / 2.0
        yield _block(pose, level_m, leg, at_m, (at_m - SHOWN_M, at_m + SHOWN_M), _vehicles(best), certain=True)
        return
    for queue, at_m in (*((queue, queue.end_m) for queue in own), *((queue, queue.start_m) for queue in other)):
        beyond = at_m + (EDGE_M if at_m == queue.end_m else -EDGE_M)
        if queue.vehicles >= FEWEST and not _is_shown(pose, level_m, leg, beyond):
            ends = (queue.start_m, queue.end_m)
            yield _block(pose, level_m, leg, at_m, ends, queue.vehicles, certain=False)


def _likelihood(pair: tuple[_Queue, _Queue]) -> float:
    overlap = pair[0].end_m - pair[1].start_m
    return min(_vehicles(pair), MOST) - abs(overlap - OVERLAP_M) / UNLIKELY_M


def _middle(pair: tuple[_Queue, _Queue]) -> float:
    return (pair[0].end_m + pair[1].start_m) / 2.0


def _vehicles(pair: tuple[_Queue, _Queue]) -> int:
    return pair[0].vehicles + pair[1].vehicles


def _queues(
    rgb: ByteImage, pose: CameraPose, level_m: float, leg: tuple[GroundPoint, GroundPoint], offset_m: float
) -> list[_Queue]:
    strip = strip_along(rgb, pose, level_m, moved_leg(*leg, offset_m))
    if strip is None:
        return []
    pieces = [
        (start * STEP_M, end * STEP_M)
        for start, end in runs(occupied(strip), round(SPLIT_M / STEP_M))
        if (end - start) * STEP_M >= VEHICLE_M
        and not _is_striped(strip[:, start:end])
        and all(_is_shown(pose, level_m, leg, at) for at in (start * STEP_M - BORDER_M, end * STEP_M + BORDER_M))
    ]
    return [queue for gap_m in GAPS_M for queue in _chained(pieces, offset_m, gap_m) if queue.vehicles >= 2]


def _queues_of(places: list[GroundPoint], leg: tuple[GroundPoint, GroundPoint], offset_m: float) -> list[_Queue]:
    """Return the queues of vehicles at places (east, north; m) on one lane along a leg."""
    (ax, ay), (bx, by) = leg
    length = math.dist(*leg) or 1.0
    ahead = (bx - ax) / length, (by - ay) / length
    on_lane = []
    for x, y in places:
        along, aside = (x - ax) * ahead[0] + (y - ay) * ahead[1], (x - ax) * ahead[1] - (y - ay) * ahead[0]
        if abs(aside - offset_m) <= BESIDE_M and 0.0 <= along <= length:
            on_lane.append((along - HALF_VEHICLE_M, along + HALF_VEHICLE_M))
    return [queue for queue in _chained(sorted(on_lane), offset_m, GAPS_M[-1]) if queue.vehicles >= 2]


def _is_striped(piece: ByteImage) -> bool:
    """Return whether a piece of a lane (across, along, 3) has the stripes of a pedestrian crossing."""
    grey = piece.astype(np.float32).mean(axis=2)
    above = grey > grey.mean(axis=0) + STRIPE
    below = grey < grey.mean(axis=0) - STRIPE
    steps = (above[1:] & ~above[:-1]).sum(axis=0) + (below[1:] & ~below[:-1]).sum(axis=0)
    return bool(steps.mean() >= STRIPES)


def _chained(pieces: list[tuple[float, float]], offset_m: float, gap_m: float) -> list[_Queue]:
    queues: list[_Queue] = []
    for start, end in pieces:
        many = max(1, round((end - start) / USUAL_M))
        if queues and start - queues[-1].end_m <= gap_m:
            last = queues.pop()
            queues.append(_Queue(last.start_m, end, offset_m, last.vehicles + many))
        else:
            queues.append(_Queue(start, end, offset_m, many))
    return queues


def _block(
    pose: CameraPose, level_m: float, leg: tuple[GroundPoint, GroundPoint], at_m: float, ends: tuple[float, float],
    vehicles: int, *, certain: bool,
) -> RoadBlock:  # fmt: skip
    pixels = [world_to_pixel(pose, (*_at(leg, end), level_m)) for end in ends]
    us = [min(max(pixel[0] / pose.width, 0.0), 1.0) for pixel in pixels if pixel is not None]
    vs = [min(max(pixel[1] / pose.height, 0.0), 1.0) for pixel in pixels if pixel is not None]
    box = (max(0.0, min(us) - 0.02), max(0.0, min(vs) - 0.03), min(1.0, max(us) + 0.02), min(1.0, max(vs) + 0.03))
    return RoadBlock(_at(leg, at_m), box, vehicles, certain)


def _is_shown(pose: CameraPose, level_m: float, leg: tuple[GroundPoint, GroundPoint], at_m: float) -> bool:
    pixel = world_to_pixel(pose, (*_at(leg, at_m), level_m))
    return pixel is not None and 0 <= pixel[0] < pose.width and 0 <= pixel[1] < pose.height


def _at(leg: tuple[GroundPoint, GroundPoint], at_m: float) -> GroundPoint:
    (ax, ay), (bx, by) = leg
    share = at_m / (math.dist(*leg) or 1.0)
    return ax + share * (bx - ax), ay + share * (by - ay)
