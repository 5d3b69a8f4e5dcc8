"""Pictures: some camera must be able to take one, and the target must cover pixels in it."""

from __future__ import annotations

import math

import msgspec

from lingjing.mission.appearance import UNSAID_M
from lingjing.mission.conditions.episode import EpisodeKnowledge
from lingjing.mission.conditions.needs import PictureNeed
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.feasibility.proof import Proof, both, exceeds, spelled
from lingjing.mission.instance import CameraSpec
from lingjing.mission.kinds import engine_kind, scene_kind
from lingjing.mission.vocabulary import PHOTO

_RESOLVED_PX = 2.0
"""Pixels of the smallest target that a picture resolves (chosen). The target's longest extent is measured at the lowest
allowed altitude and at the place of the picture where it appears largest; a smaller target looks like noise."""

_EXTENTS = ("length_m", "width_m", "height_m")
"""Properties with the size of a target."""

_MAX_EXTENTS_M = {"person_in_water": 2.5}
"""Upper bounds of the extents of models, metres. Other models may show flames, spray or people at any distance."""

_SUNK_M = 10.0
"""Metres by which a target may lie below its surface or beside its place, beyond its declared place (chosen)."""

_RAISED_M = {"ground": 100.0, "road": 100.0, "water": 0.0, "None": 0.0}
"""Upper bound of the height by which the scene raises a body on a surface, metres; others have no bound."""


def refute_picture(picture: PictureNeed, outline: Outline) -> Proof | None:
    """A proof that no picture can show the target, or None."""
    mounts = [(body, camera) for body in outline.bodies.values() for camera in body.entity.cameras]
    if not mounts:
        return _no_camera(picture, "no asset of this mission has a camera", "give an asset a `camera … { }`", ())
    usable = [(body, camera) for body, camera in mounts if _takes_pictures(body, camera, outline)]
    if not usable:
        return _no_request(picture, mounts[0][0])
    return _too_small(picture, usable)


def _takes_pictures(body: Body, camera: CameraSpec, outline: Outline) -> bool:
    """True if the camera takes pictures by itself, or if some agent may request one."""
    if camera.capture == "each_tick":
        return True
    commanded = any(body.id in agent.commands for agent in outline.instance.agents)
    return commanded and any(verb.name == PHOTO for verb in body.entity.verbs)


def takes_pictures_by_itself(outline: Outline) -> bool:
    """True if some camera takes a picture at each tick."""
    return any(c.capture == "each_tick" for body in outline.bodies.values() for c in body.entity.cameras)


def as_drawn(target: Body) -> Body:
    """The target as pictures show it: without carriers, if it is not drawn while it is aboard.

    A target that drifts takes the status word of the interaction that takes it aboard, and is absent then
    (`lingjing.engines.bodies.is_absent`). Another interaction or a nature of its own could give it another word.
    """
    entity = target.entity
    unseen = "drift_mps" in entity.properties and not entity.state and entity.blocked_m is None
    if unseen and all(interaction.aboard for interaction in entity.interactions):
        return msgspec.structs.replace(target, aboard=frozenset())
    return target


def sight_m(
    carrier: Body, camera: CameraSpec, target: Body, knowledge: EpisodeKnowledge, ceiling_m: float = math.inf
) -> float:
    """The largest distance in the plane from which a camera can show a target, metres; infinity if there is none.

    Only a camera that looks straight down has one: its carrier cannot rise higher than its altitude band, or than
    `ceiling_m`.
    """
    size, scene = _extent_m(target), knowledge.outline.instance.scene
    mount = next((mount for mount in carrier.entity.mounts if mount.view == camera.view), None)
    ahead_m = abs(mount.ahead_m) if mount is not None else 0.0
    straight_down = camera.view == "nadir" and (mount is None or (mount.gimbal and mount.tilt_deg >= 90.0))
    highest = min(knowledge.coordinate(carrier, 2).high, ceiling_m)
    if not straight_down or math.isinf(size) or math.isinf(highest) or scene_kind(scene.kind) is None:
        return math.inf
    lowest = min(0.0, scene.datum_m, target.entity.position[2]) - _SUNK_M
    focal = camera.width / (2.0 * math.tan(math.radians(camera.hfov_deg) / 2.0))
    corner = math.hypot(camera.width / 2.0, camera.height / 2.0) / focal
    return (highest - lowest) * corner + size + ahead_m + _SUNK_M


