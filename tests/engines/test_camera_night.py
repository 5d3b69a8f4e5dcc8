"""Lights after dark, and queues of people that face free space."""

from __future__ import annotations

from math import cos, hypot, radians, sin

import msgspec
import numpy as np
import pytest

from lingjing.engines.camera.effects import effects_of, site_of
from lingjing.engines.camera.effects.night import darkness, road_light
from lingjing.engines.camera.effects.particles import BEAM, POOL
from lingjing.engines.camera.lamps import lamp_pools
from lingjing.engines.camera.models import entity_parts
from lingjing.engines.camera.moving_things import stage
from lingjing.mission.geometry2d import contains, edge_distance
from lingjing.mission.instance import Entity, Weather
from lingjing.scene.city import Building, Lane, Pieces, Prop, Road
from lingjing.testing import declared
from lingjing.trace.records import BodyState

DAY, SUNSET, NIGHT = (Weather(wind_mps=3.0, sun_elevation_deg=up) for up in (45.0, 4.0, -20.0))
SHINING = ("building_fire", "fire_source", "fire_truck", "lifeboat", "quadrotor")


def thing(kind: str, people: float = 4.0) -> Entity:
    return declared(
        Entity(
            id=kind,
            group=kind,
            index=1,
            role="target",
            type=kind,
            engine="city",
            position=(0.0, 0.0, 0.0),
            properties={"people": people},
        )
    )


def state(kind: str) -> BodyState:
    return BodyState(id=kind, position=(0.0, 0.0, 0.0), kind=kind)


@pytest.mark.parametrize("kind", SHINING)
def test_lights_are_drawn_only_after_dark(kind: str) -> None:
    day, sunset, night = (effects_of(thing(kind), state(kind), 20.0, weather) for weather in (DAY, SUNSET, NIGHT))
    assert darkness(DAY) == darkness(SUNSET) == 0.0 and darkness(NIGHT) == 1.0
    assert np.array_equal(day.billboards, sunset.billboards) and np.array_equal(day.decals, sunset.decals)
    assert len(night.billboards) > len(day.billboards)
    assert (night.billboards["id"] > 0).sum() == (day.billboards["id"] > 0).sum(), "light belongs to no body"
    assert not (day.decals["kind"] >= POOL).any()


def test_lamps_light_the_ground_below_them_after_dark() -> None:
    heads = np.array([[0.0, 0.0, 8.0], [40.0, 0.0, 3.4], [900.0, 0.0, 8.0]])
    assert not len(lamp_pools(heads, (0.0, 0.0, 1.6), darkness(DAY)))
    pools = lamp_pools(heads, (0.0, 0.0, 1.6), darkness(NIGHT))
    assert len(pools) == 2, "a lamp at 900 m lights nothing that shows"
    assert (pools["kind"] == POOL).all() and (pools["place"][:, 2] == 0.0).all()
    assert pools["half"][0, 0] > pools["half"][1, 0], "a higher lamp lights more ground"


def test_only_vehicles_have_headlights_and_these_light_the_road_ahead() -> None:
    bodies = [(BodyState(id="a", position=(10.0, 0.0, 0.0), heading_deg=90.0), "car"), (state("person"), "person")]
    rows = road_light(bodies, NIGHT)
    assert len(road_light(bodies, DAY)) == 0 and len(rows) == 2
    (beam,) = rows[rows["kind"] == BEAM]
    assert beam["place"][0] > 14.0 and beam["place"][1] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(("weather", "lit"), [(DAY, False), (NIGHT, True)])
def test_a_vehicles_camera_shows_its_headlights_but_not_its_body(weather: Weather, lit: bool) -> None:
    car = BodyState(id="a", position=(10.0, 0.0, 0.0), heading_deg=90.0)
    cast = stage((), (), {}, 0.0, weather, lambda x, y, z: 0.0, -9.0, (car, "car"))
    beams = cast.decals[cast.decals["kind"] == BEAM]
    assert len(beams) == lit and len(cast.batches) == len(cast.billboards) == 0
    walker = stage((), (), {}, 0.0, weather, lambda x, y, z: 0.0, -9.0, (car, "robot_dog"))
    assert len(walker.decals) == 0


def people_of(queue: Entity, near: list[Pieces]) -> list[tuple[float, float]]:
    site = site_of(queue, near, 0.0)
    parts = entity_parts(queue, state(queue.id), 0.0, facing_deg=site.heading_deg)
    return [(float(part.rows[0, 3]), float(part.rows[1, 3])) for part in parts if part.key.startswith("person")]


def test_a_queue_keeps_its_heading_where_it_has_room() -> None:
    queue = thing("queue_of_people", people=6.0)
    assert site_of(queue, [Pieces()], 0.0).heading_deg == 0.0
    assert [round(y, 1) for _, y in people_of(queue, [])] == [-0.8, -1.6, -2.4, -3.2, -4.0, -4.8]


def test_no_person_queues_in_a_wall_or_on_a_road() -> None:
    wall = Building(id="b", polygon=((-30.0, -20.0), (30.0, -20.0), (30.0, -4.0), (-30.0, -4.0)), base_m=0.0, top_m=9.0)
    lane = Lane(id="r_0", shape=((-6.0, -50.0, 0.0), (-6.0, 50.0, 0.0)), width_m=3.2)
    near = [Pieces(buildings=(wall,), roads=(Road(id="r", lanes=(lane,)),))]
    queue = thing("queue_of_people", people=12.0)
    places = people_of(queue, near)
    assert len(places) == 12
    for x, y in places:
        assert not contains(wall.polygon, x, y) and edge_distance(wall.polygon, x, y) > 0.4 and x > -4.4
    h = radians(site_of(queue, near, 0.0).heading_deg or 0.0)
    assert places[-1] == pytest.approx((-9.6 * sin(h), -9.6 * cos(h)), abs=0.2), "one straight line"


def test_no_person_queues_at_a_steam_vent() -> None:
    vent = Prop(id="v", cls="steam_vent", model="steam_vent", position=(0.9, -4.6, 0.1))
    places = people_of(thing("queue_of_people", people=5.0), [Pieces(props=(vent,))])
    assert len(places) == 5
    assert all(hypot(x - 0.9, y + 4.6) > 1.8 for x, y in places)


def test_the_scorch_of_a_fire_lies_on_its_roof() -> None:
    roof = Building(id="b", polygon=((0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (0.0, 30.0)), base_m=0.0, top_m=12.0)
    fire = thing("building_fire")
    for place, moved in (
        ((3.0, 15.0, 12.0), (1.8, 0.0)),
        ((38.0, 28.0, 12.0), (-2.8, -2.8)),
        ((20.0, 15.0, 12.0), (0, 0)),
    ):
        there = msgspec.structs.replace(fire, position=place)
        site = site_of(there, [Pieces(buildings=(roof,))], 12.0)
        assert site.inward == pytest.approx(moved)
        effects = effects_of(there, BodyState(id="f", position=place), 20.0, DAY, site)
        assert effects.decals["place"][0] == pytest.approx((place[0] + moved[0], place[1] + moved[1], 12.0))
    assert site_of(fire, [Pieces(buildings=(roof,))], 0.0).inward == (0.0, 0.0), "on the ground"
