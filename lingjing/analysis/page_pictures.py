"""Single pictures of an episode for pages: the map with tracks, and the best frame of each camera.

A frame of a camera that took no picture during the episode is drawn afterwards (`unrecorded_frames`). A picture is a
function of the city and of the recorded states, so it equals the picture that the agent would have received.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageDraw

from lingjing.analysis.completion import sought_targets
from lingjing.analysis.played_city import city_of, credit
from lingjing.kernel.world.contract import StoredFrame
from lingjing.mission.instance import AgentSpec, Entity, Instance
from lingjing.plugins.policy import REFERENCE
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, Box, FrameInfo, Snapshot

Redraw = Callable[[Trace, Sequence[tuple[str, str, BoundaryRecord]]], Iterable[StoredFrame]]
"""A function that draws the picture of each (entity, camera, boundary) after the episode."""

MAP_IN, MAP_DPI = (9.6, 7.4), 120
"""Size of the map in inches, and its resolution. Chosen."""
FRAME_WIDTH, FRAME_QUALITY = 800, 84
"""Largest width of a frame in pixels, and its JPEG quality. Chosen."""
BEST_SHARE = 0.06
"""Best share of a picture for a target. Chosen: the surroundings remain visible."""
CUT_OFF = 0.3
"""Weight of a target that the picture's edge cuts off. Chosen."""
BOX_MARGIN = 0.012
"""Distance between a target and the box around it, as a share of the picture's width. Chosen."""
MOMENTS = 6
"""Number of pictures that are drawn for a camera without recorded pictures, to choose the best. Chosen."""
ON_ITS_WAY_M = 20.0
"""Distance from its start beyond which a body counts as under way. Chosen."""
TRUTH = (24, 220, 110)
"""Colour of true boxes: red, green, blue in 0..255."""


@dataclass(frozen=True, slots=True)
class PageFrame:
    """A frame for a page, with the agent that took or received it."""

    trace: Trace
    info: FrameInfo
    agent: str
    role: str
    targets: tuple[str, ...]
    """The visible targets."""
    drawn: bytes = b""
    """The JPEG of a frame that was drawn after the episode. Empty for a recorded frame."""

    @property
    def jpeg(self) -> bytes:
        """The encoded picture."""
        return self.drawn or self.trace.jpeg(self.info.id)

    @property
    def caption(self) -> str:
        """The caption: `scout[2] (searcher) through uav[2]'s nadir camera at tick 12, fire[1] in view`."""
        agent = self.agent if self.agent == self.role else f"{self.agent} ({self.role})"
        if self.info.camera == REFERENCE:
            return f"{agent} receives the reference picture of {self.info.entity}"
        view = f", {', '.join(self.targets)} in view" if self.targets else ""
        note = " (drawn after the episode)" if self.drawn else ""
        return f"{agent} through {self.info.entity}'s {self.info.camera} camera at tick {self.info.tick}{view}{note}"


def draw_trails(trace: Trace, path: Path) -> None:
    """Write the map of an episode as a PNG. Raises `OSError` if it cannot be written."""
    path.write_bytes(trails_png(trace))


