"""Road vehicles: cars in several shapes and colours, van, truck, bus, fire truck, motorcycle and bicycle with riders.

The origin is the middle of the footprint on the ground. Dimensions are those of `scene.sizes.SIZES`.
"""

from __future__ import annotations

from functools import cache

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, merge
from lingjing.engines.camera.models.palette import BLACK, GREY, RED, SKINS, WHITE, WOOD, YELLOW
from lingjing.engines.camera.models.shapes import limb, mirrored, pane, quad, shell, wheel
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector

# Linear colours (chosen).
GLASS: LinearRgb = (0.015, 0.02, 0.026)
LAMP: LinearRgb = (0.78, 0.78, 0.72)
TAIL: LinearRgb = (0.45, 0.02, 0.02)
CHROME: LinearRgb = (0.40, 0.41, 0.43)
FIRE_RED: LinearRgb = (0.60, 0.025, 0.02)
BLUE_LIGHT: LinearRgb = (0.02, 0.10, 0.75)

PAINTS: tuple[LinearRgb, ...] = (
    (0.74, 0.74, 0.73), (0.40, 0.42, 0.44), (0.03, 0.03, 0.035), (0.10, 0.11, 0.13), (0.05, 0.10, 0.27),
    (0.42, 0.03, 0.03), (0.66, 0.66, 0.64), (0.05, 0.13, 0.09), (0.33, 0.27, 0.19), (0.20, 0.21, 0.22),
)  # fmt: skip
"""Colours of cars in usual proportions: mostly white, silver and dark."""

_BODIES: dict[str, list[tuple[float, float, float, float]]] = {
    "sedan": [(-2.25, 0.72, 0.36, 0.80), (-2.14, 0.85, 0.24, 0.95), (-1.3, 0.90, 0.22, 0.96), (0.95, 0.90, 0.22, 0.93),
              (2.02, 0.86, 0.24, 0.76), (2.25, 0.70, 0.34, 0.62)],
    "hatch": [(-2.05, 0.74, 0.36, 0.85), (-1.97, 0.84, 0.24, 0.99), (-1.2, 0.88, 0.22, 0.98), (1.00, 0.88, 0.22, 0.95),
              (1.88, 0.84, 0.24, 0.80), (2.08, 0.68, 0.34, 0.64)],
    "suv": [(-2.3, 0.78, 0.45, 0.95), (-2.2, 0.89, 0.32, 1.10), (-1.3, 0.92, 0.30, 1.10), (1.00, 0.92, 0.30, 1.08),
            (2.05, 0.89, 0.32, 0.98), (2.3, 0.76, 0.42, 0.80)],
}  # fmt: skip
"""Stations along the body of each shape: y, half width, sill, top (m)."""
_CABINS: dict[str, list[tuple[float, float, float, float, float]]] = {
    "sedan": [(-1.82, 0.76, 0.94, 0.72, 0.97), (-1.20, 0.81, 0.94, 0.63, 1.42), (0.10, 0.81, 0.93, 0.63, 1.46),
              (1.02, 0.80, 0.92, 0.74, 0.95)],
    "hatch": [(-2.00, 0.76, 0.98, 0.70, 1.02), (-1.72, 0.79, 0.97, 0.63, 1.44), (0.15, 0.79, 0.95, 0.63, 1.49),
              (1.08, 0.78, 0.94, 0.72, 0.97)],
    "suv": [(-2.22, 0.80, 1.09, 0.74, 1.14), (-1.98, 0.84, 1.09, 0.70, 1.70), (0.20, 0.84, 1.08, 0.70, 1.74),
            (1.02, 0.83, 1.07, 0.76, 1.10)],
}  # fmt: skip
"""Stations of the cabin of each shape: y, half width and height of its foot, half width and height of its roof (m)."""
SHAPES = tuple(_BODIES)


@cache
def motorcar(shape: str, paint: int) -> Mesh:
    """Return a `sedan`, `hatch` or `suv` in one of `PAINTS`; about 400 triangles."""
    return _motorcar(shape, PAINTS[paint % len(PAINTS)])


@cache
def taxi() -> Mesh:
    """Return a yellow sedan with a sign on its roof."""
    return merge(_motorcar("sedan", YELLOW), box((0.0, -0.5, 1.53), (0.5, 0.2, 0.14), WHITE))


