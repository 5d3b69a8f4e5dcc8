"""What begins outside of the scene, and assets under its ground, as far as the text decides that.

Only scenes whose reach is known are looked at (`lingjing.mission.kinds`). What the scene moves (`on = road`) is out
only if it is so far out that it could not be moved in. All else is found when the city is there
(`lingjing.scene.anchor`).
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.proof import Proof, spelled
from lingjing.mission.kinds import engine_kind, reach_m

UNDER_M = 1.0
"""So far below the lowest surface an asset is under it, and not a leg's length short."""


def refute_standing(outline: Outline) -> list[Proof]:
    """What stands at places where it cannot begin."""
    return [proof for body in outline.bodies.values() if _is_known(body) for proof in _proofs(body, outline)]


def _is_known(body: Body) -> bool:
    where = body.where
    return len(where.outlines) == 1 and len(where.outlines[0]) == 1 and not where.drawn


def _proofs(body: Body, outline: Outline) -> Iterator[Proof]:
    scene, engine = outline.instance.scene, engine_kind(body.entity.engine)
    reach = reach_m(scene)
    if reach is None:
        return
    east, north, up = body.entity.position
    shown = f"`{body.id}` begins at ({spelled(east)} m, {spelled(north)} m, {spelled(up)} m)"
    loose = body.where.loose_m
    if max(abs(east), abs(north)) > reach + loose and not engine.anywhere:
        hint = "move it into the scene, or give the scene a larger `extent`"
        message = f"{shown}, outside of the scene, which spans {spelled(reach)} m to every side"
        yield Proof("LJ0211", body.path, message, hint, subject=body.id)
    lowest = min(0.0, scene.datum_m)
    is_placed = body.entity.role == "asset" and loose == 0.0
    if is_placed and up < lowest - UNDER_M and engine.landbound:
        message = f"{shown}, below everything in the scene, whose lowest surface lies at {spelled(lowest)} m"
        yield Proof("LJ0211", body.path, message, "give it the elevation it begins at", subject=body.id)
