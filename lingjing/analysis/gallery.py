"""Pictures of an episode one by one, for pages: the map with the trails, and the best frame of each camera."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageDraw

from lingjing.analysis.credit import credit
from lingjing.analysis.groundplan import city_of
from lingjing.kernel.references import CAMERA as REFERENCE
from lingjing.trace.reader import Trace
from lingjing.trace.records import Box, FrameInfo

MAP_IN, MAP_DPI = (9.6, 7.4), 120
FRAME_WIDTH, FRAME_QUALITY = 800, 84
BEST_SHARE = 0.06
"""Of a picture: how much of it a target best fills, so that its surroundings are seen as well."""
CUT_OFF = 0.3
"""What a view of a target is worth that the picture's edge cuts off."""
BOX_MARGIN = 0.012
"""Room between a target and the box around it, a share of the picture's width."""
TRUTH = (24, 220, 110)


@dataclass(frozen=True, slots=True)
class Shown:
    """A frame worth showing and who took it with what; `targets` are those that can be seen in it."""

    trace: Trace
    info: FrameInfo
    agent: str
    role: str
    targets: tuple[str, ...]

    @property
    def caption(self) -> str:
        """`scout[2] (searcher) through uav[2]'s nadir camera at tick 12, fire[1] in view`."""
        who = self.agent if self.agent == self.role else f"{self.agent} ({self.role})"
        if self.info.camera == REFERENCE:
            return f"{who} is shown the reference picture of {self.info.entity}"
        seen = f", {', '.join(self.targets)} in view" if self.targets else ""
        return f"{who} through {self.info.entity}'s {self.info.camera} camera at tick {self.info.tick}{seen}"


def draw_trails(trace: Trace, path: Path) -> None:
    """Write the map of an episode as a PNG. Raises `OSError` if it cannot be written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from lingjing.analysis.overview.mapview import draw_map
    from lingjing.analysis.story import tell

    figure = Figure(figsize=MAP_IN, dpi=MAP_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.01, 0.085, 0.98, 0.875))
    draw_map(axes, tell(trace), city_of(trace), credit(trace.header.attribution), legend_columns=5)
    figure.savefig(path, format="png", dpi=MAP_DPI, metadata={"Software": "lingjing"})


def best_frames(traces: Iterable[Trace]) -> list[Shown]:
    """One frame for each kind of camera that an agent looks through: the one that shows a target best; where none ever
    saw a target, the one with most to see (the largest file)."""
    best: dict[tuple[str, str], tuple[tuple[float, int], Shown]] = {}
    for trace in traces:
        groups = {entity.id: entity.group for entity in trace.header.instance.entities}
        for shown in _frames(trace):
            key = groups.get(shown.info.entity, shown.info.entity), shown.info.camera
            view = max(
                (_worth(box, shown.info) for box in shown.info.boxes if box.entity in shown.targets), default=0.0
            )
            worth = view, 0 if view else len(trace.jpeg(shown.info.id))
            if key not in best or worth > best[key][0]:
                best[key] = worth, shown
    return [shown for _, shown in best.values()]


def write_frame(shown: Shown, path: Path) -> None:
    """The frame as a JPEG of page width, a thin box around each target in it."""
    image = Image.open(io.BytesIO(shown.trace.jpeg(shown.info.id))).convert("RGB")
    if image.width > FRAME_WIDTH:
        size = FRAME_WIDTH, round(image.height * FRAME_WIDTH / image.width)
        image = image.resize(size, Image.Resampling.LANCZOS)
    pen = ImageDraw.Draw(image)
    for box in shown.info.boxes:
        if box.entity in shown.targets and shown.info.camera != REFERENCE:
            pen.rectangle(_grown(box.box, image.width, image.height), outline=TRUTH, width=2)
    image.save(path, format="JPEG", quality=FRAME_QUALITY, optimize=True)


# -- private


def _frames(trace: Trace) -> Iterator[Shown]:
    """Every frame with the agent that controls what took it, else with the first one that was shown it."""
    instance = trace.header.instance
    targets = {entity.id for entity in instance.entities if entity.role == "target"}
    roles = {agent.id: agent.role for agent in instance.agents}
    pilots = {name: agent.id for agent in reversed(instance.agents) for name in agent.controls}
    viewers: dict[str, str] = {}
    for record in trace.boundaries:
        for seen in record.observations:
            for name in seen.frames:
                viewers.setdefault(name, seen.agent)
    for frame in trace.frames.values():
        agent = pilots.get(frame.entity) or viewers.get(frame.id, "")
        if agent:
            inside = tuple(dict.fromkeys(box.entity for box in frame.boxes if box.entity in targets))
            yield Shown(trace, frame, agent, roles[agent], inside)


def _worth(box: Box, info: FrameInfo) -> float:
    """How well a frame shows what is in a box: neither too small nor too large, and not cut off."""
    share = box.pixels / (info.pose.width * info.pose.height)
    size = min(share / BEST_SHARE, BEST_SHARE / share) if share > 0 else 0.0
    x0, y0, x1, y1 = box.box
    return size if x0 > 0.01 and y0 > 0.01 and x1 < 0.99 and y1 < 0.99 else CUT_OFF * size


def _grown(box: tuple[float, float, float, float], width: int, height: int) -> tuple[float, float, float, float]:
    margin = BOX_MARGIN * width
    x0, y0, x1, y1 = (
        box[0] * width - margin,
        box[1] * height - margin,
        box[2] * width + margin,
        box[3] * height + margin,
    )
    return max(0.0, x0), max(0.0, y0), min(width - 1.0, x1), min(height - 1.0, y1)