def _motorcar(shape: str, colour: LinearRgb) -> Mesh:
    stations, cabin = _BODIES[shape], _CABINS[shape]
    lower = [
        (y, [(-0.93 * h, sill), (-h, 0.55 * sill + 0.45 * top), (-0.94 * h, top), (0.94 * h, top),
             (h, 0.55 * sill + 0.45 * top), (0.93 * h, sill)])
        for y, h, sill, top in stations
    ]  # fmt: skip
    upper = [(y, [(-foot, z0), (-roof, z1), (roof, z1), (foot, z0)]) for y, foot, z0, roof, z1 in cabin]
    nose, tail = stations[-1], stations[0]
    radius = 0.36 if shape == "suv" else 0.32
    track, axle = stations[2][1] - 0.11, 1.36
    return merge(
        shell(lower, colour, 0.6),
        shell(upper, colour, 0.6),
        *_glazing(cabin),
        *(wheel(x, y, radius, 0.21) for x in (-track, track) for y in (-axle, axle)),
        mirrored(box((0.52, nose[0] - 0.04, nose[3] - 0.02), (0.34, 0.10, 0.13), LAMP, 0.6)),
        mirrored(box((0.58, tail[0] + 0.03, tail[3] - 0.03), (0.28, 0.10, 0.14), TAIL, 0.4)),
        box((0.0, nose[0] + 0.01, nose[2] + 0.10), (0.9, 0.06, 0.16), BLACK),
        box((0.0, tail[0] - 0.01, tail[2] + 0.22), (0.52, 0.03, 0.12), WHITE),
        mirrored(box((cabin[2][1] + 0.10, 0.62, cabin[2][2] + 0.08), (0.16, 0.10, 0.12), colour, 0.5)),
    )


def _glazing(cabin: list[tuple[float, float, float, float, float]]) -> list[Mesh]:
    inside: Vector = (0.0, -0.4, 1.1)

    def across(at: int) -> list[Vector]:
        (y0, f0, _, _, z0), (y1, _, _, r1, z1) = (cabin[k] for k in ((0, 1) if at == 0 else (3, 2)))
        return [(-f0, y0, z0), (f0, y0, z0), (r1, y1, z1), (-r1, y1, z1)]

    panes = [pane(across(at), GLASS, 0.9, 0.88, away=inside) for at in (0, 1)]
    y0, y3 = cabin[0][0], cabin[3][0]
    (y1, f1, b1, r1, z1), (y2, f2, b2, r2, z2) = cabin[1:3]
    middle = 0.5 * (y1 + y2)
    for s in (-1.0, 1.0):
        for a, b in ((y0 * 0.65 + y1 * 0.35, middle), (middle, y3 * 0.68 + y2 * 0.32)):
            top_a, top_b = max(a, y1), min(b, y2)
            corners: list[Vector] = [(s * f1, a, b1), (s * f2, b, b2), (s * r2, top_b, z2), (s * r1, top_a, z1)]
            panes.append(pane(corners, GLASS, 0.9, 0.84, away=inside))
    return panes


def _axles(half: float, ys: tuple[float, ...], radius: float, width: float = 0.28) -> list[Mesh]:
    return [wheel(s * half, y, radius, width) for s in (-1.0, 1.0) for y in ys]


VAN_PAINTS: tuple[LinearRgb, ...] = ((0.76, 0.76, 0.74), (0.72, 0.47, 0.04), (0.06, 0.14, 0.34), (0.66, 0.66, 0.64))
"""Linear colours of vans (chosen)."""


