"""Events that close roads and change the radio, with the real engines of roads and links."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing.testing import Stage, compile_text, compiled, does, episode, play, run_command, says, scripted

TOWN = """ljs 2
use std.ground {{ car }}

target place_to_be {{ engine = city }}
mission town "Town" {{
  goal "Drive the van to the stop."
  scene residential {{ extent = 600 m }}
  clock {{ tick = 5 s, sync = 500 ms }}
  budget {{ ticks <= {ticks} }}
  region bridge = box((60 m, -20 m), (140 m, 20 m))
  region quarter = box((140 m, -40 m), (280 m, 280 m))
  target stop : place_to_be {{ position = (200 m, 150 m), on = road }}
  asset van : car {{ position = (-200 m, -150 m), actions {{ setDestination, stop }} }}
  agent driver as driver controls van {{ observes van.*, stop.*, events }}
  {events}
  success when distance_xy(van, stop) <= 30 m
}}
"""
EXAMPLES = Path(lingjing.__file__).parents[1] / "scenarios" / "examples"
DRIVE = {0: does("setDestination", x=203.0, y=150.0)}


def driven(tmp_path: Path, *events: str, ticks: int = 30, script: dict[int, object] = DRIVE):
    """An episode in which the van sets out at once, with its routes and the events of the mission by tick."""
    text = TOWN.format(events="\n  ".join(events), ticks=ticks)
    played = play(text, tmp_path, policy=scripted({"driver": script}), seed=1)
    lengths = {record.tick: [round(route.length_m) for route in record.routes] for record in played.trace.boundaries}
    lines = [
        (record.tick, event.line) for record in played.trace.boundaries for event in record.task_events if event.name
    ]
    return played, {tick: length for tick, length in lengths.items() if length}, lines


def test_a_moving_vehicle_gets_a_new_route_when_a_road_of_its_route_closes(tmp_path: Path) -> None:
    close = "event closing when distance_xy(van, stop) <= 420 m until now > 45 s { close bridge }"
    played, routes, lines = driven(tmp_path, close)
    assert lines == [
        (4, "occurred closing"), (4, "closed closing: bridge"),
        (10, "undone closing"), (10, "reopened closing: bridge"),
    ]  # fmt: skip
    assert list(routes) == [1, 5] and routes[5][0] > routes[1][0]
    assert played.report.success
    seen = [view for record in played.trace.boundaries for seen in record.observations for view in seen.events]
    assert [(view.kind, view.entities) for view in seen if view.kind in ("closed", "reopened")] == [
        ("closed", ("bridge",)), ("reopened", ("bridge",)),
    ]  # fmt: skip


def test_a_destination_behind_closed_roads_is_refused_and_a_trip_there_fails(tmp_path: Path) -> None:
    played, routes, _ = driven(tmp_path / "a", "event shut at 1 tick { close quarter }", ticks=6)
    reasons = [(receipt.status, receipt.reason) for receipt in played.receipts if receipt.status == "rejected"]
    assert reasons == [("rejected", "road_closed")] and list(routes) == [1]
    late = {2: does("setDestination", x=203.0, y=150.0), 4: does("setDestination", x=203.0, y=150.0)}
    again, _, lines = driven(
        tmp_path / "b", "event shut at 1 tick until now >= 20 s { close quarter }", ticks=8, script=late
    )
    answers = [
        (receipt.tick, receipt.status, receipt.reason) for receipt in again.receipts if receipt.status != "running"
    ]
    assert answers == [(3, "rejected", "unreachable"), (5, "accepted", "")], lines


def test_a_road_closes_and_reopens_by_two_timed_events(tmp_path: Path) -> None:
    events = ("event shut at 1 tick { close bridge }", "event open at 3 tick { reopen bridge }")
    played, routes, lines = driven(tmp_path, *events)
    assert lines == [(1, "closed shut: bridge"), (3, "reopened open: bridge")]
    assert list(routes) == [1, 2]
    assert played.report.success


TEAM = """ljs 2
use std.sea {{ lifeboat }}
use std.messages {{ note }}

mission fleet "Fleet" {{
  goal "Talk."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 12 }}
  {comms}
  region harbour = box((0 m, -1400 m), (60 m, -1300 m))
  asset boat[i in 1..2] : lifeboat {{ position = at(i, [(10 m, -1350 m), (400 m, -1350 m)]), heading = 30 deg }}
  agent skipper[i in 1..2] as rescuer controls boat[i] {{ observes boat[i].*, events }}
  message word : note from rescuer to all
  {events}
  success when now > 115 s
}}
"""


def answers(*events: str, comms: str = "", ticks: int = 5) -> list[str]:
    """The reason of the receipt of each tick's message of the first skipper; "" if it arrived."""
    text = TEAM.format(events="\n  ".join(events), comms=comms)
    with episode(text, seed=1, stage=Stage()) as run:
        for _ in range(ticks):
            run.do({"skipper[1]": says("word", text="hello")})
        return [reason for _, reason in run.reasons("skipper[1]")]


def test_messages_are_lost_until_an_event_on_the_radio_is_undone() -> None:
    storm = "event storm at 1 tick until now >= 30 s { comms { loss = 100 % } }"
    assert answers(storm) == ["", "lost", "lost", "", ""]


