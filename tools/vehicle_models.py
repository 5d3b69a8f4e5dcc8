"""Make the models of road vehicles: `lingjing/engines/camera/models/vehicles.npz`, which `models.stored` reads.

A vehicle is a *skin* and *patches*. The skin is a loft along y: its centre line is a side profile, its half width is a
plan times a flank (a factor by height), its lower edge rises over the wheels. Patches (windows, lamps, grille, bumper,
plates, door lines) are outlines that are projected onto the skin from ahead, astern or the side, and lifted off it. So
they follow its curves and have its smooth normals. Each model has three levels of detail.

`python tools/vehicle_models.py` writes the file anew, the same bytes each time.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from model_lofts import Curve, Projector, Skin, Soup, at, box, egg, narrow_wheel, packed, rect, rod, skinned, wheel

from lingjing.engines.camera.models import skeleton
from lingjing.engines.camera.models.stored import FOLDER, LEVELS, MATERIALS


@dataclass(frozen=True)
class Car:
    """A motorcar by its side profile."""

    skin: Skin
    wheel: float
    """Radius of the wheels."""
    track: float
    """Distance of the wheels' outer sides from the middle."""
    windows: tuple[tuple[tuple[float, float], ...], ...]
    """Side windows: corners (y, z)."""
    screen: tuple[tuple[float, float], ...]
    """Windscreen seen from ahead: corners (x, z)."""
    rear: tuple[tuple[float, float], ...]
    """Rear window seen from astern: corners (x, z)."""
    doors: tuple[float, ...]
    """Places of the door lines along y."""
    belt: float
    """Height of the belt line at the doors."""
    nose: float
    """Height of the lamps in front."""
    tail: float
    """Height of the lamps astern."""
    tall_tail: bool = False
    """True for upright rear lamps."""


def motorcar(car: Car, level: int) -> Soup:
    """Return a car at a level of detail."""
    body = skinned(car.skin, level)
    on, fine = Projector(skinned(car.skin, 0)), level == 0
    cut = ((4, 3), (2, 2), (1, 1))[level]
    made = body
    for window in car.windows:
        made += on.patch("right", window, "glass", 0.008, cut).mirrored()
    made += on.patch("front", car.screen, "glass", 0.008, ((6, 4), (4, 2), (2, 1))[level])
    made += on.patch("back", car.rear, "glass", 0.008, ((6, 3), (4, 2), (2, 1))[level])
    half = float(at(car.skin.plan, np.array(car.skin.profile[-1][0])))
    made += on.patch("front", lamp(half, car.nose, 0.145), "lamp", 0.012, cut).mirrored()
    end = float(at(car.skin.plan, np.array(car.skin.profile[0][0] + 0.05)))
    tails = (
        rect(end * 0.74, end * 1.0, car.tail - 0.16, car.tail + 0.18)
        if car.tall_tail
        else rect(end * 0.58, end * 1.02, car.tail - 0.075, car.tail + 0.075)
    )
    made += on.patch("back", tails, "tail", 0.012, cut).mirrored()
    made += on.patch("front", rect(-0.52 * half, 0.52 * half, car.nose - 0.10, car.nose + 0.035), "black", 0.012, cut)
    made += on.patch(
        "front", rect(-0.62 * half, 0.62 * half, car.skin.low + 0.07, car.skin.low + 0.20), "black", 0.01, cut
    )
    made += on.patch(
        "back", rect(-0.85 * half, 0.85 * half, car.skin.low + 0.03, car.skin.low + 0.17), "black", 0.01, cut
    )
    made += on.patch("back", rect(-0.26, 0.26, car.tail - 0.20, car.tail - 0.09), "plate", 0.02, (1, 1))
    if level < 2:
        made += on.patch("front", rect(-0.26, 0.26, car.nose - 0.25, car.nose - 0.14), "plate", 0.02, (1, 1))
        made += on.patch("back", rect(-0.40, 0.40, car.tail - 0.085, car.tail - 0.065), "chrome", 0.018, (2, 1))
        made += on.patch(
            "back", rect(-0.92 * end, 0.92 * end, car.tail - 0.235, car.tail - 0.222), "seam", 0.01, (4, 1)
        )
        made += on.patch("back", rect(0.62 * end, 0.80 * end, car.skin.low + 0.19, car.skin.low + 0.23), "tail", 0.012,
                         (1, 1)).mirrored()  # fmt: skip
        made += mirror(car)
        sill = [(car.skin.axles[0] + car.skin.arch + 0.03, car.skin.low),
                (car.skin.axles[1] - car.skin.arch - 0.03, car.skin.low),
                (car.skin.axles[1] - car.skin.arch - 0.03, car.skin.low + 0.07),
                (car.skin.axles[0] + car.skin.arch + 0.03, car.skin.low + 0.07)]  # fmt: skip
        made += on.patch("right", sill, "black", 0.006, (2, 1)).mirrored()
    if fine:
        for y in car.doors:
            made += on.patch(
                "right", rect(y - 0.010, y + 0.010, car.skin.low + 0.08, car.belt), "seam", 0.004, (1, 5)
            ).mirrored()
        for y in car.doors[1:]:
            made += on.patch(
                "right", rect(y + 0.06, y + 0.24, car.belt - 0.13, car.belt - 0.095), "chrome", 0.02, (1, 1)
            ).mirrored()
        made += on.patch(
            "front", rect(-0.40 * half, 0.40 * half, car.nose - 0.045, car.nose - 0.02), "chrome", 0.016, (3, 1)
        )
    for y in car.skin.axles:
        made += wheel(car.wheel, 0.21, level).moved(car.track, y, car.wheel).mirrored()
    return made


def lamp(half: float, z: float, tall: float) -> list[tuple[float, float]]:
    """Return the outline of a right headlamp that rises towards the side."""
    return [
        (half * 0.60, z - 0.4 * tall),
        (half * 1.06, z - 0.25 * tall),
        (half * 1.10, z + 0.65 * tall),
        (half * 0.60, z + 0.35 * tall),
    ]


def mirror(car: Car) -> Soup:
    """Return both outside mirrors."""
    window = car.windows[-1]
    y = max(corner[0] for corner in window) - 0.22
    wide = float(at(car.skin.plan, np.array(y))) * float(at(car.skin.flank, np.array(car.belt)))
    return box((wide + 0.09, y, car.belt + 0.07), (0.20, 0.11, 0.14), "paint", 0.03).mirrored()


