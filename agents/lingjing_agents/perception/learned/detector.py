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
"""Evidence below which a cell is ignored."""

MOST_CELLS = 400
"""Number of cells with the highest evidence that become boxes."""

SAME = 0.3
"""IoU from which on two boxes belong to one target."""

MOSTLY = 0.7
"""Share of the smaller of two boxes in the other from which on they belong to one target."""

PixelBoxes = npt.NDArray[np.float64]
"""(n, 5): x0, y0, x1, y1 in pixels of the whole picture, and the evidence."""


@dataclass(frozen=True, slots=True)
class LearnedDetector:
    """The network of one class."""

    scale: TargetScale
    """The scale at which the class is searched for."""
    network: IntegerNetwork
    """The network."""
    evidence: tuple[float, ...]
    """The evidence at the points of the calibration curve."""
    confidences: tuple[float, ...]
    """The confidence at these points, interpolated between them."""

    def find(self, rgb: ByteImage, pose: CameraPose, level_m: float) -> tuple[FoundBox, ...]:
        """Return the targets in a picture (height, width, 3) over ground at `level_m`, highest confidence first."""
        height, width = rgb.shape[:2]
        boxes = self.boxes(rgb, pose, level_m)
        size = np.array([width, height, width, height], np.float64)
        shares = np.clip(boxes[:, :4] / size, 0.0, 1.0)
        sure = np.interp(boxes[:, 4], self.evidence, self.confidences)
        return tuple(
            FoundBox(_image_box(share), confidence)
            for share, confidence in zip(shares.tolist(), sure.tolist(), strict=True)
            if share[0] < share[2] and share[1] < share[3]
        )

    def boxes(self, rgb: ByteImage, pose: CameraPose, level_m: float) -> PixelBoxes:
        """Return the distinct boxes of all cells, highest evidence first; none in a black picture."""
        if not rgb.any():
            return np.empty((0, 5))
        answers = [
            _cell_boxes(self.network.answer(reduced(rgb, factor)), factor)
            for factor in self.scale.factors_for(pose, level_m)
        ]
        return _distinct(np.concatenate([np.empty((0, 5)), *answers]))


def learned_detectors() -> Mapping[str, Callable[[ByteImage, CameraPose, float], tuple[FoundBox, ...]]]:
    """Return the shipped detectors by class."""
    shipped = ((cls, learned_detector(cls)) for cls in SCALES)
    return {cls: detector.find for cls, detector in shipped if detector is not None}


@cache
def learned_detector(cls: str) -> LearnedDetector | None:
    """Return the shipped detector of a class, or None."""
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
    cells = answer[rows, columns].astype(np.float64)
    order = np.argsort(-cells[:, 0], kind="stable")[:MOST_CELLS]
    cells, x, y = cells[order], columns[order] * CELL_PX + 0.5, rows[order] * CELL_PX + 0.5
    edges = np.stack([x - cells[:, 1], y - cells[:, 2], x + cells[:, 3], y + cells[:, 4]], axis=1)
    return np.concatenate([edges * factor, cells[:, :1]], axis=1)


def _distinct(boxes: PixelBoxes) -> PixelBoxes:
    """Return the box with the highest evidence of each overlapping group. Inverted boxes are dropped."""
    whole = boxes[(boxes[:, 2] > boxes[:, 0]) & (boxes[:, 3] > boxes[:, 1])]
    left = whole[np.argsort(-whole[:, 4], kind="stable")]
    kept = []
    while len(left):
        best = left[0]
        kept.append(best)
        left = left[_overlaps(best, left) < SAME]
    return np.array(kept).reshape(-1, 5)


def _overlaps(box: npt.NDArray[np.float64], others: PixelBoxes) -> npt.NDArray[np.float64]:
    """Return the IoU of a box with each of `others`, or the covered share if one contains most of the other; (n,)."""
    wide = np.minimum(box[2], others[:, 2]) - np.maximum(box[0], others[:, 0])
    high = np.minimum(box[3], others[:, 3]) - np.maximum(box[1], others[:, 1])
    shared = np.maximum(wide, 0.0) * np.maximum(high, 0.0)
    areas = (others[:, 2] - others[:, 0]) * (others[:, 3] - others[:, 1])
    own = (box[2] - box[0]) * (box[3] - box[1])
    inside = shared / np.minimum(areas, own)
    overlaps: npt.NDArray[np.float64] = np.maximum(shared / (areas + own - shared), inside * (inside > MOSTLY))
    return overlaps
