"""Pictures at a boundary: which ones are taken, their receipts, and the pictures that policies receive.

A picture is taken at the boundary for which its `takePhoto` was admitted, or at every boundary for a camera declared
`each_tick`. Policies receive the decoded stored image, so the trace holds exactly what they received. With `blank` they
receive black pictures without other channels, for studies of policies without vision.

*Reference pictures* are those that `reveal image(target) to role` shows once, at boundary 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import msgspec
import numpy as np

from lingjing.kernel.commands import camera_of
from lingjing.kernel.world.contract import StoredFrame
from lingjing.mission.instance import AgentSpec, CameraSpec, Entity, Instance
from lingjing.mission.vocabulary import PHOTO, PORTRAIT
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.policy import REFERENCE, CameraView, Picture
from lingjing.scene.camera_geometry import CameraPlacement
from lingjing.scene.picture_weather import PictureWeather
from lingjing.trace.images import decode_jpeg
from lingjing.trace.records import Absent, CameraPose, Command, Receipt


def requests(instance: Instance, commands: Iterable[Command], tick: int, time_s: float) -> tuple[CaptureRequest, ...]:
    """Return the captures due at a boundary: admitted `takePhoto` commands first, then the remaining `each_tick`
    cameras.
    """
    entities = {entity.id: entity for entity in instance.entities}
    wanted: dict[tuple[str, str], tuple[CameraPlacement | None, PictureWeather | None]] = {}
    for command in commands:  # admitted at this boundary, so the picture is of this boundary too (ADR 0003)
        if command.verb == PHOTO:
            mount = command.resource, camera_of(entities[command.resource], command.arguments)
            arguments = command.arguments
            wanted[mount] = CameraPlacement.of_arguments(arguments), PictureWeather.of_arguments(arguments)
    for entity in instance.entities:
        for camera in entity.cameras:
            if camera.capture == "each_tick":
                wanted.setdefault((entity.id, camera.name), (None, None))
    return tuple(
        CaptureRequest(
            frame=f"f{tick}-{entity}-{camera}",
            entity=entity,
            camera=camera,
            tick=tick,
            time_s=time_s,
            placement=placement,
            weather=weather,
        )
        for (entity, camera), (placement, weather) in wanted.items()
    )


def receipts(
    commands: Iterable[Command], answers: Sequence[StoredFrame | Absent], instance: Instance, time_s: float
) -> tuple[Receipt, ...]:
    """Return admission and completion receipts of `takePhoto` commands. An absent picture is `timed_out` with its
    reason.
    """
    entities = {entity.id: entity for entity in instance.entities}
    answer_by_mount = {_mount(answer): answer for answer in answers}
    out: list[Receipt] = []
    for command in commands:
        if command.verb != PHOTO:
            continue
        answer = answer_by_mount[command.resource, camera_of(entities[command.resource], command.arguments)]
        out.append(command.receipt("camera", "accepted", time_s))
        if isinstance(answer, Absent):
            out.append(command.receipt("camera", "timed_out", time_s, answer.reason, "no picture, so no detection"))
        else:
            out.append(command.receipt("camera", "completed", time_s, detail=answer.info.id))
    return tuple(out)


def policy_picture(frame: StoredFrame, *, blank: bool = False) -> Picture:
    """Return a stored frame as a policy receives it. Its arrays are read-only."""
    info = frame.info
    size = (info.pose.height, info.pose.width, 3)
    rgb = np.zeros(size, np.uint8) if blank else decode_jpeg(frame.jpeg)
    depth = None if blank else frame.depth
    semantic = None if blank else frame.semantic
    instance = None if blank else frame.instance
    for array in (rgb, depth, semantic, instance):
        if array is not None:
            array.flags.writeable = False
    return Picture(
        frame=info.id,
        entity=info.entity,
        camera=info.camera,
        tick=info.tick,
        time_s=info.time_s,
        pose=info.pose,
        rgb=rgb,
        depth=depth,
        semantic=semantic,
        instance=instance,
        instance_ids={} if blank else info.instance_ids,
        jpeg=b"" if blank else frame.jpeg,
    )


def _mount(answer: StoredFrame | Absent) -> tuple[str, str]:
    if isinstance(answer, Absent):
        return answer.entity, answer.camera
    return answer.info.entity, answer.info.camera


DISTANCE_M, HEIGHT_M, TILT_DEG, HFOV_DEG = 24.0, 4.0, 0.0, 75.0
WIDTH, HEIGHT = 1280, 720
"""The view of a person's photograph of a house from across the street, taken slightly from above. Chosen; metres,
degrees and pixels.
"""

_HIDDEN_POSE = CameraPose(
    position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=TILT_DEG, hfov_deg=HFOV_DEG, width=WIDTH, height=HEIGHT
)
"""The pose that agents receive: the frame's origin."""


