"""Timed events are recorded, logged and shown to agents, except for hidden parts."""

import msgspec
import pytest

from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.episode import play
from lingjing.mission.instance import ChannelSpec, EventSpec, Weather
from lingjing.testing import compile_text
from lingjing.testing import rescue as kit
from lingjing.testing.expressions import Call, Ref, Symbol
from lingjing.testing.traces import from_json, to_json
from lingjing.trace.foxglove import logs
from lingjing.trace.records import BoundaryRecord, ObservationRecord, TaskEvent

CALM = Weather(wind_mps=4.0)
STORM = Weather(wind_mps=14.0, visibility_m=800.0, rain=0.5)
FRONT = EventSpec(name="front", tick=2, weather=STORM)


def instance(*events, public=(), dormant=(), **changes):
    """All agents observe events; entities in `public` hide nothing."""
    made = kit.instance(weather=CALM, events=events, **changes)
    entities = tuple(
        msgspec.structs.replace(
            entity, hidden=() if entity.id in public else entity.hidden, dormant=entity.id in dormant
        )
        for entity in made.entities
    )
    return msgspec.structs.replace(made, entities=entities)


def played(ticks, *events, **changes):
    kernel = kit.kernel(instance(*events, **changes))
    return [kernel.reset(), *(kernel.step(()) for _ in range(ticks))]


def kinds(published, agent="skipper"):
    return [[(event.kind, event.entities) for event in output.observations[agent].events] for output in published]


def test_observations_and_records_hold_the_weather_of_their_boundary():
    published = played(3, FRONT)
    for agent in ("scout[1]", "skipper"):
        assert [output.observations[agent].weather for output in published] == [CALM, CALM, STORM, STORM]
    for output in published:
        assert {seen.weather for seen in output.record.observations} == {output.observations["skipper"].weather}


def test_a_change_of_the_weather_is_a_task_event_of_its_boundary_and_a_line_of_the_log():
    published = played(3, FRONT)
    changed = {"wind_mps": 14.0, "visibility_m": 800.0, "rain": 0.5}
    event = TaskEvent(kind="weather", name="front", entities=(), time_s=20.0, values=changed)
    assert [output.record.task_events for output in published] == [(), (), (event,), ()]
    assert kinds(published) == [[], [], [("weather", ())], []]
    lines = [data for _, _, data in logs(published[2].record)]
    assert any(b"weather front: rain 0.5, visibility_m 800, wind_mps 14 at 20 s" in data for data in lines)


def test_an_event_at_boundary_zero_is_in_the_brief_and_in_the_first_observation():
    now = msgspec.structs.replace(FRONT, tick=0)
    kernel = kit.kernel(instance(now))
    assert kernel.briefs()["skipper"].weather == STORM
    start = kernel.reset()
    assert [event.name for event in start.record.task_events] == ["front"]
    assert start.observations["skipper"].weather == STORM


def test_each_event_of_a_tick_records_only_its_own_changes():
    first = EventSpec(name="rain", tick=1, weather=Weather(wind_mps=4.0, rain=1.0))
    second = EventSpec(name="gale", tick=1, weather=Weather(wind_mps=20.0, rain=1.0))
    same = EventSpec(name="again", tick=1, weather=Weather(wind_mps=20.0, rain=1.0))
    published = played(1, first, second, same)
    assert [event.line for event in published[1].record.task_events] == [
        "weather rain: rain 1", "weather gale: wind_mps 20", "weather again: nothing changes",
    ]  # fmt: skip


