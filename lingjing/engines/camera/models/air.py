"""Models of aircraft and satellites."""

from __future__ import annotations

from functools import cache
from math import cos, pi, radians, sin

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, flat, loft, merge, two_sided
from lingjing.engines.camera.models.palette import BLACK, GREY, ORANGE, WHITE
from lingjing.engines.camera.models.shapes import limb, mirrored, pane, quad, shell
from lingjing.mission.appearance import LinearRgb

GLASS: LinearRgb = (0.015, 0.02, 0.026)
"""Linear colour of glass (chosen)."""


@cache
def quadrotor() -> Mesh:
    """Return a quadrotor of 1 m; the origin is in its body, and its legs end 0.2 m below."""
    parts = [
        ellipsoid((0.0, 0.0, 0.03), (0.13, 0.19, 0.07), WHITE, 0.4),
        box((0.0, 0.0, 0.09), (0.12, 0.22, 0.05), GREY, 0.3),
        ellipsoid((0.0, 0.16, -0.05), (0.05, 0.05, 0.05), BLACK, 0.8),
    ]
    for k in range(4):
        angle = radians(45.0 + 90.0 * k)
        x, y = 0.34 * cos(angle), 0.34 * sin(angle)
        parts += [
            cylinder((0.08 * cos(angle), 0.08 * sin(angle), 0.03), (x, y, 0.03), (0.022, 0.018), BLACK, 0.2, sides=6),
            cylinder((x, y, 0.01), (x, y, 0.08), (0.03, 0.03), ORANGE if y > 0 else GREY, 0.2, sides=8),
            two_sided(flat([((x, y, 0.09), (x + 0.17 * cos(a), y + 0.17 * sin(a), 0.09),
                             (x + 0.17 * cos(a + 0.5), y + 0.17 * sin(a + 0.5), 0.09))
                            for a in (0.3 + k, 0.3 + k + pi)], BLACK)),
        ]  # fmt: skip
    for side in (-1.0, 1.0):
        parts += [
            cylinder((side * 0.10, 0.0, 0.0), (side * 0.17, 0.0, -0.19), (0.014, 0.012), BLACK, sides=5),
            cylinder((side * 0.17, -0.16, -0.19), (side * 0.17, 0.16, -0.19), (0.012, 0.012), BLACK, sides=5),
        ]
    return merge(*parts)


@cache
def fixed_wing() -> Mesh:
    """Return a single-engined high-winged aeroplane of 11 m span, its wheels 1.2 m below the origin."""
    red: LinearRgb = (0.55, 0.05, 0.04)

    def ring(y: float, half: float, low: float, high: float) -> tuple[float, list[tuple[float, float]]]:
        return y, [(-0.6 * half, low), (-half, 0.5 * (low + high)), (-0.6 * half, high), (0.6 * half, high),
                   (half, 0.5 * (low + high)), (0.6 * half, low), (-0.6 * half, low)]  # fmt: skip

    hull = [ring(-5.4, 0.10, 0.10, 0.35), ring(-2.0, 0.42, -0.35, 0.62), ring(-0.6, 0.55, -0.55, 0.95),
            ring(0.7, 0.55, -0.55, 0.95), ring(1.3, 0.52, -0.52, 0.40), ring(2.4, 0.36, -0.38, 0.25)]  # fmt: skip
    wing = [(-0.75, [(-5.5, 0.97), (5.5, 0.97)]), (-0.2, [(-5.5, 1.08), (5.5, 1.08)]),
            (0.55, [(-5.5, 1.12), (5.5, 1.12)]), (0.75, [(-5.5, 1.02), (5.5, 1.02)])]  # fmt: skip
    under = [(-0.75, [(-5.5, 0.96), (5.5, 0.96)]), (0.75, [(-5.5, 0.99), (5.5, 0.99)])]
    fin = [(0.0, -5.55, 0.2), (0.0, -4.5, 0.3), (0.0, -5.1, 1.55), (0.0, -5.7, 1.55)]
    blades = (0.5, 0.5 + pi)
    disc = [((0.0, 2.55, -0.05), *((0.95 * cos(b), 2.55, 0.95 * sin(b) - 0.05) for b in (a, a + 0.16))) for a in blades]
    return merge(
        shell(hull, WHITE, 0.5),
        loft(wing, WHITE, 0.4),
        loft(under, (0.6, 0.6, 0.6)),
        mirrored(box((5.3, 0.0, 1.05), (0.4, 1.3, 0.13), red)),
        box((0.0, -4.95, 0.33), (3.4, 0.85, 0.06), WHITE, 0.4),
        two_sided(quad(fin[0], fin[1], fin[2], fin[3], red)),
        mirrored(pane([(0.56, -0.5, 0.30), (0.56, 0.65, 0.30), (0.40, 0.65, 0.85), (0.40, -0.5, 0.85)], GLASS, 0.9)),
        pane([(-0.5, 1.28, 0.42), (0.5, 1.28, 0.42), (0.33, 0.74, 0.92), (-0.33, 0.74, 0.92)], GLASS, 0.9, 0.95, 0.02),
        mirrored(box((0.545, -1.6, 0.1), (0.02, 3.2, 0.12), red)),
        mirrored(limb((0.5, 0.2, -0.4), (2.6, 0.2, 0.98), (0.05, 0.05), WHITE, 5)),
        mirrored(limb((0.4, -0.3, -0.45), (1.15, -0.3, -1.05), (0.06, 0.05), WHITE, 5)),
        *(cylinder((x, y, -1.0), (x + 0.14, y, -1.0), (0.2, 0.2), BLACK, sides=9)
          for x, y in ((1.1, -0.3), (-1.24, -0.3), (-0.07, 1.7))),
        limb((0.0, 1.7, -0.4), (0.0, 1.7, -1.0), (0.06, 0.06), WHITE, 5),
        ellipsoid((0.0, 2.5, -0.05), (0.16, 0.3, 0.16), red, rows=4, sides=8),
        two_sided(flat(disc, BLACK)),
    )  # fmt: skip


@cache
def satellite() -> Mesh:
    """Return a bus in gold foil with two solar wings and a dish towards the ground."""
    gold, cells = (0.62, 0.42, 0.10), (0.02, 0.04, 0.16)
    return merge(
        box((0.0, 0.0, 0.0), (1.2, 1.2, 1.6), gold, 0.8),
        *(box((s * 3.3, 0.0, 0.0), (4.6, 1.3, 0.05), cells, 0.9) for s in (-1.0, 1.0)),
        *(box((s * (1.6 + 1.1 * k), 0.0, 0.0), (0.05, 1.32, 0.07), WHITE) for s in (-1.0, 1.0) for k in range(4)),
        cylinder((0.0, 0.0, -1.25), (0.0, 0.0, -0.8), (0.6, 0.15), WHITE, 0.4, sides=12),
    )
