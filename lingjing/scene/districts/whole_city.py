"""A whole city of wide blocks: boulevards every 500 m, all six districts, in a store of tiles in the cache folder.

Modelled on the new towns of the steppe: superblocks of 500 m between boulevards of three lanes each way, halved by
streets of one lane, everything else reached by ways inside the blocks. `blocks` of the mission counts halves.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from lingjing.scene.city import City
from lingjing.scene.districts.district import frame, lay_out
from lingjing.scene.districts.options import DistrictPlan
from lingjing.scene.districts.streets import CityBlock, grid
from lingjing.scene.districts.zones import zone
from lingjing.scene.store import cities_folder, code_sha256, whole, write_store

TREE_GAP_M = 30.0
"""Street trees stand wider apart than in a single district: there are a hundred times as many."""


def build_wide(plan: DistrictPlan) -> City:
    """The city of a plan, read from the cache where it is known."""
    key = hashlib.sha256((repr(plan) + code_sha256(Path(__file__).parent)).encode()).hexdigest()
    folder = cities_folder() / key[:40]
    known = whole(folder)
    if known is not None:
        return known

    def kind_of(block: CityBlock) -> str:
        return zone(*block.box.centre, plan.half_m)

    made = grid(plan.half_m, plan.spacing, lanes=(3, 1))
    pieces, net = lay_out(plan, made, kind_of, TREE_GAP_M)
    return write_store(folder, frame(plan, net), pieces)