def test_appearing_and_vanishing_entities_are_recorded_once():
    come = EventSpec(name="late", tick=1, appear=("victim[2]",))
    again = EventSpec(name="twice", tick=2, appear=("victim[1]", "victim[2]"))
    go = EventSpec(name="gone", tick=3, vanish=("victim[2]",))
    empty = EventSpec(name="nobody", tick=3)
    published = played(3, come, again, go, empty, public=("victim[1]", "victim[2]"), dormant=("victim[2]",))
    lines = [[event.line for event in output.record.task_events] for output in published]
    assert lines == [[], ["appeared late: victim[2]"], [], ["vanished gone: victim[2]"]]
    assert kinds(published) == [[], [("appeared", ("victim[2]",))], [], [("vanished", ("victim[2]",))]]


def test_hidden_entities_appear_and_vanish_in_the_trace_only():
    """Two missions that differ only in the time at which a hidden entity appears give all agents the same input."""
    both = [
        played(
            4,
            EventSpec(name="late", tick=tick, appear=("victim[2]",)),
            EventSpec(name="all", tick=4, vanish=("victim[1]", "boat")),
            dormant=("victim[2]",),
        )
        for tick in (1, 3)
    ]
    for outputs in both:
        assert [event.line for each in outputs for event in each.record.task_events] == [
            "appeared late: victim[2]", "vanished all: victim[1] boat",
        ]  # fmt: skip
        assert kinds(outputs)[4] == [("vanished", ("boat",))]
    early, late = ([seen.sha256 for each in outputs for seen in each.record.observations] for outputs in both)
    assert early == late


def test_rules_do_not_treat_timed_events_as_interactions():
    """An event and an interaction may have one name: an entity that has only appeared is not rescued."""
    come = EventSpec(name="rescue", tick=1, appear=("victim[2]",), weather=STORM)
    for kind, who in (("appeared", "victim[2]"), ("weather", "victim[2]")):
        done = Call(function="emitted", arguments=(Symbol(name=kind), Ref(name=who, kind="entity")))
        kernel = kit.kernel(instance(come, success=done, dormant=("victim[2]",), ticks=3))
        assert play(kernel, PolicyBarrier({}, 5.0)).reason == "budget"
    assert kernel.state.registry.emitted == {}


def test_records_without_event_names_and_weather_are_readable():
    (record, *_) = (output.record for output in played(2, FRONT)[2:])
    plain = msgspec.json.decode(to_json(record))
    for event in plain["task_events"]:
        del event["name"]
    for seen in plain["observations"]:
        del seen["weather"]
    back = from_json(msgspec.json.encode(plain), BoundaryRecord)
    assert {event.name for event in back.task_events} == {""}
    assert {seen.weather for seen in back.observations} == {None}
    assert isinstance(back.observations[0], ObservationRecord)


def test_agents_without_an_events_channel_still_observe_the_weather():
    made = instance(FRONT)
    agents = tuple(
        msgspec.structs.replace(agent, observes=(ChannelSpec(source="entity", name="boat"),)) for agent in made.agents
    )
    kernel = kit.kernel(msgspec.structs.replace(made, agents=agents))
    kernel.reset(), kernel.step(())
    out = kernel.step(()).observations["skipper"]
    assert (out.weather, out.events) == (STORM, ())


@pytest.mark.parametrize("where", ["", "event front at 1 tick "])
def test_weather_that_depends_on_a_hidden_value_is_rejected(where):
    """Observations cannot carry a hidden value."""
    text = f"""
ljs 1
use std.sea {{ lifeboat, person_in_water }}
mission raft "A raft" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 1 s, sync = 500 ms }}
  budget {{ ticks <= 2 }}
  region search = box((-600 m, -1100 m), (600 m, -800 m))
  target victim : person_in_water {{ hidden position ~ sites(search) }}
  asset boat : lifeboat {{ position = (0 m, -900 m) }}
  {where}{"{" if where else ""} weather {{ visibility = distance_xy(boat, victim) }} {"}" if where else ""}
  agent skipper as skipper controls boat {{ observes boat.* }}
  success when distance_xy(boat, victim) <= 10 m
}}
"""
    assert "LJ0401" in [diagnostic.code for diagnostic in compile_text(text).diagnostics]
