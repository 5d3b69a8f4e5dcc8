"""Satellite cameras with pictures so wide that the scene covers a few pixels: a hint, not a proof.

A mission may intend that. Mostly, however, a camera of an aircraft was mounted on a satellite by mistake.
"""

from __future__ import annotations

import math

from lingjing.errors import LingjingError
from lingjing.mission import model
from lingjing.mission.conditions.outline import Outline, of_mission, too_large
from lingjing.mission.feasibility.proof import Proof, gathered, spelled
from lingjing.mission.instance import CameraSpec, Entity
from lingjing.mission.kinds import engine_kind, extent_m

_WIDE_FACTOR = 50.0
"""A picture wider than the scene by this factor is reported (chosen): the scene covers a fiftieth of its width."""

_DEFAULT_ORBIT_M = 550e3
"""Height of the orbit of a satellite without elements, metres (`lingjing.engines.satellite.passes.HEIGHT_KM`)."""
_LOWEST_ORBIT_M = 160e3
"""Lower bound of the height of an orbit from elements, metres (chosen: lower ones decay within days)."""


def too_wide(mission: model.Mission) -> tuple[Proof, ...]:
    """A hint for each satellite camera that is far too wide for the scene, in the mission's first mode; empty if the
    mission cannot be evaluated or is too large."""
    try:
        if not any(engine_kind(group.engine).orbits for group in mission.groups):
            return ()
        mode = mission.modes.allowed[0]
        return () if too_large(mission, mode) else _too_wide_of(of_mission(mission, mode))
    except LingjingError:
        return ()


def _too_wide_of(outline: Outline) -> tuple[Proof, ...]:
    """Return the hints of `too_wide` for the outline of a mission."""
    extent = extent_m(outline.instance.scene)
    if extent is None:
        return ()
    carriers = [body.entity for body in outline.bodies.values() if engine_kind(body.entity.engine).orbits]
    hints = [_hint(entity, camera, extent) for entity in carriers for camera in entity.cameras]
    return gathered(proof for proof in hints if proof is not None)


def _hint(entity: Entity, camera: CameraSpec, extent: float) -> Proof | None:
    height = _LOWEST_ORBIT_M if entity.properties.get("tle1") else _DEFAULT_ORBIT_M
    across = 2.0 * height * math.tan(math.radians(camera.hfov_deg) / 2.0)
    if across < _WIDE_FACTOR * extent:
        return None
    pixels = camera.width * extent / across
    return Proof(
        "LJ0506",
        f"{entity.role}/{entity.group}",
        f"the pictures of `{entity.id}.{camera.name}` are too wide for the scene: from {height / 1000.0:,.0f} km, "
        f"{spelled(camera.hfov_deg)} deg show {across / 1000.0:,.0f} km across, "
        f"the scene is {spelled(extent / 1000.0)} km wide and covers {pixels:.1f} of {camera.width} px",
        "narrow its field of view: `orbit` of `std.sensors` shows 20 km",
        subject=entity.id,
    )
