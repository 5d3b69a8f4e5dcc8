"""The schedule of a mission: the weather and the present entities at a time, and the engines that they need."""

import msgspec
import pytest

from lingjing.kernel.world.selection import select_engines
from lingjing.mission.instance import CommsSpec, EventSpec, SceneSpec, Weather
from lingjing.mission.schedule import Schedule
from lingjing.testing import PluginHost

FOG, STORM = Weather(visibility_m=100.0), Weather(wind_mps=14.0)


@pytest.fixture
def schedule(instance_of, victim):
    """Ticks of 10 s. Declared out of order: a storm at 3, fog at 1. `victim[2]` appears at 2 and vanishes at 4."""
    late = msgspec.structs.replace(victim(2), dormant=True)
    events = (
        EventSpec(name="storm", tick=3, weather=STORM, vanish=("victim[1]",)),
        EventSpec(name="fog", tick=1, weather=FOG),
        EventSpec(name="come", tick=2, appear=("victim[2]",)),
        EventSpec(name="go", tick=4, vanish=("victim[2]",)),
    )
    return Schedule(msgspec.structs.replace(instance_of([victim(1), late]), events=events))


@pytest.mark.parametrize(
    ("time_s", "weather"),
    [(0.0, Weather()), (9.99, Weather()), (10.0, FOG), (29.9, FOG), (30.0, STORM), (900.0, STORM)],
)
def test_the_weather_holds_from_its_boundary_on(schedule, time_s, weather):
    assert schedule.weather(time_s) == weather


@pytest.mark.parametrize(
    ("time_s", "first", "second"), [(0.0, 1, 0), (19.9, 1, 0), (20.0, 1, 1), (30.0, 0, 1), (40.0, 0, 0)]
)
def test_an_entity_is_present_from_its_appearance_until_it_vanishes(schedule, time_s, first, second):
    assert [schedule.present(f"victim[{n}]", time_s) for n in (1, 2)] == [bool(first), bool(second)]


def test_a_time_that_rounding_made_slightly_too_early_counts_as_the_boundary(schedule):
    assert schedule.weather(0.1 * 300 - 1e-9) == STORM


def test_traffic_and_radio_range_select_engines_without_an_entity(instance_of, boat):
    host = PluginHost()
    bare = instance_of([boat()])
    busy = SceneSpec(kind="bay", options={"traffic": 40.0})
    limited = CommsSpec(mode="broadcast", hub=None, range_m=500.0)
    assert select_engines(bare, host).local == ("vessel",)
    assert select_engines(msgspec.structs.replace(bare, scene=busy), host).local == ("road", "vessel")
    assert select_engines(msgspec.structs.replace(bare, comms=limited), host).local == ("city", "vessel")
    quiet = SceneSpec(kind="bay", options={"traffic": 0.0})
    assert select_engines(msgspec.structs.replace(bare, scene=quiet), host).local == ("vessel",)
