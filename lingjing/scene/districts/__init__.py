"""Procedural districts: cities without a map, the same for the same seed and options.

- `options`: what the mission says → `DistrictPlan`.
- `streets`: the plan's grid → nodes and edges of the road net, blocks between the kerbs.
- `zones` chooses what fills a block; `dwellings`, `offices` and `industry` fill it,
  `furnish` puts up what stands there.
- `sites`: compounds, factories, pipelines; `coast`: sea, harbour, bridge.
- `rectangles`, `palette`, `draft`: rectangles, colours, and the pieces under way.
- `district` puts one together, `whole_city` all of them as a city of wide blocks in a store of tiles.

Invariants: the ground is flat at elevation 0. Every block is a `Solid` slab `draft.KERB_M` high, with its sidewalk,
lots and buildings on it, and dropped kerbs (`Slope`) at its corners; streets lie at 0 between the slabs, sites
at 0 behind their walls. Streets run through the origin along multiples of the spacing. Nothing is read but the spec.
"""

from __future__ import annotations

from lingjing.mission.instance import SceneSpec
from lingjing.scene.city import City


def build(spec: SceneSpec) -> City:
    """The city of a spec of any of these kinds. Raises `UsageError` for options that make no sense."""
    from lingjing.scene.districts.district import built_district
    from lingjing.scene.districts.options import plan
    from lingjing.scene.districts.whole_city import build_wide

    made = plan(spec)
    return build_wide(made) if spec.kind == "city" else built_district(made)


__all__ = ["build"]
