"""Small targets: which boxes pass, and the chance of a blind box, with and without a tolerance in pixels.

A target of a few pixels fails the paper's rule (IoU of at least 0.5) by an error that no careful observer can avoid: a
box of 15 by 9 pixels that is 3 pixels off in both axes has an IoU of 0.37. A mission may therefore accept boxes with
edges within a few pixels of the true ones (`edge_error` in rules). Both scores are reported, each with its *chance
level*: the share of boxes of the target's true size, at places drawn uniformly over the picture, that would pass.

Units are pixels of the picture. All boxes here have the true size, so that shifts decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import fmean

from lingjing.analysis.completion import judged_targets
from lingjing.analysis.detection import OVERLAP, MatchedReport, aligned_frames, detect, iou
from lingjing.analysis.memo import cache_by_trace
from lingjing.mission.expression import Binary, Call, Expr, Number, children
from lingjing.trace.reader import Trace

_STEPS = 400
"""Steps of the integral over the shifts of a box."""


def passes(width: float, height: float, shift: tuple[float, float], tolerance: float = 0.0) -> bool:
    """Return whether a box of the true size passes when it is shifted by (across, down)."""
    across, down = map(abs, shift)
    shared = max(0.0, width - across) * max(0.0, height - down)
    whole = 2.0 * width * height - shared
    return (whole > 0.0 and shared / whole >= OVERLAP) or max(across, down) <= tolerance > 0.0


def chance(width: float, height: float, picture: tuple[int, int], tolerance: float = 0.0) -> float:
    """Return the share of places of a box of the true size at which it passes, 0 to 1."""
    room = (max(picture[0] - width, 1.0), max(picture[1] - height, 1.0))
    reach = max(width / 3.0, tolerance)
    step = reach / _STEPS
    area = 4.0 * step * sum(_passing_down(width, height, (n + 0.5) * step, tolerance) for n in range(_STEPS))
    return min(1.0, area / (room[0] * room[1]))


def _passing_down(width: float, height: float, across: float, tolerance: float) -> float:
    """Return the largest shift down at which a box passes that is shifted by `across`.

    IoU >= 1/2 of two boxes of equal size means that they share at least two thirds of one.
    """
    by_overlap = height * (1.0 - 2.0 / 3.0 * width / (width - across)) if across < width / 3.0 else 0.0
    return max(by_overlap, tolerance if across <= tolerance else 0.0, 0.0)


@cache_by_trace
def tolerance_of(trace: Trace) -> float:
    """Return the tolerance in pixels of the mission's matching rules: 0 if they have none."""
    rules = (rule for rule in trace.header.instance.rules if rule.matching)
    return max((tolerance for rule in rules for tolerance in _tolerances(rule.condition)), default=0.0)


def _tolerances(node: Expr) -> Iterator[float]:
    if isinstance(node, Binary) and isinstance(node.left, Call) and node.left.function == "edge_error":
        yield node.right.value if isinstance(node.right, Number) else 0.0
    for part in children(node):
        yield from _tolerances(part)


def strict_detections(trace: Trace) -> int:
    """Return the number of detections that also pass the paper's rule."""
    return sum(_is_strict(trace, report) for report in detect(trace).reports if report.target is not None)


def _is_strict(trace: Trace, report: MatchedReport) -> bool:
    info = trace.frames.get(report.frame)
    if info is None or report.box is None:
        return False
    return any(box.entity == report.target and iou(report.box, box.box) >= OVERLAP for box in info.boxes)


def chance_level(trace: Trace, tolerance: float) -> float | None:
    """Return the mean chance over the visible targets of all aligned frames, or None without one."""
    targets = judged_targets(trace.header.instance)
    chances = [
        chance(*sizes, (frame.pose.width, frame.pose.height), tolerance)
        for frame in aligned_frames(trace)
        for box in frame.boxes
        if box.entity in targets
        for sizes in [pixel_size(box.box, (frame.pose.width, frame.pose.height))]
    ]
    return fmean(chances) if chances else None


def pixel_size(box: Sequence[float], picture: tuple[int, int]) -> tuple[float, float]:
    """Return width and height of a normalised box in pixels."""
    return (box[2] - box[0]) * picture[0], (box[3] - box[1]) * picture[1]


__all__ = ["chance", "chance_level", "passes", "pixel_size", "strict_detections", "tolerance_of"]
