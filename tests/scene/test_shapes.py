"""Collision shapes: convex parts of footprints, and the shapes of a city's pieces."""

import math

import pytest

from lingjing.engines.quadruped.city_shapes import LOAD_M, NEED_M, CityShapes
from lingjing.engines.quadruped.moving_boxes import POOL, MirroredBodies
from lingjing.scene.city import Bridge, Building, City, Land, Pipe, Prop, Slope, Solid, Tile
from lingjing.scene.shapes import Capsule, Hull, OrientedBox, convex_parts, shapes_of, solid_shapes
from lingjing.scene.sizes import SIZES
from lingjing.trace.records import BodyState

ELL = ((0.0, 0.0), (6.0, 0.0), (6.0, 2.0), (2.0, 2.0), (2.0, 5.0), (0.0, 5.0))
STAR = tuple(
    ((4.0 if k % 2 else 1.5) * math.cos(math.pi * k / 5), (4.0 if k % 2 else 1.5) * math.sin(math.pi * k / 5))
    for k in range(10)
)
COURT = (((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)), (((3.0, 3.0), (3.0, 6.0), (6.0, 6.0), (6.0, 3.0)),))


def area(polygon) -> float:
    return 0.5 * sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True))


@pytest.mark.parametrize(
    ("outline", "holes", "most", "wanted"),
    [
        (ELL, (), 2, 18.0),
        (tuple(reversed(ELL)), (), 2, 18.0),
        (STAR, (), 8, area(STAR)),
        (*COURT, 8, 72.0),
        (((0.0, 0.0), (5.0, 0.0), (5.0, 0.0), (10.0, 0.0), (10.0, 3.0), (0.0, 3.0)), (), 1, 30.0),
        (((0.0, 0.0), (5.0, 0.0), (10.0, 0.0)), (), 0, 0.0),
    ],
    ids=["ell", "clockwise", "star", "courtyard", "straights", "flat"],
)
def test_parts_are_convex_and_cover_the_polygon(outline, holes, most, wanted):
    parts = convex_parts(outline, holes)
    assert len(parts) <= most
    assert sum(area(part) for part in parts) == pytest.approx(wanted, abs=1e-9)
    for part in parts:
        corners = [(part[k - 2], part[k - 1], part[k]) for k in range(len(part))]
        turns = [(b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) for a, b, c in corners]
        assert min(turns) > -1e-9


def test_rectangles_become_boxes_at_any_angle():
    turned = tuple((x * 0.6 - y * 0.8, x * 0.8 + y * 0.6) for x, y in ((0, 0), (4, 0), (4, 2), (0, 2)))
    (box,) = solid_shapes(Solid(id="hut", polygon=turned, base_m=1.0, top_m=4.0))
    assert isinstance(box, OrientedBox)
    assert box.half == pytest.approx((2.0, 1.0, 1.5))
    assert box.centre == pytest.approx((0.4, 2.2, 2.5))
    assert math.tan(box.yaw) == pytest.approx(4.0 / 3.0)


def test_every_kind_of_piece_has_a_shape():
    tile = Tile(
        key=(0, 0),
        solids=(Solid(id="wall", polygon=ELL, base_m=0.0, top_m=2.0),),
        buildings=(Building(id="house", polygon=COURT[0], holes=COURT[1], base_m=0.0, top_m=9.0),),
        slopes=(Slope(id="ramp", top=((0.0, 0.0, 0.0), (4.0, 0.0, 1.0), (4.0, 2.0, 1.0), (0.0, 2.0, 0.0))),),
        bridges=(Bridge(id="span", path=((0.0, 0.0, 6.0), (50.0, 0.0, 6.0), (90.0, 30.0, 8.0)), width_m=8.0),),
        pipes=(Pipe(id="pipe", path=((0.0, 0.0, 1.0), (5.0, 0.0, 1.0), (5.0, 5.0, 1.0))),),
        props=(
            Prop(id="oak", cls="tree", model="tree", position=(1.0, 1.0, 0.0), scale=2.0),
            Prop(id="lorry", cls="parked_truck", model="parked_truck", position=(5.0, 5.0, 0.0), heading_deg=90.0),
            Prop(id="buoy", cls="buoy", model="buoy", position=(0.0, 0.0, 0.0), floating=True),
            Prop(id="paint", cls="paint", model="paint", position=(0.0, 0.0, 0.0)),
        ),
    )
    shapes = list(shapes_of(tile))
    assert {shape.thing for shape in shapes} == {"wall", "house", "ramp", "span", "pipe", "oak", "lorry"}
    decks = [shape for shape in shapes if shape.thing == "span" and isinstance(shape, Hull)]
    assert len(decks) == 2
    assert set(decks[0].corners[2:4]) == set(decks[1].corners[0:2])
    assert [shape for shape in shapes if shape.thing == "span" and isinstance(shape, OrientedBox)]
    (oak,) = (shape for shape in shapes if shape.thing == "oak")
    assert isinstance(oak, Capsule)
    assert oak.radius_m == pytest.approx(0.36)
    (lorry,) = (shape for shape in shapes if shape.thing == "lorry")
    assert lorry.half == pytest.approx((SIZES["truck"].length_m / 2, SIZES["truck"].width_m / 2, 1.8))
    assert lorry.yaw == pytest.approx(0.0)


