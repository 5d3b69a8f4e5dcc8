"""Clearance maps for legged robots."""

from __future__ import annotations

import pytest

from lingjing.scene.city import Building, City, Pipe, Prop, Solid, Water
from lingjing.scene.obstacles import obstacle_map

SQUARE = ((10.0, 10.0), (20.0, 10.0), (20.0, 20.0), (10.0, 20.0))


def clearance(x: float, y: float, **pieces: object) -> float:
    city = City(id="t", origin=(31.0, 121.0), bounds=(-100.0, -100.0, 100.0, 100.0), **pieces)
    clearance_map = obstacle_map(city, (-30.0, -30.0, 30.0, 30.0), cell_m=0.5, far_m=1.5)
    return float(clearance_map.clearance_m[clearance_map.cell(x, y)])


@pytest.mark.parametrize("x, expected", [(15.0, 0.0), (9.25, 0.75), (8.25, 1.5), (0.0, 1.5)])
def test_a_cell_has_the_distance_to_the_nearest_wall(x, expected):
    house = Building(id="house", polygon=SQUARE, base_m=0.0, top_m=9.0)
    assert clearance(x, 15.25, buildings=(house,)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("base, top, free", [(0.0, 0.15, True), (0.0, 0.3, False), (0.7, 1.0, False), (0.9, 3.0, True)])
def test_kerbs_and_high_objects_are_no_obstacles(base, top, free):
    slab = Solid(id="slab", polygon=SQUARE, base_m=base, top_m=top)
    assert (clearance(15.0, 15.0, solids=(slab,)) > 0.0) is free


def test_pipes_trees_and_water_are_obstacles():
    pipe = Pipe(id="pipe", path=((-20.0, 0.0, 0.5), (20.0, 0.0, 0.5)), radius_m=0.4)
    tree = Prop(id="tree", cls="tree", model="tree", position=(-10.0, -10.0, 0.0))
    pond = Water(polygon=((-30.0, 20.0), (0.0, 20.0), (0.0, 30.0), (-30.0, 30.0)), level_m=0.0)
    assert clearance(5.0, 0.25, pipes=(pipe,)) == 0.0
    assert clearance(-10.0, -10.0, props=(tree,)) < 0.3
    assert clearance(-10.0, 25.0, waters=(pond,)) == 0.0
    assert clearance(10.0, 25.0, waters=(pond,)) == 1.5
