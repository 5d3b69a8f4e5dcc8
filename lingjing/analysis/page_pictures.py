"""Pictures of an episode one by one, for pages: the map with the trails, and the best frame of each camera.

A camera through which nobody looked is asked afterwards (`unasked_frames`): a picture is a function of the city and of
the states that the trace holds, so it is the one that the agent would have got.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageDraw

from lingjing.analysis.played_city import city_of, credit
from lingjing.kernel.world.contract import StoredFrame
from lingjing.mission.instance import AgentSpec, Entity, Instance
from lingjing.plugins.policy import REFERENCE
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, Box, FrameInfo, Snapshot

LookBack = Callable[[Trace, Sequence[tuple[str, str, BoundaryRecord]]], Iterable[StoredFrame]]
"""What draws the picture of each (entity, camera, boundary) that nobody took."""

MAP_IN, MAP_DPI = (9.6, 7.4), 120
FRAME_WIDTH, FRAME_QUALITY = 800, 84
BEST_SHARE = 0.06
"""Of a picture: how much of it a target best fills, so that its surroundings are seen as well."""
CUT_OFF = 0.3
"""What a view of a target is worth that the picture's edge cuts off."""
BOX_MARGIN = 0.012
"""Room between a target and the box around it, a share of the picture's width."""
MOMENTS = 6
"""So many pictures are tried of a camera through which nobody looked."""
ON_ITS_WAY_M = 20.0
"""From here on, a body no longer stands where it was put."""
TRUTH = (24, 220, 110)


@dataclass(frozen=True, slots=True)
class ShownFrame:
    """A frame worth showing and who took it with what; `targets` are those that can be seen in it. `drawn` is its JPEG
    where it is not in the trace because nobody asked for it."""

    trace: Trace
    info: FrameInfo
    agent: str
    role: str
    targets: tuple[str, ...]
    drawn: bytes = b""

    @property
    def jpeg(self) -> bytes:
        """The encoded picture."""
        return self.drawn or self.trace.jpeg(self.info.id)

    @property
    def caption(self) -> str:
        """`scout[2] (searcher) through uav[2]'s nadir camera at tick 12, fire[1] in view`."""
        who = self.agent if self.agent == self.role else f"{self.agent} ({self.role})"
        if self.info.camera == REFERENCE:
            return f"{who} is shown the reference picture of {self.info.entity}"
        seen = f", {', '.join(self.targets)} in view" if self.targets else ""
        asked = " (drawn afterwards: nobody asked for it)" if self.drawn else ""
        return f"{who} through {self.info.entity}'s {self.info.camera} camera at tick {self.info.tick}{seen}{asked}"


def draw_trails(trace: Trace, path: Path) -> None:
    """Write the map of an episode as a PNG. Raises `OSError` if it cannot be written."""
    path.write_bytes(trails_png(trace))