def city(**pieces) -> City:
    return City(id="c", origin=(31.0, 121.5), bounds=(-1e3, -1e3, 1e3, 1e3), **pieces)


def test_surroundings_hold_each_near_shape_once_and_request_more_near_the_edge():
    posts = tuple(
        Solid(id=f"p{k}", polygon=((x, 0.0), (x + 40.0, 0.0), (x + 40.0, 1.0), (x, 1.0)), base_m=0.0, top_m=1.0)
        for k, x in enumerate(range(-500, 500, 50))
    )
    around = CityShapes(city(solids=posts))
    assert not around.suffices([(0.0, 0.0)])
    held = [shape.thing for shape in around.load([(0.0, 0.0, 0.3), (5.0, 3.0, 0.3)])]
    assert len(held) == len(set(held))
    near = {post.id for post in posts if post.polygon[0][0] < LOAD_M and post.polygon[1][0] > -LOAD_M}
    assert near <= set(held)
    assert len(held) < len(posts)
    assert around.suffices([(0.0, 0.0), (LOAD_M - NEED_M, 0.0)])
    assert not around.suffices([(LOAD_M + 40.0, 0.0)])
    assert CityShapes(city(solids=posts)).load([(0.0, 0.0, 0.3), (5.0, 3.0, 0.3)]) == around.load(
        [(0.0, 0.0, 0.3), (5.0, 3.0, 0.3)]
    )


def test_raised_land_and_tall_solids_are_cut_to_the_neighbourhood():
    tower = Solid(id="tower", polygon=ELL, base_m=-50.0, top_m=600.0)
    big = Land(polygon=((-5e3, -5e3), (5e3, -5e3), (5e3, 5e3), (-5e3, 5e3)), top_m=2.0)
    flat = Land(polygon=((-5e3, -5e3), (5e3, -5e3), (5e3, 5e3), (-5e3, 5e3)), top_m=0.0)
    shapes = CityShapes(city(solids=(tower,), lands=(big, flat))).load([(0.0, 0.0, 2.3)])
    ground = [shape for shape in shapes if shape.thing == "land-0"]
    assert all(
        isinstance(shape, OrientedBox) and shape.centre[2] + shape.half[2] == pytest.approx(2.0) for shape in ground
    )
    assert sum(4.0 * shape.half[0] * shape.half[1] for shape in ground) == pytest.approx(len(ground) * 32.0**2)
    levels = [corner[2] for shape in shapes if shape.thing == "tower" for corner in getattr(shape, "corners", ())]
    levels += [
        shape.centre[2] + sign * shape.half[2]
        for shape in shapes
        if shape.thing == "tower" and isinstance(shape, OrientedBox)
        for sign in (1, -1)
    ]
    assert (min(levels), max(levels)) == pytest.approx((-22.7, 27.3))
    assert "land-1" not in {shape.thing for shape in shapes}


def test_the_nearest_solid_mirrors_are_boxes(instance_of, uav, victim):
    lookout = MirroredBodies(instance_of([uav(1), victim(1)]), ("dog",))
    mirrors = [
        BodyState(id="uav[1]", position=(3.0, 0.0, 5.0), status="hovering"),
        BodyState(id="victim[1]", position=(9.0, 0.0, 0.0), status="rescued"),
        BodyState(id="traffic/9", kind="car", position=(500.0, 0.0, 0.0), velocity=(20.0, 0.0, 0.0)),
        BodyState(id="smoke/1", kind="smoke", position=(1.0, 0.0, 0.0)),
        *(BodyState(id=f"crowd/{k}", kind="person", position=(4.0 + k, 0.0, 0.0)) for k in range(30)),
    ]
    movers = lookout.nearest(mirrors, [(0.0, 0.0, 0.3)])
    assert len(movers) == POOL
    assert {mover.thing for mover in movers} == {"uav[1]", *(f"crowd/{k}" for k in range(POOL - 1))}
    hovering = next(mover for mover in movers if mover.thing == "uav[1]")
    assert hovering.base[2] == pytest.approx(5.0 - 0.35 / 2)
    assert lookout.nearest(mirrors, []) == ()
