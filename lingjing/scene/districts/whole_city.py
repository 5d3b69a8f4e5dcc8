"""A whole city: boulevards every 500 m, all six kinds of district, in a store of tiles in the cache folder.

The layout follows the new towns of the steppe: superblocks of 500 m between boulevards of three lanes each way, halved
by streets of one lane; ways inside the blocks lead to all other places. The mission's option `blocks` counts halves.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from lingjing.scene.city import City
from lingjing.scene.districts.district import frame, lay_out
from lingjing.scene.districts.options import DistrictPlan
from lingjing.scene.districts.streets import CityBlock, grid
from lingjing.scene.districts.zones import zone
from lingjing.scene.store import cities_folder, code_sha256, intact_city, write_store

TREE_GAP_M = 30.0
"""Distance between street trees, metres (chosen): wider than in a single district, because a city has a hundred times
as many."""


def build_wide(plan: DistrictPlan) -> City:
    """Return the city of a plan, from the cache if it is there."""
    key = hashlib.sha256((repr(plan) + code_sha256(Path(__file__).parent)).encode()).hexdigest()
    folder = cities_folder() / key[:40]
    known = intact_city(folder)
    if known is not None:
        return known

    def kind_of(block: CityBlock) -> str:
        return zone(*block.box.centre, plan.half_m)

    made = grid(plan.half_m, plan.spacing, lanes=(3, 1))
    pieces, net = lay_out(plan, made, kind_of, TREE_GAP_M)
    return write_store(folder, frame(plan, net), pieces)
