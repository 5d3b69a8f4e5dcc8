"""Which frames a set has: for each class as many that show a target as that show none, split by seed.

A frame without a target is a *hard negative* if somebody reported a target on it that is not there, or if it shows
something else that is an entity of the mission (a boat, a vehicle, another target). Those are taken first. A frame
whose only targets are too faint to be seen is left out: the engine says that nobody sees them, and an eye may differ.

Everything is a function of the frames: where some are to be chosen of many, each seed gives one in turn, in the order
of the hashes of their names.
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
"""Why a negative is hard: a target was reported that is not there, something else is in view; "" for a plain one."""


class SetFrame(msgspec.Struct, frozen=True, kw_only=True):
    """A frame of a set of one class: whether it shows such a target, and if not whether it is a hard one."""

    frame: LabelledFrame
    split: Split
    present: bool
    hard: HardReason = ""


class ClassSet(msgspec.Struct, frozen=True, kw_only=True):
    """The frames of one class, and what was left out: `spare_positives` and `spare_negatives` for balance, `faint`
    because their targets are too faint to be seen."""

    cls: str
    frames: tuple[SetFrame, ...]
    spare_positives: int = 0
    spare_negatives: int = 0
    faint: int = 0

    def count(self, split: Split, *, present: bool) -> int:
        """How many frames of a split show a target, or show none."""
        return sum(one.split == split and one.present == present for one in self.frames)


def validation_seeds(seeds: Iterable[int], share: float) -> frozenset[int]:
    """The last `share` (0..1) of the seeds, rounded up; none of a single seed."""
    every = sorted(set(seeds))
    count = min(len(every) - 1, math.ceil(round(len(every) * share, 9)))  # 0.07 of 100 are 7, not 7.000000000000001
    return frozenset(every[len(every) - count :]) if count > 0 else frozenset()


def class_set(
    frames: Sequence[LabelledFrame], cls: str, share: float = 0.0, most: int | None = None, *, balanced: bool = True
) -> ClassSet:
    """The set of a class from frames of missions that have such targets; a `share` of their seeds is for validation,
    and each half of a split has at most `most` frames. One that is not `balanced` has every frame that fits."""
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
            for frame in _in_turn(one for one in negatives if hardness(one, cls) == hard)
        ]
        spare[True] += len(positives) - with_it
        spare[False] += len(negatives) - without
        chosen += [SetFrame(frame=one, split=split, present=True) for one in _in_turn(positives)[:with_it]]
        chosen += [SetFrame(frame=one, split=split, present=False, hard=hardness(one, cls)) for one in ranked[:without]]
    chosen.sort(key=lambda one: (one.split, one.frame.name))
    return ClassSet(
        cls=cls, frames=tuple(chosen), spare_positives=spare[True], spare_negatives=spare[False], faint=faint
    )


def hardness(frame: LabelledFrame, cls: str) -> HardReason:
    """Why a frame without such a target is easily taken for one with it."""
    if cls in frame.reported:
        return "reported"
    return "other" if frame.boxes else ""


def _in_turn(frames: Iterable[LabelledFrame]) -> list[LabelledFrame]:
    """The frames with each (mission, seed) giving one in turn, those of one in the order of their names' hashes."""
    by_seed: dict[tuple[str, int], list[LabelledFrame]] = {}
    for frame in sorted(frames, key=lambda one: hashlib.sha256(one.name.encode()).digest()):
        by_seed.setdefault((frame.mission, frame.seed), []).append(frame)
    turns = [(turn, key, frame) for key, some in by_seed.items() for turn, frame in enumerate(some)]
    return [frame for _, _, frame in sorted(turns, key=lambda one: one[:2])]


__all__ = ["SPLITS", "ClassSet", "HardReason", "SetFrame", "Split", "class_set", "hardness", "validation_seeds"]