def trails_png(trace: Trace) -> bytes:
    """Return the map of an episode with tracks as a PNG of `MAP_IN` inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from lingjing.analysis.history import history_of
    from lingjing.analysis.overview.mapview import draw_map
    from lingjing.analysis.overview.style import literal_text

    out = io.BytesIO()
    source = credit(trace.header.attribution)
    with literal_text(source):
        figure = Figure(figsize=MAP_IN, dpi=MAP_DPI, facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.01, 0.085, 0.98, 0.875))
        draw_map(axes, history_of(trace), city_of(trace), source, legend_columns=5)
        figure.savefig(out, format="png", dpi=MAP_DPI, metadata={"Software": "lingjing"})
    return out.getvalue()


def best_frames(traces: Iterable[Trace]) -> list[PageFrame]:
    """Return one frame for each kind of camera: the one with the best view of a target.

    For a camera that never showed a target, it is the frame with the most detail, which has the largest file.
    """
    return _best(shown for trace in traces for shown in _frames(trace))


def unrecorded_frames(trace: Trace, shown: Iterable[PageFrame], redraw: Redraw) -> list[PageFrame]:
    """Draw a frame of each kind of mounted camera that is not among `shown`: the best of a few moments.

    `redraw` is the function of `lingjing.causal.redraw`. Returns [] if the city cannot be rebuilt. Raises
    `InfrastructureError` if no picture can be drawn on this machine.
    """
    present = {_kind(frame) for frame in shown}
    lacking: dict[tuple[str, str], list[Entity]] = {}
    for entity in trace.header.instance.entities:
        for camera in entity.cameras:
            if (entity.group, camera.name) not in present:
                lacking.setdefault((entity.group, camera.name), []).append(entity)
    requests = [
        (entity.id, camera, record)
        for (_, camera), members in lacking.items()
        for entity, record in _moments(trace, members)
    ]
    frames = []
    for stored in redraw(trace, requests):
        agent = _pilots(trace.header.instance).get(stored.info.entity)
        if agent is not None:
            frames.append(_page_frame(trace, stored.info, agent.id, stored.jpeg))
    return _best(frames)


def sort_by_camera(shown: Iterable[PageFrame]) -> list[PageFrame]:
    """Return frames in the order in which their cameras are declared, reference pictures last."""

    def place(frame: PageFrame) -> tuple[int, int]:
        for at, entity in enumerate(frame.trace.header.instance.entities):
            for number, camera in enumerate(entity.cameras):
                if (entity.group, camera.name) == _kind(frame):
                    return at, number
        return len(frame.trace.header.instance.entities), 0

    return sorted(shown, key=place)


def write_frame(shown: PageFrame, path: Path) -> None:
    """Write the frame as a JPEG of page width, with a thin box around each visible target."""
    path.write_bytes(frame_jpeg(shown))


def frame_jpeg(shown: PageFrame) -> bytes:
    """Return the frame as a JPEG of page width, with a thin box around each visible target."""
    image = Image.open(io.BytesIO(shown.jpeg)).convert("RGB")
    if image.width > FRAME_WIDTH:
        size = FRAME_WIDTH, round(image.height * FRAME_WIDTH / image.width)
        image = image.resize(size, Image.Resampling.LANCZOS)
    pen = ImageDraw.Draw(image)
    for box in shown.info.boxes:
        if box.entity in shown.targets and shown.info.camera != REFERENCE:
            pen.rectangle(_grown(box.box, image.width, image.height), outline=TRUTH, width=2)
    out = io.BytesIO()
    image.save(out, format="JPEG", quality=FRAME_QUALITY, optimize=True)
    return out.getvalue()


# -- private


def _frames(trace: Trace) -> Iterator[PageFrame]:
    """Yield every frame with the agent that controls its camera, or else with the first agent that received it."""
    pilots = _pilots(trace.header.instance)
    viewers: dict[str, str] = {}
    for record in trace.boundaries:
        for observation in record.observations:
            for name in observation.frames:
                viewers.setdefault(name, observation.agent)
    for frame in trace.frames.values():
        agent = pilots[frame.entity].id if frame.entity in pilots else viewers.get(frame.id, "")
        if agent:
            yield _page_frame(trace, frame, agent)


def _pilots(instance: Instance) -> dict[str, AgentSpec]:
    return {name: agent for agent in reversed(instance.agents) for name in agent.controls}


def _page_frame(trace: Trace, frame: FrameInfo, agent: str, drawn: bytes = b"") -> PageFrame:
    targets = sought_targets(trace.header.instance)
    role = next(spec.role for spec in trace.header.instance.agents if spec.id == agent)
    inside = tuple(dict.fromkeys(box.entity for box in frame.boxes if box.entity in targets and box.pixels > 0))
    return PageFrame(trace, frame, agent, role, inside, drawn)


def _best(frames: Iterable[PageFrame]) -> list[PageFrame]:
    best: dict[tuple[str, str], tuple[tuple[float, int], PageFrame]] = {}
    for shown in frames:
        view = max((_worth(box, shown.info) for box in shown.info.boxes if box.entity in shown.targets), default=0.0)
        worth = view, 0 if view else len(shown.jpeg)
        if _kind(shown) not in best or worth > best[_kind(shown)][0]:
            best[_kind(shown)] = worth, shown
    return [shown for _, shown in best.values()]


def _kind(shown: PageFrame) -> tuple[str, str]:
    """Return the kind of a camera: the group of its entity, and its name. One frame of each kind is shown."""
    groups = {entity.id: entity.group for entity in shown.trace.header.instance.entities}
    return groups.get(shown.info.entity, shown.info.entity), shown.info.camera


def _moments(trace: Trace, members: list[Entity]) -> Iterator[tuple[Entity, BoundaryRecord]]:
    """Yield up to `MOMENTS` moments spread over the episode, with the members in turn, after they have left."""
    under_way = [
        (entity, record)
        for number, record in enumerate(trace.boundaries)
        for entity in (members[number % len(members)],)
        if record.snapshots and _moved(entity, record.snapshots[-1])
    ]
    known = under_way or [(members[0], record) for record in trace.boundaries if record.snapshots]
    for part in range(min(MOMENTS, len(known))):
        yield known[part * len(known) // min(MOMENTS, len(known))]


def _moved(entity: Entity, snapshot: Snapshot) -> bool:
    place = next((state.position for state in snapshot.states if state.id == entity.id), entity.position)
    return math.dist(place, entity.position) > ON_ITS_WAY_M


def _worth(box: Box, info: FrameInfo) -> float:
    """Return the quality, 0 to 1, of the view of an entity: highest at `BEST_SHARE`, lower if it is cut off."""
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
