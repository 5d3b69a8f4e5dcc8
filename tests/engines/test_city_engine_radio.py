"""Radio links: range, knife edges and weather; the city engine reports missing links at decision boundaries."""

import msgspec
import pytest
from pytest import approx

from lingjing.engines.city.engine import CityEngine
from lingjing.engines.city.radio import Coverage, around_m, clearness, edge_loss_db
from lingjing.mission.instance import AgentSpec, CommsSpec, Entity, EventSpec, Weather
from lingjing.scene.city import Bridge, Building, City
from lingjing.scene.terrain import Terrain
from lingjing.testing import declared
from lingjing.trace.records import BodyState

DRY = City(id="dry", origin=(31.0, 121.5), bounds=(-2000.0, -2000.0, 2000.0, 2000.0))
CLEAR = Weather(visibility_m=10_000.0)


def block(top, x=200.0, half=10.0, base=0.0):
    corners = ((x - half, -50.0), (x + half, -50.0), (x + half, 50.0), (x - half, 50.0))
    return Building(id="tower", polygon=corners, base_m=base, top_m=top)


def dog(number, x, z=0.0):
    return declared(
        Entity(
            id=f"dog[{number}]",
            group="dog",
            index=number,
            role="asset",
            type="robot_dog",
            engine="quadruped",
            position=(x, 0.0, z),
        )
    )


def commanded(instance_of, entities, range_m=400.0, weather=CLEAR, **changes):
    agents = tuple(
        AgentSpec(id=f"a-{e.id}", name="a", index=0, role="r", controls=(e.id,), commands=(e.id,), observes=())
        for e in entities
    )
    comms = CommsSpec(mode="broadcast", hub=None, range_m=range_m)
    return msgspec.structs.replace(instance_of(entities, weather), agents=agents, comms=comms, **changes)


@pytest.fixture
def silent(instance_of):
    """Return whether two dogs at the ends of a way have no radio link."""

    def measure(metres, city=DRY, weather=CLEAR, z=0.0, range_m=400.0):
        entities = [dog(1, 0.0, z), dog(2, metres, z)]
        coverage = Coverage(commanded(instance_of, entities, range_m), Terrain(city))
        return bool(coverage.unlinked({e.id: e.position for e in entities}, weather))

    return measure


@pytest.mark.parametrize(("metres", "out"), [(399.9, False), (400.0, False), (400.1, True)])
def test_the_range_is_inclusive(silent, metres, out):
    assert silent(metres) == out


def test_without_a_range_all_assets_are_linked(silent):
    assert not silent(1e6, range_m=None)


def test_a_tower_between_two_dogs_shortens_the_range(silent):
    """An edge 60 m above the line, 200 m from both ends: the parameter is 24, the loss 13 + 20 log 24 = 40.6 dB."""
    assert edge_loss_db(60.0, 200.0, 200.0) == approx(40.6, abs=0.2)
    assert silent(399.0, msgspec.structs.replace(DRY, buildings=(block(60.0),)))
    assert not silent(399.0, msgspec.structs.replace(DRY, buildings=(block(60.0, base=20.0),)))  # it stands on stilts
    assert not silent(399.0, msgspec.structs.replace(DRY, buildings=(block(60.0, x=-200.0),)))  # it stands behind


def test_an_asset_above_the_roofs_is_linked(silent):
    city = msgspec.structs.replace(DRY, buildings=(block(60.0),))
    assert silent(399.0, city, z=50.0)
    assert not silent(399.0, city, z=70.0)


def test_an_edge_close_to_the_line_of_sight_reduces_the_range(silent):
    """A grazing edge costs 6 dB, which halves the range."""
    assert edge_loss_db(0.0, 100.0, 100.0) == approx(6.0, abs=0.1)
    city = msgspec.structs.replace(DRY, buildings=(block(0.9, x=150.0),))  # as high as a dog's antenna
    assert silent(300.0, city)
    assert not silent(190.0, msgspec.structs.replace(DRY, buildings=(block(0.9, x=95.0),)))


def test_an_edge_far_below_the_line_of_sight_causes_no_loss():
    assert edge_loss_db(-20.0, 100.0, 100.0) == 0.0
    losses = [edge_loss_db(over, 100.0, 300.0) for over in (-5.0, 0.0, 5.0, 20.0, 80.0)]
    assert losses == sorted(losses)


def test_a_bridge_overhead_is_no_obstacle(silent):
    deck = Bridge(id="deck", path=((200.0, -50.0, 12.0), (200.0, 50.0, 12.0)), width_m=20.0, pier_spacing_m=0.0)
    assert not silent(399.0, msgspec.structs.replace(DRY, bridges=(deck,)))


def test_fog_shortens_the_range(silent):
    fog = Weather(visibility_m=400.0)
    assert clearness(CLEAR) == 1.0
    assert clearness(fog) == approx(0.693, abs=0.001)
    assert (silent(270.0, weather=fog), silent(290.0, weather=fog), silent(290.0)) == (False, True, False)


def test_missing_links_are_reported_at_every_boundary_and_updated_each_tick(player, instance_of):
    """A pair is in the instance's order; between two ticks the last answer holds."""
    instance = commanded(instance_of, [dog(1, 0.0), dog(2, 500.0), dog(3, 50.0)])
    played = player(CityEngine(), instance, DRY, "city")
    pairs = (("dog[1]", "dog[2]"), ("dog[2]", "dog[3]"))
    assert played.boundary.unreachable_links == pairs
    near = [BodyState(id=f"dog[{n}]", position=(x, 0.0, 0.0)) for n, x in ((1, 0.0), (2, 300.0), (3, 50.0))]
    assert played.run(9.5, near).unreachable_links == pairs
    assert played.step(near).unreachable_links == ()


def test_a_change_to_fog_cuts_the_radio_link(player, instance_of):
    fog = EventSpec(name="fog", tick=1, weather=Weather(visibility_m=100.0))
    instance = commanded(instance_of, [dog(1, 0.0), dog(2, 350.0)], events=(fog,))
    played = player(CityEngine(), instance, DRY, "city")
    here = [BodyState(id=e.id, position=e.position) for e in instance.entities]
    assert played.run(9.5, here).unreachable_links == ()
    assert played.step(here).unreachable_links == (("dog[1]", "dog[2]"),)


def test_a_way_around_a_corner_costs_less_than_one_over_the_roof(silent):
    """An edge that just touches a high tower costs the loss at its near side."""
    outline = ((190.0, -1.0), (210.0, -1.0), (210.0, 300.0), (190.0, 300.0))
    assert around_m(outline, (0.0, 0.0, 0.0), (400.0, 0.0, 0.0)) == approx(1.0)
    clipped = Building(id="clipped", polygon=outline, base_m=0.0, top_m=200.0)
    wide = Building(id="wide", polygon=tuple((x, -300.0 if y < 0 else y) for x, y in outline), base_m=0.0, top_m=200.0)
    assert not silent(400.0, msgspec.structs.replace(DRY, buildings=(clipped,)), range_m=1300.0)
    assert silent(400.0, msgspec.structs.replace(DRY, buildings=(wide,)), range_m=1300.0)