FLANK: Curve = ((0.15, 0.93), (0.34, 0.985), (0.55, 1.0), (0.78, 0.985), (0.90, 0.945), (0.96, 0.915), (1.46, 0.70))
"""The flank of a low car."""

SEDAN = Car(
    skin=Skin(
        profile=((-2.25, 0.62), (-2.22, 0.80), (-2.14, 0.95), (-2.0, 1.00), (-1.66, 1.03), (-1.50, 1.08),
                 (-1.0, 1.33), (-0.75, 1.405),
                 (-0.40, 1.44), (0.0, 1.445), (0.25, 1.41), (0.42, 1.355), (1.10, 0.985), (1.22, 0.94),
                 (1.75, 0.865), (2.05, 0.77),
                 (2.18, 0.68), (2.25, 0.55)),
        plan=((-2.25, 0.72), (-2.19, 0.80), (-2.0, 0.855), (-1.4, 0.895), (0.0, 0.90), (1.3, 0.895), (1.85, 0.85),
              (2.10, 0.77), (2.25, 0.62)),
        flank=FLANK, low=0.21, axles=(-1.33, 1.38), arch=0.39, hub=0.32, corner=0.11,
    ),
    wheel=0.32, track=0.88,
    windows=(((-1.32, 0.985), (-0.93, 0.975), (-0.90, 1.33), (-1.02, 1.28)), ((-0.86, 0.975), (-0.14, 0.965),
                                                                              (-0.14, 1.365), (-0.82, 1.345)),
             ((-0.05, 0.965), (0.88, 0.955), (0.40, 1.285), (-0.05, 1.365))),
    screen=((-0.70, 1.0), (0.70, 1.0), (0.55, 1.385), (-0.55, 1.385)),
    rear=((-0.66, 1.10), (0.66, 1.10), (0.52, 1.37), (-0.52, 1.37)),
    doors=(-0.92, -0.10, 0.98), belt=0.93, nose=0.635, tail=0.80,
)  # fmt: skip
HATCH = Car(
    skin=Skin(
        profile=((-2.05, 0.60), (-2.03, 0.85), (-1.98, 1.02), (-1.88, 1.22), (-1.74, 1.41), (-1.60, 1.465),
                 (-1.0, 1.50), (-0.2, 1.51),
                 (0.15, 1.475), (0.34, 1.42), (1.05, 1.02), (1.18, 0.97), (1.60, 0.88), (1.88, 0.79), (2.0, 0.70),
                 (2.06, 0.56)),
        plan=((-2.05, 0.74), (-2.0, 0.80), (-1.8, 0.85), (-1.2, 0.88), (0.0, 0.885), (1.2, 0.88), (1.65, 0.84),
              (1.92, 0.76), (2.06, 0.62)),
        flank=((0.15, 0.93), (0.34, 0.985), (0.55, 1.0), (0.80, 0.985), (0.93, 0.945), (0.99, 0.92), (1.52, 0.73)),
        low=0.21, axles=(-1.25, 1.26), arch=0.39, hub=0.32, corner=0.11,
    ),
    wheel=0.32, track=0.865,
    windows=(((-1.72, 1.06), (-1.10, 1.0), (-1.06, 1.40), (-1.56, 1.38)), ((-1.0, 1.0), (-0.24, 0.99),
                                                                           (-0.24, 1.425), (-0.96, 1.41)),
             ((-0.14, 0.99), (0.83, 0.985), (0.32, 1.34), (-0.14, 1.425))),
    screen=((-0.70, 1.035), (0.70, 1.035), (0.56, 1.45), (-0.56, 1.45)),
    rear=((-0.63, 1.09), (0.63, 1.09), (0.54, 1.40), (-0.54, 1.40)),
    doors=(-1.06, -0.19, 0.93), belt=0.95, nose=0.67, tail=0.90, tall_tail=True,
)  # fmt: skip
SUV = Car(
    skin=Skin(
        profile=((-2.3, 0.66), (-2.29, 0.90), (-2.24, 1.06), (-2.12, 1.18), (-1.96, 1.40), (-1.82, 1.55),
                 (-1.66, 1.615), (-1.1, 1.65), (-0.2, 1.66),
                 (0.12, 1.63), (0.30, 1.575), (0.94, 1.17), (1.08, 1.12), (1.6, 1.05), (2.0, 0.97), (2.18, 0.87),
                 (2.3, 0.66)),
        plan=((-2.3, 0.78), (-2.24, 0.84), (-2.0, 0.88), (-1.2, 0.905), (0.0, 0.91), (1.2, 0.905), (1.8, 0.875),
              (2.12, 0.81), (2.3, 0.68)),
        flank=((0.25, 0.95), (0.46, 0.99), (0.70, 1.0), (0.95, 0.985), (1.06, 0.95), (1.13, 0.925), (1.70, 0.765)),
        low=0.30, axles=(-1.36, 1.36), arch=0.45, hub=0.37, corner=0.11,
    ),
    wheel=0.37, track=0.90,
    windows=(((-1.84, 1.19), (-1.18, 1.14), (-1.15, 1.555), (-1.62, 1.51)), ((-1.08, 1.14), (-0.24, 1.13),
                                                                           (-0.24, 1.575), (-1.05, 1.565)),
             ((-0.14, 1.13), (0.76, 1.125), (0.28, 1.475), (-0.14, 1.575))),
    screen=((-0.73, 1.19), (0.73, 1.19), (0.60, 1.59), (-0.60, 1.59)),
    rear=((-0.72, 1.20), (0.72, 1.20), (0.60, 1.545), (-0.60, 1.545)),
    doors=(-1.13, -0.19, 0.90), belt=1.09, nose=0.86, tail=0.99, tall_tail=True,
)  # fmt: skip
VAN = Car(
    skin=Skin(
        profile=((-2.95, 0.60), (-2.94, 2.30), (-2.90, 2.50), (-2.75, 2.565), (-1.5, 2.58), (1.0, 2.57),
                 (1.25, 2.50), (1.42, 2.38), (2.18, 1.40),
                 (2.30, 1.29), (2.70, 1.14), (2.86, 1.0), (2.95, 0.62)),
        plan=((-2.95, 0.96), (-2.88, 1.0), (-2.0, 1.02), (1.6, 1.02), (2.2, 0.97), (2.6, 0.90), (2.82, 0.80),
              (2.95, 0.66)),
        flank=((0.2, 0.96), (0.5, 1.0), (1.1, 1.0), (1.25, 0.985), (2.0, 0.93), (2.6, 0.87)),
        low=0.30, axles=(-1.80, 1.82), arch=0.44, hub=0.35, corner=0.14, crown=0.02,
    ),
    wheel=0.35, track=1.0,
    windows=(((0.95, 1.34), (1.98, 1.32), (1.42, 2.02), (0.95, 2.06)),),
    screen=((-0.84, 1.42), (0.84, 1.42), (0.74, 2.32), (-0.74, 2.32)),
    rear=((-0.72, 1.45), (0.72, 1.45), (0.66, 2.15), (-0.66, 2.15)),
    doors=(-0.55, 0.78, 2.02), belt=1.25, nose=0.92, tail=1.10, tall_tail=True,
)  # fmt: skip

