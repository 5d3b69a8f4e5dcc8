"""Incidents from events and states: each once, with its time and place."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import lingjing
from lingjing import Trace, metrics
from lingjing import read as read_trace
from lingjing.analysis.history import history_of
from lingjing.analysis.incidents import incidents
from lingjing.analysis.overview.mapview import draw_map
from lingjing.analysis.overview.timeline import draw_events
from lingjing.cli.scorecard import MOST_ROWS, plain, scorecard
from lingjing.mission.instance import Entity, InteractionSpec
from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation
from lingjing.trace.records import BodyState, Snapshot, TaskEvent

replace = msgspec.structs.replace


def entity(name: str, role: str = "asset", **properties: object) -> Entity:
    return Entity(
        id=name, group=name, index=0, role=role, type=name, engine="x", position=(0.0, 0.0, 0.0),  # type: ignore[arg-type]
        properties=properties,  # type: ignore[arg-type]
    )  # fmt: skip


def snapshot(time_s: float, **status: str) -> Snapshot:
    """Return a snapshot with all entities at (time, 0, 5) and the given statuses."""
    states = [BodyState(id=name, position=(time_s, 0.0, 5.0), status=word) for name, word in status.items()]
    return Snapshot(time_s=time_s, states=tuple(states))


def task_event(kind: str, time_s: float, *entities: str, name: str = "", **values: float) -> TaskEvent:
    return TaskEvent(kind=kind, time_s=time_s, entities=entities, values=values, name=name)


@pytest.fixture
def of(trace: Trace):  # type: ignore[no-untyped-def]
    """A function that returns the incidents of an episode with ticks of 10 s and the given (snapshots, events)."""

    def incidents_of(*steps: tuple[tuple[Snapshot, ...], tuple[TaskEvent, ...]], entities: tuple[Entity, ...] = ()):  # type: ignore[no-untyped-def]
        known = entities or tuple(entity(name) for name in ("a", "b", "c", "boat"))
        instance = replace(trace.header.instance, entities=(*known, entity("raft", "target")))
        plain = trace.boundaries[0]
        records = tuple(
            replace(plain, tick=tick, time_s=10.0 * tick, snapshots=seen, task_events=events, events=(), stages=())
            for tick, (seen, events) in enumerate(steps)
        )
        made: Trace = Trace(trace.path, replace(trace.header, instance=instance), records, None, False)
        return incidents(made)

    return incidents_of


def test_both_reports_of_a_collision_are_one_incident_with_its_place(of) -> None:  # type: ignore[no-untyped-def]
    seen = (
        snapshot(4.5, a="moving", b="moving"),
        snapshot(5.0, a="dead", b="dead"),
        snapshot(10.0, a="dead", b="dead"),
    )
    hit = (
        task_event("collided", 4.7, "a", "b", speed_mps=12.25),
        task_event("collided", 4.7, "b", "a", speed_mps=12.0),
    )
    (incident,) = of(((), ()), (seen, hit))
    assert (incident.kind, incident.entities, incident.tick, incident.time_s) == ("collided", ("a", "b"), 1, 4.7)
    assert incident.line == "a and b collided at 12.2 m/s, at (5, 0, 5)"


def test_incidents_of_one_tick_are_in_order_of_time(of) -> None:  # type: ignore[no-untyped-def]
    hits = (
        task_event("collided", 7.0, "c", "tower-7"),
        task_event("collided", 3.0, "a", "b"),
        task_event("fell", 3.0, "boat"),
    )
    listed = of(((), ()), ((snapshot(10.0, a="dead", b="dead", c="dead"),), hits))
    assert [incident.text for incident in listed] == ["a and b collided", "boat fell", "c hit tower-7"]


def test_a_second_collision_of_a_pair_counts_and_the_report_of_the_other_side_does_not(of) -> None:  # type: ignore[no-untyped-def]
    times = (("a", "b", 1.0), ("b", "a", 1.9), ("a", "b", 5.0), ("b", "a", 9.0))
    listed = of(((), tuple(task_event("collided", time_s, *pair) for *pair, time_s in times)))
    assert [incident.time_s for incident in listed] == [1.0, 5.0, 9.0]


def test_collisions_and_lost_statuses_at_boundary_0_are_incidents(of) -> None:  # type: ignore[no-untyped-def]
    listed = of(((snapshot(0.0, a="idle", boat="aground"),), (task_event("collided", 0.0, "a", "ground"),)))
    assert [(incident.tick, incident.time_s, incident.text) for incident in listed] == [
        (0, 0.0, "a hit the ground"),
        (0, 0.0, "boat is aground"),
    ]


def test_a_lost_status_without_an_event_is_one_incident_while_it_lasts(of) -> None:  # type: ignore[no-untyped-def]
    steps = [
        ((snapshot(0.0, a="idle", boat="idle"),), ()),
        ((snapshot(5.0, a="idle", boat="aground"), snapshot(10.0, a="dead", boat="aground")), ()),
        ((snapshot(20.0, a="dead", boat="idle"),), ()),
        ((snapshot(30.0, a="dead", boat="aground"),), ()),
    ]
    listed = [(incident.text, incident.time_s) for incident in of(*steps)]
    assert listed == [("boat is aground", 5.0), ("a is dead", 10.0), ("boat is aground", 30.0)]


def test_an_empty_battery_explains_a_later_death_and_a_collision_does_not(of) -> None:  # type: ignore[no-untyped-def]
    events = (task_event("collided", 2.0, "a", "kerb"), task_event("battery_empty", 2.0, "b"))
    steps = [((snapshot(10.0, a="idle", b="idle"),), events), ((snapshot(20.0, a="dead", b="dead"),), ())]
    assert [incident.text for incident in of(*steps)] == ["a hit kerb", "the battery of b is empty", "a is dead"]


def test_events_of_unknown_bodies_interactions_and_schedules_are_no_incidents(of) -> None:  # type: ignore[no-untyped-def]
    """Collisions of unknown bodies, the status of a target, an interaction `fell` and a scheduled event `drowned`."""
    known = (
        entity("a"),
        replace(entity("tree", "target"), interactions=(InteractionSpec(name="fell", by="a", within_m=1.0),)),
    )
    seen = (snapshot(10.0, tree="dead", raft="dead", stranger="dead"),)
    events = (
        task_event("collided", 1.0, "car-1", "car-2"),
        task_event("fell", 1.0, "tree", "a"),
        task_event("drowned", 1.0, "a", name="drowned"),
        task_event("arrived", 1.0, "a"),
    )
    assert of((seen, events), entities=known) == ()
    (hit,) = of(((), (task_event("collided", 1.0, "car-1", "a"),)), entities=known)
    assert (hit.text, hit.position) == ("car-1 and a collided", None)


def test_a_car_that_hits_a_target_is_an_incident(of) -> None:  # type: ignore[no-untyped-def]
    (hit,) = of(((), (task_event("collided", 1.0, "car-1", "raft"),)))
    assert hit.text == "car-1 and raft collided"


# -- a real episode

MISSION = """\
ljs 1
use std.air { quadrotor }
mission crash "Two drones, one line" {
  goal "Fly."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 6 }
  mode broadcast in { broadcast }
  asset uav[1..2] : quadrotor {
    position = at(i, [(0 m, -700 m, 40 m), (120 m, -700 m, 40 m)])
    actions { setDestination, stop }
  }
  asset kite : quadrotor { position = (300 m, -900 m, 10 m), endurance = 20 s, actions { stop } }
  agent pilot[1..2] as pilot controls uav[i] { observes uav[i].*, events }
  agent third as pilot controls kite { observes kite.*, events }
  event front at 30 s { weather { wind = 8 m/s from 200 deg } }
  success when now >= 10 s
}
"""
GOALS = {"uav[1]": (120.0, -700.0, 40.0), "uav[2]": (0.0, -700.0, 40.0)}


class Collider:
    """A policy that flies the first two drones into each other and leaves the third one in the air."""

    async def reset(self, brief: Brief) -> None:
        self.body = brief.resources[0].id

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if observation.tick or self.body not in GOALS:
            return Decision()
        x, y, z = GOALS[self.body]
        return Decision(command=Action(verb="setDestination", arguments={"x": x, "y": y, "z": z}))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    """The report of an episode that is won at the boundary after the collision."""
    folder = tmp_path_factory.mktemp("crash")
    file = folder / "crash.ljs"
    file.write_text(MISSION)
    return lingjing.run(file, policy=Collider, world="inline", out=folder / "run")


def test_a_collision_of_two_drones_is_in_the_report_and_the_summary(report) -> None:  # type: ignore[no-untyped-def]
    assert (report.success, report.ticks, report.metrics.incidents) == (True, 1, 1)
    (incident,) = report.incidents
    assert set(incident.entities) == {"uav[1]", "uav[2]"} and 2.0 < incident.time_s < 10.0
    assert incident.position == pytest.approx((60.0, -700.0, 38.0), abs=4.0)
    assert dict(scorecard(report))["Incidents"] == ((f"{incident.time_s:.1f} s, tick 1", incident.line),)
    piped = dict(dict(plain(report))["outcome"])
    assert piped["incidents"] == "1" and piped["incident_log"] == f"{incident.time_s:.1f} s, tick 1: {incident.line}"
    assert piped["event_log"] == "N/A"
    assert Path(report.trace).with_name("overview.png").stat().st_size > 10_000


def test_incidents_are_drawn_on_the_map_and_in_the_timeline(report) -> None:  # type: ignore[no-untyped-def]
    history = history_of(read_trace(Path(report.trace)))
    for draw in (draw_map, draw_events):
        for shown, words in ((history, 1), (dataclasses.replace(history, incidents=()), 0)):
            figure = Figure(figsize=(8, 6))
            FigureCanvasAgg(figure)
            axes = figure.add_subplot()
            draw(axes, shown)  # type: ignore[operator]
            legend = axes.get_legend()
            labels = [] if legend is None else [text.get_text() for text in legend.get_texts()]
            assert labels.count("incident") == words
            assert sum(line.get_marker() == "X" for line in axes.lines) == words


def test_the_report_of_an_episode_has_scheduled_events_too(tmp_path: Path) -> None:
    file = tmp_path / "crash.ljs"
    file.write_text(MISSION.replace("now >= 10 s", "now >= 60 s"))
    result = lingjing.run(lingjing.compile(file), policy=Collider, world="inline", out=tmp_path / "run", overview=False)
    crash, empty = result.incidents
    assert (crash.kind, empty.text) == ("collided", "the battery of kite is empty")
    landed = {state.id: state.status for state in read_trace(result.trace).boundaries[-1].snapshots[-1].states}
    assert set(landed.values()) == {"dead"}, "the kite came down on the water, which is no separate incident"
    assert [event.line for event in result.happened] == ["weather front: wind_from_deg 200, wind_mps 8"]
    assert result.incidents == incidents(read_trace(result.trace))


def test_a_long_list_is_shortened_with_a_note(report) -> None:  # type: ignore[no-untyped-def]
    many = replace(report, incidents=report.incidents * (MOST_ROWS + 3))
    rows = dict(scorecard(many))["Incidents"]
    assert len(rows) == MOST_ROWS + 1 and rows[-1] == ("", "and 3 more (--json has all)")
    assert dict(dict(plain(many))["outcome"])["incident_log"].endswith("; and 3 more (--json has all)")


def test_an_episode_without_incidents_has_an_empty_list(trace: Trace) -> None:
    assert incidents(trace) == () and metrics(trace).incidents == 0
