"""`cover`: the share of a region that the positions drawn for several seeds cover.

The bounding box of the region is divided into 3 by 3 cells, or into 2 by 2 if fewer than 18 positions are drawn. A cell
is covered if a drawn position lies in it. The share is the area of the region in covered cells, as a part of its whole
area. Positions outside of the region do not count. Uniform draws of 18 positions cover 88 % on average; draws from one
half of the region cover at most about two thirds. Positions are those of the mission before the city moves any.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.geometry2d import Polygon, contains
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate

LEAST_SHARE = 2 / 3
"""The least covered share of the region's area (chosen)."""
LEAST_POSITIONS = 8
"""The least number of positions; two for each of 2 by 2 cells (chosen)."""
_FINE = 18
"""The least number of positions for 3 by 3 cells; two for each (chosen)."""
_SAMPLES = 36
"""Sampled points along each side of the bounding box; a multiple of 2 and 3 (chosen)."""


class Coverage(msgspec.Struct, frozen=True, kw_only=True):
    """The drawn positions of one region."""

    share: float
    """The covered share of the region's area, 0 to 1."""
    positions: int
    """Number of drawn positions."""
    inside: int
    """Number of drawn positions in the region."""
    distinct: int
    """Number of different positions in the region, compared to the centimetre."""

    @property
    def spreads(self) -> bool:
        """True if the draws cover the region."""
        return self.share >= LEAST_SHARE

    def __str__(self) -> str:
        """The measure in words."""
        return (
            f"{self.share:.0%} of the region is covered ({LEAST_SHARE:.0%} is due): {self.positions} positions were "
            f"drawn, {self.inside} of them in the region, {self.distinct} different ones"
        )


def cover(mission: model.Mission, expectation: model.SpreadExpectation, settings: Mapping[str, float]) -> Coverage:
    """Draw the instances of the expectation's seeds and measure the region.

    Raises `MissionError` if the expectation cannot be evaluated: an instance cannot be made, no position is drawn, too
    few are, or the outline of the region is known only in the built city.
    """
    mode = expectation.episodes.mode or None
    outline: Polygon = ()
    drawn: list[tuple[float, float]] = []
    for seed in expectation.episodes.seeds:
        instance = instantiate(mission, seed=seed, mode=mode, settings=settings)
        outline = outline or _outline(instance, expectation.region)
        drawn += list(_drawn(mission, instance))
    if len(drawn) < LEAST_POSITIONS:
        hint = "name more seeds" if drawn else "draw one with `position ~ sites(…)`"
        raise MissionError(
            f"the seeds draw {len(drawn)} positions, and at least {LEAST_POSITIONS} are needed", hint=hint
        )
    inside = [point for point in drawn if contains(outline, *point)]
    return Coverage(
        share=_share(outline, inside, 3 if len(drawn) >= _FINE else 2),
        positions=len(drawn),
        inside=len(inside),
        distinct=len({(round(east, 2), round(north, 2)) for east, north in inside}),
    )


# -- private


def _outline(instance: Instance, name: str) -> Polygon:
    region = next(region for region in instance.regions if region.name == name)
    if not region.polygon:
        message = f"the outline of `{name}` is known only in the built city"
        raise MissionError(message, hint="name a region with corners, such as `box(…)`")
    return region.polygon


def _drawn(mission: model.Mission, instance: Instance) -> Iterator[tuple[float, float]]:
    groups = {
        group.name
        for group in mission.groups
        for each in group.properties
        if each.name == "position" and isinstance(each.value, ex.Draw)
    }
    for entity in instance.entities:
        if entity.group in groups:
            yield entity.position[0], entity.position[1]


def _share(outline: Polygon, inside: list[tuple[float, float]], cells: int) -> float:
    low = min(east for east, _ in outline), min(north for _, north in outline)
    high = max(east for east, _ in outline), max(north for _, north in outline)
    size = [(most - least) / cells or 1.0 for least, most in zip(low, high, strict=True)]

    def cell(point: tuple[float, float]) -> tuple[int, ...]:
        return tuple(
            min(cells - 1, math.floor((at - least) / side)) for at, least, side in zip(point, low, size, strict=True)
        )

    covered = {cell(point) for point in inside}
    steps = [(number + 0.5) / _SAMPLES for number in range(_SAMPLES)]
    samples = [(low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])) for x in steps for y in steps]
    of_region = [cell(point) for point in samples if contains(outline, *point)]
    return sum(at in covered for at in of_region) / max(1, len(of_region))