def test_messages_from_or_to_a_jammed_region_are_lost() -> None:
    jam = "event jamming at 1 tick until now >= 30 s { jam harbour { loss = 100 % } }"
    assert answers(jam) == ["", "lost", "lost", "", ""]
    elsewhere = jam.replace("harbour", "offshore").replace(
        "event", "region offshore = box((0 m, 0 m), (9 m, 9 m))\n  event"
    )
    assert answers(elsewhere) == [""] * 5


@pytest.mark.parametrize("effect", ["comms { range <= 100 m }", "jam harbour { range <= 100 m }"])
def test_an_event_shortens_the_radio_range_with_and_without_a_declared_range(effect: str) -> None:
    event = f"event short at 1 tick until now >= 30 s {{ {effect} }}"
    for comms in ("", "comms { range <= 3 km }"):
        reasons = answers(event, comms=comms, ticks=6)
        assert "out_of_range" in reasons and reasons[0] == reasons[-1] == "", reasons


def test_the_trace_has_the_radio_changes_of_an_event() -> None:
    effects = "jam harbour { loss = 50 %, range <= 90 m }, comms { loss = 10 % }"
    event = f"event jamming when now > 5 s until now > 25 s {{ {effects} }}"
    with episode(TEAM.format(events=event, comms=""), seed=1, stage=Stage()) as run:
        run.wait(4)
        lines = [item.line for published in run.all for item in published.record.task_events]
    assert lines == [
        "occurred jamming", "comms jamming: loss 0.1", "jammed jamming: harbour loss 0.5, range_m 90",
        "undone jamming", "comms jamming: loss 0", "jam_ended jamming: harbour",
    ]  # fmt: skip


def test_the_printer_writes_effects_on_roads_and_radio(tmp_path: Path) -> None:
    events = (
        "event e when now > 5 s { close bridge, jam quarter { loss = 50 %, range <= 90 m }, comms { loss = 10 % } }"
    )
    file, printed = tmp_path / "town.ljs", tmp_path / "printed.ljs"
    file.write_text(TOWN.format(events=f"{events}\n  event f at 9 s {{ reopen bridge }}", ticks=30), encoding="utf-8")
    assert run_command(["compile", str(file), "--emit", "ljs", "-o", str(printed)]) == 0
    assert compiled(printed).events == compiled(file).events


WRONG = {
    "event e at 1 s { close van }": ("LJ0201", "name of a region"),
    "event e at 1 s { close box((0 m, 0 m), (1 m, 1 m)) }": ("LJ0201", "name of a region"),
    "event e at 1 s { close brigde }": ("LJ0101", "brigde"),
    "event e at 1 s { jam bridge { loss = 120 % } }": ("LJ0206", "at most 1"),
    "event e at 1 s { jam bridge { delay = 2 tick } }": ("LJ0108", "delay"),
    "event e at 1 s { comms { range = 9 m } }": ("LJ0303", "<="),
    "close bridge": ("LJ0107", "no meaning"),
}


@pytest.mark.parametrize("event", WRONG)
def test_a_wrong_effect_has_one_error_with_the_reason(event: str) -> None:
    code, words = WRONG[event]
    errors = [
        item for item in compile_text(TOWN.format(events=event, ticks=30)).diagnostics if item.severity == "error"
    ]
    assert [item.code for item in errors] == [code], errors
    assert words in errors[0].message + errors[0].hint


def test_the_oracle_wins_the_harbour_with_a_closing_bridge(tmp_path: Path) -> None:
    """Seed 0: both vans are on their way to the bridge when it closes, and it reopens behind the boat."""
    played = play(EXAMPLES / "harbour.ljs", tmp_path, policy="oracle", seed=0)
    assert played.report.success
    routes = {(route.entity, route.number) for record in played.trace.boundaries for route in record.routes}
    assert {("van[1]", 2), ("van[2]", 2)} <= routes
    kinds = [event.kind for record in played.trace.boundaries for event in record.task_events if event.name]
    assert kinds == ["occurred", "closed", "comms", "undone", "reopened", "comms"]


@pytest.mark.parametrize("how", [["--emit", "mission"], ["--emit", "graphml"], ["--emit", "ljs"]])
def test_the_harbour_compiles_to_every_output_format(how: list[str], tmp_path: Path) -> None:
    out = tmp_path / "harbour.out"
    assert run_command(["compile", str(EXAMPLES / "harbour.ljs"), *how, "-o", str(out)]) == 0
    assert "opening" in out.read_text(encoding="utf-8")


def test_the_conditions_of_an_event_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["graph", str(EXAMPLES / "harbour.ljs"), "--conditions"]) == 0
    shown = capsys.readouterr().out
    assert "[event/opening/when]" in shown and "[event/opening/until]" in shown
    assert "decides: the mission's event opening" in shown and "event opening" in shown
    for form in ("mermaid", "dot", "svg"):
        assert run_command(["graph", str(EXAMPLES / "harbour.ljs"), "--format", form]) == 0
    assert run_command(["docs", str(EXAMPLES / "harbour.ljs")]) == 0
