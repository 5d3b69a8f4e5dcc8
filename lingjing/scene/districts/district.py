"""One district from its plan: ground, streets, blocks, and its site or seaside."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot
from pathlib import Path

import msgspec

from lingjing.errors import UsageError
from lingjing.mission.geometry2d import left_of
from lingjing.scene.city import City, Land, Pieces
from lingjing.scene.districts import coast, sites
from lingjing.scene.districts.draft import Draft, stream
from lingjing.scene.districts.furnish import CHAMFER_M, block_slab
from lingjing.scene.districts.options import DistrictPlan
from lingjing.scene.districts.palette import HOMES
from lingjing.scene.districts.rectangles import Rect, around, bounds
from lingjing.scene.districts.streets import APRON_M, CityBlock, StreetGrid, blocks, grid, network
from lingjing.scene.districts.zones import fill, heights, surface
from lingjing.scene.lines import project
from lingjing.scene.network import (
    Network,
    StreetEdge,
    StreetNode,
    build_network,
    moved_streets,
    network_folder,
    read_roads,
)
from lingjing.scene.outlines import inside
from lingjing.scene.translation import translate

GUTTER_M = 0.4
"""Distance that the asphalt extends under the kerb, metres (chosen)."""

GROUND_M = 3000.0
"""Distance that the ground extends beyond the district, metres (chosen): the horizon is land."""


KEPT = 8
"""Cached districts of a process (chosen). Episodes of one mission differ by a seed that changes only floating
objects."""


def cached_district(plan: DistrictPlan) -> City:
    """Return the district, cached if this process has built it lately."""
    kept = _kept(plan, network_folder())
    if not Path(kept.network).is_file():  # the cache folder was cleared meanwhile
        for cache in (_kept, _laid_out):
            cache.cache_clear()
        kept = _kept(plan, network_folder())
    return kept


@lru_cache(KEPT)
def _kept(plan: DistrictPlan, networks: Path) -> City:
    """The district of a plan. Only the pieces that were added first, with the ground, depend on the episode's seed.

    All other pieces are taken from the district of seed 0.
    """
    laid = _laid_out(replace(plan, seed=0), networks)
    if not plan.seed:
        return _city(plan, laid.pieces, laid.net)
    draft = Draft()
    _ground(draft, plan)
    props = (*draft.props, *laid.pieces.props[laid.first_props :])
    return _city(plan, msgspec.structs.replace(laid.pieces, props=props), laid.net)


@dataclass(frozen=True, slots=True)
class _LaidOut:
    """A district after layout."""

    pieces: Pieces
    net: Network
    first_props: int
    """Number of props that were added with the ground."""


@lru_cache(KEPT)
def _laid_out(plan: DistrictPlan, networks: Path) -> _LaidOut:
    draft = Draft()
    _ground(draft, plan)
    return _LaidOut(*lay_out(plan, grid(plan.half_m, plan.spacing), lambda block: plan.kind), len(draft.props))


def build_district(plan: DistrictPlan) -> City:
    """Build the district; the city itself holds the pieces."""
    return _city(plan, *lay_out(plan, grid(plan.half_m, plan.spacing), lambda block: plan.kind))


def _city(plan: DistrictPlan, pieces: Pieces, net: Network) -> City:
    pieces = translate(pieces, plan.centre)
    digest = hashlib.sha256(msgspec.msgpack.encode(pieces) + net.sha256.encode()).hexdigest()
    light = frame(plan, net)
    return msgspec.structs.replace(
        light, sha256=digest, **{name: getattr(pieces, name) for name in pieces.__struct_fields__}
    )


def lay_out(
    plan: DistrictPlan, made: StreetGrid, kind_of: Callable[[CityBlock], str], tree_gap_m: float = 16.0
) -> tuple[Pieces, Network]:
    """Lay out a plan on a grid and build its road network.

    `kind_of` names the kind of district that fills a block. Pieces lie about the origin; the network lies about the
    district's centre.
    """
    draft = Draft()
    _ground(draft, plan)
    gates = _site(draft, plan)
    for block in blocks(made, _keep_out(plan)):
        if _dry(plan, block.box):
            _block(draft, plan, block, kind_of(block), tree_gap_m)
    nodes, edges = _streets(plan, made, gates)
    _pave(draft, nodes, edges)
    net = build_network(*moved_streets(nodes, edges, plan.centre), origin=plan.origin)
    roads, junctions = read_roads(net.path)
    ways = translate(Pieces(roads=roads, junctions=junctions), (-plan.centre[0], -plan.centre[1]))
    if plan.bridge:
        coast.fit_ramp(draft, plan, ways.roads)
    _outskirts(draft, plan)
    return msgspec.structs.replace(draft.pieces(), roads=ways.roads, junctions=ways.junctions), net


def frame(plan: DistrictPlan, net: Network) -> City:
    """The city of a plan without its pieces."""
    reach = plan.half_m + plan.outskirts_m
    boxes = [Rect(-reach, -reach, reach, reach)]
    if plan.site:
        boxes.append(plan.site.inset(-40.0))
    if plan.bridge:
        boxes.append(bounds(plan.bridge).inset(-200.0))
    east, north = plan.centre
    return City(
        id=f"{plan.kind}-{plan.layout}",
        origin=plan.origin,
        bounds=(
            min(box.west for box in boxes) + east,
            min(box.south for box in boxes) + north,
            max(box.east for box in boxes) + east,
            max(box.north for box in boxes) + north,
        ),
        datum_m=plan.datum_m,
        attribution="procedural",
        network=net.path,
    )


# -- private


def _ground(draft: Draft, plan: DistrictPlan) -> None:
    if plan.shore:
        coast.seaside(draft, plan, stream(plan.layout, "coast"))
    else:
        reach = 2.0 * (plan.half_m + GROUND_M)
        draft.lands.append(Land(polygon=around(0.0, 0.0, reach, reach).polygon, top_m=0.0, surface="grass"))


def _site(draft: Draft, plan: DistrictPlan) -> sites.Gates:
    """Build the plan's site, if it has one, and return its gates."""
    if plan.site is None:
        return {}
    chance = stream(plan.layout, "site")
    if plan.pipeline and not plan.inside:
        sites.pipeline(draft, plan.site, plan.pipeline, chance)
        return {}
    gates = sites.gates(plan.site, every=plan.kind in ("industrial", "logistics"))
    build = sites.factory if plan.kind in ("industrial", "logistics") else sites.compound
    build(draft, plan.site, plan.height_m, chance, gates)
    return gates


