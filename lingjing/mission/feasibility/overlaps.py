"""Bodies that begin in one place, as far as the text decides that.

Only places are compared that the text gives exactly: drawn ones, and those that the scene looks for (`on = road`), are
kept apart when the city is there (`lingjing.scene.anchor`). Of an engine that no file describes nothing is known.
"""

from __future__ import annotations

from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.proof import Proof, spelled
from lingjing.mission.footprint import StartingBodies, footprint
from lingjing.mission.kinds import is_described

OVERLAP = "LJ0212"
"""The code of its proofs."""


def refute_overlaps(outline: Outline) -> list[Proof]:
    """Assets that stand or fly where another one is already."""
    starting, found = StartingBodies(), []
    for body in outline.bodies.values():
        room = footprint(body.entity)
        if room is None or not _is_exact(body) or not is_described("engine", body.entity.engine):
            continue
        other = starting.met(room)
        if other is not None:
            found.append(_proof(body, other))
        starting.add(body.id, room)
    return found


def _is_exact(body: Body) -> bool:
    outlines = body.where.outlines
    return len(outlines) == 1 and len(outlines[0]) == 1 and not body.where.drawn and not body.where.loose_m


def _proof(body: Body, other: str) -> Proof:
    east, north, up = (spelled(metres) for metres in body.entity.position)
    message = f"`{body.id}` begins at ({east} m, {north} m, {up} m), where `{other}` is: they would overlap"
    return Proof(OVERLAP, body.path, message, _HINT, subject=body.id)


_HINT = "give each its own place: a group takes `at(i, [(0 m, 0 m), …])`, or `spread 8 m` behind one place"
