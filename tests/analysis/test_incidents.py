"""Who crashed, fell or ran out of energy: from events and states, each once, at its time and place."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import lingjing
from lingjing.analysis.history import history_of
from lingjing.analysis.incidents import incidents
from lingjing.analysis.metrics import metrics
from lingjing.analysis.overview.mapview import draw_map
from lingjing.analysis.overview.timeline import draw_events
from lingjing.cli.scorecard import MOST_ROWS, plain, scorecard
from lingjing.dsl.loading.load import load_mission
from lingjing.mission.instance import Entity, InteractionSpec
from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import BodyState, Snapshot, TaskEvent

replace = msgspec.structs.replace


def entity(name: str, role: str = "asset", **properties: object) -> Entity:
    return Entity(
        id=name, group=name, index=0, role=role, type=name, engine="x", position=(0.0, 0.0, 0.0),  # type: ignore[arg-type]
        properties=properties,  # type: ignore[arg-type]
    )  # fmt: skip


def snapshot(time_s: float, **status: str) -> Snapshot:
    """Everybody at (time, 0, 5) with a status; `idle` if none is given."""
    states = [BodyState(id=name, position=(time_s, 0.0, 5.0), status=word) for name, word in status.items()]
    return Snapshot(time_s=time_s, states=tuple(states))


def happened(kind: str, time_s: float, *entities: str, name: str = "", **values: float) -> TaskEvent:
    return TaskEvent(kind=kind, time_s=time_s, entities=entities, values=values, name=name)


@pytest.fixture
def of(trace: Trace):  # type: ignore[no-untyped-def]
    """The incidents of an episode of ticks of 10 s and macro-steps of 0.5 s with these (snapshots, events)."""

    def found(*steps: tuple[tuple[Snapshot, ...], tuple[TaskEvent, ...]], entities: tuple[Entity, ...] = ()):  # type: ignore[no-untyped-def]
        known = entities or tuple(entity(name) for name in ("a", "b", "c", "boat"))
        instance = replace(trace.header.instance, entities=(*known, entity("raft", "target")))
        plain = trace.boundaries[0]
        records = tuple(
            replace(plain, tick=tick, time_s=10.0 * tick, snapshots=seen, task_events=events, events=(), stages=())
            for tick, (seen, events) in enumerate(steps)
        )
        made: Trace = Trace(trace.path, replace(trace.header, instance=instance), records, None, False)
        return incidents(made)

    return found


def test_a_collision_of_two_is_one_and_takes_place_where_its_macro_step_ends(of) -> None:  # type: ignore[no-untyped-def]
    seen = (
        snapshot(4.5, a="moving", b="moving"),
        snapshot(5.0, a="dead", b="dead"),
        snapshot(10.0, a="dead", b="dead"),
    )
    hit = (happened("collided", 4.7, "a", "b", speed_mps=12.25), happened("collided", 4.7, "b", "a", speed_mps=12.0))
    (one,) = of(((), ()), (seen, hit))
    assert (one.kind, one.entities, one.tick, one.time_s) == ("collided", ("a", "b"), 1, 4.7)
    assert one.line == "a and b collided at 12.2 m/s, at (5, 0, 5)"


def test_two_at_one_tick_are_two_and_in_order_of_time(of) -> None:  # type: ignore[no-untyped-def]
    hits = (
        happened("collided", 7.0, "c", "tower-7"),
        happened("collided", 3.0, "a", "b"),
        happened("fell", 3.0, "boat"),
    )
    found = of(((), ()), ((snapshot(10.0, a="dead", b="dead", c="dead"),), hits))
    assert [one.text for one in found] == ["a and b collided", "boat fell", "c hit tower-7"]


def test_a_second_collision_of_a_pair_counts_and_what_the_other_side_says_of_it_does_not(of) -> None:  # type: ignore[no-untyped-def]
    times = (("a", "b", 1.0), ("b", "a", 1.9), ("a", "b", 5.0), ("b", "a", 9.0))
    found = of(((), tuple(happened("collided", time_s, *pair) for *pair, time_s in times)))
    assert [one.time_s for one in found] == [1.0, 5.0, 9.0]


def test_boundary_0_counts_and_so_does_who_begins_lost(of) -> None:  # type: ignore[no-untyped-def]
    found = of(((snapshot(0.0, a="idle", boat="aground"),), (happened("collided", 0.0, "a", "ground"),)))
    assert [(one.tick, one.time_s, one.text) for one in found] == [
        (0, 0.0, "a hit the ground"),
        (0, 0.0, "boat is aground"),
    ]


def test_a_status_that_nothing_explains_is_an_incident_once(of) -> None:  # type: ignore[no-untyped-def]
    steps = [
        ((snapshot(0.0, a="idle", boat="idle"),), ()),
        ((snapshot(5.0, a="idle", boat="aground"), snapshot(10.0, a="dead", boat="aground")), ()),
        ((snapshot(20.0, a="dead", boat="idle"),), ()),
        ((snapshot(30.0, a="dead", boat="aground"),), ()),
    ]
    found = [(one.text, one.time_s) for one in of(*steps)]
    assert found == [("boat is aground", 5.0), ("a is dead", 10.0), ("boat is aground", 30.0)]


def test_a_bump_long_before_explains_no_death_but_an_empty_battery_does(of) -> None:  # type: ignore[no-untyped-def]
    told = (happened("collided", 2.0, "a", "kerb"), happened("battery_empty", 2.0, "b"))
    steps = [((snapshot(10.0, a="idle", b="idle"),), told), ((snapshot(20.0, a="dead", b="dead"),), ())]
    assert [one.text for one in of(*steps)] == ["a hit kerb", "the battery of b is empty", "a is dead"]


def test_what_is_no_incident(of) -> None:  # type: ignore[no-untyped-def]
    """Strangers among themselves, a target's status, an interaction and an event of the mission that are called so."""
    known = (
        entity("a"),
        replace(entity("tree", "target"), interactions=(InteractionSpec(name="fell", by="a", within_m=1.0),)),
    )
    seen = (snapshot(10.0, tree="dead", raft="dead", stranger="dead"),)
    events = (
        happened("collided", 1.0, "car-1", "car-2"),
        happened("fell", 1.0, "tree", "a"),
        happened("drowned", 1.0, "a", name="drowned"),
        happened("arrived", 1.0, "a"),
    )
    assert of((seen, events), entities=known) == ()
    (hit,) = of(((), (happened("collided", 1.0, "car-1", "a"),)), entities=known)
    assert (hit.text, hit.position) == ("car-1 and a collided", None)


