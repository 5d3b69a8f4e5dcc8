"""Start places: errors in the declared positions of entities, as far as the mission's text decides that.

Four checks: more drawn members than fit into a region; entities outside the scene, below its ground, on its land or
above the surface of their engine; and bodies that overlap.

Only scenes with known extent, levels and land are checked (`lingjing.mission.kinds`). An entity that the scene moves
(`on = road`) is reported only if it is too far outside to be moved in. Overlaps are checked for exact places only:
drawn places and those that the scene finds are separated when the city is built (`lingjing.scene.anchor`), which also
finds all other errors. An engine without a description file is skipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import PossiblePlaces
from lingjing.mission.feasibility.proof import Proof, spelled
from lingjing.mission.footprint import StartingBodies, footprint
from lingjing.mission.geometry2d import contains, convex_hull, signed_area
from lingjing.mission.kinds import centre_m, engine_kind, is_described, land, levels_m, reach_m, scene_kind, spoken

# -- drawn places

_RESOLUTION_M = 0.001
"""Resolution of drawn places, metres (`lingjing.mission.draws`); a smaller minimum distance has no effect."""


def refute_places(outline: Outline) -> list[Proof]:
    """Proofs that the drawn places of a group cannot all lie in their region."""
    proofs = []
    for group, count, where in outline.drawn_sites:
        most = _max_places(where)
        if count > most:
            hectares = sum(abs(signed_area(outline_)) for outline_ in where.outlines) / 10_000.0
            proofs.append(
                Proof(
                    "LJ0611",
                    f"target/{group}",
                    f"{count} places at least {spelled(where.apart)} m apart cannot fit into {hectares:.4g} ha: "
                    f"at most {most} can",
                    "lower `apart`, declare fewer members, or widen the region",
                )
            )
    return proofs


def _max_places(where: PossiblePlaces) -> float:
    """Upper bound of the number of points in the region with a distance of at least `apart`.

    Groemer (1960): a convex area A of perimeter P holds at most 2/√3 · A/d² + P/(2d) + 1 points with distances of d or
    more. The convex hull of the region holds at least as many as the region.
    """
    if where.apart < _RESOLUTION_M or not where.drawn:
        return math.inf
    hull = convex_hull(tuple(corner for outline in where.outlines for corner in outline))
    if len(hull) < 3:
        return math.inf
    around = sum(math.dist(a, b) for a, b in zip(hull, (*hull[1:], hull[0]), strict=True))
    apart = where.apart
    return math.floor(2.0 / math.sqrt(3.0) * abs(signed_area(hull)) / apart**2 + around / (2.0 * apart) + 1.0 + 1e-9)


# -- positions in the scene

UNDER_M = 1.0
"""An asset this far below the lowest surface is reported, metres (chosen): more than the length of a leg."""

OFF_M = 10.0
"""An asset of a road or water engine this far above or below its surface is reported, metres (chosen): larger than the
error of a rough elevation."""


def refute_standing(outline: Outline) -> list[Proof]:
    """Proofs that an entity cannot begin at its place."""
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


_ELEVATION = "give it its elevation at the start, or leave the elevation out"


# -- overlaps

OVERLAP = "LJ0212"
"""The diagnostic code of these proofs."""


def refute_overlaps(outline: Outline) -> list[Proof]:
    """Proofs that an asset begins where another one is."""
    starting, proofs = StartingBodies(), []
    for body in outline.bodies.values():
        room = footprint(body.entity)
        if room is None or not _is_exact_place(body) or not is_described("engine", body.entity.engine):
            continue
        other = starting.overlapping(room)
        if other is not None:
            proofs.append(_overlap_proof(body, other))
        starting.add(body.id, room)
    return proofs


def _is_exact_place(body: Body) -> bool:
    outlines = body.where.outlines
    return len(outlines) == 1 and len(outlines[0]) == 1 and not body.where.drawn and not body.where.loose_m


def _overlap_proof(body: Body, other: str) -> Proof:
    east, north, up = (spelled(metres) for metres in body.entity.position)
    message = f"`{body.id}` begins at ({east} m, {north} m, {up} m), where `{other}` is: they would overlap"
    return Proof(OVERLAP, body.path, message, _SEPARATE, subject=body.id)


_SEPARATE = "give each its own place: a group takes `at(i, [(0 m, 0 m), …])`, or `spread 8 m` behind one place"
