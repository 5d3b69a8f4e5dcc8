"""Things at places of a mission: a destination's sign, parcels and lockers, a warehouse's dock, a pipe's clamp.

Signs and lockers of places on a road stand at its kerb, to the right of the position as seen along the heading.
"""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

from lingjing.engines.camera.meshes import Mesh, box, cylinder, flat, merge
from lingjing.engines.camera.models.palette import BLACK, GREY, ORANGE, WHITE, WOOD, YELLOW
from lingjing.engines.camera.models.shapes import at, blob, limb, turned
from lingjing.mission.appearance import LinearRgb

KERB_M = 2.4
"""Distance from a position on a lane to things at its kerb, metres (chosen)."""
# Linear colours (chosen).
SIGN_BLUE: LinearRgb = (0.02, 0.13, 0.48)
CARD: LinearRgb = (0.42, 0.28, 0.14)
TAPE: LinearRgb = (0.62, 0.52, 0.36)
DOOR_BLUE: LinearRgb = (0.03, 0.12, 0.34)
DOOR_DARK: LinearRgb = (0.02, 0.08, 0.24)
PANE: LinearRgb = (0.10, 0.14, 0.17)
BRASS: LinearRgb = (0.45, 0.30, 0.08)
HALL: LinearRgb = (0.42, 0.44, 0.46)
HALL_DARK: LinearRgb = (0.33, 0.35, 0.37)
STEEL_LIGHT: LinearRgb = (0.55, 0.56, 0.57)


def _parcel(x: float, y: float, z: float, size: tuple[float, float, float], shade: float = 1.0) -> Mesh:
    card: LinearRgb = (CARD[0] * shade, CARD[1] * shade, CARD[2] * shade)
    w, d, h = size
    return merge(
        box((x, y, z + h / 2), size, card),
        box((x, y, z + h / 2), (w * 0.14, d + 0.01, h + 0.01), TAPE),
        box((x - w * 0.26, y + 0.05 * d, z + h + 0.004), (w * 0.3, d * 0.3, 0.01), WHITE),
    )


@cache
def parking_sign() -> Mesh:
    """Return a blue sign with a white P at the kerb, visible from both sides."""
    letter = [
        (-0.12, 0.0, 0.09, 0.62), (0.02, 0.265, 0.28, 0.09), (0.02, 0.0, 0.28, 0.09), (0.14, 0.13, 0.09, 0.30),
    ]  # fmt: skip
    face = [
        box((KERB_M + (x if s < 0 else -x), s * 0.035, 2.35 + z), (w, 0.02, h), WHITE)
        for s in (-1.0, 1.0) for x, z, w, h in letter
    ]  # fmt: skip
    return merge(
        limb((KERB_M, 0.0, 0.0), (KERB_M, 0.0, 2.8), (0.04, 0.04), GREY, 6),
        box((KERB_M, 0.0, 2.35), (0.85, 0.05, 0.95), SIGN_BLUE),
        *face,
    )


@cache
def parcel_station(served: bool) -> Mesh:
    """Return a yellow parcel locker at the kerb with a screen and a sign; parcels stand beside it until it is
    served."""
    front = KERB_M - 0.31
    doors, handles = [], []
    for column in range(5):
        y = -0.94 + 0.47 * column
        patterns = (0.30, 0.58, 0.62), (0.44, 0.30, 0.44, 0.30), (0.30, 0.30, 0.62)
        heights = patterns[min(column, 4 - column)]
        low = 0.62 if column == 2 else 0.14
        for high in heights:
            doors.append(box((front, y, low + high / 2), (0.03, 0.41, high - 0.04), WHITE, 0.2))
            handles.append(box((front - 0.02, y + 0.15, low + high / 2), (0.02, 0.03, 0.09), BLACK))
            low += high
    screen = [
        box((front, 0.0, 0.36), (0.03, 0.41, 0.42), GREY),
        box((front - 0.02, 0.0, 1.42), (0.03, 0.30, 0.22), BLACK, 0.6),
    ]
    sign = [
        box((KERB_M + 0.05, 0.0, 2.06), (1.15, 2.6, 0.10), YELLOW, 0.2),
        box((KERB_M - 0.05, 0.0, 2.36), (0.12, 1.7, 0.5), YELLOW, 0.2),
        *(turned(_emblem(0.34), at((KERB_M - 0.05 + s * 0.07, -0.5, 2.36), -90.0 * s)) for s in (-1.0, 1.0)),
        *(box((KERB_M - 0.05 + s * 0.065, 0.12 + 0.2 * k, 2.36), (0.02, 0.12, 0.20 + 0.06 * (k % 2)), BLACK)
          for s in (-1.0, 1.0) for k in range(4)),
    ]  # fmt: skip
    waiting = [] if served else [
        _parcel(KERB_M - 0.75, -1.6, 0.0, (0.6, 0.5, 0.45)), _parcel(KERB_M - 0.1, -1.65, 0.0, (0.5, 0.6, 0.35), 1.2),
        _parcel(KERB_M - 0.6, -1.58, 0.45, (0.42, 0.4, 0.3), 0.9),
    ]  # fmt: skip
    body = box((KERB_M, 0.0, 1.02), (0.6, 2.42, 2.04), (0.62, 0.40, 0.02), 0.2)
    return merge(body, *doors, *handles, *screen, *sign, *waiting)