@cache
def van(paint: int) -> Mesh:
    """Return a 5.9 m delivery van with a stripe along its sides."""
    colour = VAN_PAINTS[paint % len(VAN_PAINTS)]
    stripe: LinearRgb = (0.62, 0.10, 0.02) if paint % 2 == 0 else WHITE

    def section(y: float, low: float, high: float, half: float) -> tuple[float, list[tuple[float, float]]]:
        return y, [(-half, low), (-half, high - 0.12), (-half + 0.14, high), (half - 0.14, high), (half, high - 0.12),
                   (half, low)]  # fmt: skip

    body = [section(-2.95, 0.35, 2.58, 1.0), section(1.15, 0.30, 2.60, 1.03), section(1.75, 0.30, 2.30, 1.02),
            section(2.45, 0.30, 1.25, 0.98), section(2.95, 0.40, 1.02, 0.88)]  # fmt: skip
    inside: Vector = (0.0, 0.0, 1.2)
    side: list[Vector] = [(1.03, 1.0, 1.35), (1.0, 2.2, 1.35), (1.0, 1.80, 2.05), (1.03, 1.0, 2.15)]
    return merge(
        shell(body, colour, 0.4),
        pane([(-0.96, 2.42, 1.30), (0.96, 2.42, 1.30), (0.86, 1.78, 2.26), (-0.86, 1.78, 2.26)], GLASS, 0.9, 0.92,
             0.03, inside),
        mirrored(pane(side, GLASS, 0.9, 0.9, 0.02, inside)),
        mirrored(quad((1.045, -2.8, 1.25), (1.045, 0.8, 1.25), (1.045, 0.8, 1.62), (1.045, -2.8, 1.62), stripe)),
        mirrored(quad((0.98, -2.965, 1.6), (0.1, -2.965, 1.6), (0.1, -2.965, 2.3), (0.98, -2.965, 2.3), GLASS, 0.6)),
        mirrored(box((0.66, 2.93, 0.92), (0.32, 0.10, 0.20), LAMP, 0.6)),
        mirrored(box((0.92, -2.96, 1.2), (0.14, 0.06, 0.5), TAIL, 0.4)),
        box((0.0, 2.95, 0.52), (1.7, 0.12, 0.24), BLACK),
        *_axles(0.88, (-1.75, 1.75), 0.35, 0.24),
    )  # fmt: skip


BOX_PAINTS: tuple[LinearRgb, ...] = ((0.70, 0.70, 0.68), (0.30, 0.36, 0.42), (0.42, 0.26, 0.10), (0.08, 0.20, 0.30))
"""Linear colours of the boxes of trucks (chosen)."""


@cache
def truck(paint: int) -> Mesh:
    """Return a 9 m box truck with a cab and a box of different colours."""
    cab: LinearRgb = ((0.55, 0.05, 0.04), (0.70, 0.70, 0.68), (0.06, 0.16, 0.36), (0.75, 0.75, 0.73))[paint % 4]
    cargo = BOX_PAINTS[paint % len(BOX_PAINTS)]
    return merge(
        box((0.0, -1.15, 2.22), (2.5, 6.6, 2.65), cargo, 0.15),
        *(box((s * 1.252, -1.15, 2.22), (0.02, 6.3, 0.10), GREY) for s in (-1.0, 1.0)),
        box((0.0, -0.9, 0.72), (1.1, 7.0, 0.28), BLACK),
        _cab(3.45, 2.05, 2.4, 2.75, cab),
        mirrored(box((0.9, -4.46, 0.95), (0.35, 0.06, 0.18), TAIL, 0.4)),
        box((0.0, -4.44, 0.62), (2.3, 0.10, 0.18), GREY),
        *_axles(1.05, (-3.1, -2.0, 3.2), 0.48),
    )


def _cab(y: float, length: float, width: float, top: float, colour: LinearRgb) -> Mesh:
    front, back, half = y + length / 2, y - length / 2, width / 2

    def section(at: float, high: float) -> tuple[float, list[tuple[float, float]]]:
        return at, [(-half, 0.45), (-half, high - 0.1), (-half + 0.1, high), (half - 0.1, high), (half, high - 0.1),
                    (half, 0.45)]  # fmt: skip

    inside: Vector = (0.0, y, 1.2)
    base = top - 1.15
    side: list[Vector] = [(half, back + 0.5, base), (half, front - 0.1, base), (half, front - 0.2, top - 0.25),
                         (half, back + 0.5, top - 0.25)]  # fmt: skip
    return merge(
        shell([section(back, top), section(front - 0.18, top), section(front, base), section(front, 0.9)], colour, 0.5),
        pane([(-half, front, base), (half, front, base), (half - 0.05, front - 0.17, top - 0.1),
              (0.05 - half, front - 0.17, top - 0.1)], GLASS, 0.9, 0.9, 0.02, inside),
        mirrored(pane(side, GLASS, 0.9, 0.94, 0.01, inside)),
        box((0.0, front + 0.03, 1.0), (width * 0.7, 0.06, 0.4), BLACK),
        mirrored(box((half - 0.3, front + 0.04, 0.72), (0.36, 0.08, 0.2), LAMP, 0.6)),
        box((0.0, front + 0.06, 0.5), (width, 0.14, 0.26), GREY),
        mirrored(box((half + 0.14, front - 0.15, top - 0.65), (0.14, 0.1, 0.45), BLACK)),
    )  # fmt: skip


