"""Pictures at a boundary: which ones are taken, what is stored, what policies receive.

A picture is taken at the boundary its `takePhoto` was admitted for, or at every boundary for a camera declared
`each_tick`. Policies receive the decoded stored image, so the trace holds exactly what they saw. `blank` hands out
black pictures without depth or classes instead, for the study that shows what a policy does without its eyes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from lingjing.kernel.commands import camera_of
from lingjing.kernel.world.contract import StoredFrame
from lingjing.mission.instance import Instance
from lingjing.mission.vocabulary import PHOTO
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.policy import Picture
from lingjing.trace.images import decode_jpeg, quantise_depth
from lingjing.trace.records import Absent, Command, Receipt


def requests(instance: Instance, commands: Iterable[Command], tick: int, time_s: float) -> tuple[CaptureRequest, ...]:
    """Captures due at a boundary: admitted `takePhoto` commands first, then `each_tick` cameras not among them."""
    entities = {entity.id: entity for entity in instance.entities}
    wanted: dict[tuple[str, str], None] = {}
    for command in commands:  # admitted at this boundary, so the picture is of this boundary too (ADR 0003)
        if command.verb == PHOTO:
            wanted[command.resource, camera_of(entities[command.resource], command.arguments)] = None
    for entity in instance.entities:
        for camera in entity.cameras:
            if camera.capture == "each_tick":
                wanted[entity.id, camera.name] = None
    return tuple(
        CaptureRequest(frame=f"f{tick}-{entity}-{camera}", entity=entity, camera=camera, tick=tick, time_s=time_s)
        for entity, camera in wanted
    )


def receipts(
    commands: Iterable[Command], answers: Sequence[StoredFrame | Absent], instance: Instance, time_s: float
) -> tuple[Receipt, ...]:
    """Admission and completion of the `takePhoto` commands; an absent picture is `timed_out` with its reason."""
    entities = {entity.id: entity for entity in instance.entities}
    found = {_mount(answer): answer for answer in answers}
    out: list[Receipt] = []
    for command in commands:
        if command.verb != PHOTO:
            continue
        answer = found[command.resource, camera_of(entities[command.resource], command.arguments)]
        out.append(command.receipt("camera", "accepted", time_s))
        if isinstance(answer, Absent):
            out.append(command.receipt("camera", "timed_out", time_s, answer.reason, "no picture, so no detection"))
        else:
            out.append(command.receipt("camera", "completed", time_s, detail=answer.info.id))
    return tuple(out)


def seen(frame: StoredFrame, *, blank: bool = False) -> Picture:
    """What a policy receives of a stored frame; arrays are read-only."""
    info = frame.info
    rgb = decode_jpeg(frame.jpeg)
    if blank:
        rgb = np.zeros_like(rgb)
    depth = None if frame.depth is None or blank else quantise_depth(frame.depth)
    semantic = None if frame.semantic is None or blank else frame.semantic
    for array in (rgb, depth, semantic):
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
        jpeg=b"" if blank else frame.jpeg,
    )


def _mount(answer: StoredFrame | Absent) -> tuple[str, str]:
    if isinstance(answer, Absent):
        return answer.entity, answer.camera
    return answer.info.entity, answer.info.camera
