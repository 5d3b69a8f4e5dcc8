"""Comparison of detection reports with the ground truth of their frames (the paper's box-matching rule).

The kernel decides which report matches which target (`adjudicate matched`, one to one in a frame). This module counts
the results. A report of a kind that no matching rule compares with the truth is neither true nor false. An example is
the report of a jam, which the engine records when the UAV is near.

A target is missed if it is visible and no report matches it, and if one could: rivals, which only resemble targets, and
places that no rule compares with reports are never missed (`completion.judged_targets`).

*Aligned frames* are the pictures that an agent received which may report what they show: a driver's view is none where
only searchers report (ADR 0053). Reference pictures are left out, because no report may name them. A mission without a
matching rule has no aligned frames. A report counts once, whatever the number of its recipients. A target without
visible pixels is not evaluated in a frame.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import msgspec

from lingjing.analysis.completion import judged_targets
from lingjing.analysis.memo import cache_by_trace
from lingjing.analysis.messages import admitted_messages
from lingjing.plugins.frame_detector import UnitBox
from lingjing.plugins.policy import REFERENCE
from lingjing.trace.admitted_messages import AdmittedMessage
from lingjing.trace.reader import Trace
from lingjing.trace.records import FrameInfo

BINS = 10
"""Number of bins, of equal width, of the expected calibration error (the paper's definition)."""

OVERLAP = 0.5
"""Lowest IoU of two boxes of the same object (the paper's box-matching rule)."""


@dataclass(frozen=True, slots=True)
class MatchedReport:
    """One detection report, with the target that it matched."""

    id: str
    tick: int
    sender: str
    frame: str
    """The id of the frame that the report names; "" if it names none."""
    cls: str
    box: UnitBox | None
    """The box of the report; None if the report has no valid box."""
    position: tuple[float, float] | None
    """(east, north) in metres. None if the report has no position."""
    confidence: float | None
    target: str | None
    """The matched target, or None."""
    judged: bool
    """True if a rule of the mission compares reports of this kind with the truth."""
    error_m: float | None
    """Planar distance between `position` and the matched target at the capture time of the frame. None if unknown."""

    @property
    def false(self) -> bool:
        """True if the report was compared with the truth and matches no target."""
        return self.judged and self.target is None


class PerceptionCounts(msgspec.Struct, frozen=True, kw_only=True):
    """The counts of one episode for rates of perception over several episodes."""

    frames: int = 0
    """Number of aligned frames."""
    missing: int = 0
    """Number of aligned frames with an unmatched visible target."""
    hallucinating: int = 0
    """Number of aligned frames with a false report."""
    confusing: int = 0
    """Number of aligned frames with a report that confuses another object with a target."""
    errors_m: tuple[float, ...] = ()
    """Distances of matched reports from their targets."""
    confidences: tuple[tuple[float, bool], ...] = ()
    """The confidence of each judged report, and True if it matched."""


@dataclass(frozen=True, slots=True)
class Detection:
    """Reports, and counts over aligned frames. A rate is None if its denominator is zero."""

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
        """Share of aligned frames with a report that confuses another object with a target.

        The paper: "Number of evaluated perception calls assigned to an incorrect target class or distractor". Such a
        report is false, and its box has an IoU of at least `OVERLAP` with the true box of an object of another class,
        which is an entity or a thing without one (`FrameInfo.others`).
        """
        return ratio(self.confusing_frames, self.frames)

    @property
    def localisation_error_m(self) -> float | None:
        """Median planar error over matched reports that name a position."""
        errors = [report.error_m for report in self.reports if report.error_m is not None]
        return median(errors) if errors else None

    @property
    def counts(self) -> PerceptionCounts:
        """The counts that are pooled over episodes."""
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
        """The confidence of each judged report that has one, and True if it matched."""
        return tuple(
            (r.confidence, r.target is not None) for r in self.reports if r.judged and r.confidence is not None
        )


@cache_by_trace
def detect(trace: Trace) -> Detection:
    """Align every report of the trace with its frame, and count."""
    reports = tuple(_reports(trace))
    hits: dict[str, set[str]] = {}
    wrong: set[str] = set()
    for report in reports:
        if report.false:
            wrong.add(report.frame)
        elif report.target is not None:
            hits.setdefault(report.frame, set()).add(report.target)
    targets, frames = judged_targets(trace.header.instance), aligned_frames(trace)
    missed = {frame.id: len(_visible(frame, targets) - hits.get(frame.id, set())) for frame in frames}
    return Detection(
        reports=reports,
        frames=len(frames),
        true_positives=sum(map(len, hits.values())),
        false_positives=sum(report.false for report in reports),
        false_negatives=sum(missed.values()),
        missing_frames=sum(count > 0 for count in missed.values()),
        hallucinating_frames=sum(frame.id in wrong for frame in frames),
        confusing_frames=len({report.frame for report in reports if confused_with(trace, report) is not None}),
    )


def calibration_error(judged: Sequence[tuple[float, bool]]) -> float | None:
    """Return the expected calibration error of (confidence, correct) pairs, or None if there are none.

    The paper: "Mean absolute difference between box-match accuracy and mean confidence across ten bins of equal width,
    weighted by the number of samples in each bin". A confidence outside 0..1 counts in the nearest bin.
    """
    return ratio(sum(map(abs, calibration_gaps(judged))), len(judged))


def calibration_gaps(judged: Sequence[tuple[float, bool]]) -> list[float]:
    """Return, for each bin, the number of correct samples minus the sum of confidences.

    The gaps of several episodes can be added.
    """
    gaps = [0.0] * BINS
    for confidence, right in judged:
        gaps[int(min(max(confidence, 0.0), 1.0 - 0.5 / BINS) * BINS)] += right - confidence
    return gaps


def confused_with(trace: Trace, report: MatchedReport) -> str | None:
    """Return the object of another class that a false report confused with a target, or None.

    It is the object with the largest IoU between its true box and the box of the report, if that is at least `OVERLAP`:
    the id of an entity, or the class of a thing without one.
    """
    info = trace.frames.get(report.frame)
    if not report.false or report.box is None or info is None:
        return None
    others = [
        (iou(report.box, truth.box), truth.entity or truth.cls)
        for truth in (*info.boxes, *info.others)
        if truth.cls != report.cls
    ]
    overlap, entity = max(others, default=(0.0, ""))
    return entity if overlap >= OVERLAP else None


def iou(first: UnitBox, second: UnitBox) -> float:
    """Return the intersection over union of two boxes."""
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    shared = max(0.0, width) * max(0.0, height)
    union = sum(abs((box[2] - box[0]) * (box[3] - box[1])) for box in (first, second)) - shared
    return shared / union if union > 0 else 0.0


@cache_by_trace
def matching_rules(trace: Trace) -> frozenset[str]:
    """Return the names of the rules that compare a report with the truth."""
    return frozenset(rule.name for rule in trace.header.instance.rules if rule.matching)


@cache_by_trace
def shots(trace: Trace) -> tuple[FrameInfo, ...]:
    """Return the frames that mounted cameras took during the episode: all except reference pictures."""
    return tuple(frame for frame in trace.frames.values() if frame.camera != REFERENCE)


@cache_by_trace
def aligned_frames(trace: Trace) -> tuple[FrameInfo, ...]:
    """Return the frames of `shots` without those that only agents receive which cannot report what they show."""
    instance, judged = trace.header.instance, judged_kinds(trace)
    reporting = {
        agent.id
        for agent in instance.agents
        if any(message.kind in judged and message.is_sent_by(agent.role) for message in instance.messages)
    }

    def is_aligned(frame: FrameInfo) -> bool:
        viewers = {agent.id for agent in instance.agents if agent.receives_pictures(frame.entity, frame.camera)}
        return not viewers or not viewers.isdisjoint(reporting)

    return tuple(filter(is_aligned, shots(trace))) if judged else ()


def judged_kinds(trace: Trace) -> frozenset[str]:
    """Return the kinds of messages that a matching rule compares with the truth."""
    kinds = {kind.kind for kind in trace.header.instance.messages}
    rules = (rule for rule in trace.header.instance.rules if rule.matching)
    return frozenset(kinds & {parameter.domain for rule in rules for parameter in rule.parameters})


def _position_of(trace: Trace, entity: str, tick: int) -> tuple[float, float] | None:
    """Return the true (east, north) of an entity at boundary `tick`, or None if either does not exist."""
    if not 0 <= tick < len(trace.boundaries) or not trace.boundaries[tick].snapshots:
        return None
    for state in trace.boundaries[tick].snapshots[-1].states:
        if state.id == entity:
            return state.position[0], state.position[1]
    return None


def ratio(part: float, whole: float) -> float | None:
    """Return `part / whole`, or None if `whole` is zero."""
    return part / whole if whole else None


def numbers(value: object, count: int) -> tuple[float, ...] | None:
    """Return the first `count` items of a message field as floats, or None if they are not finite numbers."""
    if not isinstance(value, tuple) or len(value) < count:
        return None
    plain = [float(item) for item in value[:count] if isinstance(item, int | float) and math.isfinite(item)]
    return tuple(plain) if len(plain) == count else None


def _reports(trace: Trace) -> Iterator[MatchedReport]:
    matches, judged = _matches(trace), judged_kinds(trace)
    for message in admitted_messages(trace):
        if message.category == "report":
            yield _report(trace, message, matches.get(message.id), message.kind in judged)


def _report(trace: Trace, message: AdmittedMessage, target: str | None, judged: bool) -> MatchedReport:
    body = message.body
    frame, box = str(body.get("frame") or ""), _box(message)
    position, confidence = numbers(body.get("position"), 2), body.get("confidence")
    info = trace.frames.get(frame)
    truth = _position_of(trace, target, info.tick) if target is not None and info is not None else None
    return MatchedReport(
        id=message.id,
        tick=message.tick,
        sender=message.sender,
        frame=frame,
        cls=str(body.get("class") or ""),
        box=box,
        position=None if position is None else (position[0], position[1]),
        confidence=float(confidence) if isinstance(confidence, int | float) else None,
        target=target,
        judged=judged,
        error_m=math.dist(position, truth) if position is not None and truth is not None else None,
    )


def _box(message: AdmittedMessage) -> UnitBox | None:
    box = numbers(message.body.get("box"), 4)
    return None if box is None else (box[0], box[1], box[2], box[3])


def _matches(trace: Trace) -> dict[str, str]:
    """Return the matched target of each report id, from the events of the matching rules.

    The parameters of a rule may be in any order: a binding that is no entity is a report.
    """
    rules = matching_rules(trace)
    entities = {entity.id for entity in trace.header.instance.entities}
    matches: dict[str, str] = {}
    for record in trace.boundaries:
        for event in record.events:
            targets = [name for name in event.bindings if name in entities]
            reports = [name for name in event.bindings if name not in entities]
            if event.kind in rules and targets and reports:
                matches[reports[0]] = targets[0]
    return matches


def _visible(frame: FrameInfo, targets: Container[str]) -> set[str]:
    return {truth.entity for truth in frame.boxes if truth.pixels > 0 and truth.entity in targets}
