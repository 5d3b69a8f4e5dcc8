"""Road vehicles: cars in several shapes and colours, van, truck, bus, fire truck, motorcycle and bicycle with riders.

Cars, van and truck are stored models (`stored`), the others are built here.

The origin is the middle of the footprint on the ground. Dimensions are those of `scene.sizes.SIZES`.
"""

from __future__ import annotations

from functools import cache

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, merge
from lingjing.engines.camera.models.palette import BLACK, GREY, RED, SKINS, WHITE, WOOD, YELLOW
from lingjing.engines.camera.models.shapes import limb, mirrored, pane, shell, wheel
from lingjing.engines.camera.models.stored import stored
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

SHAPES = ("sedan", "hatch", "suv")
"""Shapes of cars."""


def motorcar(shape: str, paint: int) -> Mesh:
    """Return a `sedan`, `hatch` or `suv` in one of `PAINTS`."""
    return stored(shape, PAINTS[paint % len(PAINTS)])


@cache
def taxi() -> Mesh:
    """Return a yellow sedan with a sign on its roof."""
    return merge(stored("sedan", YELLOW), box((0.0, -0.4, 1.52), (0.5, 0.2, 0.14), WHITE))


def _axles(half: float, ys: tuple[float, ...], radius: float, width: float = 0.28) -> list[Mesh]:
    return [wheel(s * half, y, radius, width) for s in (-1.0, 1.0) for y in ys]


VAN_PAINTS: tuple[LinearRgb, ...] = ((0.76, 0.76, 0.74), (0.72, 0.47, 0.04), (0.06, 0.14, 0.34), (0.66, 0.66, 0.64))
"""Linear colours of vans (chosen)."""


def van(paint: int) -> Mesh:
    """Return a 5.9 m delivery van."""
    return stored("van", VAN_PAINTS[paint % len(VAN_PAINTS)])


BOX_PAINTS: tuple[LinearRgb, ...] = ((0.70, 0.70, 0.68), (0.30, 0.36, 0.42), (0.42, 0.26, 0.10), (0.08, 0.20, 0.30))
"""Linear colours of the boxes of trucks (chosen)."""


CAB_PAINTS: tuple[LinearRgb, ...] = ((0.55, 0.05, 0.04), (0.70, 0.70, 0.68), (0.06, 0.16, 0.36), (0.75, 0.75, 0.73))
"""Linear colours of the cabs of trucks (chosen)."""


def truck(paint: int) -> Mesh:
    """Return a 9 m box truck with a cab and a box of different colours."""
    return stored("truck", CAB_PAINTS[paint % len(CAB_PAINTS)], BOX_PAINTS[paint % len(BOX_PAINTS)])


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
