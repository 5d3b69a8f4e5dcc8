"""The paper's appearance probe: detectors report whether a frame, and its twin, shows a target.

Both pictures of a pair get the same question. F1 is that of presence, 2 TP / (2 TP + FP + FN), pooled by detector,
class and domain. The difference is F1 on the twins less F1 on the frames. Intervals are bootstrapped over pairs, with
the same samples for both domains. A missing answer counts as no detection. Boxes, if a detector returns any, are
matched on the frames (IoU at least 0.5, each target once).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.analysis.detection import OVERLAP, iou, ratio
from lingjing.analysis.shares import ConfidenceBounds
from lingjing.bench.frame_sets.balance import SetFrame
from lingjing.bench.frame_sets.folder import read_picture
from lingjing.bench.frame_sets.twins import TwinRecord, decoded, twin_picture
from lingjing.bench.statistics import bounds_of, drawn_samples
from lingjing.bench.table_cells import ABSENT, UNDEFINED, ResultCell, ResultLine, ResultTable
from lingjing.plugins.frame_detector import FrameDetector, FrameQuestion


class ProbedFrame(msgspec.Struct, frozen=True, kw_only=True):
    """The answers of one detector on one frame, and on its twin if there is one."""

    detector: str
    cls: str
    name: str
    truth: bool
    """True if the frame shows a target."""
    said: bool
    """True if the detector reports a target."""
    twin_said: bool | None = None
    """True if the detector reports a target on the twin; None without a twin."""
    unanswered: int = 0
    """Number of missing answers (0 to 2)."""
    hits: int = 0
    """Matched boxes."""
    boxes: int = 0
    """Boxes of the detector."""
    targets: int = 0
    """True boxes."""


class Confusion(msgspec.Struct, frozen=True, kw_only=True):
    """Counts of right and wrong answers of a detector."""

    true_positives: int
    false_positives: int
    false_negatives: int
    true_negatives: int


class ProbeCell(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one detector in one class. Undefined numbers are None; intervals are 95 % intervals."""

    detector: str
    cls: str
    pairs: int
    """Frames with a twin."""
    frames: Confusion
    """Counts on the frames."""
    twins: Confusion | None
    """Counts on the twins; None without pairs."""
    f1: float | None
    """F1 on the frames."""
    f1_bounds: ConfidenceBounds
    twin_f1: float | None
    """F1 on the twins."""
    twin_bounds: ConfidenceBounds
    difference: float | None
    """F1 on the twins less F1 on the frames."""
    difference_bounds: ConfidenceBounds
    precision: float | None
    """Precision of boxes on the frames."""
    recall: float | None
    """Recall of boxes on the frames."""
    unanswered: int
    """Number of missing answers."""

    @property
    def counted(self) -> int:
        """The number of frames behind `f1`: those with a twin, if there are any."""
        counts = self.frames
        return counts.true_positives + counts.false_positives + counts.false_negatives + counts.true_negatives


def probed(
    folder: Path,
    cls: str,
    frames: Sequence[SetFrame],
    detector: tuple[str, FrameDetector],
    twins: Mapping[str, tuple[Path, TwinRecord]],
) -> Iterator[ProbedFrame]:
    """Run a detector, given with its name, on frames of a set's folder, and on their twins by frame name."""
    name, model = detector
    for item in frames:
        jpeg = read_picture(folder, cls, item)
        answer = model.answer(_question(cls, item, jpeg))
        twin_answer = None
        if item.frame.name in twins:
            twin_answer = model.answer(_question(cls, item, twin_picture(*twins[item.frame.name])))
        left = [box.box for box in item.frame.shows(cls)]
        hits = 0
        for box in answer.boxes:
            best = max(left, key=lambda true: iou(box, true), default=None)
            if best is not None and iou(box, best) >= OVERLAP:
                left.remove(best)
                hits += 1
        yield ProbedFrame(
            detector=name, cls=cls, name=item.frame.name, truth=item.present, said=answer.present,
            twin_said=None if twin_answer is None else twin_answer.present,
            unanswered=bool(answer.failure) + bool(twin_answer is not None and twin_answer.failure),
            hits=hits, boxes=len(answer.boxes), targets=hits + len(left),
        )  # fmt: skip


def _question(cls: str, item: SetFrame, picture: bytes) -> FrameQuestion:
    return FrameQuestion(cls, picture, decoded(picture), item.frame.pose, item.frame.level_m)