def _keep_out(plan: DistrictPlan) -> list[Rect]:
    """The boxes that no block may cover: the site and the bridge's ramp."""
    boxes = [] if plan.site is None else [plan.site.inset(-APRON_M)]
    if plan.bridge:
        boxes.append(bounds((coast.bridge_foot(plan), plan.bridge[0])).inset(-coast.DECK_M / 2.0 - 1.0))
    return boxes


def _dry(plan: DistrictPlan, box: Rect) -> bool:
    """True if a block lies wholly on land."""
    if not plan.shore:
        return True
    land = left_of(plan.shore, plan.half_m + coast.SEA_M)
    corners = box.polygon
    return all(inside(land, x, y) and project(plan.shore, x, y).off_m > coast.STRAND_M for x, y in corners)


def _block(draft: Draft, plan: DistrictPlan, block: CityBlock, kind: str, tree_gap_m: float) -> None:
    chance = stream(plan.layout, f"block/{block.column}/{block.row}/{block.box.south:.0f}/{block.box.west:.0f}")
    inner = block_slab(draft, block.box, surface(kind), chance, tree_gap_m)
    first = "warehouse" if kind == "logistics" and hypot(block.box.west, block.box.south) < 25.0 else ""
    tall = heights(kind, plan.height_m) if plan.kind == "city" else plan.height_m
    if plan.homes and block.box.meets(bounds(plan.homes)):
        begun = len(draft.buildings)
        fill(draft, "residential", inner, tall, chance, "homes" if plan.detached else "slabs")
        draft.repaint(begun, chance.sample(HOMES, len(HOMES)))
    else:
        fill(draft, kind, inner, tall, chance, first)