BUS_PAINTS: tuple[LinearRgb, ...] = ((0.08, 0.30, 0.22), (0.66, 0.66, 0.64), (0.55, 0.06, 0.05))
"""Linear colours of buses (chosen)."""


@cache
def bus(paint: int) -> Mesh:
    """Return a 12 m city bus with a band of windows."""
    colour = BUS_PAINTS[paint % len(BUS_PAINTS)]
    bars = [box((s * 1.285, y, 2.0), (0.02, 0.12, 1.0), colour) for s in (-1.0, 1.0) for y in (-4.4, -2.2, 0.0, 2.2)]
    return merge(
        box((0.0, 0.0, 1.65), (2.55, 12.0, 2.6), colour, 0.4),
        box((0.0, 0.0, 2.0), (2.57, 11.7, 0.95), GLASS, 0.9),
        box((0.0, 0.02, 1.95), (2.35, 12.02, 1.5), GLASS, 0.9),
        *bars,
        box((0.0, 0.0, 2.98), (2.45, 11.8, 0.08), WHITE),
        box((0.0, -2.5, 3.05), (1.7, 2.6, 0.22), (0.5, 0.5, 0.5)),
        box((0.0, 2.6, 3.04), (1.5, 1.8, 0.18), (0.5, 0.5, 0.5)),
        box((0.0, 6.02, 2.75), (1.7, 0.06, 0.3), (0.5, 0.25, 0.02)),
        *(box((1.288, y, 1.45), (0.02, 1.25, 2.1), GLASS, 0.7) for y in (4.6, -0.6)),
        mirrored(box((0.95, 6.02, 0.75), (0.4, 0.06, 0.22), LAMP, 0.6)),
        mirrored(box((1.05, -6.02, 1.0), (0.25, 0.06, 0.5), TAIL, 0.4)),
        *_axles(1.08, (-3.4, 3.6), 0.48),
    )


@cache
def fire_truck() -> Mesh:
    """Return a red fire engine with white stripes, roller shutters, a ladder on its roof and a bar of blue lights."""
    rails = [box((0.45 + s * 0.26, -1.1, 3.2), (0.07, 6.2, 0.12), (0.62, 0.63, 0.64), 0.5) for s in (-1.0, 1.0)]
    rungs = [box((0.45, -4.0 + 0.58 * k, 3.2), (0.5, 0.06, 0.05), (0.62, 0.63, 0.64), 0.5) for k in range(11)]
    shutters = [
        box((s * 1.252, y, 1.75), (0.03, 1.45, 1.5), (0.55, 0.56, 0.58), 0.4)
        for s in (-1.0, 1.0) for y in (-3.3, -1.6, 0.1)
    ]  # fmt: skip
    return merge(
        box((0.0, -1.55, 1.85), (2.5, 5.4, 2.5), FIRE_RED, 0.5),
        _cab(2.75, 3.0, 2.5, 2.95, FIRE_RED),
        *shutters,
        *(box((s * 1.255, -0.2, 0.86), (0.03, 8.0, 0.26), WHITE) for s in (-1.0, 1.0)),
        *(box((s * 1.262, -0.2, 0.86), (0.03, 8.0, 0.09), YELLOW) for s in (-1.0, 1.0)),
        box((0.0, -1.55, 3.11), (2.3, 5.2, 0.03), (0.42, 0.43, 0.44)),
        *rails,
        *rungs,
        cylinder((-0.7, -3.6, 3.22), (-0.7, 0.4, 3.22), (0.13, 0.13), (0.10, 0.10, 0.11), sides=7),
        box((0.0, 3.35, 3.0), (1.9, 0.34, 0.08), GREY),
        *(box((s * 0.66, 3.35, 3.11), (0.55, 0.30, 0.18), BLUE_LIGHT, 0.8) for s in (-1.0, 1.0)),
        *(box((s * 1.05, -4.15, 3.14), (0.22, 0.22, 0.16), BLUE_LIGHT, 0.8) for s in (-1.0, 1.0)),
        box((0.0, -4.28, 1.7), (1.9, 0.05, 1.7), (0.55, 0.56, 0.58), 0.4),
        mirrored(box((1.1, -4.27, 0.75), (0.26, 0.06, 0.4), TAIL, 0.4)),
        box((0.0, -0.5, 0.62), (2.0, 7.2, 0.3), BLACK),
        *_axles(1.08, (-2.5, 2.75), 0.52, 0.32),
    )