def probe_cell(answers: Sequence[ProbedFrame]) -> ProbeCell:
    """Return the cell of one detector and class."""
    paired = [answer for answer in answers if answer.twin_said is not None]
    counts = np.array([_kind(answer.truth, answer.said) for answer in paired or answers])
    twin_counts = np.array([_kind(answer.truth, bool(answer.twin_said)) for answer in paired]).reshape(-1, 4)
    drawn = drawn_samples(len(counts))
    scores = _f1s(counts[drawn].sum(axis=1))
    twin_scores = _f1s(twin_counts[drawn].sum(axis=1)) if paired else np.full(1, math.nan)
    f1, twin_f1 = _f1(counts), _f1(twin_counts)
    hits, boxes, targets = (sum(getattr(answer, field) for answer in answers) for field in ("hits", "boxes", "targets"))
    return ProbeCell(
        detector=answers[0].detector, cls=answers[0].cls, pairs=len(paired),
        frames=_confusion(counts), twins=_confusion(twin_counts) if paired else None,
        f1=f1, f1_bounds=bounds_of(scores), twin_f1=twin_f1, twin_bounds=bounds_of(twin_scores),
        difference=None if f1 is None or twin_f1 is None else twin_f1 - f1,
        difference_bounds=bounds_of(twin_scores - scores),
        precision=ratio(hits, boxes), recall=ratio(hits, targets),
        unanswered=sum(answer.unanswered for answer in answers),
    )  # fmt: skip


def probe_table(cells: Sequence[ProbeCell], notes: Sequence[str] = ()) -> ResultTable:
    """Return the paper's table: a line for each class and detector."""
    lines = tuple(
        ResultLine("", (cell.cls, cell.detector), (
            _count(cell.counted),
            _with_bounds(cell.f1, cell.f1_bounds),
            _with_bounds(cell.twin_f1, cell.twin_bounds) if cell.pairs else ResultCell(ABSENT),
            _with_bounds(cell.difference, cell.difference_bounds, sign="+") if cell.pairs else ResultCell(ABSENT),
            _plain(cell.precision), _plain(cell.recall), _count(cell.unanswered),
        ))
        for cell in cells
    )  # fmt: skip
    return ResultTable(
        "probe",
        "Appearance probe",
        ("Class", "Detector"),
        ("Counted", "F1 frames", "F1 twins", "Difference", "Box precision", "Box recall", "Unanswered"),
        lines,
        tuple(notes),
    )


def _kind(truth: bool, answer: bool) -> tuple[bool, bool, bool, bool]:
    """Return the class of an answer as flags: TP, FP, FN, TN."""
    return truth and answer, answer and not truth, truth and not answer, not (truth or answer)


def _confusion(counts: npt.NDArray[np.generic]) -> Confusion:
    tp, fp, fn, tn = (int(value) for value in counts.sum(axis=0))
    return Confusion(true_positives=tp, false_positives=fp, false_negatives=fn, true_negatives=tn)


def _f1(counts: npt.NDArray[np.generic]) -> float | None:
    score = float(_f1s(counts.sum(axis=0)[np.newaxis])[0]) if len(counts) else math.nan
    return None if math.isnan(score) else score


def _f1s(totals: npt.NDArray[np.generic]) -> npt.NDArray[np.float64]:
    """Return F1 of each row of TP, FP, FN, TN; nan if all but TN are 0."""
    tp, fp, fn = (totals[:, place].astype(np.float64) for place in range(3))
    with np.errstate(invalid="ignore"):
        scores: npt.NDArray[np.float64] = 2 * tp / (2 * tp + fp + fn)
    return scores


def _with_bounds(value: float | None, bounds: ConfidenceBounds, sign: str = "-") -> ResultCell:
    if value is None:
        return ResultCell(UNDEFINED)
    return ResultCell(f"{value:{sign}.2f} [{bounds.low:{sign}.2f}, {bounds.high:{sign}.2f}]", value)


def _plain(value: float | None) -> ResultCell:
    return ResultCell(UNDEFINED) if value is None else ResultCell(f"{value:.2f}", value)


def _count(number: int) -> ResultCell:
    return ResultCell(str(number), float(number))


__all__ = ["Confusion", "ProbeCell", "ProbedFrame", "probe_cell", "probe_table", "probed"]
