"""Adversaries that read pictures, but know no shape: `MaskReader` and `ColourTable`.

They have the rules of the heuristic inside, with detectors of their own in the place of its detectors.

- `MaskReader`: takes what sticks out of the depth image, or has a class of its own in the class image, for a target.
- `ColourTable`: takes the colours of targets, learnt on two seeds with the truth (`colour_tables.json`), for a target.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.plugins.geometry import focal_px, pixel_ray
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Picture, Policy
from lingjing_agents.adversaries.guesses import SIZES_M, USUAL_M, level
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.heuristic.target_types import Detector
from lingjing_agents.perception.images import ImageBox, opencv
from lingjing_agents.perception.people_at_sea import FoundBox

MaskArray = npt.NDArray[np.uint8]
"""A mask (height, width), 0 or 1."""

STICKS_OUT_M = 0.06
"""Height above the surroundings from which on a pixel belongs to a thing, metres (chosen: depth is in centimetres)."""
SIMILAR = (0.45, 1.9)
"""Smallest and largest ratio of a patch's side to the usual side of a target (chosen)."""
MOST = 6
"""Boxes of one picture (chosen)."""
SHARE = 0.35
"""Least share of a target's colours among the pixels of a cell, to join it to a patch (chosen)."""
CELL_PX = 4
"""Side of a cell of `ColourTable`, pixels (chosen)."""
BITS = 3
"""Bits of each colour channel in a table (chosen: 512 colours)."""
TABLES = Path(__file__).with_name("colour_tables.json")
"""Colours by class, numbers of `colour_numbers`."""


class _Sighted:
    """The heuristic with the detectors of a subclass."""

    async def reset(self, brief: Brief) -> None:
        """Give the heuristic the detectors."""
        self._brief = brief
        self._wrapped: Policy = HeuristicPolicy({name: self._detector(name) for name in brief.classes})
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the heuristic's decision."""
        return await self._wrapped.act(observation, inbox)

    def _detector(self, name: str) -> Detector:
        def find(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
            mask = self.mask(name, picture)
            return () if mask is None else patches(self._brief, name, picture, mask)

        return find

    def mask(self, name: str, picture: Picture) -> MaskArray | None:
        """Return the pixels that may show a target of a class; None if the picture says nothing."""
        raise NotImplementedError


class MaskReader(_Sighted):
    """Reads depth and classes, and no colour."""

    def mask(self, name: str, picture: Picture) -> MaskArray | None:
        """Return what sticks out of the depth image, and what has a rare class."""
        out = np.zeros(picture.rgb.shape[:2], np.uint8)
        if picture.depth is not None:
            depth_m = np.where(np.isfinite(picture.depth), picture.depth, 0.0).astype(np.float32)
            out |= (_surroundings(depth_m) - depth_m > STICKS_OUT_M).astype(np.uint8)
        if picture.semantic is not None:
            counts = np.bincount(picture.semantic.ravel(), minlength=256)
            rare = np.flatnonzero((counts > 0) & (counts < 0.01 * picture.semantic.size))
            out |= np.isin(picture.semantic, rare).astype(np.uint8)
        return out if picture.depth is not None or picture.semantic is not None else None


class ColourTable(_Sighted):
    """Reads colours by a table, and no shape but the size."""

    def mask(self, name: str, picture: Picture) -> MaskArray | None:
        """Return the cells in which the colours of the class are frequent, in full resolution."""
        colours = tables().get(name)
        if colours is None:
            return None
        known = np.zeros(1 << (3 * BITS), np.float32)
        known[list(colours)] = 1.0
        cv2 = opencv()
        hits = known[colour_numbers(picture.rgb)]
        dense = cv2.blur(hits, (CELL_PX, CELL_PX)) >= SHARE
        closed: MaskArray = cv2.morphologyEx(
            dense.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((2 * CELL_PX + 1, 2 * CELL_PX + 1), np.uint8)
        )
        return closed


@cache
def tables() -> dict[str, tuple[int, ...]]:
    """Return the learnt colours of each class; empty if none was learnt."""
    if not TABLES.is_file():
        return {}
    return {name: tuple(colours) for name, colours in json.loads(TABLES.read_text()).items()}


def colour_numbers(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.int64]:
    """Return the number of each pixel's colour, 0 to 511."""
    coarse = rgb.astype(np.int64) >> (8 - BITS)
    numbers: npt.NDArray[np.int64] = (coarse[..., 0] << (2 * BITS)) | (coarse[..., 1] << BITS) | coarse[..., 2]
    return numbers


def learn(pictures: list[tuple[npt.NDArray[np.uint8], list[ImageBox]]], ratio: float = 6.0) -> list[int]:
    """Return the colours that are `ratio` times as frequent in boxes of targets as outside of them.

    `pictures` are images (height, width, 3) with the true boxes of one class.
    """
    size = 1 << (3 * BITS)
    inside, outside = np.zeros(size), np.zeros(size)
    for rgb, boxes in pictures:
        numbers = colour_numbers(rgb)
        marked = np.zeros(rgb.shape[:2], np.bool_)
        height, width = rgb.shape[:2]
        for left, top, right, bottom in boxes:
            marked[int(top * height) : int(bottom * height) + 1, int(left * width) : int(right * width) + 1] = True
        inside += np.bincount(numbers[marked], minlength=size)
        outside += np.bincount(numbers[~marked], minlength=size)
    often = inside / max(inside.sum(), 1.0)
    rarely = outside / max(outside.sum(), 1.0)
    chosen = (often > ratio * rarely) & (often > 0.004)
    return [int(number) for number in np.flatnonzero(chosen)]


def patches(brief: Brief, name: str, picture: Picture, mask: MaskArray) -> tuple[FoundBox, ...]:
    """Return the boxes of the patches of a mask that have about the size of a target, the most similar ones first."""
    cv2 = opencv()
    _, _, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    wide_m, high_m = next(((w, h) for word, w, h in SIZES_M if word in name), (USUAL_M, USUAL_M))
    pose, ground = picture.pose, level(brief)
    boxes: list[tuple[float, ImageBox]] = []
    for (left, top, width, height, _), (u, v) in zip(stats[1:].tolist(), centres[1:].tolist(), strict=True):
        falls = -pixel_ray(pose, u, v)[2]
        away_m = (pose.position[2] - ground) / falls if falls > 0.05 else 40.0
        metres = max(away_m, 2.0) / focal_px(pose)
        ratio = max(width * metres, height * metres) / max(wide_m, high_m)
        if SIMILAR[0] <= ratio <= SIMILAR[1]:
            box = left / pose.width, top / pose.height, (left + width) / pose.width, (top + height) / pose.height
            boxes.append((abs(float(np.log(ratio))), box))
    return tuple(FoundBox(box, 0.9) for _, box in sorted(boxes)[:MOST])


def _surroundings(depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the median of the depth around each pixel, computed on a smaller image."""
    cv2 = opencv()
    small = cv2.resize(depth_m, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_NEAREST)
    smooth = cv2.medianBlur(small, 5)
    whole: npt.NDArray[np.float32] = cv2.resize(smooth, depth_m.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return whole
