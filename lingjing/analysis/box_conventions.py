"""Boxes that would match under another convention than the mission's.

Vision models are trained on boxes of several conventions: shares, thousandths or pixels, x or y first, the second
corner or width and height. A box in the wrong one is a miss for the adjudicator. Counted apart, it shows that a model
saw the target and wrote the box down wrongly. Both the boxes of false reports count and those of answers that could not
be used, because thousandths and pixels are no valid shares.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator
from dataclasses import dataclass

from lingjing.analysis.completion import judged_targets
from lingjing.analysis.detection import OVERLAP, MatchedReport, detect, iou
from lingjing.analysis.memo import cache_by_trace
from lingjing.plugins.frame_detector import UnitBox
from lingjing.trace.reader import Trace
from lingjing.trace.records import FrameInfo

THOUSANDTHS = 1000.0
"""The unit of boxes of several families of models, such as Qwen and Gemini."""

Numbers = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ConventionError:
    """One box with the convention under which it would have matched."""

    tick: int
    agent: str
    frame: str
    numbers: Numbers
    """The box as the model wrote it."""
    convention: str
    """The name of the convention, such as `thousandths, y first`."""
    target: str
    """The target that it would match."""


@cache_by_trace
def convention_errors(trace: Trace) -> tuple[ConventionError, ...]:
    """Return the boxes of a trace that would match a target under another convention, in order of boundaries."""
    targets = judged_targets(trace.header.instance)
    errors = (_error(trace, targets, *written) for written in _unmatched(trace))
    return tuple(error for error in errors if error is not None)


def _unmatched(trace: Trace) -> Iterator[tuple[int, str, str, Numbers]]:
    """Yield the tick, the agent, the frame and the numbers of each box without a match."""
    reports: dict[int, list[MatchedReport]] = {}
    for report in detect(trace).reports:
        if report.false and report.box is not None:
            reports.setdefault(report.tick, []).append(report)
    for record in trace.boundaries:
        for report in reports.get(record.tick, ()):
            assert report.box is not None
            yield report.tick, report.sender, report.frame, report.box
        for made in record.decisions:
            for box in made.decision.usage.unread_boxes if made.decision.usage else ():
                yield record.tick, made.agent, box.frame, box.numbers


def _error(
    trace: Trace, targets: Container[str], tick: int, agent: str, frame: str, numbers: Numbers
) -> ConventionError | None:
    info = trace.frames.get(frame)
    if info is None or not all(map(math.isfinite, numbers)):
        return None
    truths = {truth.entity: truth.box for truth in info.boxes if truth.pixels > 0 and truth.entity in targets}
    for convention, box in readings(numbers, info):
        for target, truth in truths.items():
            if iou(box, truth) >= OVERLAP:
                return ConventionError(tick, agent, frame, numbers, convention, target)
    return None


def readings(numbers: Numbers, frame: FrameInfo) -> Iterator[tuple[str, UnitBox]]:
    """Yield a box under each other convention as shares of the picture, if it is one there."""
    size = (float(frame.pose.width), float(frame.pose.height))
    units = {"shares": (1.0, 1.0), "thousandths": (THOUSANDTHS, THOUSANDTHS), "pixels": size}
    for unit, (across, down) in units.items():
        for order in ("x first", "y first"):
            a, b, c, d = numbers if order == "x first" else (numbers[1], numbers[0], numbers[3], numbers[2])
            x0, y0, x1, y1 = a / across, b / down, c / across, d / down
            for form, box in (("", (x0, y0, x1, y1)), (", width and height", (x0, y0, x0 + x1, y0 + y1))):
                if (unit, order, form) != ("shares", "x first", "") and _is_box(box):
                    yield f"{unit}, {order}{form}", box


def _is_box(box: UnitBox) -> bool:
    return 0.0 <= box[0] < box[2] <= 1.0 and 0.0 <= box[1] < box[3] <= 1.0
