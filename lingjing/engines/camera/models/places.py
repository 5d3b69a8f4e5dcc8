"""Things at places of a mission: a destination's sign, parcels and lockers, a warehouse's dock, a pipe's clamp.

Signs and lockers of places on a road stand at its kerb, to the right of the position as seen along the heading.
"""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

from lingjing.engines.camera.meshes import Mesh, box, cylinder, merge
from lingjing.engines.camera.models.palette import BLACK, GREY, ORANGE, WHITE, WOOD, YELLOW
from lingjing.engines.camera.models.shapes import at, limb, turned
from lingjing.mission.appearance import LinearRgb

KERB_M = 2.4
"""Distance from a position on a lane to things at its kerb, metres (chosen)."""
# Linear colours (chosen).
SIGN_BLUE: LinearRgb = (0.02, 0.13, 0.48)
CARD: LinearRgb = (0.42, 0.28, 0.14)
TAPE: LinearRgb = (0.62, 0.52, 0.36)


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
    """Return a yellow parcel locker at the kerb; parcels stand beside it until it is served."""
    doors = [
        box((KERB_M - 0.32, -0.99 + 0.5 * k + 0.24, 0.45 + 0.58 * row), (0.02, 0.44, 0.50), WHITE)
        for k in range(4) for row in range(3)
    ]  # fmt: skip
    roof = [
        box((KERB_M + 0.05, 0.0, 2.08), (1.05, 2.3, 0.08), YELLOW),
        box((KERB_M, 0.0, 2.13), (0.5, 1.5, 0.03), WHITE),
    ]
    waiting = [] if served else [
        _parcel(KERB_M - 0.75, -1.5, 0.0, (0.6, 0.5, 0.45)), _parcel(KERB_M - 0.1, -1.55, 0.0, (0.5, 0.6, 0.35), 1.2),
        _parcel(KERB_M - 0.6, -1.48, 0.45, (0.42, 0.4, 0.3), 0.9),
    ]  # fmt: skip
    return merge(box((KERB_M, 0.0, 1.02), (0.6, 2.0, 2.04), (0.62, 0.40, 0.02), 0.2), *doors, *roof, *waiting)


@cache
def doorstep(served: bool) -> Mesh:
    """Return a door mat with a delivery box and a plant beside it; once served, parcels lie on the mat."""
    parts = [
        box((0.0, 0.0, 0.012), (1.3, 0.8, 0.024), (0.30, 0.07, 0.04)),
        box((0.0, 0.0, 0.027), (1.0, 0.5, 0.006), (0.46, 0.34, 0.20)),
        box((1.0, 0.1, 0.45), (0.5, 0.5, 0.9), SIGN_BLUE, 0.2),
        box((1.0, 0.1, 0.92), (0.56, 0.56, 0.05), WHITE),
        box((1.0, 0.36, 0.5), (0.3, 0.02, 0.3), WHITE),
        box((-1.0, 0.1, 0.2), (0.42, 0.42, 0.4), (0.32, 0.13, 0.07)),
        cylinder((-1.0, 0.1, 0.4), (-1.0, 0.1, 1.1), (0.3, 0.05), (0.06, 0.13, 0.04), sides=7),
    ]
    if served:
        parts += [_parcel(0.0, 0.0, 0.03, (0.5, 0.4, 0.35)), _parcel(0.05, 0.02, 0.38, (0.34, 0.3, 0.22), 1.2)]
    return merge(*parts)


@cache
def dock() -> Mesh:
    """Return a warehouse's loading bay at the kerb: an orange totem with a white box, pallets and a loaded hand
    truck."""
    parcels = [
        _parcel(KERB_M + 1.2 + 0.9 * (k % 3), 1.6 - 1.1 * (k // 3), 0.14, (0.75, 0.75, 0.7), 0.9 + k / 10)
        for k in range(6)
    ]  # fmt: skip
    pallets = [box((KERB_M + 2.1, 1.6 - 1.1 * k, 0.07), (2.9, 0.95, 0.14), WOOD) for k in range(2)]
    return merge(
        box((KERB_M, -1.6, 2.2), (0.35, 1.5, 4.4), ORANGE, 0.2),
        *(box((KERB_M + s * 0.19, -1.6, 3.5), (0.02, 1.0, 0.9), WHITE) for s in (-1.0, 1.0)),
        *(box((KERB_M + s * 0.205, -1.6, 3.5), (0.02, 0.14, 0.9), CARD) for s in (-1.0, 1.0)),
        *(box((KERB_M + s * 0.19, -1.6, 2.0 - 0.4 * k), (0.02, 1.1 - 0.2 * k, 0.16), WHITE)
          for s in (-1.0, 1.0) for k in range(3)),
        *pallets,
        *parcels,
    )  # fmt: skip


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