def _rider(y: float, seat: float, hands: Vector, coat: LinearRgb, head: LinearRgb, skin: LinearRgb) -> list[Mesh]:
    hip: Vector = (0.0, y, seat)
    shoulder: Vector = (0.0, y + 0.22, seat + 0.50)
    parts = [
        cylinder(hip, shoulder, (0.15, 0.20), coat, sides=7),
        ellipsoid((0.0, y + 0.27, seat + 0.72), (0.12, 0.13, 0.15), head, rows=4, sides=7),
        ellipsoid((0.0, y + 0.34, seat + 0.69), (0.08, 0.08, 0.10), skin, rows=3, sides=6),
    ]
    for s in (-1.0, 1.0):
        parts.append(limb((s * 0.19, y + 0.22, seat + 0.46), (s * hands[0], hands[1], hands[2]), (0.06, 0.045), coat))
        knee: Vector = (s * 0.17, y + 0.40, seat - 0.10)
        parts.append(limb((s * 0.10, y, seat), knee, (0.085, 0.07), (0.06, 0.07, 0.10)))
        parts.append(limb(knee, (s * 0.14, y + 0.22, seat - 0.52), (0.06, 0.05), (0.06, 0.07, 0.10)))
    return parts


@cache
def motorcycle(paint: int) -> Mesh:
    """Return a motor scooter with a helmeted rider."""
    colour: LinearRgb = ((0.45, 0.04, 0.03), (0.05, 0.14, 0.35), (0.70, 0.70, 0.68))[paint % 3]
    coat: LinearRgb = ((0.08, 0.10, 0.16), (0.72, 0.50, 0.03), (0.20, 0.20, 0.20))[paint % 3]
    return merge(
        wheel(0.0, -0.68, 0.28, 0.13), wheel(0.0, 0.68, 0.28, 0.13),
        box((0.0, -0.45, 0.62), (0.30, 0.95, 0.26), colour, 0.4),
        box((0.0, 0.0, 0.34), (0.36, 0.55, 0.08), BLACK),
        box((0.0, 0.45, 0.68), (0.36, 0.12, 0.62), colour, 0.4),
        box((0.0, 0.42, 1.02), (0.66, 0.05, 0.05), BLACK),
        box((0.0, 0.54, 0.90), (0.18, 0.06, 0.14), LAMP, 0.6),
        box((0.0, -0.35, 0.78), (0.28, 0.62, 0.08), BLACK),
        box((0.0, -0.82, 0.98), (0.38, 0.36, 0.34), coat),
        *_rider(-0.22, 0.82, (0.28, 0.38, 1.04), coat, (WHITE, RED, BLACK)[paint % 3], SKINS[paint % len(SKINS)]),
    )  # fmt: skip


@cache
def bicycle(paint: int) -> Mesh:
    """Return a bicycle with its rider."""
    coat: LinearRgb = ((0.10, 0.26, 0.34), (0.52, 0.06, 0.05), (0.66, 0.66, 0.62), (0.10, 0.28, 0.10))[paint % 4]
    return merge(
        *(cylinder((-0.03, y, 0.34), (0.03, y, 0.34), (0.33, 0.33), (0.07, 0.07, 0.075), sides=9)
          for y in (-0.52, 0.52)),
        limb((0.0, -0.52, 0.34), (0.0, -0.15, 0.85), (0.025, 0.025), CHROME, 4),
        limb((0.0, -0.10, 0.34), (0.0, 0.40, 0.82), (0.025, 0.025), CHROME, 4),
        limb((0.0, 0.52, 0.34), (0.0, 0.38, 1.02), (0.025, 0.025), CHROME, 4),
        box((0.0, 0.38, 1.03), (0.56, 0.04, 0.04), BLACK),
        box((0.0, -0.18, 0.90), (0.16, 0.26, 0.06), BLACK),
        *_rider(-0.18, 0.94, (0.26, 0.36, 1.05), coat, WOOD, SKINS[paint % len(SKINS)]),
    )  # fmt: skip
