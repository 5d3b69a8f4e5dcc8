"""A city as meshes: closed walls, roads of the right width, and no more corners than the limit."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from lingjing.mission.instance import Entity
from lingjing.scene.city import Building, City, Prop
from lingjing.scene.plan import PlanShape
from lingjing.scene.surroundings import city_meshes, shapes_around, surroundings
from lingjing.testing import bare_instance, declared

OUTLINE = ((0.0, 0.0), (10.0, 0.0), (10.0, 20.0), (0.0, 20.0))
YARD = ((2.0, 2.0), (2.0, 6.0), (6.0, 6.0), (6.0, 2.0))


def area(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (points[triangles[:, n]] for n in range(3))
    return np.cross(b - a, c - a) / 2.0


def test_the_mesh_of_a_building_has_a_roof_without_the_yard_and_closed_walls() -> None:
    house = PlanShape("building", OUTLINE, (YARD,), top_m=12.0, base_m=2.0)
    roof, walls = city_meshes([house])
    up = area(roof.points, roof.triangles)
    assert up[:, 2].sum() == pytest.approx(200.0 - 16.0) and (roof.points[:, 2] == 12.0).all()
    faces = area(walls.points, walls.triangles)
    assert np.linalg.norm(faces, axis=1).sum() == pytest.approx((60.0 + 16.0) * 10.0)
    assert np.allclose(faces.sum(axis=0), 0.0)  # closed
    middle = walls.points[walls.triangles].mean(axis=1)
    outer = (middle[:, 0] < 0.1) | (middle[:, 0] > 9.9) | (middle[:, 1] < 0.1) | (middle[:, 1] > 19.9)
    away = ((middle - (5.0, 10.0, 7.0)) * faces).sum(axis=1)
    assert (away[outer] > 0).all()  # seen from outside they are anticlockwise
    assert walls.colour[0] < roof.colour[0]


def test_a_road_keeps_its_width_around_a_bend_and_on_a_ramp() -> None:
    road = PlanShape("road", ((0.0, 0.0), (100.0, 0.0), (100.0, 50.0)), width_m=6.0, heights_m=(0.0, 5.0, 5.0))
    (mesh,) = city_meshes([road])
    flat = mesh.points.copy()
    flat[:, 2] = 0.0
    assert area(flat, mesh.triangles)[:, 2].sum() == pytest.approx(150.0 * 6.0)
    corner = mesh.points[2:4, :2]
    assert {tuple(point) for point in corner.round(6)} == {(103.0, -3.0), (97.0, 3.0)}
    assert mesh.points[2, 2] - mesh.points[0, 2] == pytest.approx(5.0)


@pytest.mark.parametrize("points", [((0.0, 0.0), (0.0, 0.0)), ((0.0, 0.0), (5.0, 0.0), (0.0, 0.0)), ((1.0, 1.0),)])
def test_a_line_without_a_length_or_with_a_turn_back_gives_no_spike(points: tuple[tuple[float, float], ...]) -> None:
    for mesh in city_meshes([PlanShape("road", points, width_m=4.0, heights_m=(0.0,) * len(points))]):
        assert np.isfinite(mesh.points).all() and np.abs(mesh.points).max() <= 5.0 + 2 * math.sqrt(8.0)


def test_trees_are_left_out_first_if_a_city_exceeds_the_limit() -> None:
    trees = tuple(Prop(id=f"t{n}", cls="tree", model="tree", position=(float(n), 0.0, 0.0)) for n in range(50))
    house = Building(id="b", polygon=OUTLINE, base_m=0.0, top_m=9.0)
    city = City(id="c", origin=(0.0, 0.0), bounds=(-100.0, -100.0, 100.0, 100.0), buildings=(house,), props=trees)
    whole, none = shapes_around(city, (0.0, 0.0, 10.0, 10.0), 1000)
    assert len(whole) == 51 and none == []
    fewer, lacks = shapes_around(city, (0.0, 0.0, 10.0, 10.0), 20)
    assert [shape.layer for shape in fewer] == ["building"] and lacks == ["tree"]


def test_episodes_in_one_city_share_its_meshes() -> None:
    house = Building(id="b", polygon=OUTLINE, base_m=0.0, top_m=9.0)
    city = City(id="c", origin=(0.0, 0.0), bounds=(-900.0, -900.0, 900.0, 900.0), buildings=(house,))
    far = bare_instance((declared(Entity(id="a", group="a", index=1, role="asset", type="t", engine="x",
                                         position=(800.0, 800.0, 0.0))),))  # fmt: skip
    shown = surroundings(city, bare_instance(())).meshes
    assert len(shown) == 2 and surroundings(city, bare_instance(())).meshes is shown
    assert surroundings(city, far).meshes == ()  # another part of it
    buoy = Prop(id="p", cls="buoy", model="buoy_red", position=(5.0, 50.0, 0.0), floating=True)
    tree = msgspec.structs.replace(buoy, cls="tree", model="tree", floating=False)
    assert surroundings(msgspec.structs.replace(city, props=(buoy,)), bare_instance(())).meshes is shown
    for other in ({"props": (tree,)}, {"buildings": (house, house)}):
        assert surroundings(msgspec.structs.replace(city, **other), bare_instance(())).meshes is not shown
