"""Procedural districts: cities without a map, equal for equal seed and options.

A *district* is a square of streets and blocks with one character (residential, industrial, …). A *block* is the ground
between kerbs; its *filling* (slab houses, a park, …) stands on *lots*. A *site* is an area without public streets: a
walled compound, a factory, a pipeline yard.

The modules in control-flow order:

- `options`: options of the mission → `DistrictPlan`.
- `district`: plan → city; `whole_city`: all districts as one city of large blocks in a store of tiles.
- `streets`: the plan's grid → nodes and edges of the road network, and the blocks between the kerbs.
- `zones` chooses the filling of a block; `dwellings`, `offices` and `industry` build it; `furnish` adds equipment.
- `sites`: compounds, factories, pipelines. `coast`: sea, harbour, bridge.
- `rectangles`, `palette`, `draft`: rectangles, colours, and the pieces under construction.

Invariants: the ground is flat at elevation 0. Every block is a `Solid` slab of height `draft.KERB_M` that carries its
sidewalk, lots and buildings, with dropped kerbs (`Slope`) at its corners. Streets lie at 0 between the slabs, sites at
0 behind their walls. Streets run through the origin along multiples of the spacing. The spec is the only input.
"""

from __future__ import annotations

from lingjing.mission.instance import SceneSpec
from lingjing.scene.city import City


def build(spec: SceneSpec) -> City:
    """The city of a spec of any of these kinds. Raises `UsageError` for options without a meaning."""
    from lingjing.scene.districts.district import cached_district
    from lingjing.scene.districts.options import plan
    from lingjing.scene.districts.whole_city import build_wide

    made = plan(spec)
    return build_wide(made) if spec.kind == "city" else cached_district(made)


__all__ = ["build"]
