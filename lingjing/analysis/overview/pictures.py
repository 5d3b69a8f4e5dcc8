"""The pictures of the overview: crops of the best detections, and one whole frame.

True boxes of targets are green, those of rivals and other places grey, reported boxes magenta. Without reports, the
largest views of missed targets are shown. In a mission without report messages, the whole frame is the last one.
Reference pictures are left out, because no camera of an agent took them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from lingjing.analysis.completion import sought_targets
from lingjing.analysis.history import History
from lingjing.analysis.overview import style
from lingjing.errors import LingjingError
from lingjing.mission.operations import overlap
from lingjing.plugins.frame_detector import UnitBox
from lingjing.trace.reader import Trace
from lingjing.trace.records import FrameInfo

FRONT = "front"
UNREADABLE = "the picture cannot be decoded"


@dataclass(frozen=True, slots=True)
class ReportView:
    """One crop of a frame."""

    frame: FrameInfo
    truth: UnitBox | None
    """The true box. None for a false or unjudged report."""
    claim: UnitBox | None
    """The reported box. None for a target that was not reported."""
    entity: str
    """The target, or the reported class of an unjudged report; "" for a false report."""
    overlap: float
    """IoU of the two boxes, 0 to 1."""
    error_m: float | None
    judged: bool = True
    """True if a rule compares the report with the truth."""

    @property
    def caption(self) -> str:
        """The caption of the crop, two lines."""
        first = f"{self.entity or 'nothing there'} · {self.frame.entity} · tick {self.frame.tick}"
        if not self.judged:
            return f"{first}\n{'in view' if self.claim is None else 'reported'}"
        if self.claim is None:
            return f"{first}\nvisible, not reported"
        if self.truth is None:
            return f"{first}\nfalse report"
        error = "" if self.error_m is None else f" · {self.error_m:.1f} m off"
        return f"{first}\nIoU {self.overlap:.2f}{error}"


def best_views(history: History, count: int) -> list[ReportView]:
    """Return up to `count` crops: the best match of each target, unjudged reports, a false report, missed targets."""
    matches = sorted(_matches(history), key=lambda view: (-view.overlap, view.frame.tick))
    first: dict[str, ReportView] = {}
    for view in matches:
        first.setdefault(view.entity, view)
    firsts = sorted(first.values(), key=lambda view: view.frame.tick)
    others = [view for view in matches if view not in firsts]
    return [
        *firsts,
        *_unjudged(history),
        *_false(history)[:1],
        *_missed(history, set(first)),
        *others,
        *_false(history)[1:],
    ][:count]


def whole_frame(history: History) -> FrameInfo | None:
    """Return the frame with the most targets that the mission is about; among equal ones, a frame that a report names.

    If reports are not judged, frames that a report names come first. In a mission without reports it is the last frame.
    """
    if not history.reporting:
        return max(history.shots, key=lambda frame: (frame.time_s, frame.camera == FRONT), default=None)
    reported = {report.frame for report in history.reports if report.target is not None or not report.judged}
    targets = sought_targets(history.instance)

    def worth(frame: FrameInfo) -> tuple[int, bool, int]:
        visible = [truth for truth in frame.boxes if truth.entity in targets]
        return len(visible) if history.judging else 0, frame.id in reported, sum(truth.pixels for truth in visible)

    return max(history.shots, key=worth, default=None)


def draw_view(axes: Axes, trace: Trace, view: ReportView) -> None:
    """Draw one crop, which is several times wider than its boxes."""
    rgb = _rgb(trace, view.frame)
    style.bare(axes)
    axes.set_xlabel(view.caption, fontsize=8, color=style.INK, labelpad=3)
    if rgb is None:
        draw_nothing(axes, UNREADABLE)
        return
    x0, y0, x1, y1 = _window(view, rgb.shape[1], rgb.shape[0], style.panel_shape(axes))
    axes.imshow(rgb[y0:y1, x0:x1], extent=(x0, x1, y1, y0), interpolation="nearest", aspect="auto")
    axes.set_xlim(x0, x1)
    axes.set_ylim(y1, y0)
    _box(axes, view.truth, rgb, style.TRUTH, "-", 1.8)
    _box(axes, view.claim, rgb, style.CLAIM, (0, (3, 2)), 1.8)


def draw_whole(axes: Axes, trace: Trace, history: History, frame: FrameInfo | None) -> None:
    """Draw a whole frame with all its boxes."""
    style.bare(axes)
    rgb = None if frame is None else _rgb(trace, frame)
    if frame is None or rgb is None:
        draw_nothing(axes, "no picture was taken" if frame is None else UNREADABLE)
        return
    axes.imshow(rgb, extent=(0, rgb.shape[1], rgb.shape[0], 0), interpolation="antialiased", aspect="equal")
    sought = sought_targets(history.instance)
    for truth in frame.boxes:
        if truth.entity in history.fate:
            is_sought = truth.entity in sought
            colour, width = (style.TRUTH, 1.4) if is_sought else (style.FATES["aside"], 0.8)
            _box(axes, _grown(truth.box, 0.008), rgb, colour, "-", width)
    for report in history.reports:
        if report.frame == frame.id and report.box is not None:
            _box(axes, _grown(report.box, 0.014), rgb, style.CLAIM, (0, (3, 2)), 1.4)
    height = frame.pose.position[2] - history.instance.scene.datum_m
    caption = f"{frame.entity} {frame.camera} · tick {frame.tick} · {height:.0f} m up"
    axes.set_xlabel(caption, fontsize=8, color=style.INK, labelpad=3)


def _matches(history: History) -> list[ReportView]:
    views = []
    for report in history.reports:
        frame = history.frames.get(report.frame)
        if frame is None or report.target is None or report.box is None:
            continue
        truth = next((box.box for box in frame.boxes if box.entity == report.target), None)
        if truth is not None:
            share = overlap(truth, report.box)
            views.append(ReportView(frame, truth, report.box, report.target, share, report.error_m))
    return views


def _false(history: History) -> list[ReportView]:
    return [
        ReportView(history.frames[report.frame], None, report.box, "", 0.0, None)
        for report in history.reports
        if report.false and report.box is not None and report.frame in history.frames
    ]


def _unjudged(history: History) -> list[ReportView]:
    """Return the reports that no rule compares with the truth."""
    return [
        ReportView(history.frames[report.frame], None, report.box, report.cls, 0.0, None, judged=False)
        for report in history.reports
        if not report.judged and report.box is not None and report.frame in history.frames
    ]


def _missed(history: History, matched: set[str]) -> list[ReportView]:
    best: dict[str, tuple[int, ReportView]] = {}
    lacking = sought_targets(history.instance) - matched
    for frame in history.shots:
        for truth in frame.boxes:
            if truth.entity in lacking and truth.pixels > best.get(truth.entity, (0,))[0]:
                best[truth.entity] = (
                    truth.pixels,
                    ReportView(frame, truth.box, None, truth.entity, 0.0, None, history.judging),
                )
    return [view for _, view in best.values()]


def _window(view: ReportView, width: int, height: int, shape: float) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of the crop in pixels.

    The boxes are in its middle. It is at least a twenty-fourth of the frame wide. `shape` is its width over its height.
    """
    boxes = [box for box in (view.truth, view.claim) if box is not None]
    x0, y0 = min(box[0] for box in boxes) * width, min(box[1] for box in boxes) * height
    x1, y1 = max(box[2] for box in boxes) * width, max(box[3] for box in boxes) * height
    wide = max(5 * (x1 - x0), 2.6 * (y1 - y0) * shape, width / 24, 48.0)
    wide = min(wide, width, height * shape)
    high = wide / shape
    left = min(max((x0 + x1 - wide) / 2, 0.0), width - wide)
    top = min(max((y0 + y1 - high) / 2, 0.0), height - high)
    return round(left), round(top), round(left + wide), round(top + high)


def _rgb(trace: Trace, frame: FrameInfo) -> npt.NDArray[np.uint8] | None:
    try:
        return trace.picture(frame.id).rgb
    except LingjingError:
        return None  # the page is drawn in spite of a damaged picture; the panel has a note


def _box(
    axes: Axes,
    box: UnitBox | None,
    rgb: npt.NDArray[np.uint8],
    colour: str,
    line: str | tuple[int, tuple[int, int]],
    width: float,
) -> None:
    if box is None:
        return
    high, wide = rgb.shape[:2]
    corner, size = (box[0] * wide, box[1] * high), ((box[2] - box[0]) * wide, (box[3] - box[1]) * high)
    axes.add_patch(Rectangle(corner, *size, fill=False, edgecolor=colour, linewidth=width, linestyle=line))


def _grown(box: UnitBox, margin: float) -> UnitBox:
    return box[0] - margin, box[1] - margin * 16 / 9, box[2] + margin, box[3] + margin * 16 / 9


def draw_nothing(axes: Axes, text: str) -> None:
    """Draw an empty panel with a note."""
    style.bare(axes)
    axes.set_facecolor(style.PANEL)
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=9, color=style.FAINT)
