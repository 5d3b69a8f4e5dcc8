"""Detection reports against the ground truth of the frames they speak of (the paper's box-matching rule).

The kernel decides which report matches which target (`adjudicate matched`, one to one in a frame); here it is
counted. A report of a kind that no such rule compares with the truth (a jam, which the engine records when the UAV is
near) is neither true nor false. Aligned frames are all stored frames, each of which was handed to a policy at its
boundary, but reference pictures, of which no report may speak; a mission that judges no reports has none. A report
counts once, whether many heard it or nobody. A target without visible pixels is not evaluated in a frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import msgspec

from lingjing.analysis.memo import once_per_trace
from lingjing.analysis.messages import admitted
from lingjing.plugins.frame_detector import UnitBox
from lingjing.plugins.policy import REFERENCE
from lingjing.trace.admitted import AdmittedMessage
from lingjing.trace.reader import Trace
from lingjing.trace.records import FrameInfo

BINS = 10
"""Bins of equal width of the expected calibration error."""

OVERLAP = 0.5
"""The IoU from which two boxes are of the same thing (the paper's box-matching rule)."""


@dataclass(frozen=True, slots=True)
class MatchedReport:
    """One detection report: what was said, about which frame, and the target it matched, if any.

    `judged` if a rule of the mission compares such reports with the truth: only then is one without a target false.
    `box` is normalised (x0, y0, x1, y1); `position` is (east, north) in metres; `error_m` its planar distance to
    the matched target at the frame's capture time.
    """

    id: str
    tick: int
    sender: str
    frame: str
    cls: str
    box: UnitBox | None
    position: tuple[float, float] | None
    confidence: float | None
    target: str | None
    judged: bool
    error_m: float | None

    @property
    def false(self) -> bool:
        """Whether it was compared with the truth and matches no target."""
        return self.judged and self.target is None


class PerceptionCounts(msgspec.Struct, frozen=True, kw_only=True):
    """What rates of perception over several episodes need of one.

    `missing`, `hallucinating` and `confusing` of the aligned `frames` have one or more of each. `errors_m` are the
    distances of matched reports from their targets, `confidences` what compared reports said of
    themselves and whether they matched.
    """

    frames: int = 0
    missing: int = 0
    hallucinating: int = 0
    confusing: int = 0
    errors_m: tuple[float, ...] = ()
    confidences: tuple[tuple[float, bool], ...] = ()


@dataclass(frozen=True, slots=True)
class Detection:
    """Counts over aligned frames; rates are None where their denominator is zero."""

    reports: tuple[MatchedReport, ...]
    frames: int
    true_positives: int
    false_positives: int
    false_negatives: int
    missing_frames: int
    hallucinating_frames: int
    confusing_frames: int

    @property
    def precision(self) -> float | None:
        """TP / (TP + FP)."""
        return ratio(self.true_positives, self.true_positives + self.false_positives)

    @property
    def recall(self) -> float | None:
        """TP / (TP + FN)."""
        return ratio(self.true_positives, self.true_positives + self.false_negatives)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall."""
        wrong = self.false_positives + self.false_negatives
        return ratio(2 * self.true_positives, 2 * self.true_positives + wrong)

    @property
    def miss_rate(self) -> float | None:
        """Share of aligned frames with at least one unmatched visible target."""
        return ratio(self.missing_frames, self.frames)

    @property
    def hallucination_rate(self) -> float | None:
        """Share of aligned frames with at least one unmatched report."""
        return ratio(self.hallucinating_frames, self.frames)

    @property
    def confusion_rate(self) -> float | None:
        """Share of aligned frames with a report that took something else for a target.

        "Number of evaluated perception calls assigned to an incorrect target class or distractor": a report without a
        target of its own whose box overlaps by half (IoU) with the true box of something of another class.
        """
        return ratio(self.confusing_frames, self.frames)

    @property
    def localisation_error_m(self) -> float | None:
        """Median planar error over matched reports that name a position."""
        errors = [report.error_m for report in self.reports if report.error_m is not None]
        return median(errors) if errors else None

    @property
    def counts(self) -> PerceptionCounts:
        """What is pooled over episodes."""
        return PerceptionCounts(
            frames=self.frames,
            missing=self.missing_frames,
            hallucinating=self.hallucinating_frames,
            confusing=self.confusing_frames,
            errors_m=tuple(report.error_m for report in self.reports if report.error_m is not None),
            confidences=self.confidences,
        )

    @property
    def calibration_error(self) -> float | None:
        """Expected calibration error of the reports' confidences against their matches, ten bins."""
        return calibration_error(self.confidences)

    @property
    def confidences(self) -> tuple[tuple[float, bool], ...]:
        """The confidence of each report that was compared with the truth and has one, and whether it matched."""
        return tuple(
            (r.confidence, r.target is not None) for r in self.reports if r.judged and r.confidence is not None
        )


@once_per_trace
def detect(trace: Trace) -> Detection:
    """Align every report of the trace with the frame it names."""
    reports = tuple(_reports(trace))
    hits: dict[str, set[str]] = {}
    wrong: set[str] = set()
    for report in reports:
        if report.false:
            wrong.add(report.frame)
        elif report.target is not None:
            hits.setdefault(report.frame, set()).add(report.target)
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    frames = shots(trace) if judged_kinds(trace) else ()
    missed = {frame.id: len(_visible(frame, targets) - hits.get(frame.id, set())) for frame in frames}
    return Detection(
        reports=reports,
        frames=len(frames),
        true_positives=sum(len(found) for found in hits.values()),
        false_positives=sum(report.false for report in reports),
        false_negatives=sum(missed.values()),
        missing_frames=sum(count > 0 for count in missed.values()),
        hallucinating_frames=sum(frame.id in wrong for frame in frames),
        confusing_frames=len({report.frame for report in reports if confused_with(trace, report) is not None}),
    )


def calibration_error(judged: Sequence[tuple[float, bool]]) -> float | None:
    """Expected calibration error of confidences and whether each was right: "Mean absolute difference between box-match
    accuracy and mean confidence across ten bins of equal width, weighted by the number of samples in each bin". A
    confidence outside 0..1 counts in the bin that is nearest."""
    return ratio(sum(map(abs, calibration_gaps(judged))), len(judged))


def calibration_gaps(judged: Sequence[tuple[float, bool]]) -> list[float]:
    """By bin, how many were right less the sum of the confidences; those of several episodes add up."""
    gaps = [0.0] * BINS
    for confidence, right in judged:
        gaps[int(min(max(confidence, 0.0), 1.0 - 0.5 / BINS) * BINS)] += right - confidence
    return gaps


def confused_with(trace: Trace, report: MatchedReport) -> str | None:
    """The entity of another class that a false report took for a target: the one whose true box overlaps most with the
    report's, by half or more; None if it is of nothing, or of nothing else."""
    info = trace.frames.get(report.frame)
    if not report.false or report.box is None or info is None:
        return None
    others = [(iou(report.box, truth.box), truth.entity) for truth in info.boxes if truth.cls != report.cls]
    overlap, entity = max(others, default=(0.0, ""))
    return entity if overlap >= OVERLAP else None


def iou(one: UnitBox, other: UnitBox) -> float:
    """Intersection over union of two boxes."""
    width = min(one[2], other[2]) - max(one[0], other[0])
    height = min(one[3], other[3]) - max(one[1], other[1])
    shared = max(0.0, width) * max(0.0, height)
    union = sum(abs((box[2] - box[0]) * (box[3] - box[1])) for box in (one, other)) - shared
    return shared / union if union > 0 else 0.0


@once_per_trace
def matching_rules(trace: Trace) -> frozenset[str]:
    """Names of the rules that compare a report with the truth."""
    return frozenset(rule.name for rule in trace.header.instance.rules if rule.matching)


@once_per_trace
def shots(trace: Trace) -> tuple[FrameInfo, ...]:
    """The frames that somebody's camera took during the episode: all but reference pictures."""
    return tuple(frame for frame in trace.frames.values() if frame.camera != REFERENCE)


def judged_kinds(trace: Trace) -> frozenset[str]:
    """The kinds of messages that a matching rule compares with the truth."""
    kinds = {kind.kind for kind in trace.header.instance.messages}
    rules = (rule for rule in trace.header.instance.rules if rule.matching)
    return frozenset(kinds & {parameter.domain for rule in rules for parameter in rule.parameters})


def position_of(trace: Trace, entity: str, tick: int) -> tuple[float, float] | None:
    """True (east, north) of an entity at boundary `tick`, None if there is no such boundary or entity."""
    if not 0 <= tick < len(trace.boundaries) or not trace.boundaries[tick].snapshots:
        return None
    for state in trace.boundaries[tick].snapshots[-1].states:
        if state.id == entity:
            return state.position[0], state.position[1]
    return None


def ratio(part: float, whole: float) -> float | None:
    """Part / whole, None for an empty whole."""
    return part / whole if whole else None


def numbers(value: object, count: int) -> tuple[float, ...] | None:
    """The first `count` finite numbers of a message field, None if it does not hold them."""
    if not isinstance(value, tuple) or len(value) < count:
        return None
    plain = [float(item) for item in value[:count] if isinstance(item, int | float) and math.isfinite(item)]
    return tuple(plain) if len(plain) == count else None


def _reports(trace: Trace) -> Iterator[MatchedReport]:
    matches, judged = _matches(trace), judged_kinds(trace)
    for message in admitted(trace):
        if message.category == "report":
            yield _report(trace, message, matches.get(message.id), message.kind in judged)


def _report(trace: Trace, said: AdmittedMessage, target: str | None, judged: bool) -> MatchedReport:
    body = said.body
    frame, box = str(body.get("frame") or ""), _box(said)
    position, confidence = numbers(body.get("position"), 2), body.get("confidence")
    info = trace.frames.get(frame)
    truth = position_of(trace, target, info.tick) if target is not None and info is not None else None
    return MatchedReport(
        id=said.id,
        tick=said.tick,
        sender=said.sender,
        frame=frame,
        cls=str(body.get("class") or ""),
        box=box,
        position=None if position is None else (position[0], position[1]),
        confidence=float(confidence) if isinstance(confidence, int | float) else None,
        target=target,
        judged=judged,
        error_m=math.dist(position, truth) if position is not None and truth is not None else None,
    )


def _box(said: AdmittedMessage) -> UnitBox | None:
    box = numbers(said.body.get("box"), 4)
    return None if box is None else (box[0], box[1], box[2], box[3])


def _matches(trace: Trace) -> dict[str, str]:
    """MatchedReport id to target, from the events of the matching rules, whatever the order of their parameters."""
    rules = matching_rules(trace)
    entities = {entity.id for entity in trace.header.instance.entities}
    found: dict[str, str] = {}
    for record in trace.boundaries:
        for event in record.events:
            targets = [name for name in event.bindings if name in entities]
            reports = [name for name in event.bindings if name not in entities]
            if event.kind in rules and targets and reports:
                found[reports[0]] = targets[0]
    return found


def _visible(frame: FrameInfo, targets: set[str]) -> set[str]:
    return {truth.entity for truth in frame.boxes if truth.pixels > 0 and truth.entity in targets}
