"""The checks of a type's body: pictures show it at its declared size, and bodies that fly into it collide.

They test one entity of a mission with the installed engines `camera` and `multirotor`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from lingjing.mission.instance import Entity, Instance, VerbSpec
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.mission.vocabulary import COLLIDED
from lingjing.plugins.bodies import entity_size, solid_size, sunk_m
from lingjing.plugins.building import build_city
from lingjing.plugins.conformance.case import require, run_all
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Box, CameraPose, Command

PIXELS = (400, 1600)
"""The bounds of a picture's width and height, pixels. Within them the thinnest side of the entity decides."""

THIN_PX = 4.0
"""The size of the thinnest side of the entity in a picture, pixels. Chosen."""
HFOV_DEG = 60.0
"""The horizontal field of view of the pictures, degrees. Chosen."""
BEARINGS = 8
"""The number of directions from which pictures of the entity are taken. Chosen."""

MOST_TIMES = 2.0
"""The largest allowed ratio between the drawn and the declared size, in both directions. Chosen."""

EDGE_PX = 2.0
"""The allowed error of a box's edges, pixels: thin bodies are few pixels high at a distance. Chosen."""

_PROBE = "conformance"
_ABOVE_M, _LIFT_M, _SECONDS = 4.0, 20.0, 30.0


@dataclass(frozen=True, slots=True)
class BodyCase:
    """An entity of an instance at its place, and the city around it."""

    instance: Instance
    city: City
    entity: Entity

    @property
    def state(self) -> BodyState:
        """The state of the entity at rest."""
        return BodyState(id=self.entity.id, position=self.entity.position, heading_deg=self.entity.heading_deg)

    @property
    def middle_m(self) -> float:
        """The elevation of its middle, metres."""
        return self.entity.position[2] + entity_size(self.entity).height_m / 2.0 - sunk_m(self.entity)


def check_body(mission: Mission, entity: str, *, seed: int = 1) -> None:
    """Run every check of an entity of a mission. Raises one `ConformanceError` that lists all failed checks."""
    instance = instantiate(mission, seed=seed)
    city = build_city(instance.scene, PluginHost())
    instance = anchor(instance, city, imported=bool(mission.origin.places))
    entities = {entity.id: entity for entity in instance.entities}
    require(entity in entities, f"the mission has no entity `{entity}`, it has {', '.join(entities)}")
    run_all(f"the type `{entities[entity].type}`", BODY_CHECKS, BodyCase(instance, city, entities[entity]))


def check_is_seen(case: BodyCase) -> None:
    """Check that a picture from some direction shows the entity, and at its size if the entity declares one."""
    size = solid_size(case.entity)
    about_m = 1.0 if size is None else max(size.length_m, size.width_m, size.height_m)
    away_m = 1.5 * about_m + 2.0
    frame_m = 2.0 * away_m * math.tan(math.radians(HFOV_DEG) / 2.0)
    thin_m = about_m if size is None else min(size.length_m, size.width_m, size.height_m)
    pixels = round(min(max(PIXELS[0], frame_m * THIN_PX / thin_m), PIXELS[1]))
    seen = [box for box in _boxes(case, away_m, pixels) if box is not None]
    require(bool(seen), f"no picture from {away_m:g} m away shows `{case.entity.id}`")
    if size is None or not any(case.entity.number(f"{name}_m") for name in ("length", "width", "height")):
        return
    wide = max(box.box[2] - box.box[0] for box in seen) * frame_m
    high = max(box.box[3] - box.box[1] for box in seen) * frame_m
    for what, drawn, declared in (
        ("wide", wide, math.hypot(size.length_m, size.width_m)),
        ("high", high, size.height_m),
    ):
        edge_m = EDGE_PX * frame_m / pixels
        right = declared / MOST_TIMES - edge_m <= drawn <= declared * MOST_TIMES + edge_m
        require(right, f"`{case.entity.id}` is drawn {drawn:.1f} m {what}, its measures allow {declared:.1f} m")


def check_can_be_hit(case: BodyCase) -> None:
    """Check that a multirotor which descends on the entity collides with it. An entity without a body passes.

    The entity is lifted into the air, because other rules hold for collisions at the ground.
    """
    if solid_size(case.entity) is None:
        return
    x, y, z = case.entity.position
    lifted = msgspec.structs.replace(case.state, position=(x, y, z + _LIFT_M))
    middle_m = case.middle_m + _LIFT_M
    top_m = middle_m + entity_size(case.entity).height_m / 2.0
    probe = Entity(id=_PROBE, group=_PROBE, index=1, role="asset", type=_PROBE, engine="multirotor",
                   position=(x, y, top_m + _ABOVE_M), verbs=(VerbSpec(name="setDestination"),))  # fmt: skip
    others = tuple(e for e in case.instance.entities if e.engine != probe.engine or e.id == case.entity.id)
    instance = msgspec.structs.replace(case.instance, entities=(*others, probe))
    down = Command(id="c0-1", tick=0, sender=_PROBE, resource=_PROBE, verb="setDestination",
                   arguments={"x": x, "y": y, "z": middle_m})  # fmt: skip
    engine = PluginHost().engine(probe.engine).factory()
    hit = False
    try:
        engine.reset(EngineSpec(engine=probe.engine, instance=instance, owns=(_PROBE,)), case.city, 1)
        engine.submit((down,))
        step_s = instance.clock.sync_s
        for number in range(1, round(_SECONDS / step_s) + 1):
            boundary = engine.advance(number * step_s, (lifted,))
            met = [event.entities for event in boundary.events if event.kind == COLLIDED]
            if hit := any(case.entity.id in entities for entities in met):
                break
    finally:
        engine.close()
    require(hit, f"a multirotor comes down on `{case.entity.id}` and does not collide with it")


BODY_CHECKS: tuple[Callable[[BodyCase], None], ...] = (check_is_seen, check_can_be_hit)
"""Every check of a body."""


def _boxes(case: BodyCase, away_m: float, pixels: int) -> list[Box | None]:
    """Return the entity's boxes in pictures from all directions, level with its middle; None where it is not
    visible."""
    x, y, _ = case.entity.position
    engine = PluginHost().engine("camera").factory()
    try:
        engine.reset(EngineSpec(engine="camera", instance=case.instance, owns=()), case.city, 1)
        engine.advance(1.0, (case.state,))
        requests = []
        for number in range(BEARINGS):
            bearing = math.radians(360.0 * number / BEARINGS)
            place = (x - away_m * math.sin(bearing), y - away_m * math.cos(bearing), case.middle_m)
            pose = CameraPose(position=place, heading_deg=math.degrees(bearing), tilt_deg=0.0, hfov_deg=HFOV_DEG,
                              width=pixels, height=pixels)  # fmt: skip
            requests.append(CaptureRequest(frame=f"f{number}", entity=case.entity.id, camera=_PROBE, tick=0,
                                           time_s=1.0, pose=pose))  # fmt: skip
        frames = engine.capture(tuple(requests))
    finally:
        engine.close()
    return [next((b for b in frame.info.boxes if b.entity == case.entity.id), None) for frame in frames]


__all__ = ["BODY_CHECKS", "BodyCase", "check_body", "check_can_be_hit", "check_is_seen"]