def _streets(plan: DistrictPlan, made: StreetGrid, gates: sites.Gates) -> tuple[list[StreetNode], list[StreetEdge]]:
    blocked = None
    if plan.shore:
        land = left_of(plan.shore, plan.half_m + coast.SEA_M)

        def wet(start: tuple[float, float], end: tuple[float, float]) -> bool:
            ends = (start, end)
            dry = all(inside(land, *p) and project(plan.shore, *p).off_m > coast.STRAND_M for p in ends)
            return not dry or coast.under_ramp(plan, start, end)

        blocked = wet
    nodes, edges = network(made, plan.site, tuple(gates.values()), blocked)
    if plan.bridge:
        nodes, edges = _with_bridge(plan, nodes, edges)
    if not edges:
        raise UsageError(
            f"scene `{plan.kind}`: no street fits between its blocks and its site", hint="widen `extent` or add blocks"
        )
    return nodes, edges


def _pave(draft: Draft, nodes: list[StreetNode], edges: list[StreetEdge]) -> None:
    """Paint asphalt from kerb to kerb, under the lanes and into the chamfered corners of the blocks."""
    places = {node.id: (node.east, node.north) for node in nodes}
    widest: dict[str, float] = {}
    for edge in edges:
        if edge.bridge:
            continue
        half = edge.lanes * edge.width_m + GUTTER_M
        widest[edge.start] = max(widest.get(edge.start, 0.0), half)
        if edge.start < edge.end:
            draft.area(bounds((places[edge.start], places[edge.end])).inset(-half), "asphalt", 0.0)
    for name, half in widest.items():
        side = 2.0 * (half + CHAMFER_M)
        draft.area(around(*places[name], side, side), "asphalt", 0.0)


def _with_bridge(
    plan: DistrictPlan, nodes: list[StreetNode], edges: list[StreetEdge]
) -> tuple[list[StreetNode], list[StreetEdge]]:
    """The network with the bridge joined to the crossing nearest to its foot."""
    foot = coast.bridge_foot(plan)
    joint = min(nodes, key=lambda node: (hypot(node.east - foot[0], node.north - foot[1]), node.id))
    at_crossing = hypot(joint.east - foot[0], joint.north - foot[1]) < 1.0
    start = joint if at_crossing else StreetNode(id="bridge-foot", east=foot[0], north=foot[1])
    far, spans = coast.bridge_streets(plan, start.id)
    if at_crossing:
        return [*nodes, *far], [*edges, *spans]
    links = [
        StreetEdge(id=f"{a}_to_{b}", start=a, end=b, lanes=2, kind="secondary", priority=2, name="Bridge Road")
        for a, b in ((joint.id, start.id), (start.id, joint.id))
    ]
    return [*nodes, start, *far], [*edges, *links, *spans]


def _outskirts(draft: Draft, plan: DistrictPlan) -> None:
    """Plant trees around the square, so that it has no sharp edge."""
    if plan.shore:
        return
    from lingjing.scene.districts.furnish import tree

    chance = stream(plan.layout, "outskirts")
    outer = plan.half_m + plan.outskirts_m
    site = plan.site.inset(-20.0) if plan.site else None
    for _ in range(int(plan.extent_m / 3.0)):
        x, y = chance.uniform(-outer, outer), chance.uniform(-outer, outer)
        if max(abs(x), abs(y)) > plan.half_m + 6.0 and not (site and site.holds(x, y)):
            tree(draft, x, y, chance, 0.0)