CAB = Car(
    skin=Skin(
        profile=((2.40, 2.36), (2.46, 2.52), (2.58, 2.60), (3.60, 2.59), (3.86, 2.52), (4.02, 2.38), (4.36, 1.62),
                 (4.42, 1.45), (4.48, 0.62)),
        plan=((2.40, 1.08), (3.8, 1.10), (4.2, 1.08), (4.38, 1.02), (4.48, 0.90)),
        flank=((0.4, 0.97), (0.7, 1.0), (1.5, 1.0), (1.7, 0.985), (2.60, 0.88)),
        low=0.50, axles=(3.52,), arch=0.58, hub=0.48, corner=0.14, crown=0.02,
    ),
    wheel=0.50, track=1.12,
    windows=(((2.98, 1.66), (3.62, 1.66), (3.62, 2.31), (2.98, 2.31)),
             ((3.62, 1.66), (4.16, 1.52), (3.90, 2.26), (3.62, 2.31))),
    screen=((-1.00, 1.56), (1.00, 1.56), (0.94, 2.44), (-0.94, 2.44)),
    rear=((-0.5, 1.8), (0.5, 1.8), (0.5, 2.3), (-0.5, 2.3)),
    doors=(2.86, 4.21), belt=1.31, nose=0.94, tail=1.2,
)  # fmt: skip
"""The cab of a truck, a car without a back: low over its wheels, which stand under its doors."""


def van_body(level: int) -> Soup:
    """Return a van with a sliding door, rear doors and rubbing strips."""
    made = motorcar(VAN, level)
    on = Projector(skinned(VAN.skin, 0))
    if level < 2:
        made += on.patch("right", rect(-1.33, 1.35, 0.62, 0.74), "black", 0.012, (6, 1)).mirrored()
        made += on.patch("back", rect(-0.012, 0.012, 0.65, 2.35), "seam", 0.012, (1, 3))
    if level == 0:
        made += on.patch("right", rect(-2.6, 0.7, 1.60, 1.63), "seam", 0.006, (4, 1)).mirrored()
        made += on.patch("right", rect(-2.75, -2.73, 0.6, 2.3), "seam", 0.006, (1, 4)).mirrored()
        made += on.patch("front", rect(-0.55, 0.55, 1.0, 1.05), "black", 0.012, (4, 1))
    return made


@dataclass(frozen=True)
class Load:
    """The box on a truck behind its cab; metres."""

    rear: float
    """Place of the rear end along y."""
    axles: tuple[float, ...]
    """Places of the rear axles along y."""
    low: float
    """Height of the floor."""
    high: float
    """Height of the top."""


LONG_LOAD = Load(-3.65, (-0.45,), 1.02, 3.12)
SHORT_LOAD = Load(-3.08, (-0.15,), 1.02, 3.15)
FRONT = 2.25
"""Place of the front end of a load along y, metres: close behind the cab."""
NOSE = 4.57
"""Place of a truck's front bumper along y, metres."""


def box_truck(level: int, load: Load) -> Soup:
    """Return a truck: a cab over the engine, a chassis with tank, steps and wheels, and a box between rails and posts.

    A low box close behind the cab, with much of its length behind the rear wheels, is what a detector takes for a truck
    from the side. A box 0.2 m higher, or rear wheels 0.5 m farther back, lower its score by a twentieth or more.
    """
    on, cut = Projector(skinned(CAB.skin, 0)), ((4, 3), (2, 2), (1, 1))[level]
    made = skinned(CAB.skin, level)
    for window in CAB.windows:
        made += on.patch("right", window, "glass", 0.01, cut).mirrored()
    made += on.patch("front", CAB.screen, "glass", 0.01, ((8, 4), (4, 2), (2, 1))[level])
    made += on.patch("front", rect(-0.72, 0.72, 1.00, 1.30), "black", 0.015, cut)
    made += on.patch("front", rect(0.50, 1.02, 0.82, 1.06), "lamp", 0.02, cut).mirrored()
    made += on.patch("right", [(4.24, 0.88), (4.44, 0.86), (4.42, 1.08), (4.28, 1.06)], "black", 0.02,
                     (2, 1)).mirrored()  # fmt: skip
    made += box((0.0, 4.42, 0.60), (2.24, 0.30, 0.36), "bumper", 0.05)
    for start, end, high in ((4.11, 4.40, 0.80), (2.42, 2.93, 0.92)):
        made += on.patch("right", rect(start, end, 0.52, high), "bumper", 0.012, (2, 2)).mirrored()
    middle, length = 0.5 * (load.rear + FRONT), FRONT - load.rear
    half, tall = 0.5 * (load.low + load.high), load.high - load.low
    made += box((0.0, middle, half), (2.40, length, tall), "cargo")
    made += box((1.205, middle, load.low + 0.10), (0.09, length, 0.20), "cargo").mirrored()
    made += box((1.205, middle, load.high - 0.06), (0.09, length + 0.02, 0.12), "cargo").mirrored()
    for y in (load.rear + 0.05, FRONT - 0.05):
        made += box((1.20, y, half), (0.03, 0.09, tall - 0.3), "bumper").mirrored()
    made += box((0.0, load.rear, load.low + 0.10), (2.40, 0.06, 0.20), "chrome")
    made += box((0.0, middle + 0.3, 0.86), (0.9, length + 0.6, 0.26), "under")
    made += box((0.0, FRONT + 0.1, 0.95), (1.9, 0.40, 0.50), "under")
    made += box((1.06, load.rear + 0.05, 0.84), (0.30, 0.06, 0.16), "tail").mirrored()
    made += box((0.0, load.rear + 0.05, 0.56), (2.2, 0.10, 0.12), "bumper")
    if level < 2:
        made += truck_details(on, level, load)
    for y in (*load.axles, *CAB.skin.axles):
        made += dark_wheel(CAB.wheel, level).moved(CAB.track, y, CAB.wheel).mirrored()
    return made.moved(0.0, -0.5 * (NOSE + load.rear), 0.0)