def test_a_car_that_hits_a_target_is_an_incident(of) -> None:  # type: ignore[no-untyped-def]
    (hit,) = of(((), (happened("collided", 1.0, "car-1", "raft"),)))
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
    """Flies the first two into each other and leaves the third in the air."""

    async def reset(self, brief: Brief) -> None:
        self.body = brief.resources[0].id

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if observation.tick or self.body not in GOALS:
            return Decision()
        x, y, z = GOALS[self.body]
        return Decision(command=Action(verb="setDestination", arguments={"x": x, "y": y, "z": z}))


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory):  # type: ignore[no-untyped-def]
    """It is won at the boundary by which the first two have crashed."""
    folder = tmp_path_factory.mktemp("crash")
    file = folder / "crash.ljs"
    file.write_text(MISSION)
    return lingjing.run(file, policy=Collider, world="inline", out=folder / "run")


def test_two_drones_that_fly_into_each_other_are_in_the_report_and_the_summary(report) -> None:  # type: ignore[no-untyped-def]
    assert (report.success, report.ticks, report.metrics.incidents) == (True, 1, 1)
    (one,) = report.incidents
    assert set(one.entities) == {"uav[1]", "uav[2]"} and 2.0 < one.time_s < 10.0
    assert one.position == pytest.approx((60.0, -700.0, 38.0), abs=4.0)
    assert dict(scorecard(report))["Incidents"] == ((f"{one.time_s:.1f} s, tick 1", one.line),)
    piped = dict(dict(plain(report))["outcome"])
    assert piped["incidents"] == "1" and piped["incident_log"] == f"{one.time_s:.1f} s, tick 1: {one.line}"
    assert piped["event_log"] == "N/A"
    assert Path(report.trace).with_name("overview.png").stat().st_size > 10_000


def test_they_are_drawn_on_the_map_and_in_the_timeline(report) -> None:  # type: ignore[no-untyped-def]
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


def test_a_whole_episode_says_what_happened_by_itself_too(tmp_path: Path) -> None:
    file = tmp_path / "crash.ljs"
    file.write_text(MISSION.replace("now >= 10 s", "now >= 500 s"))
    result = lingjing.run(load_mission(file), policy=Collider, world="inline", out=tmp_path / "run", overview=False)
    crash, empty = result.incidents
    assert (crash.kind, empty.text) == ("collided", "the battery of kite is empty")
    landed = {state.id: state.status for state in read_trace(result.trace).boundaries[-1].snapshots[-1].states}
    assert set(landed.values()) == {"dead"}, "it came down on the water, which is no incident of its own"
    assert [event.line for event in result.happened] == ["weather front: wind_from_deg 200, wind_mps 8"]
    assert result.incidents == incidents(read_trace(result.trace))


def test_a_long_list_is_cut_and_says_so(report) -> None:  # type: ignore[no-untyped-def]
    many = replace(report, incidents=report.incidents * (MOST_ROWS + 3))
    rows = dict(scorecard(many))["Incidents"]
    assert len(rows) == MOST_ROWS + 1 and rows[-1] == ("", "and 3 more (--json has all)")
    assert dict(dict(plain(many))["outcome"])["incident_log"].endswith("; and 3 more (--json has all)")


def test_an_episode_without_any_has_none(trace: Trace) -> None:
    assert incidents(trace) == () and metrics(trace).incidents == 0
