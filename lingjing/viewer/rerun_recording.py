"""A trace as a Rerun recording (`.rrd`) that contains its blueprint, which arranges the views.

Rerun can open an MCAP file too, but does not decode scenes, boxes and this project's own records (version 0.41).
`rerun-sdk` is a large optional package. Only this module imports it, when a recording is written.
"""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from lingjing.analysis.played_city import surroundings_of
from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.mission.instance import Entity
from lingjing.scene.camera_geometry import focal_px
from lingjing.scene.surroundings import OVERHEAD_M
from lingjing.trace.foxglove import body_turn, camera_axes, geodetic, log_lines
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, CameraPose, FrameInfo, Receipt, Snapshot, UnitBox
from lingjing.trace.topics import CHANNELS, entity_topic
from lingjing.trace.viewer_messages import ReportedBoxes, cameras_at
from lingjing.viewer.episode_view import EpisodeView
from lingjing.whole_files import written_whole

CLOCK = "simulation"
"""Name of the timeline in simulated seconds. The other timeline is `tick`."""

TRUE, REPORTED = (50, 255, 100), (255, 115, 190)
"""Colours of boxes: red, green, blue in 0..255. Chosen."""
ASSET, TARGET, REGION = (40, 120, 235), (245, 95, 30), (30, 180, 80)
"""Colours of markers and outlines. Chosen."""
MOST_CAMERAS = 8
"""Most cameras, and most agents, with views. Chosen: more tabs do not fit."""


def write_rerun(trace: Trace, path: Path, *, truth: bool) -> None:
    """Write the recording. A failure leaves no file behind.

    Raises `UsageError` if `rerun-sdk` is not installed or the file cannot be written.
    """
    rerun = _rerun()
    if path.suffix != ".rrd":
        raise UsageError(f"{path}: a Rerun recording is an .rrd file", hint="name it -o episode.rrd")
    try:
        with written_whole(path) as partial:
            _Recording(rerun, trace, truth=truth).save(partial)
    except _WriterError as error:  # the error of Rerun does not name its cause, such as a full disk
        hint = "make room, or choose another place with -o"
        raise UsageError(f"cannot write {path}: Rerun's own writer reports: {error}", hint=hint) from error
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror}", hint="choose another place with -o") from error


def _rerun() -> Any:
    try:
        import rerun
        import rerun.blueprint
    except ImportError as error:
        message = "a Rerun recording needs rerun-sdk, which is not installed"
        raise UsageError(message, hint=install_line("rerun")) from error
    return rerun


class _WriterError(Exception):
    """The error for a failed write of Rerun."""