def in_material(soup: Soup, old: Sequence[str], new: str) -> Soup:
    """Return triangles with some materials replaced by another."""
    which = np.isin(soup.materials, [MATERIALS.index(name) for name in old])
    return replace(soup, materials=np.where(which, MATERIALS.index(new), soup.materials).astype(np.uint8))


def dark_wheel(radius: float, level: int) -> Soup:
    """Return the wheel of a light truck: a wide tyre, a closed dark dish and a small hub."""
    made = in_material(wheel(radius, 0.30, level, 0.62), ("rim", "under"), "bumper")
    return made + rod((0.0, 0.0, 0.0), (0.03, 0.0, 0.0), (0.12, 0.11), "rim", (8, 6, 4)[level])


def heavy_wheel(radius: float, level: int) -> Soup:
    """Return the wheel of a truck: a wide tyre, a dark dish and a bright hub."""
    made = in_material(wheel(radius, 0.34, level, 0.56), ("rim",), "bumper")
    return made + box((0.0, 0.0, 0.0), (0.06, 0.26, 0.26), "rim", 0.05)


def truck_details(on: Projector, level: int, load: Load) -> Soup:
    """Return what only the finer levels of a truck show: mirrors, rear doors, tank, mudguards, plates."""
    made = box((1.25, 4.12, 1.95), (0.14, 0.10, 0.42), "black", 0.02).mirrored()
    made += rod((1.04, 4.05, 2.30), (1.25, 4.12, 2.15), (0.02, 0.02), "black", 4).mirrored()
    made += on.patch("front", rect(-0.26, 0.26, 0.58, 0.70), "plate", 0.12, (1, 1))
    half, tall = 0.5 * (load.low + load.high), load.high - load.low
    made += box((0.0, load.rear - 0.012, half), (0.03, 0.03, tall - 0.1), "black")
    made += box((0.35, load.rear - 0.018, half - 0.1), (0.03, 0.03, tall - 0.3), "chrome").mirrored()
    made += box((0.0, load.rear, load.high - 0.05), (2.40, 0.05, 0.10), "chrome")
    made += box((1.19, load.rear, half), (0.06, 0.06, tall), "chrome").mirrored()
    made += box((0.0, load.rear - 0.01, 0.84), (0.52, 0.03, 0.12), "plate")
    made += box((0.92, 1.30, 0.72), (0.30, 1.00, 0.34), "steel", 0.10).mirrored()
    for y in load.axles:
        made += box((0.98, y, 1.03), (0.40, 1.12, 0.04), "black").mirrored()
    made += box((0.98, min(load.axles) - 0.62, 0.74), (0.36, 0.03, 0.50), "black").mirrored()
    if level == 0:
        back, front = CAB.doors
        made += on.patch("right", rect(back - 0.01, back + 0.01, 0.95, 2.45), "seam", 0.006, (1, 5)).mirrored()
        made += on.patch("right", rect(front - 0.01, front + 0.01, 1.08, 1.48), "seam", 0.006, (1, 3)).mirrored()
        made += on.patch("right", rect(back, front, CAB.belt - 0.01, CAB.belt + 0.01), "seam", 0.006, (5, 1)).mirrored()
        made += on.patch("right", rect(2.95, 3.15, 1.38, 1.43), "black", 0.02, (1, 1)).mirrored()
        made += on.patch("front", rect(-0.60, 0.60, 1.13, 1.16), "chrome", 0.02, (3, 1))
        for x in (-0.5, 0.3):
            made += rod((x, 4.42, 1.60), (x + 0.45, 4.32, 1.92), (0.012, 0.010), "black", 4)
    return made


ESTATE = replace(
    SEDAN,
    skin=replace(
        SEDAN.skin,
        profile=((-2.32, 0.62), (-2.30, 0.86), (-2.25, 1.02), (-2.14, 1.22), (-1.98, 1.40), (-1.82, 1.47),
                 (-1.2, 1.505), (-0.4, 1.505), (0.0, 1.49), (0.25, 1.44), (0.42, 1.375), (1.10, 0.985), (1.22, 0.94),
                 (1.75, 0.865), (2.05, 0.77), (2.18, 0.68), (2.25, 0.55)),
        plan=((-2.32, 0.76), (-2.26, 0.82), (-2.0, 0.865), (-1.4, 0.895), (0.0, 0.90), (1.3, 0.895), (1.85, 0.85),
              (2.10, 0.77), (2.25, 0.62)),
    ),
    windows=(((-1.98, 1.04), (-1.02, 0.985), (-1.0, 1.39), (-1.80, 1.36)), *SEDAN.windows[1:]),
    rear=((-0.64, 1.07), (0.64, 1.07), (0.55, 1.39), (-0.55, 1.39)),
    tail=0.88, tall_tail=True,
)  # fmt: skip
CITY_CAR = replace(
    HATCH,
    skin=replace(
        HATCH.skin,
        profile=((-1.80, 0.60), (-1.785, 0.85), (-1.74, 1.05), (-1.66, 1.26), (-1.54, 1.44), (-1.40, 1.50),
                 (-0.9, 1.535), (-0.1, 1.54), (0.22, 1.50), (0.42, 1.44), (1.06, 1.05), (1.18, 1.00), (1.50, 0.92),
                 (1.68, 0.82), (1.76, 0.72), (1.82, 0.56)),
        plan=((-1.80, 0.74), (-1.75, 0.79), (-1.5, 0.825), (-1.0, 0.84), (0.0, 0.845), (1.0, 0.84), (1.4, 0.80),
              (1.66, 0.73), (1.82, 0.60)),
        flank=((0.15, 0.93), (0.34, 0.985), (0.55, 1.0), (0.82, 0.985), (0.95, 0.945), (1.02, 0.92), (1.55, 0.75)),
        axles=(-1.12, 1.16),
    ),
    track=0.825,
    windows=(((-1.50, 1.10), (-0.98, 1.04), (-0.94, 1.42), (-1.36, 1.40)), ((-0.88, 1.04), (-0.16, 1.02),
                                                                            (-0.16, 1.45), (-0.84, 1.43)),
             ((-0.06, 1.02), (0.84, 1.015), (0.38, 1.37), (-0.06, 1.45))),
    screen=((-0.66, 1.065), (0.66, 1.065), (0.54, 1.48), (-0.54, 1.48)),
    rear=((-0.60, 1.12), (0.60, 1.12), (0.52, 1.43), (-0.52, 1.43)),
    doors=(-0.92, -0.11, 0.94), belt=0.97, nose=0.69, tail=0.92,
)  # fmt: skip