def trails_png(trace: Trace) -> bytes:
    """The map of an episode with the trails, as a PNG of `MAP_IN` inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from lingjing.analysis.history import history_of
    from lingjing.analysis.overview.mapview import draw_map
    from lingjing.analysis.overview.style import as_written

    out = io.BytesIO()
    source = credit(trace.header.attribution)
    with as_written(source):
        figure = Figure(figsize=MAP_IN, dpi=MAP_DPI, facecolor="white")
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.01, 0.085, 0.98, 0.875))
        draw_map(axes, history_of(trace), city_of(trace), source, legend_columns=5)
        figure.savefig(out, format="png", dpi=MAP_DPI, metadata={"Software": "lingjing"})
    return out.getvalue()


def best_frames(traces: Iterable[Trace]) -> list[ShownFrame]:
    """One frame for each kind of camera that an agent looks through: the one that shows a target best; where none ever
    saw a target, the one with most to see (the largest file)."""
    return _best(shown for trace in traces for shown in _frames(trace))


def unasked_frames(trace: Trace, shown: Iterable[ShownFrame], look_back: LookBack) -> list[ShownFrame]:
    """A frame of each kind of camera that is mounted in the episode and not among `shown`, the best of a few moments;
    [] if the city is no longer to be had. `look_back` is that of `lingjing.causal.lookback`. Raises
    `InfrastructureError` if no picture can be drawn here."""
    have = {_kind(one) for one in shown}
    lacking: dict[tuple[str, str], list[Entity]] = {}
    for entity in trace.header.instance.entities:
        for camera in entity.cameras:
            if (entity.group, camera.name) not in have:
                lacking.setdefault((entity.group, camera.name), []).append(entity)
    wanted = [
        (entity.id, camera, record)
        for (_, camera), members in lacking.items()
        for entity, record in _moments(trace, members)
    ]
    found = []
    for stored in look_back(trace, wanted):
        agent = _pilots(trace.header.instance).get(stored.info.entity)
        if agent is not None:
            found.append(_shown(trace, stored.info, agent.id, stored.jpeg))
    return _best(found)


def in_order(shown: Iterable[ShownFrame]) -> list[ShownFrame]:
    """Frames as their cameras are declared, reference pictures last."""

    def place(one: ShownFrame) -> tuple[int, int]:
        for at, entity in enumerate(one.trace.header.instance.entities):
            for number, camera in enumerate(entity.cameras):
                if (entity.group, camera.name) == _kind(one):
                    return at, number
        return len(one.trace.header.instance.entities), 0

    return sorted(shown, key=place)


def write_frame(shown: ShownFrame, path: Path) -> None:
    """Write the frame as a JPEG of page width, a thin box around each target in it."""
    path.write_bytes(frame_jpeg(shown))


def frame_jpeg(shown: ShownFrame) -> bytes:
    """The frame as a JPEG of page width, a thin box around each target in it."""
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


def _frames(trace: Trace) -> Iterator[ShownFrame]:
    """Every frame with the agent that controls what took it, else with the first one that was shown it."""
    pilots = _pilots(trace.header.instance)
    viewers: dict[str, str] = {}
    for record in trace.boundaries:
        for seen in record.observations:
            for name in seen.frames:
                viewers.setdefault(name, seen.agent)
    for frame in trace.frames.values():
        agent = pilots[frame.entity].id if frame.entity in pilots else viewers.get(frame.id, "")
        if agent:
            yield _shown(trace, frame, agent)


def _pilots(instance: Instance) -> dict[str, AgentSpec]:
    return {name: agent for agent in reversed(instance.agents) for name in agent.controls}


def _shown(trace: Trace, frame: FrameInfo, agent: str, drawn: bytes = b"") -> ShownFrame:
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    role = next(one.role for one in trace.header.instance.agents if one.id == agent)
    inside = tuple(dict.fromkeys(box.entity for box in frame.boxes if box.entity in targets and box.pixels > 0))
    return ShownFrame(trace, frame, agent, role, inside, drawn)


def _best(frames: Iterable[ShownFrame]) -> list[ShownFrame]:
    best: dict[tuple[str, str], tuple[tuple[float, int], ShownFrame]] = {}
    for shown in frames:
        view = max((_worth(box, shown.info) for box in shown.info.boxes if box.entity in shown.targets), default=0.0)
        worth = view, 0 if view else len(shown.jpeg)
        if _kind(shown) not in best or worth > best[_kind(shown)][0]:
            best[_kind(shown)] = worth, shown
    return [shown for _, shown in best.values()]


def _kind(shown: ShownFrame) -> tuple[str, str]:
    """Group and camera: what is shown once."""
    groups = {entity.id: entity.group for entity in shown.trace.header.instance.entities}
    return groups.get(shown.info.entity, shown.info.entity), shown.info.camera


def _moments(trace: Trace, members: list[Entity]) -> Iterator[tuple[Entity, BoundaryRecord]]:
    """A few moments spread over the episode with the members in turn, once they are on their way."""
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
