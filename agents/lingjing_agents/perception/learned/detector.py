"""`LearnedDetector`: the boxes of one class in a picture, by a trained network."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
import numpy.typing as npt

from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage, ImageBox
from lingjing_agents.perception.learned.network import CELL_PX, IntegerLayer, IntegerNetwork
from lingjing_agents.perception.learned.targets import SCALES, TargetScale, reduced
from lingjing_agents.perception.people_at_sea import FoundBox

LEAST_EVIDENCE = -2.0
"""Cells with less are not looked at."""

MOST_CELLS = 400
"""Of the cells with evidence, so many of the best are made boxes of."""

SAME = 0.3
"""The IoU from which two boxes are of one target."""

MOSTLY = 0.7
"""The share of the smaller of two boxes from which they are of one target, however large the other is."""

PixelBoxes = npt.NDArray[np.float64]
"""x0, y0, x1, y1 and the evidence, a line for each box; in pixels of the whole picture."""


@dataclass(frozen=True, slots=True)
class LearnedDetector:
    """The network of one class. Between the points of `evidence` and `confidences` the confidence is interpolated."""

    scale: TargetScale
    network: IntegerNetwork
    evidence: tuple[float, ...]
    confidences: tuple[float, ...]

    def find(self, rgb: ByteImage, pose: CameraPose, level_m: float) -> tuple[FoundBox, ...]:
        """Targets in a picture (height, width, 3) taken over ground at elevation `level_m`, the surest first."""
        height, width = rgb.shape[:2]
        found = self.boxes(rgb, pose, level_m)
        size = np.array([width, height, width, height], np.float64)
        shares = np.clip(found[:, :4] / size, 0.0, 1.0)
        sure = np.interp(found[:, 4], self.evidence, self.confidences)
        return tuple(
            FoundBox(_image_box(share), confidence)
            for share, confidence in zip(shares.tolist(), sure.tolist(), strict=True)
            if share[0] < share[2] and share[1] < share[3]
        )

    def boxes(self, rgb: ByteImage, pose: CameraPose, level_m: float) -> PixelBoxes:
        """The boxes that are left of those of all cells, most evidence first; nothing in a black picture."""
        if not rgb.any():
            return np.empty((0, 5))
        answers = [
            _cell_boxes(self.network.answer(reduced(rgb, factor)), factor)
            for factor in self.scale.factors_for(pose, level_m)
        ]
        return _distinct(np.concatenate([np.empty((0, 5)), *answers]))


def learned_detectors() -> Mapping[str, Callable[[ByteImage, CameraPose, float], tuple[FoundBox, ...]]]:
    """What finds targets, by class: of all classes that a detector ships for."""
    found = ((cls, learned_detector(cls)) for cls in SCALES)
    return {cls: detector.find for cls, detector in found if detector is not None}


@cache
def learned_detector(cls: str) -> LearnedDetector | None:
    """The shipped detector of a class, None if none was trained for it."""
    file = resources.files("lingjing_agents.perception.learned") / "weights" / f"{cls}.npz"
    if cls not in SCALES or not file.is_file():
        return None
    with file.open("rb") as stream, np.load(stream, allow_pickle=False) as stored:
        count = sum(name.startswith("weights") for name in stored.files)
        layers = tuple(
            IntegerLayer(
                stored[f"weights{n}"].astype(np.float32), stored[f"bias{n}"].astype(np.float32), stored[f"scale{n}"]
            )
            for n in range(count)
        )
        evidence, confidences = stored["evidence"].tolist(), stored["confidences"].tolist()
    return LearnedDetector(SCALES[cls], IntegerNetwork(layers), tuple(evidence), tuple(confidences))


def _image_box(share: list[float]) -> ImageBox:
    return share[0], share[1], share[2], share[3]


def _cell_boxes(answer: npt.NDArray[np.float32], factor: int) -> PixelBoxes:
    rows, columns = np.nonzero(answer[..., 0] >= LEAST_EVIDENCE)
    told = answer[rows, columns].astype(np.float64)
    order = np.argsort(-told[:, 0], kind="stable")[:MOST_CELLS]
    told, x, y = told[order], columns[order] * CELL_PX + 0.5, rows[order] * CELL_PX + 0.5
    edges = np.stack([x - told[:, 1], y - told[:, 2], x + told[:, 3], y + told[:, 4]], axis=1)
    return np.concatenate([edges * factor, told[:, :1]], axis=1)


def _distinct(boxes: PixelBoxes) -> PixelBoxes:
    """Of boxes that overlap the one with most evidence; ones that are turned inside out are none."""
    whole = boxes[(boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])]
    left = whole[np.argsort(-whole[:, 4], kind="stable")]
    kept = []
    while len(left):
        best = left[0]
        kept.append(best)
        left = left[_overlaps(best, left) < SAME]
    return np.array(kept).reshape(-1, 5)


def _overlaps(one: npt.NDArray[np.float64], others: PixelBoxes) -> npt.NDArray[np.float64]:
    """The IoU of a box with each of others; more if one holds most of the other."""
    wide = np.minimum(one[2], others[:, 2]) - np.maximum(one[0], others[:, 0])
    high = np.minimum(one[3], others[:, 3]) - np.maximum(one[1], others[:, 1])
    shared = np.maximum(wide, 0.0) * np.maximum(high, 0.0)
    areas = (others[:, 2] - others[:, 0]) * (others[:, 3] - others[:, 1])
    own = (one[2] - one[0]) * (one[3] - one[1])
    inside = shared / np.minimum(areas, own)
    overlaps: npt.NDArray[np.float64] = np.maximum(shared / (areas + own - shared), inside * (inside > MOSTLY))
    return overlaps