def sports_car_spoiler(level: int) -> Soup:
    """Return a saloon with a spoiler and a darker roof rail."""
    made = motorcar(SEDAN, level)
    return made + box((0.0, -2.08, 1.13), (1.30, 0.20, 0.035), "paint", 0.01) + \
        box((0.50, -2.06, 1.06), (0.05, 0.12, 0.12), "paint").mirrored()  # fmt: skip


def rails(car: Car, low: float, high: float, z: float, level: int) -> Soup:
    """Return roof rails of a car between two places."""
    if level == 2:
        return Soup()
    half = 0.80 * float(at(car.skin.plan, np.array(0.0))) * float(at(car.skin.flank, np.array(z)))
    return box((half, 0.5 * (low + high), z + 0.05), (0.035, high - low, 0.035), "chrome").mirrored()


def estate(level: int) -> Soup:
    """Return an estate with roof rails."""
    return motorcar(ESTATE, level) + rails(ESTATE, -1.7, 0.1, 1.47, level)


def suv(level: int) -> Soup:
    """Return a tall car with roof rails."""
    made, on = motorcar(SUV, level), Projector(skinned(SUV.skin, 0))
    made += on.patch("back", rect(-0.80, 0.80, 0.33, 0.58), "bumper", 0.014, ((4, 2), (3, 1), (2, 1))[level])
    made += on.patch("front", rect(-0.66, 0.66, 0.33, 0.52), "bumper", 0.014, ((4, 2), (3, 1), (2, 1))[level])
    return made + rails(SUV, -1.5, 0.1, 1.635, level)


def stripe(on: Projector, low: float, high: float, start: float, end: float, material: str, level: int) -> Soup:
    """Return a stripe along both flanks."""
    return on.patch("right", rect(start, end, low, high), material, 0.010, ((12, 2), (8, 1), (4, 1))[level]).mirrored()


def taxi(level: int) -> Soup:
    """Return a saloon with a sign on its roof and chequers along its doors."""
    made = motorcar(SEDAN, level)
    made += box((0.0, -0.30, 1.56), (0.56, 0.18, 0.16), "white", 0.03)
    made += box((0.0, -0.30, 1.475), (0.60, 0.22, 0.03), "black")
    made += box((0.0, -0.205, 1.56), (0.36, 0.01, 0.07), "black")
    made += box((0.0, -0.395, 1.56), (0.36, 0.01, 0.07), "black")
    on = Projector(skinned(SEDAN.skin, 0))
    if level == 2:
        return made + stripe(on, 0.76, 0.84, -0.85, 0.90, "black", 2)
    for k in range(10):
        low = 0.76 if k % 2 else 0.80
        made += on.patch("right", rect(-0.85 + 0.17 * k, -0.70 + 0.17 * k, low, low + 0.04), "black", 0.006,
                         (1, 1)).mirrored()  # fmt: skip
    return made


def light_bar(y: float, z: float, half: float, level: int) -> Soup:
    """Return a bar of blue lights across a roof."""
    made = box((0.0, y, z), (2.0 * half, 0.26, 0.04), "black")
    made += box((0.66 * half, y, z + 0.08), (0.60 * half, 0.24, 0.12), "blue", 0.03).mirrored()
    return made if level == 2 else made + box((0.0, y, z + 0.07), (0.66 * half, 0.20, 0.09), "white", 0.02)


def police_car(level: int) -> Soup:
    """Return an estate of the police: a stripe along its flanks and a bar of blue lights."""
    on = Projector(skinned(ESTATE.skin, 0))
    made = motorcar(ESTATE, level) + light_bar(0.0, 1.53, 0.58, level)
    made += stripe(on, 0.66, 0.84, -2.0, 1.95, "cargo", level)
    if level < 2:
        made += stripe(on, 0.60, 0.64, -2.0, 1.95, "yellow", level)
        made += on.patch("front", rect(-0.45, 0.45, 0.90, 0.94), "cargo", 0.012, (3, 1))
    return made


def minibus(level: int) -> Soup:
    """Return a van with windows along its sides."""
    made, on = van_body(level), Projector(skinned(VAN.skin, 0))
    cut = ((3, 2), (2, 1), (1, 1))[level]
    for start, end in ((-2.75, -1.55), (-1.45, -0.35), (-0.25, 0.72)):
        made += on.patch("right", rect(start, end, 1.36, 2.06), "glass", 0.009, cut).mirrored()
    return made


def ambulance(level: int) -> Soup:
    """Return a van of the ambulance service: stripes, crosses and blue lights."""
    on, made = Projector(skinned(VAN.skin, 0)), van_body(level)
    made += light_bar(1.05, 2.60, 0.72, level) + box((0.70, -2.75, 2.62), (0.24, 0.20, 0.12), "blue", 0.02).mirrored()
    made += stripe(on, 1.02, 1.22, -2.85, 2.05, "cargo", level)
    if level < 2:
        made += stripe(on, 0.84, 0.96, -2.85, 2.05, "yellow", level)
        made += on.patch("right", rect(-2.6, 0.72, 1.62, 2.02), "glass", 0.009, (4, 2)).mirrored()
        for wide, tall in ((0.26, 0.09), (0.09, 0.26)):
            cross = rect(-1.2 - wide / 2, -1.2 + wide / 2, 2.24 - tall / 2, 2.24 + tall / 2)
            made += on.patch("right", cross, "red", 0.012, (1, 1)).mirrored()
        made += on.patch("front", rect(-0.60, 0.60, 1.14, 1.20), "cargo", 0.014, (3, 1))
        made += on.patch("back", rect(-0.95, 0.95, 1.02, 1.22), "cargo", 0.014, (3, 1))
    return made


