"""Road vehicles: the shapes of `vehicles.npz` that each look has, their colours, and their variants by number.

The origin is the middle of the footprint on the ground. Dimensions are those of `scene.sizes.SIZES`, give or take the
difference between shapes and a few per cent of `STRETCH`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lingjing.engines.camera.models.palette import BLACK, HAIRS, RED, SKINS, WHITE, YELLOW
from lingjing.engines.camera.models.shapes import ModelPart, Placement
from lingjing.engines.camera.models.stored import Palette, stored
from lingjing.mission.appearance import LinearRgb

# Linear colours (chosen).
FIRE_RED: LinearRgb = (0.56, 0.022, 0.018)
POLICE_BLUE: LinearRgb = (0.02, 0.08, 0.36)
DENIM: LinearRgb = (0.06, 0.07, 0.12)

PAINTS: tuple[LinearRgb, ...] = (
    (0.74, 0.74, 0.73), (0.40, 0.42, 0.44), (0.03, 0.03, 0.035), (0.10, 0.11, 0.13), (0.05, 0.10, 0.27),
    (0.42, 0.03, 0.03), (0.66, 0.66, 0.64), (0.05, 0.13, 0.09), (0.33, 0.27, 0.19), (0.20, 0.21, 0.22),
)  # fmt: skip
"""Colours of cars in usual proportions: mostly white, silver and dark."""
STRETCH = 0.025
"""Largest change of a variant's length and height, as a share (chosen)."""
GOLDEN, PLASTIC = 0.6180339887, 0.7548776662
"""Steps of two sequences that fill 0..1 evenly: the inverses of the golden and of the plastic ratio."""


@dataclass(frozen=True)
class VehicleLook:
    """The variants of a look."""

    shapes: tuple[str, ...]
    """Names in the file."""
    palettes: tuple[Palette, ...]
    """Colours."""

    @property
    def count(self) -> int:
        """Number of variants."""
        return len(self.shapes) * len(self.palettes)


def _paints(name: str, colours: Sequence[LinearRgb]) -> tuple[Palette, ...]:
    return tuple(((name, colour),) for colour in colours)


def _trucks() -> tuple[Palette, ...]:
    cabs: tuple[LinearRgb, ...] = ((0.74, 0.74, 0.73), (0.70, 0.70, 0.68), (0.50, 0.56, 0.64), (0.52, 0.53, 0.55),
                                   (0.70, 0.65, 0.52))  # fmt: skip
    boxes: tuple[LinearRgb, ...] = ((0.72, 0.72, 0.70), (0.70, 0.70, 0.68), (0.71, 0.71, 0.69), (0.70, 0.68, 0.62),
                                    (0.70, 0.70, 0.69))  # fmt: skip
    return tuple((("paint", cab), ("cargo", box)) for cab, box in zip(cabs, boxes, strict=True))


def _buses() -> tuple[Palette, ...]:
    paints: tuple[LinearRgb, ...] = ((0.08, 0.30, 0.22), (0.66, 0.66, 0.64), (0.55, 0.06, 0.05), (0.70, 0.50, 0.05))
    bands: tuple[LinearRgb, ...] = ((0.70, 0.70, 0.66), (0.05, 0.16, 0.42), (0.72, 0.70, 0.64), (0.05, 0.06, 0.09))
    return tuple((("paint", paint), ("cargo", band)) for paint, band in zip(paints, bands, strict=True))


def _riders(
    paints: Sequence[LinearRgb], coats: Sequence[LinearRgb], helmets: Sequence[LinearRgb]
) -> tuple[Palette, ...]:
    return tuple(
        (("paint", paint), ("coat", coat), ("helmet", helmet), ("trousers", DENIM), ("shoes", BLACK),
         ("skin", SKINS[k % len(SKINS)]), ("hair", HAIRS[k % len(HAIRS)]))
        for k, (paint, coat, helmet) in enumerate(zip(paints, coats, helmets, strict=True))
    )  # fmt: skip


LOOKS: dict[str, VehicleLook] = {
    "car": VehicleLook(("sedan", "hatch", "suv", "estate", "city_car", "spoiler"), _paints("paint", PAINTS)),
    "taxi": VehicleLook(("taxi",), _paints("paint", (YELLOW, (0.72, 0.66, 0.50)))),
    "police_car": VehicleLook(("police_car",), ((("paint", WHITE), ("cargo", POLICE_BLUE)),
                                                (("paint", (0.62, 0.63, 0.64)), ("cargo", (0.04, 0.24, 0.10))))),
    "ambulance": VehicleLook(("ambulance",), ((("paint", WHITE), ("cargo", RED)),
                                              (("paint", (0.74, 0.66, 0.06)), ("cargo", (0.04, 0.26, 0.10))))),
    "delivery_van": VehicleLook(("van", "van", "minibus"), _paints("paint", (
        (0.76, 0.76, 0.74), (0.72, 0.47, 0.04), (0.06, 0.14, 0.34), (0.66, 0.66, 0.64)))),
    "truck": VehicleLook(("truck", "short_truck"), _trucks()),
    "bus": VehicleLook(("bus",), _buses()),
    "fire_truck": VehicleLook(("fire_truck",), _paints("paint", (FIRE_RED,))),
    "motorcycle": VehicleLook(("motorcycle",), _riders(
        ((0.45, 0.04, 0.03), (0.05, 0.14, 0.35), (0.06, 0.06, 0.065), (0.60, 0.30, 0.03)),
        ((0.03, 0.03, 0.035), (0.10, 0.11, 0.14), (0.36, 0.05, 0.04), (0.16, 0.12, 0.08)),
        (WHITE, RED, BLACK, (0.10, 0.12, 0.15)))),
    "bicycle": VehicleLook(("bicycle",), _riders(
        ((0.05, 0.05, 0.055), (0.50, 0.05, 0.04), (0.06, 0.20, 0.40), (0.30, 0.32, 0.33)),
        ((0.10, 0.26, 0.34), (0.52, 0.06, 0.05), (0.66, 0.66, 0.62), (0.10, 0.28, 0.10)),
        ((0.70, 0.70, 0.68), (0.06, 0.06, 0.07), (0.55, 0.08, 0.05), (0.05, 0.18, 0.40)))),
}  # fmt: skip
"""All looks of vehicles by name."""


def vehicle(name: str, number: int) -> ModelPart:
    """Return the `number`-th variant of a look: shape, colours and proportions."""
    look = LOOKS[name]
    turn, shape = divmod(number, len(look.shapes))
    paint = (turn + shape) % len(look.palettes)
    levels = stored(look.shapes[shape], look.palettes[paint])
    return ModelPart(f"{name}-{look.shapes[shape]}-{paint}", levels[0], _proportions(number), levels[1:])


def _proportions(number: int) -> Placement:
    along, up = (1.0 + STRETCH * (2.0 * (number * step % 1.0) - 1.0) for step in (GOLDEN, PLASTIC))
    return np.hstack([np.diag((1.0, along, up)), np.zeros((3, 1))])