_REFERENCE_CAMERA = CameraSpec(
    name=REFERENCE, view="front", width=WIDTH, height=HEIGHT, hfov_deg=HFOV_DEG, channels=("rgb",), capture="on_request"
)


def reference_views(instance: Instance, agent: AgentSpec) -> tuple[CameraView, ...]:
    """Return the reference pictures that are revealed to the agent's role, as cameras."""
    shown = dict.fromkeys(name for reveal in instance.reveals if reveal.role == agent.role for name in reveal.entities)
    return tuple(CameraView(entity=name, camera=_REFERENCE_CAMERA) for name in shown)


class ReferencePictures:
    """The reference pictures of one instance. Holds no run-time state.

    The camera stands in front of the target, in the direction of its heading, at the distance that the target declares
    (`portrait`) or `DISTANCE_M`, and lower where it is near, so that it shows the ground. The true pose would reveal
    the target's position, so agents receive the picture with a pose at the frame's origin. Reports may not cite these
    pictures: they show a target to agents that have not found it.
    """

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        self._roles: dict[str, set[str]] = {}
        for reveal in instance.reveals:
            for entity in reveal.entities:
                self._roles.setdefault(entity, set()).add(reveal.role)

    def requests(self, tick: int, time_s: float) -> tuple[CaptureRequest, ...]:
        """Return the captures to make; empty at every boundary but 0."""
        if tick != 0:
            return ()
        return tuple(
            CaptureRequest(
                frame=f"r{tick}-{name}",
                entity=name,
                camera=REFERENCE,
                tick=tick,
                time_s=time_s,
                pose=_in_front_of(self._entities[name]),
            )
            for name in self._roles
        )

    def pictures_for(self, agent: AgentSpec, pictures: Sequence[Picture]) -> tuple[Picture, ...]:
        """Return the pictures that are revealed to the agent's role, without their poses."""
        return tuple(
            replace(picture, pose=_HIDDEN_POSE)
            for picture in pictures
            if picture.camera == REFERENCE and agent.role in self._roles.get(picture.entity, ())
        )

    def absent_for(self, agent: AgentSpec, absent: Sequence[Absent]) -> tuple[Absent, ...]:
        """Return the reference pictures for the agent's role that could not be taken."""
        return tuple(
            picture
            for picture in absent
            if picture.camera == REFERENCE and agent.role in self._roles.get(picture.entity, ())
        )


def _in_front_of(entity: Entity) -> CameraPose:
    angle = math.radians(entity.heading_deg)
    east, north, elevation = entity.position
    away_m = entity.number_or(f"{PORTRAIT}_m", DISTANCE_M)
    up_m = min(HEIGHT_M, away_m / 4.0)
    return msgspec.structs.replace(
        _HIDDEN_POSE,
        position=(east + away_m * math.sin(angle), north + away_m * math.cos(angle), elevation + up_m),
        heading_deg=(entity.heading_deg + 180.0) % 360.0,
    )