BUS = Skin(
    profile=((-6.0, 0.60), (-5.99, 2.55), (-5.93, 2.86), (-5.78, 2.98), (-3.0, 3.0), (0.0, 3.0), (3.0, 3.0),
             (5.45, 2.99), (5.72, 2.93), (5.85, 2.78), (5.95, 2.20), (6.0, 1.30), (6.0, 0.60)),
    plan=((-6.0, 1.12), (-5.92, 1.22), (-5.6, 1.27), (0.0, 1.275), (5.3, 1.27), (5.75, 1.22), (5.93, 1.12), (6.0, 1.0)),
    flank=((0.3, 0.975), (0.5, 1.0), (1.2, 1.0), (2.4, 0.985), (3.0, 0.93)),
    low=0.30, axles=(-3.15, 3.35), arch=0.60, hub=0.48, corner=0.16, crown=0.03,
)  # fmt: skip


def bus(level: int) -> Soup:
    """Return a city bus of 12 m: window bands, two doors on its right side, destination signs, air conditioning."""
    made, on = skinned(BUS, level), Projector(skinned(BUS, 0))
    cut = ((3, 2), (2, 1), (1, 1))[level]
    panes = [(-5.6, -4.35), (-4.25, -3.0), (-2.9, -1.65), (-1.55, -0.45), (0.95, 2.05), (2.15, 3.3), (3.4, 4.3)]
    for start, end in panes:
        made += on.patch("right", rect(start, end, 1.28, 2.48), "glass", 0.01, cut).mirrored()
    left = (((-0.38, 0.88), 1.28), ((4.4, 5.55), 1.28))
    for (start, end), low in left:
        pane = on.patch("right", rect(start, end, low, 2.48), "glass", 0.01, cut)
        made += pane.opposite()
    for start, end in ((-0.36, 0.22), (0.26, 0.84), (4.42, 4.95), (4.99, 5.52)):
        made += on.patch("right", rect(start, end, 0.42, 2.46), "glass", 0.012, cut)
        if level == 0:
            made += on.patch("right", rect(start - 0.02, start + 0.02, 0.40, 2.50), "seam", 0.016, (1, 4))
    made += on.patch("front", [(-1.06, 1.12), (1.06, 1.12), (1.02, 2.50), (-1.02, 2.50)], "glass", 0.012,
                     ((6, 4), (4, 2), (2, 1))[level])  # fmt: skip
    made += on.patch("front", rect(-0.85, 0.85, 2.60, 2.86), "black", 0.014, cut)
    made += on.patch("back", rect(-0.95, 0.95, 1.62, 2.45), "glass", 0.012, cut)
    made += on.patch("front", rect(0.62, 1.02, 0.62, 0.84), "lamp", 0.014, cut).mirrored()
    made += on.patch("back", rect(0.86, 1.10, 0.70, 1.25), "tail", 0.014, cut).mirrored()
    made += box((0.0, -2.6, 3.12), (1.7, 2.6, 0.20), "white", 0.05)
    made += box((0.0, 2.6, 3.10), (1.5, 1.8, 0.16), "white", 0.04)
    made += box((0.0, 6.0, 0.48), (2.1, 0.10, 0.22), "bumper", 0.03)
    made += box((0.0, -6.0, 0.50), (2.3, 0.10, 0.24), "bumper", 0.03)
    made += stripe(on, 0.95, 1.10, -5.9, 5.6, "cargo", level)
    if level < 2:
        made += on.patch("front", rect(-0.70, 0.70, 2.66, 2.80), "orange", 0.022, (2, 1))
        made += on.patch("front", rect(-0.45, 0.45, 0.66, 0.86), "black", 0.014, cut)
        made += on.patch("front", rect(-0.26, 0.26, 0.50, 0.61), "plate", 0.10, (1, 1))
        made += on.patch("back", rect(-0.26, 0.26, 0.72, 0.84), "plate", 0.02, (1, 1))
        made += on.patch("back", rect(-0.80, 0.80, 0.95, 1.35), "black", 0.012, cut)
        made += on.patch("right", rect(3.4, 4.3, 2.58, 2.80), "black", 0.014, cut)
        made += box((1.40, 5.95, 2.05), (0.20, 0.14, 0.46), "black", 0.03).mirrored()
        made += rod((1.22, 5.85, 2.6), (1.40, 5.96, 2.25), (0.025, 0.025), "black", 5).mirrored()
    if level == 0:
        for y in (-4.3, -1.6, 3.35):
            made += on.patch("right", rect(y - 0.012, y + 0.012, 0.34, 0.94), "seam", 0.006, (1, 2)).mirrored()
        made += on.patch("front", rect(-0.02, 0.02, 1.14, 2.48), "seam", 0.02, (1, 4))
        made += rod((0.1, 6.03, 1.18), (0.75, 6.0, 1.75), (0.015, 0.012), "black", 4).mirrored()
    for y in BUS.axles:
        made += wheel(0.48, 0.30, level, 0.58).moved(1.25, y, 0.48).mirrored()
    return made


FIRE_CAB = Car(
    skin=Skin(
        profile=((1.30, 2.80), (1.38, 2.92), (1.55, 2.97), (3.55, 2.95), (3.84, 2.87), (3.96, 2.72), (4.20, 1.68),
                 (4.26, 1.45), (4.30, 0.72)),
        plan=((1.30, 1.23), (3.7, 1.25), (4.1, 1.21), (4.24, 1.13), (4.30, 1.04)),
        flank=((0.4, 0.97), (0.7, 1.0), (1.6, 1.0), (1.8, 0.985), (2.95, 0.90)),
        low=0.50, axles=(2.75,), arch=0.62, hub=0.50, corner=0.13, crown=0.02,
    ),
    wheel=0.50, track=1.20,
    windows=(((3.10, 1.66), (4.00, 1.62), (3.80, 2.50), (3.10, 2.54)), ((1.62, 1.66), (2.95, 1.66), (2.95, 2.54),
                                                                        (1.62, 2.54))),
    screen=((-1.04, 1.66), (1.04, 1.66), (0.96, 2.72), (-0.96, 2.72)),
    rear=((-0.5, 1.8), (0.5, 1.8), (0.5, 2.3), (-0.5, 2.3)),
    doors=(1.50, 3.02, 4.05), belt=1.52, nose=0.90, tail=1.2,
)  # fmt: skip
"""The crew cab of a fire engine."""


