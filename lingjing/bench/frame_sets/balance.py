"""The choice of frames for a set: for each class as many with a target as without, split by seed.

A frame without a target is a *hard negative* if a false report refers to it, or if it shows another entity of the
mission (a boat, a vehicle, another target). Hard negatives are chosen first. A frame is left out if
its only targets are too faint: the engine calls them invisible, and a human may disagree.

The choice is a function of the frames: each seed gives one frame in turn, in the order of the hashes of frame names.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from typing import Literal

import msgspec

from lingjing.bench.frame_sets.labelled import LabelledFrame

Split = Literal["train", "validation"]
SPLITS: tuple[Split, ...] = ("train", "validation")

HardReason = Literal["", "reported", "other"]
"""`reported`: a false report refers to the frame. `other`: another entity is in view. "": not hard."""


class SetFrame(msgspec.Struct, frozen=True, kw_only=True):
    """A frame in the set of one class."""

    frame: LabelledFrame
    split: Split
    present: bool
    """True if the frame shows a target of the class."""
    hard: HardReason = ""
    """The kind of hard negative."""


class ClassSet(msgspec.Struct, frozen=True, kw_only=True):
    """The frames of one class."""

    cls: str
    frames: tuple[SetFrame, ...]
    spare_positives: int = 0
    """Frames with a target that were left out for balance."""
    spare_negatives: int = 0
    """Frames without a target that were left out for balance."""
    faint: int = 0
    """Frames that were left out because their targets are too faint."""

    def count(self, split: Split, *, present: bool) -> int:
        """Return the number of frames of a split with a target, or without."""
        return sum(frame.split == split and frame.present == present for frame in self.frames)


def validation_seeds(seeds: Iterable[int], share: float) -> frozenset[int]:
    """Return the last `share` (0 to 1) of the seeds, rounded up; none if there is a single seed."""
    every = sorted(set(seeds))
    count = min(len(every) - 1, math.ceil(round(len(every) * share, 9)))  # 0.07 · 100 is 7.000000000000001
    return frozenset(every[len(every) - count :]) if count > 0 else frozenset()


def class_set(
    frames: Sequence[LabelledFrame], cls: str, share: float = 0.0, most: int | None = None, *, balanced: bool = True
) -> ClassSet:
    """Return the set of a class from the frames of missions with such targets.

    A `share` of the seeds is for validation. Each half of a split has at most `most` frames. A set that is not
    `balanced` has all frames.
    """
    fitting = {frame.name: frame for frame in frames if cls in frame.targets}
    held = validation_seeds((frame.seed for frame in fitting.values()), share)
    chosen: list[SetFrame] = []
    spare = {True: 0, False: 0}
    faint = 0
    for split in SPLITS:
        mine = [frame for frame in fitting.values() if (frame.seed in held) == (split == "validation")]
        positives = [frame for frame in mine if frame.shows(cls)]
        negatives = [frame for frame in mine if not frame.shows(cls) and cls not in frame.faint]
        faint += len(mine) - len(positives) - len(negatives)
        bound = len(mine) if most is None else most
        with_it, without = min(len(positives), bound), min(len(negatives), bound)
        if balanced:
            with_it = without = min(with_it, without)
        ranked = [
            frame
            for hard in ("reported", "other", "")
            for frame in _in_turn(labelled for labelled in negatives if _hardness(labelled, cls) == hard)
        ]
        spare[True] += len(positives) - with_it
        spare[False] += len(negatives) - without
        chosen += [SetFrame(frame=labelled, split=split, present=True) for labelled in _in_turn(positives)[:with_it]]
        chosen += [
            SetFrame(frame=labelled, split=split, present=False, hard=_hardness(labelled, cls))
            for labelled in ranked[:without]
        ]
    chosen.sort(key=lambda labelled: (labelled.split, labelled.frame.name))
    return ClassSet(
        cls=cls, frames=tuple(chosen), spare_positives=spare[True], spare_negatives=spare[False], faint=faint
    )


def _hardness(frame: LabelledFrame, cls: str) -> HardReason:
    """Return the reason why a frame without such a target is easily mistaken for one with it."""
    if cls in frame.reported:
        return "reported"
    return "other" if frame.boxes else ""


def _in_turn(frames: Iterable[LabelledFrame]) -> list[LabelledFrame]:
    """Return the frames with each (mission, seed) giving one in turn, in the order of the hashes of their names."""
    by_seed: dict[tuple[str, int], list[LabelledFrame]] = {}
    for frame in sorted(frames, key=lambda item: hashlib.sha256(item.name.encode()).digest()):
        by_seed.setdefault((frame.mission, frame.seed), []).append(frame)
    turns = [(turn, key, frame) for key, some in by_seed.items() for turn, frame in enumerate(some)]
    return [frame for _, _, frame in sorted(turns, key=lambda item: item[:2])]


__all__ = ["SPLITS", "ClassSet", "HardReason", "SetFrame", "Split", "class_set", "validation_seeds"]
