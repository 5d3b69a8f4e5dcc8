"""Doors, signs and balconies on facades."""

import numpy as np
import pytest

from lingjing.engines.camera.facade_meshes import MOST_BALCONIES, balconies, entrance
from lingjing.scene.city import Building

SQUARE = ((0.0, 0.0), (40.0, 0.0), (40.0, 15.0), (0.0, 15.0))
USES = ("residential", "commercial", "office", "industrial", "warehouse", "school", "public", "house")


def building(use: str, levels: int = 5, seed: int = 1) -> Building:
    return Building(id="b", polygon=SQUARE, base_m=0.0, top_m=3.0 * levels, levels=levels, use=use, seed=seed,
                    colour=(0.4, 0.4, 0.4), roof_colour=(0.3, 0.3, 0.3), entrance=(20.0, 0.0, 180.0))  # fmt: skip


@pytest.mark.parametrize("use", USES)
def test_a_door_stands_in_front_of_its_wall(use: str) -> None:
    place = entrance(building(use), 9).vertices["position"]
    assert len(place) and place[:, 1].max() <= 1e-4 and place[:, 1].min() >= -1.6, "in front of the southern wall"
    assert place[:, 2].min() >= -1e-4 and 2.0 < place[:, 2].max() < 4.1
    assert abs(place[:, 0].mean() - 20.0) < 0.4


def test_only_a_shop_has_an_awning_and_only_offices_and_shops_a_sign() -> None:
    tops = {use: float(entrance(building(use), 9).vertices["position"][:, 2].max()) for use in USES}
    assert {use for use, top in tops.items() if top > 3.9} == {"commercial", "office"}
    counts = {use: len(entrance(building(use), 9).index) for use in ("commercial", "office")}
    assert counts["commercial"] > counts["office"]


def test_only_blocks_of_flats_have_balconies() -> None:
    made = balconies(building("residential"), 15.0, 3.0, 9)
    assert 0 < len(made) <= 2 * MOST_BALCONIES + 1
    place = np.concatenate([part.vertices["position"] for part in made])
    out = np.maximum(np.maximum(-place[:, 1], place[:, 1] - 15.0), np.maximum(-place[:, 0], place[:, 0] - 40.0))
    assert (out >= -1e-4).all() and out.max() < 1.2, "outside of the walls"
    assert place[:, 2].min() > 2.5, "none on the ground floor"
    for other in (building("office"), building("residential", 1), building("residential", 30), building("house")):
        assert balconies(other, other.top_m, 3.0, 9) == []