def fire_engine(level: int) -> Soup:
    """Return a fire engine: crew cab, roller shutters, stripes, hose reel, ladder on its roof, blue lights."""
    on, cut = Projector(skinned(FIRE_CAB.skin, 0)), ((4, 3), (2, 2), (1, 1))[level]
    made = skinned(FIRE_CAB.skin, level)
    for window in FIRE_CAB.windows:
        made += on.patch("right", window, "glass", 0.01, cut).mirrored()
    made += on.patch("front", FIRE_CAB.screen, "glass", 0.01, ((6, 3), (4, 2), (2, 1))[level])
    made += on.patch("front", rect(-0.62, 0.62, 1.10, 1.40), "black", 0.015, cut)
    made += on.patch("front", rect(0.66, 1.02, 0.82, 1.02), "lamp", 0.015, cut).mirrored()
    made += box((0.0, 4.27, 0.62), (2.40, 0.18, 0.32), "white", 0.04)
    made += box((0.0, -1.50, 1.90), (2.46, 5.50, 2.10), "paint", 0.06)
    made += box((0.0, -0.2, 0.66), (0.95, 7.4, 0.30), "under")
    made += box((0.0, -1.50, 2.975), (2.20, 5.30, 0.05), "steel")
    made += box((1.245, -1.5, 0.98), (0.03, 5.50, 0.22), "white").mirrored()
    made += stripe(on, 0.88, 1.10, 1.4, 4.15, "white", level)
    made += box((1.252, -1.5, 0.98), (0.03, 5.50, 0.08), "yellow").mirrored()
    for y in (-3.45, -1.65, 0.15):
        made += box((1.235, y, 1.96), (0.03, 1.55, 1.62), "steel").mirrored()
    made += box((0.0, -4.255, 1.90), (1.6, 0.03, 1.70), "steel")
    made += box((1.05, -4.26, 0.95), (0.24, 0.05, 0.50), "tail").mirrored()
    made += light_bar(3.35, 2.98, 0.98, level) + box((1.05, -4.12, 3.07), (0.22, 0.22, 0.16), "blue", 0.03).mirrored()
    for x in (0.19, 0.71):
        made += box((x, -1.0, 3.20), (0.07, 6.6, 0.12), "steel")
        made += box((x, -1.3, 3.36), (0.06, 5.6, 0.10), "steel")
    rungs = (18, 9, 5)[level]
    for k in range(rungs):
        y = -4.1 + 6.2 * k / (rungs - 1)
        made += rod((0.19, y, 3.20), (0.71, y, 3.20), (0.025, 0.025), "steel", 4)
    made += box((0.45, -4.0, 3.08), (0.66, 0.10, 0.20), "steel") + box((0.45, 1.6, 3.08), (0.66, 0.10, 0.20), "steel")
    made += rod((-0.70, -3.8, 3.12), (-0.70, 0.6, 3.12), (0.11, 0.11), "black", (10, 7, 4)[level])
    if level < 2:
        made += box((1.42, 4.08, 2.15), (0.18, 0.12, 0.52), "black", 0.02).mirrored()
        made += on.patch("front", rect(-0.26, 0.26, 0.55, 0.67), "plate", 0.16, (1, 1))
        made += on.patch("front", rect(-0.60, 0.60, 1.46, 1.56), "white", 0.014, (3, 1))
        made += box((0.0, -4.30, 0.62), (2.4, 0.14, 0.10), "bumper")
        made += box((0.95, 0.95, 0.66), (0.42, 1.0, 0.44), "bumper", 0.06).mirrored()
        made += rod((0.95, -4.34, 0.8), (0.95, -4.34, 2.95), (0.02, 0.02), "chrome", 4)
        for y in (1.50, 3.02):
            made += on.patch("right", rect(y, y + 0.02, 0.75, 1.58), "seam", 0.006, (1, 4)).mirrored()
            made += on.patch("right", rect(y + 0.08, y + 0.26, 1.40, 1.45), "chrome", 0.02, (1, 1)).mirrored()
    if level == 0:
        for y in (-3.45, -1.65, 0.15):
            for k in range(6):
                made += box((1.256, y, 1.34 + 0.25 * k), (0.012, 1.55, 0.02), "seam").mirrored()
        for k in range(5):
            made += box((0.0, -4.272, 1.30 + 0.3 * k), (1.6, 0.012, 0.02), "seam")
    for y in (-2.5, 2.75):
        made += heavy_wheel(0.50, level).moved(1.20, y, 0.50).mirrored()
    return made


def person_on(figure: str, pose: str, seat: Sequence[float], level: int) -> Soup:
    """Return a figure of `people.npz` in a pose, its hips at a place."""
    points, normals, rows = skeleton.skin(figure, skeleton.POSES[pose], level)
    hips = skeleton.stored_arrays("people")[f"{figure}/joints"][0] * skeleton.UNIT_M
    index = skeleton.stored_arrays("people")[f"{figure}/{level}/index"].reshape(-1, 3)
    return Soup((points - hips + np.array(seat))[index], normals[index], rows[index[:, 0], 6].astype(np.uint8))


