"""What begins outside of the scene, assets under its ground, on its land or above what they are always on, as far as
the text decides that.

Only scenes whose reach, levels and land are known are looked at (`lingjing.mission.kinds`). What the scene moves
(`on = road`) is out only if it is so far out that it could not be moved in. All else is found when the city is there
(`lingjing.scene.anchor`).
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.proof import Proof, spelled
from lingjing.mission.geometry2d import contains
from lingjing.mission.kinds import centre_m, engine_kind, land, levels_m, reach_m, scene_kind, spoken

UNDER_M = 1.0
"""So far below the lowest surface an asset is under it, and not a leg's length short."""

OFF_M = 10.0
"""So far above or below the road or the water that it is always on, an asset's elevation is no rough one."""


def refute_standing(outline: Outline) -> list[Proof]:
    """What stands at places where it cannot begin."""
    return [proof for body in outline.bodies.values() if _is_known(body) for proof in _proofs(body, outline)]


def _is_known(body: Body) -> bool:
    where = body.where
    return len(where.outlines) == 1 and len(where.outlines[0]) == 1 and not where.drawn


def _proofs(body: Body, outline: Outline) -> Iterator[Proof]:
    yield from _out_of_scene(body, outline)
    if body.entity.role == "asset":
        yield from _under_the_scene(body, outline)
        yield from _off_its_surface(body, outline)


def _out_of_scene(body: Body, outline: Outline) -> Iterator[Proof]:
    reach = reach_m(outline.instance.scene)
    east, north, _ = body.entity.position
    if reach is None or engine_kind(body.entity.engine).anywhere:
        return
    middle = centre_m(outline.instance.scene)
    if max(abs(east - middle[0]), abs(north - middle[1])) > reach + body.where.loose_m:
        hint = "move it into the scene, or give the scene a larger `extent`"
        about = "" if middle == (0.0, 0.0) else f" of ({spelled(middle[0])} m, {spelled(middle[1])} m)"
        message = f"{_shown(body)}, outside of the scene, which spans {spelled(reach)} m to every side{about}"
        yield Proof("LJ0211", body.path, message, hint, subject=body.id)


def _under_the_scene(body: Body, outline: Outline) -> Iterator[Proof]:
    scene = outline.instance.scene
    kind, lowest = scene_kind(scene.kind), min(0.0, scene.datum_m)
    if kind is None or not kind.level or body.where.loose_m or not engine_kind(body.entity.engine).landbound:
        return
    if body.entity.position[2] < lowest - UNDER_M:
        message = f"{_shown(body)}, below everything in the scene, whose lowest surface lies at {spelled(lowest)} m"
        yield Proof("LJ0211", body.path, message, _ELEVATION, subject=body.id)


def _off_its_surface(body: Body, outline: Outline) -> Iterator[Proof]:
    scene, surface = outline.instance.scene, engine_kind(body.entity.engine).stands_on
    east, north, up = body.entity.position
    levels = levels_m(scene, surface)
    is_given = up != scene.datum_m  # without an elevation a position has the datum's
    if levels is not None and is_given and not levels[0] - OFF_M <= up <= levels[1] + OFF_M:
        low, high = (spelled(metres) for metres in levels)
        where = f"at {low} m" if low == high else f"between {low} m and {high} m"
        message = f"{_shown(body)}, and is always on {spoken(surface)}, which lies {where}"
        yield Proof("LJ0211", body.path, message, _ELEVATION, subject=body.id)
    if surface == "water" and any(contains(outline, east, north) for outline in land(scene)):
        yield Proof("LJ0211", body.path, f"{_shown(body)}, which is on land", "move it into the water", subject=body.id)


def _shown(body: Body) -> str:
    east, north, up = body.entity.position
    return f"`{body.id}` begins at ({spelled(east)} m, {spelled(north)} m, {spelled(up)} m)"


_ELEVATION = "give it the elevation it begins at, or leave that out"