class _Recording:
    """The recording of one episode."""

    def __init__(self, rerun: Any, trace: Trace, *, truth: bool) -> None:
        self._rr = rerun
        self._trace = trace
        self._instance = trace.header.instance
        self._view = EpisodeView(self._instance, truth=truth)
        self._frames = trace.frames
        self._reports = ReportedBoxes(self._instance)
        self._around = surroundings_of(trace)

    def save(self, path: Path) -> None:
        """Write the episode to a file."""
        name = _trace_name(self._trace)
        recording = self._rr.RecordingStream(
            "lingjing", recording_id=uuid.uuid5(uuid.NAMESPACE_URL, name), send_properties=False
        )
        recording.save(path, default_blueprint=self._blueprint())
        self._out = recording
        recording.send_recording_name(name)
        self._beginning()
        for record in self._trace.boundaries:
            visible, revealed = self._view.take(record)
            self._boundary(visible, revealed)
        try:
            recording.flush()
        except RuntimeError as error:
            raise _WriterError(str(error)) from error
        recording.disconnect()

    # -- static data

    def _beginning(self) -> None:
        rr, out = self._rr, self._out
        out.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for number, mesh in enumerate(self._around.meshes):
            red, green, blue = (round(255 * part) for part in mesh.colour)
            shape = rr.Mesh3D(
                vertex_positions=mesh.points, triangle_indices=mesh.triangles, albedo_factor=(red, green, blue, 255)
            )
            out.log(f"world/city/{mesh.layer}/{number}", shape, static=True)
        level = self._instance.scene.datum_m
        for region in self._instance.regions:
            if region.polygon and (self._view.truth or not region.hidden):
                ring = [(x, y, level) for x, y in (*region.polygon, region.polygon[0])]
                out.log(f"world/regions/{region.name}", rr.LineStrips3D([ring], colors=[REGION]), static=True)
        visible = (entity for entity in self._instance.entities if entity.id not in self._view.hidden)
        self._markers(visible, static=True)

    def _markers(self, entities: Iterable[Entity], *, static: bool) -> None:
        """Log markers of entities. A static marker is visible at all times, at the origin while it has no position."""
        for entity in entities:
            colour = ASSET if entity.role == "asset" else TARGET
            box = self._rr.Boxes3D(half_sizes=[(2.0, 1.0, 0.5)], colors=[colour], labels=[entity.id])
            self._out.log(f"{_body_path(entity.id)}/marker", box, static=static)

    # -- boundaries

    def _boundary(self, record: BoundaryRecord, revealed: Sequence[Entity]) -> None:
        rr, out = self._rr, self._out
        self._at(record.snapshots[0].time_s if record.snapshots else record.time_s, record.tick)
        self._markers(revealed, static=False)
        for snapshot in record.snapshots:
            self._at(snapshot.time_s, record.tick)
            for state in snapshot.states:
                turn = self._rr.Quaternion(xyzw=body_turn(state))
                out.log(_body_path(state.id), self._rr.Transform3D(translation=state.position, quaternion=turn))
        if record.snapshots:
            self._trails(record.snapshots)
            self._cameras(record)
        for frame in record.frames:
            self._picture(frame)
        self._at(record.time_s, record.tick)
        self._agents(record)
        self._reported(record)
        for name, value in (("score", record.reward), ("scr", record.scr)):
            out.log(f"score/{name}", rr.Scalars([value]))
        for level, name, text in log_lines(record):
            out.log(f"log/{entity_topic(name.split(' ')[0])}", rr.TextLog(f"{name}: {text}", level=LEVELS[level]))

    def _at(self, time_s: float, tick: int) -> None:
        self._out.set_time(CLOCK, duration=time_s)
        self._out.set_time("tick", sequence=tick)

    def _trails(self, snapshots: Sequence[Snapshot]) -> None:
        """Log the path of each entity since the last boundary. A view with a long time range shows the whole trail."""
        for state in snapshots[-1].states:
            way = [other.position for shot in snapshots for other in shot.states if other.id == state.id]
            if len(way) > 1 and way[0] != way[-1] and state.position[2] < OVERHEAD_M:
                self._out.log(f"world/trails/{entity_topic(state.id)}", self._rr.LineStrips3D([way], colors=[ASSET]))
            latitude, longitude = geodetic(self._instance.scene.origin, *state.position[:2])
            self._out.log(f"map/{entity_topic(state.id)}", self._rr.GeoPoints(lat_lon=[(latitude, longitude)]))

    def _cameras(self, record: BoundaryRecord) -> None:
        """Log the pose of each camera relative to the world, because the poses are in the world frame."""
        for _, entity, camera, pose in cameras_at(self._instance, self._around, record):
            self._camera(_camera_path(entity, camera), pose)

    def _camera(self, path: str, pose: CameraPose) -> None:
        rows = [[axis[row] for axis in camera_axes(pose)] for row in range(3)]
        pinhole = self._rr.Pinhole(
            focal_length=focal_px(pose), width=pose.width, height=pose.height, image_plane_distance=10.0
        )
        self._out.log(path, self._rr.Transform3D(translation=pose.position, mat3x3=rows), pinhole)

    def _picture(self, frame: FrameInfo) -> None:
        rr, out = self._rr, self._out
        path = _camera_path(frame.entity, frame.camera)
        self._at(frame.time_s, frame.tick)
        self._camera(path, frame.pose)
        try:
            stored = self._trace.picture(frame.id)
        except UsageError:
            return  # the picture is missing in the trace; other pictures are shown
        out.log(f"{path}/rgb", rr.EncodedImage(contents=self._trace.jpeg(frame.id), media_type="image/jpeg"))
        if stored.depth is not None:
            out.log(f"{path}/depth", rr.DepthImage(stored.depth, meter=1.0))
        if stored.semantic is not None:
            out.log(f"{path}/semantic", rr.SegmentationImage(stored.semantic, opacity=0.0))
        if stored.instance is not None:
            out.log(f"{path}/instance", rr.SegmentationImage(stored.instance, opacity=0.0))
        if self._view.truth:
            self._boxes(f"{path}/rgb/truth", frame, [(truth.entity, truth.box) for truth in frame.boxes], TRUE)
        out.log(f"{path}/rgb/reported", rr.Clear(recursive=False))

    def _reported(self, record: BoundaryRecord) -> None:
        """Log reported boxes at the time of their picture."""
        names = self._reports.take(record) & self._frames.keys()
        for name in sorted(names):
            info = self._frames[name]
            self._at(info.time_s, info.tick)
            path = f"{_camera_path(info.entity, info.camera)}/rgb/reported"
            self._boxes(path, info, self._reports.of(name), REPORTED)
        self._at(record.time_s, record.tick)

    def _boxes(
        self,
        path: str,
        frame: FrameInfo,
        boxes: Sequence[tuple[str, UnitBox]],
        colour: tuple[int, int, int],
    ) -> None:
        wide, high = frame.pose.width, frame.pose.height
        if not boxes:
            self._out.log(path, self._rr.Clear(recursive=False))
            return
        drawn = self._rr.Boxes2D(
            mins=[(box[0] * wide, box[1] * high) for _, box in boxes],
            sizes=[((box[2] - box[0]) * wide, (box[3] - box[1]) * high) for _, box in boxes],
            labels=[label for label, _ in boxes],
            colors=[colour] * len(boxes),
        )
        self._out.log(path, drawn)

    def _agents(self, record: BoundaryRecord) -> None:
        rr, out = self._rr, self._out
        for entry in record.decisions:
            if entry.decision.thought:
                out.log(f"agents/{entity_topic(entry.agent)}/thought", rr.TextDocument(entry.decision.thought))
        for command in record.commands:
            values = ", ".join(f"{name}={value}" for name, value in command.arguments.items())
            text = f"{command.id} {command.resource}.{command.verb} {values}".rstrip()
            out.log(f"agents/{entity_topic(command.sender)}/commands", rr.TextLog(text, level="INFO"))
        for receipt in record.receipts:
            out.log(
                f"agents/{entity_topic(receipt.sender)}/commands", rr.TextLog(_receipt_line(receipt), level="DEBUG")
            )

    # -- the blueprint

    def _blueprint(self) -> Any:
        blueprint = self._rr.blueprint
        always = blueprint.VisibleTimeRanges(
            timeline=CLOCK,
            start=blueprint.TimeRangeBoundary.infinite(),
            end=blueprint.TimeRangeBoundary.cursor_relative(seconds=0.0),
        )
        world = blueprint.Spatial3DView(
            origin="world",
            name="city",
            contents=["$origin/**", *(f"- $origin/cameras/*/*/{channel}" for channel in CHANNELS)],
            overrides={
                f"world/trails/{entity_topic(entity.id)}": always
                for entity in self._instance.entities
                if entity.id not in self._view.hidden
            },
            eye_controls=self._eye(),
        )
        cameras = [
            blueprint.Spatial2DView(
                origin=_camera_path(entity.id, camera.name),
                contents="$origin/rgb/**",
                name=f"{entity.id} {camera.name}",
            )
            for entity in self._instance.entities
            for camera in entity.cameras
            if any(entity.id in agent.controls for agent in self._instance.agents)
        ][:MOST_CAMERAS]
        agents = [
            blueprint.Vertical(
                blueprint.TextDocumentView(origin=f"agents/{entity_topic(agent.id)}/thought", name="thought"),
                blueprint.TextLogView(origin=f"agents/{entity_topic(agent.id)}/commands", name="commands"),
                name=agent.id,
            )
            for agent in self._instance.agents[:MOST_CAMERAS]
        ]
        side = [blueprint.Tabs(*cameras, name="pictures")] if cameras else []
        side += [blueprint.Tabs(*agents, name="agents")] if agents else []
        below = blueprint.Horizontal(
            blueprint.TimeSeriesView(origin="score", name="score"),
            blueprint.TextLogView(origin="log", name="log"),
            blueprint.MapView(origin="map", name="map"),
        )
        above = blueprint.Horizontal(world, blueprint.Vertical(*side), column_shares=[3, 2]) if side else world
        return blueprint.Blueprint(
            blueprint.Vertical(above, below, row_shares=[3, 1]),
            blueprint.TimePanel(timeline=CLOCK, playback_speed=5.0),
            collapse_panels=True,
        )

    def _eye(self) -> Any:
        """Return an oblique view from the south that contains all entities on the map."""
        entities = [entity for entity in self._instance.entities if entity.position[2] < OVERHEAD_M]
        places = [entity.position for entity in entities] or [(0.0, 0.0, 0.0)]
        west, east = min(x for x, *_ in places), max(x for x, *_ in places)
        south, north = min(y for _, y, _ in places), max(y for _, y, _ in places)
        x, y, far = (west + east) / 2, (south + north) / 2, max(150.0, 0.9 * math.hypot(east - west, north - south))
        return self._rr.blueprint.EyeControls3D(
            position=(x, y - far, 0.8 * far), look_target=(x, y, 0.0), eye_up=(0.0, 0.0, 1.0)
        )


LEVELS = {"INFO": "INFO", "WARNING": "WARN"}
"""Rerun's log level for each level of `log_lines`."""


def _trace_name(trace: Trace) -> str:
    """Return the name of a recording, such as `ssr, seed 1, broadcast, 0e6f1fac69070`."""
    instance = trace.header.instance
    digest = trace.boundaries[-1].digest[:16] if trace.boundaries else "nothing"
    return f"{instance.mission}, seed {instance.seed}, {instance.mode}, {digest}"


def _body_path(entity: str) -> str:
    """Return the path of an entity in the recording."""
    return f"world/bodies/{entity_topic(entity)}"


def _camera_path(entity: str, camera: str) -> str:
    """Return the path of a camera in the recording."""
    return f"world/cameras/{entity_topic(entity)}/{camera}"


def _receipt_line(receipt: Receipt) -> str:
    """Return a receipt in words, such as `c7-1 on uav[1]: rejected, busy`."""
    words = (receipt.status, receipt.reason, receipt.detail)
    return f"{receipt.request} on {receipt.resource}: {', '.join(word for word in words if word)}"