def motorcycle(level: int) -> Soup:
    """Return a motorcycle with its rider."""
    n = (8, 6, 4)[level]
    made = narrow_wheel(0.315, 0.062, level, 5).moved(0.0, 0.74, 0.315)
    made += narrow_wheel(0.315, 0.075, level, 5).moved(0.0, -0.70, 0.315)
    made += egg((0.0, 0.14, 0.80), (0.155, 0.30, 0.13), "paint", n, n + 2)
    made += box((0.0, -0.36, 0.80), (0.27, 0.66, 0.10), "black", 0.04)
    made += egg((0.0, -0.72, 0.80), (0.12, 0.24, 0.08), "paint", n // 2, n)
    made += box((0.0, 0.06, 0.46), (0.30, 0.44, 0.30), "steel", 0.05)
    made += box((0.0, 0.10, 0.62), (0.20, 0.34, 0.14), "black", 0.03)
    made += rod((0.10, 0.74, 0.315), (0.085, 0.50, 0.98), (0.028, 0.030), "chrome", n).mirrored()
    made += rod((0.12, 0.02, 0.34), (0.14, -0.86, 0.40), (0.045, 0.055), "chrome", n)
    made += rod((0.11, -0.70, 0.315), (0.09, -0.05, 0.46), (0.03, 0.03), "black", 5).mirrored()
    made += rod((0.09, -0.62, 0.36), (0.09, -0.42, 0.76), (0.03, 0.03), "chrome", 5).mirrored()
    made += rod((-0.36, 0.42, 1.00), (0.36, 0.42, 1.00), (0.016, 0.016), "black", 5)
    made += egg((0.0, 0.62, 0.86), (0.105, 0.08, 0.105), "black", n // 2 + 1, n)
    made += egg((0.0, 0.665, 0.86), (0.085, 0.05, 0.085), "lamp", n // 2, n)
    made += box((0.0, -0.96, 0.76), (0.18, 0.05, 0.08), "tail") + box((0.0, -1.0, 0.58), (0.20, 0.02, 0.14), "plate")
    made += box((0.0, 0.74, 0.66), (0.13, 0.46, 0.03), "paint", 0.01)
    made += box((0.0, -0.86, 0.66), (0.15, 0.30, 0.03), "black", 0.01)
    if level < 2:
        made += box((0.30, 0.40, 1.20), (0.12, 0.03, 0.09), "black", 0.01).mirrored()
        made += rod((0.28, 0.42, 1.0), (0.30, 0.40, 1.16), (0.01, 0.01), "black", 4).mirrored()
        made += rod((-0.24, 0.02, 0.30), (0.24, 0.02, 0.30), (0.02, 0.02), "black", 4)
        made += box((0.17, 0.56, 0.86), (0.06, 0.05, 0.05), "orange").mirrored()
        made += box((0.15, -0.95, 0.70), (0.06, 0.04, 0.05), "orange").mirrored()
        made += box((0.0, 0.60, 1.08), (0.26, 0.03, 0.20), "glass", 0.03)
    return made + person_on("rider", "motorcycle", (0.0, -0.26, 0.93), level)


def bicycle(level: int) -> Soup:
    """Return a bicycle with its rider."""
    n = (6, 5, 4)[level]
    made = narrow_wheel(0.34, 0.022, level, (14, 10, 4)[level]).moved(0.0, 0.54, 0.34)
    made += narrow_wheel(0.34, 0.022, level, (14, 10, 4)[level]).moved(0.0, -0.50, 0.34)
    crank, seat, fork, head = (0.0, -0.06, 0.29), (0.0, -0.24, 0.82), (0.0, 0.40, 0.66), (0.0, 0.36, 0.86)
    bars = [(crank, seat), (seat, head), (crank, fork), (fork, (0.0, 0.345, 0.93))]
    for start, end in bars:
        made += rod(start, end, (0.020, 0.020), "paint", n)
    for end in (crank, (0.0, -0.22, 0.76)):
        made += rod((0.05, -0.50, 0.34), end, (0.012, 0.012), "paint", 4).mirrored()
    made += rod((0.045, 0.54, 0.34), fork, (0.014, 0.018), "paint", 4).mirrored()
    made += rod(seat, (0.0, -0.27, 0.94), (0.014, 0.014), "chrome", 4)
    made += box((0.0, -0.27, 0.96), (0.15, 0.26, 0.05), "black", 0.02)
    made += rod((-0.29, 0.42, 0.99), (0.29, 0.42, 0.99), (0.014, 0.014), "black", 5)
    made += rod((0.0, 0.345, 0.93), (0.0, 0.42, 0.99), (0.014, 0.014), "black", 4)
    made += box((0.02, -0.06, 0.29), (0.012, 0.17, 0.17), "chrome", 0.05)
    made += rod((0.06, -0.06, 0.29), (0.06, 0.10, 0.36), (0.012, 0.012), "chrome", 4)
    made += rod((-0.06, -0.06, 0.29), (-0.06, -0.20, 0.20), (0.012, 0.012), "chrome", 4)
    made += box((0.11, 0.10, 0.36), (0.10, 0.09, 0.025), "black")
    made += box((-0.11, -0.20, 0.20), (0.10, 0.09, 0.025), "black")
    if level < 2:
        made += box((0.0, -0.86, 0.62), (0.05, 0.02, 0.05), "tail")
        made += egg((0.0, 0.47, 0.90), (0.035, 0.035, 0.035), "lamp", 4, 6)
        made += box((0.0, -0.60, 0.70), (0.14, 0.40, 0.02), "black")
    return made + person_on("cyclist", "bicycle", (0.0, -0.27, 1.03), level)


MADE = {
    "sedan": lambda level: motorcar(SEDAN, level),
    "spoiler": sports_car_spoiler,
    "hatch": lambda level: motorcar(HATCH, level),
    "city_car": lambda level: motorcar(CITY_CAR, level),
    "suv": suv,
    "estate": estate,
    "taxi": taxi,
    "police_car": police_car,
    "van": van_body,
    "minibus": minibus,
    "ambulance": ambulance,
    "truck": lambda level: box_truck(level, LONG_LOAD),
    "short_truck": lambda level: box_truck(level, SHORT_LOAD),
    "bus": bus,
    "fire_truck": fire_engine,
    "motorcycle": motorcycle,
    "bicycle": bicycle,
}
"""All models by name."""


def main() -> None:
    """Write the file, and print the triangles of each level."""
    arrays = {}
    for name, make in MADE.items():
        counts = []
        for level in range(LEVELS):
            vertices, index = packed(make(level))
            arrays[f"{name}/{level}/vertices"], arrays[f"{name}/{level}/index"] = vertices, index
            counts.append(len(index) // 3)
        print(f"{name}: {', '.join(map(str, counts))} triangles", flush=True)
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER / "vehicles.npz"
    np.savez_compressed(file, **arrays)


if __name__ == "__main__":
    main()
