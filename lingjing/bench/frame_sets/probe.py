"""The paper's appearance probe: whether detectors see a target in a frame, and in its twin.

Both pictures of a pair are asked about with the same question. F1 is that of presence, 2 TP / (2 TP + FP + FN), pooled
by detector, class and domain; the difference is F1 on the twins less F1 on the frames. Intervals are bootstrapped over
pairs, the same draw for both domains. An answer that did not come counts as no detection. Boxes, where a detector
gives some, are judged on the frames by the box-matching rule (IoU at least 0.5, each target once).
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
    """What one detector said of one frame, and of its twin if there is one."""

    detector: str
    cls: str
    name: str
    truth: bool
    said: bool
    twin_said: bool | None = None
    unanswered: int = 0
    hits: int = 0
    boxes: int = 0
    targets: int = 0


class Confusion(msgspec.Struct, frozen=True, kw_only=True):
    """How often a detector said yes and no, rightly and wrongly."""

    true_positives: int
    false_positives: int
    false_negatives: int
    true_negatives: int


class ProbeCell(msgspec.Struct, frozen=True, kw_only=True):
    """The counts of a detector in a class. F1 of the frames, of the twins, and their difference, each None where it is
    over nothing, with 95 % intervals; `precision` and `recall` are of boxes."""

    detector: str
    cls: str
    pairs: int
    frames: Confusion
    twins: Confusion | None
    f1: float | None
    f1_bounds: ConfidenceBounds
    twin_f1: float | None
    twin_bounds: ConfidenceBounds
    difference: float | None
    difference_bounds: ConfidenceBounds
    precision: float | None
    recall: float | None
    unanswered: int

    @property
    def counted(self) -> int:
        """How many frames the F1 of frames is over: those of pairs, if there are any."""
        said = self.frames
        return said.true_positives + said.false_positives + said.false_negatives + said.true_negatives


def probed(
    folder: Path,
    cls: str,
    frames: Sequence[SetFrame],
    detector: tuple[str, FrameDetector],
    twins: Mapping[str, tuple[Path, TwinRecord]],
) -> Iterator[ProbedFrame]:
    """Ask a detector, which comes with its name, about frames of a set's folder, and about their twins by the frames'
    names."""
    name, asked = detector
    for one in frames:
        jpeg = read_picture(folder, cls, one)
        answer = asked.answer(_question(cls, one, jpeg))
        twin_answer = None
        if one.frame.name in twins:
            twin_answer = asked.answer(_question(cls, one, twin_picture(*twins[one.frame.name])))
        left = [box.box for box in one.frame.shows(cls)]
        hits = 0
        for box in answer.boxes:
            best = max(left, key=lambda true: iou(box, true), default=None)
            if best is not None and iou(box, best) >= OVERLAP:
                left.remove(best)
                hits += 1
        yield ProbedFrame(
            detector=name, cls=cls, name=one.frame.name, truth=one.present, said=answer.present,
            twin_said=None if twin_answer is None else twin_answer.present,
            unanswered=bool(answer.failure) + bool(twin_answer is not None and twin_answer.failure),
            hits=hits, boxes=len(answer.boxes), targets=hits + len(left),
        )  # fmt: skip


def _question(cls: str, one: SetFrame, picture: bytes) -> FrameQuestion:
    return FrameQuestion(cls, picture, decoded(picture), one.frame.pose, one.frame.level_m)


def probe_cell(answers: Sequence[ProbedFrame]) -> ProbeCell:
    """The cell of one detector and class."""
    paired = [one for one in answers if one.twin_said is not None]
    counts = np.array([_kind(one.truth, one.said) for one in paired or answers])
    twin_counts = np.array([_kind(one.truth, bool(one.twin_said)) for one in paired]).reshape(-1, 4)
    drawn = drawn_samples(len(counts))
    scores = _f1s(counts[drawn].sum(axis=1))
    twin_scores = _f1s(twin_counts[drawn].sum(axis=1)) if paired else np.full(1, math.nan)
    f1, twin_f1 = _f1(counts), _f1(twin_counts)
    hits, boxes, targets = (sum(getattr(one, field) for one in answers) for field in ("hits", "boxes", "targets"))
    return ProbeCell(
        detector=answers[0].detector, cls=answers[0].cls, pairs=len(paired),
        frames=_confusion(counts), twins=_confusion(twin_counts) if paired else None,
        f1=f1, f1_bounds=bounds_of(scores), twin_f1=twin_f1, twin_bounds=bounds_of(twin_scores),
        difference=None if f1 is None or twin_f1 is None else twin_f1 - f1,
        difference_bounds=bounds_of(twin_scores - scores),
        precision=ratio(hits, boxes), recall=ratio(hits, targets),
        unanswered=sum(one.unanswered for one in answers),
    )  # fmt: skip


def probe_table(cells: Sequence[ProbeCell], notes: Sequence[str] = ()) -> ResultTable:
    """The paper's table: a line for each class and detector."""
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


def _kind(truth: bool, said: bool) -> tuple[bool, bool, bool, bool]:
    """Which of the four counts an answer is one of: TP, FP, FN, TN."""
    return truth and said, said and not truth, truth and not said, not (truth or said)


def _confusion(counts: npt.NDArray[np.generic]) -> Confusion:
    tp, fp, fn, tn = (int(value) for value in counts.sum(axis=0))
    return Confusion(true_positives=tp, false_positives=fp, false_negatives=fn, true_negatives=tn)


def _f1(counts: npt.NDArray[np.generic]) -> float | None:
    score = float(_f1s(counts.sum(axis=0)[np.newaxis])[0]) if len(counts) else math.nan
    return None if math.isnan(score) else score


def _f1s(totals: npt.NDArray[np.generic]) -> npt.NDArray[np.float64]:
    """F1 of each row of TP, FP, FN, TN; nan where there is nothing to find and nothing was found."""
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