def _emblem(size: float) -> Mesh:
    """Return a parcel as an emblem of a sign, flat, its face ahead (+y)."""
    return merge(
        box((0.0, 0.0, 0.0), (size, 0.02, size), CARD), box((0.0, 0.005, 0.0), (0.16 * size, 0.03, size), TAPE),
        box((0.0, 0.005, 0.24 * size), (size, 0.03, 0.05 * size), BLACK),
    )  # fmt: skip


@cache
def doorstep(served: bool) -> Mesh:
    """Return the front door of a house: a blue leaf in a white frame with a light, a number and a letter slot, a mat
    before it, and a parcel box and a plant beside it. Once served, parcels lie on the mat."""
    wall, leaf = -0.20, -0.105
    panels = [box((x, leaf + 0.025, z), (0.34, 0.02, high), DOOR_DARK, 0.2)
              for x in (-0.22, 0.22) for z, high in ((0.42, 0.52),)]  # fmt: skip
    door = [
        box((0.0, wall, 1.28), (2.36, 0.16, 2.56), WHITE),
        box((0.0, leaf, 1.07), (1.02, 0.05, 2.10), DOOR_BLUE, 0.3),
        *panels,
        *(box((x, leaf + 0.025, 1.62), (0.34, 0.02, 0.66), PANE, 0.8) for x in (-0.22, 0.22)),
        box((0.0, leaf + 0.03, 1.02), (0.32, 0.03, 0.07), BRASS, 0.7),
        box((0.42, leaf + 0.06, 1.05), (0.06, 0.09, 0.16), BRASS, 0.7),
        *(box((x, leaf, 1.25), (0.38, 0.03, 1.95), PANE, 0.8) for x in (-0.82, 0.82)),
        box((0.0, leaf, 2.34), (2.0, 0.03, 0.26), PANE, 0.8),
        box((0.0, 0.12, 2.66), (2.7, 0.86, 0.10), GREY),
        box((1.34, wall + 0.09, 1.66), (0.26, 0.03, 0.20), SIGN_BLUE),
        *(box((1.29 + 0.1 * k, wall + 0.11, 1.66), (0.03 + 0.03 * k, 0.02, 0.12), WHITE) for k in range(2)),
        box((-1.34, wall + 0.10, 1.85), (0.14, 0.14, 0.26), YELLOW, 0.4),
    ]  # fmt: skip
    parts = [
        *door,
        box((0.0, 0.30, 0.012), (1.3, 0.7, 0.024), (0.30, 0.07, 0.04)),
        box((0.0, 0.30, 0.027), (1.0, 0.45, 0.006), (0.46, 0.34, 0.20)),
        box((1.45, 0.12, 0.45), (0.45, 0.42, 0.9), GREY, 0.2),
        box((1.45, 0.12, 0.92), (0.50, 0.47, 0.05), BLACK),
        box((1.45, 0.34, 0.66), (0.30, 0.02, 0.05), BLACK),
        turned(_emblem(0.24), at((1.45, 0.335, 0.42))),
        box((-1.45, 0.12, 0.2), (0.42, 0.42, 0.4), (0.32, 0.13, 0.07)),
        blob((-1.45, 0.12, 0.72), (0.32, 0.32, 0.40), (0.07, 0.14, 0.04), 3, 5, 8),
    ]
    if served:
        parts += [_parcel(0.0, 0.25, 0.03, (0.5, 0.4, 0.35)), _parcel(0.05, 0.27, 0.38, (0.34, 0.3, 0.22), 1.2)]
    return merge(*parts)


