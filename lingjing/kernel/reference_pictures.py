"""Reference pictures: what `reveal image(target) to role` shows, once, at boundary 0.

A picture is taken from in front of the target, which looks where its heading says. Its pose would tell where the
target is, so those who are shown it get one at the frame's origin; and no report may speak of it, because it shows
the target to somebody who has not found it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import msgspec

from lingjing.mission.instance import AgentSpec, Entity, Instance
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.policy import REFERENCE, Picture
from lingjing.trace.records import Absent, CameraPose

DISTANCE_M, HEIGHT_M, TILT_DEG, HFOV_DEG = 24.0, 4.0, 0.0, 75.0
WIDTH, HEIGHT = 1280, 720
"""A person's photograph of a house from across the street, taken a little from above."""

_NOWHERE = CameraPose(
    position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=TILT_DEG, hfov_deg=HFOV_DEG, width=WIDTH, height=HEIGHT
)


class ReferencePictures:
    """The reference pictures of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        self._roles: dict[str, set[str]] = {}
        for reveal in instance.reveals:
            for entity in reveal.entities:
                self._roles.setdefault(entity, set()).add(reveal.role)

    def requests(self, tick: int, time_s: float) -> tuple[CaptureRequest, ...]:
        """What the camera is asked for; nothing but at boundary 0."""
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

    def shown_to(self, agent: AgentSpec, pictures: Sequence[Picture]) -> tuple[Picture, ...]:
        """Those of the pictures that the agent's role is shown, without their poses."""
        return tuple(
            replace(picture, pose=_NOWHERE)
            for picture in pictures
            if picture.camera == REFERENCE and agent.role in self._roles.get(picture.entity, ())
        )

    def missed_by(self, agent: AgentSpec, absent: Sequence[Absent]) -> tuple[Absent, ...]:
        """Reference pictures that the agent's role should have been shown and that did not come."""
        return tuple(one for one in absent if one.camera == REFERENCE and agent.role in self._roles.get(one.entity, ()))


def _in_front_of(entity: Entity) -> CameraPose:
    angle = math.radians(entity.heading_deg)
    east, north, elevation = entity.position
    return msgspec.structs.replace(
        _NOWHERE,
        position=(east + DISTANCE_M * math.sin(angle), north + DISTANCE_M * math.cos(angle), elevation + HEIGHT_M),
        heading_deg=(entity.heading_deg + 180.0) % 360.0,
    )