def _extent_m(target: Body) -> float:
    """The longest visible extent of a target from corner to corner, metres; infinity if unknown."""
    entity = target.entity
    look = entity.properties.get("look")
    if entity.parts or look is not None:
        return math.inf if entity.parts else _MAX_EXTENTS_M.get(str(look), math.inf)
    if not any(name in entity.properties for name in _EXTENTS):
        return math.inf
    return math.hypot(*(target.bounds(name)[1] if name in entity.properties else UNSAID_M for name in _EXTENTS))


def _max_pixels(size_m: float, height_m: float, camera: CameraSpec) -> float:
    """Upper bound of the pixels of a body of this size from this height, for every place in the picture and every
    rotation of the camera.

    A focal length of `f` pixels shows an angle `a` off the axis with `f / cos² a` pixels a radian; the corner of the
    picture has the largest angle.
    """
    focal = camera.width / (2.0 * math.tan(math.radians(camera.hfov_deg) / 2.0))
    corner = ((camera.width / 2.0) ** 2 + (camera.height / 2.0) ** 2) / focal**2
    nearest = height_m - size_m / 2.0
    return math.inf if nearest <= 0 else focal * (1.0 + corner) * 2.0 * math.atan(size_m / 2.0 / nearest)


def _too_small(picture: PictureNeed, usable: list[tuple[Body, CameraSpec]]) -> Proof | None:
    size = _extent_m(picture.target)
    if math.isinf(size):
        return None
    views = [(_max_pixels(size, _lowest_m(body, picture.target), camera), body, camera) for body, camera in usable]
    pixels, body, camera = max(views, key=lambda view: view[0])
    if not exceeds(_RESOLVED_PX, pixels):
        return None
    needed, covered = both(_RESOLVED_PX, pixels)
    return Proof(
        "LJ0608",
        picture.at,
        f"no camera can resolve `{picture.target.id}`: {spelled(size)} m seen by `{body.id}.{camera.name}` "
        f"({camera.width} by {camera.height} px, {spelled(camera.hfov_deg)} deg) from "
        f"{spelled(_lowest_m(body, picture.target))} m, the lowest allowed, cover {covered} px at most, "
        f"{needed} px are needed",
        "lower the band, or give the camera more pixels or a narrower field of view",
        ((body.path, "the camera's carrier"), (picture.target.path, "the target")),
        picture.target.id,
    )


def _lowest_m(body: Body, target: Body) -> float:
    """Metres between camera and target at the lowest allowed altitude; 0 if no altitude band applies to the asset."""
    lowest = body.bounds("band_low_m")[0]
    raised = _RAISED_M.get(str(target.entity.properties.get("on")), math.inf)
    if not engine_kind(body.entity.engine).in_band or not math.isfinite(lowest):
        return 0.0
    top = target.entity.position[2] + _extent_m(target) + raised
    return max(0.0, lowest - top)


def _no_request(picture: PictureNeed, body: Body) -> Proof:
    verbs = [verb.name for verb in body.entity.verbs]
    if PHOTO in verbs:
        why, hint = f"no agent may command `{body.id}`", "let an agent control it, or write `capture = each_tick`"
    else:
        why = f"`{body.id}` takes pictures on request, and `{PHOTO}` is not among its actions"
        hint = f"add `{PHOTO}` to its actions, or write `capture = each_tick`"
    return _no_camera(picture, why, hint, ((body.path, "the camera's carrier"),))


def _no_camera(picture: PictureNeed, why: str, hint: str, related: tuple[tuple[str, str], ...]) -> Proof:
    return Proof(
        "LJ0609",
        picture.at,
        f"no picture can show `{picture.target.id}`: {why}",
        hint,
        (*related, (picture.target.path, "the target")),
        picture.target.id,
    )