@cache
def dock() -> Mesh:
    """Return a depot at the kerb: a gabled hall of corrugated steel with roller shutters, an orange band with a
    parcel as its emblem, and pallets with parcels before it."""
    west, east, half = KERB_M + 1.0, KERB_M + 5.0, 2.9
    middle = 0.5 * (west + east)
    ribs = [
        *(box((west + 0.2 + 0.4 * k, s * half, 1.75), (0.10, 0.06, 3.5), HALL_DARK)
          for s in (-1.0, 1.0) for k in range(10)),
        *(box((x, 0.2 - half + 0.4 * k, 1.75), (0.06, 0.10, 3.5), HALL_DARK) for x in (west, east) for k in range(14)),
    ]  # fmt: skip
    shutters = []
    for place, turn in (
        ((west - 0.03, 0.0, 0.0), -90.0),
        ((middle, -half - 0.03, 0.0), 180.0),
        ((middle, half + 0.03, 0.0), 0.0),
    ):
        slats = [
            box((0.0, 0.04 + 0.02 * (k % 2), 0.17 + 0.30 * k), (2.5, 0.05, 0.28), STEEL_LIGHT, 0.3) for k in range(8)
        ]
        posts = [box((x, 0.06, 1.25), (0.16, 0.12, 2.5), YELLOW) for x in (-1.34, 1.34)]
        stripes = [box((x, 0.13, 0.25 + 0.5 * k), (0.165, 0.02, 0.22), BLACK) for x in (-1.34, 1.34) for k in range(5)]
        board = [
            box((0.0, 0.05, 2.98), (3.6, 0.10, 0.86), ORANGE, 0.2), turned(_emblem(0.66), at((-1.25, 0.12, 2.98))),
            *(box((-0.45 + 0.42 * k, 0.11, 2.98), (0.26, 0.04, 0.42 - 0.08 * (k % 2)), WHITE) for k in range(5)),
        ]  # fmt: skip
        shutters.append(turned(merge(*slats, *posts, *stripes, *board), at(place, turn)))
    ring = [(west - 0.3, 3.45), (east + 0.3, 3.45), (middle, 4.4)]
    roof = merge(*(
        flat([((a[0], -half - 0.3, a[1]), (b[0], -half - 0.3, b[1]), (b[0], half + 0.3, b[1])),
              ((a[0], -half - 0.3, a[1]), (b[0], half + 0.3, b[1]), (a[0], half + 0.3, a[1]))], HALL_DARK)
        for a, b in ((ring[0], ring[2]), (ring[2], ring[1]))
    ), *(flat([[(x, s * half, z) for x, z in ring]], HALL) for s in (-1.0, 1.0)))  # fmt: skip
    goods = [box((KERB_M + 0.2, y, 0.07), (0.95, 1.1, 0.14), WOOD) for y in (-2.2, 2.2)]
    goods += [_parcel(KERB_M + 0.2, y, 0.14 + 0.52 * k, (0.72 - 0.1 * k, 0.8, 0.5), 0.9 + 0.15 * k)
              for y in (-2.2, 2.2) for k in range(2)]  # fmt: skip
    return merge(box((middle, 0.0, 1.75), (east - west, 2.0 * half, 3.5), HALL), *ribs, *shutters, roof, *goods)


@cache
def crowd_barrier() -> Mesh:
    """Return a metre of barrier with a bar, for the head of a queue."""
    return merge(
        *(box((x, 0.0, 0.5), (0.05, 0.05, 1.0), GREY) for x in (-0.9, 0.9)),
        box((0.0, 0.0, 0.95), (1.8, 0.04, 0.10), (0.55, 0.05, 0.04)),
    )


@cache
def clamp(radius_m: float) -> Mesh:
    """Return an orange sleeve with bolts around a pipe along y: a sealed leak."""
    r = radius_m * 1.12
    bolts = [
        turned(box((0.0, y, 0.0), (0.16, 0.10, 0.22), BLACK), at((r * cos(a), 0.0, r * sin(a))))
        for a in (0.0, pi) for y in (-0.22, 0.22)
    ]  # fmt: skip
    return merge(cylinder((0.0, -0.4, 0.0), (0.0, 0.4, 0.0), (r, r), ORANGE, 0.2, sides=14), *bolts)


@cache
def cracked_pipe(radius_m: float) -> Mesh:
    """Return a rusty, torn flange around a pipe along y: the place of a leak."""
    r = radius_m * 1.10
    rust: LinearRgb = (0.20, 0.07, 0.025)
    return merge(
        cylinder((0.0, -0.18, 0.0), (0.0, 0.18, 0.0), (r, r), rust, sides=14),
        *(box((r * cos(a), 0.0, r * sin(a)), (0.12, 0.5, 0.12), (0.10, 0.05, 0.03)) for a in (0.5, 1.4, 2.6)),
    )


@cache
def embers() -> Mesh:
    """Return a charred heap of boards and drums that burns on the ground."""
    char: LinearRgb = (0.025, 0.020, 0.018)
    boards = [
        turned(box((0.0, 0.0, 0.0), (0.13, 1.2, 0.06), char if k % 2 else (0.06, 0.035, 0.02)),
               at((0.15 * cos(2.1 * k), 0.15 * sin(2.1 * k), 0.06 + 0.03 * k), 57.0 * k, 9.0 * (k % 3 - 1)))
        for k in range(7)
    ]  # fmt: skip
    return merge(
        *boards,
        cylinder((0.35, 0.55, 0.14), (-0.25, 0.62, 0.14), (0.14, 0.14), (0.07, 0.03, 0.02), sides=8),
        box((-0.35, 0.1, 0.12), (0.4, 0.4, 0.24), (0.04, 0.03, 0.025)),
    )


__all__ = [
    "KERB_M", "clamp", "cracked_pipe", "crowd_barrier", "dock", "doorstep", "embers", "parcel_station", "parking_sign",
]  # fmt: skip
