"""Events with a condition: they occur, are undone and repeat, in a fixed order, and leave marks in the trace."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.testing import Stage, compile_text, compiled, episode, play, run_command, scripted

TEXT = """ljs 2
use std.sea {{ lifeboat }}

target gauge {{
  engine = city
  state level = 1 m
  state stock = 50 kg
  interaction read {{ by = vessel, within = 30 m, status = taken }}
}}
mission tide "Tide" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 12 }}
  weather {{ wind = 2 m/s from 90 deg, visibility = 8 km }}
  target g : gauge {{ position = (20 m, -1330 m) }}
  target buoy[1..2] : gauge {{ position = at(i, [(90 m, -1330 m)], spread 20 m) }}
  asset boat : lifeboat {{ position = (10 m, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat {{ observes boat.*, g.*, buoy.*, events }}
  {events}
  success when now > 115 s
}}
"""


def text(*events: str) -> str:
    return TEXT.format(events="\n  ".join(events))


def lines(mission_text: str, ticks: int) -> list[list[str]]:
    """The lines of the log for the events of the mission at each boundary."""
    with episode(mission_text, seed=1, stage=Stage()) as run:
        rows = [[event.line for event in run.published.record.task_events if event.name]]
        for _ in range(ticks):
            run.do()
            rows.append([event.line for event in run.published.record.task_events if event.name])
    return rows


def marks(mission_text: str, ticks: int = 12) -> dict[str, list[int]]:
    """The ticks at which each event occurred (positive) or was undone (negative)."""
    ticks_of: dict[str, list[int]] = {}
    for tick, row in enumerate(lines(mission_text, ticks)):
        for line in row:
            kind, name, *_ = line.split()
            if kind in ("occurred", "undone"):
                ticks_of.setdefault(name.rstrip(":"), []).append(tick if kind == "occurred" else -tick)
    return ticks_of


def test_an_event_occurs_once_at_the_first_boundary_at_which_its_condition_holds() -> None:
    assert marks(text("event gale when now > 25 s { weather { wind = 15 m/s from 220 deg } }")) == {"gale": [3]}


def test_undoing_an_event_restores_the_previous_values() -> None:
    event = """event surge when now > 15 s until now > 35 s {
      weather { visibility = 500 m }, change g.level to g.level + 2 m, vanish buoy[1] }"""
    with episode(text(event), seed=1, stage=Stage()) as run:
        seen = []
        for _ in range(7):
            observation = run.published.observations["skipper"]
            views = {view.id: view for view in observation.entities}
            buoy = "buoy[1]" in views and views["buoy[1]"].status != "dormant"
            resources = views["g"].resources or {}
            seen.append((observation.weather.visibility_m, resources["level"], buoy))
            run.do()
    calm, rough = (8000.0, 1.0, True), (500.0, 3.0, False)
    # The weather of an observation changes with the event; engines take over the rest in the following tick.
    assert seen[:3] == [calm, calm, (500.0, 1.0, True)]
    assert seen[3] == rough
    assert seen[4:] == [(8000.0, 3.0, False), calm, calm]


def test_agents_observe_the_changes_and_the_trace_has_the_marks() -> None:
    event = "event surge when now > 15 s until now > 35 s { weather { visibility = 500 m }, change g.level to 3 m }"
    with episode(text(event), seed=1, stage=Stage()) as run:
        for _ in range(2):
            run.do()
        observed = [(view.kind, view.entities) for view in run.published.observations["skipper"].events]
        recorded = [happened.line for happened in run.published.record.task_events]
    assert observed == [("weather", ()), ("changed", ("g",))]
    assert recorded == ["occurred surge: g", "weather surge: visibility_m 500", "changed surge: g level_m 3"]


def test_an_event_repeats_after_its_pause_and_not_before() -> None:
    gust = "event gust when now >= 10 s repeat every {pause} {{ weather {{ wind = 9 m/s from 0 deg }} }}"
    assert marks(text(gust.format(pause="30 s")), 8) == {"gust": [1, 4, 7]}
    assert marks(text(gust.format(pause="1 s")), 4) == {"gust": [1, 2, 3, 4]}
    undone = "event gust when now >= 10 s until now >= 10 s repeat every 20 s { weather { wind = 9 m/s from 0 deg } }"
    assert marks(text(undone), 8) == {"gust": [1, -2, 4, -5, 7, -8]}


def test_an_event_at_a_time_can_be_undone_and_repeat() -> None:
    event = "event ebb at 20 s until g.level < 0.5 m repeat every 30 s { change g.level to 0.2 m }"
    # The level falls in the tick after the event; undone, it is 1 m again.
    assert marks(text(event), 9) == {"ebb": [2, -3, 6, -7]}


def test_later_events_of_a_boundary_use_earlier_changes_and_each_event_acts_once() -> None:
    """Two events that trigger each other end: each changes at most once at a boundary."""
    up = "event up when g.level < 2 m repeat every 1 s { change g.level to 3 m }"
    down = "event down when g.level > 2 m repeat every 1 s { change g.level to 1 m }"
    ticks_of = marks(text(up, down), 6)
    assert ticks_of == {"up": [0, 2, 4, 6], "down": [1, 3, 5]}


def test_a_later_event_overrides_an_earlier_event_until_the_later_one_is_undone() -> None:
    storm = "event storm when now > 5 s { weather { wind = 15 m/s from 220 deg } }"
    fog = "event fog when now > 15 s until now > 35 s { weather { wind = 1 m/s from 0 deg, visibility = 100 m } }"
    with episode(text(storm, fog), seed=1, stage=Stage()) as run:
        winds = []
        for _ in range(5):
            run.do()
            weather = run.published.observations["skipper"].weather
            winds.append((weather.wind_mps, weather.visibility_m))
    assert winds == [(15.0, 8000.0), (1.0, 100.0), (1.0, 100.0), (15.0, 8000.0), (15.0, 8000.0)]


def test_undoing_an_event_does_not_overwrite_the_value_of_a_later_event() -> None:
    first = "event first when now > 5 s until now > 35 s { change g.level to 3 m }"
    second = "event second when now > 15 s { change g.level to 5 m }"
    with episode(text(first, second), seed=1, stage=Stage()) as run:
        levels = []
        for _ in range(6):
            run.do()
            levels.append(run.state("g").resources["level"])
    assert levels == [1.0, 3.0, 5.0, 5.0, 5.0, 5.0]


def test_an_event_sets_a_status_word() -> None:
    """The boat is too far away to take the gauge by its interaction."""
    swap, far = "event swap when now > 15 s { change g.status to taken }", Stage(places={"boat": (300.0, -1350.0, 0.0)})
    statuses = {}
    for event in ("", swap):
        with episode(text(event), seed=1, stage=far) as run:
            for _ in range(3):
                run.do()
                statuses.setdefault(event, []).append(run.state("g").status)
    assert statuses == {"": ["waiting"] * 3, swap: ["waiting", "waiting", "taken"]}


def test_a_replay_agrees_with_the_episode(tmp_path: Path) -> None:
    event = "event surge when now > 15 s until now > 35 s repeat every 10 s { change g.level to 3 m, vanish buoy }"
    played = play(text(event), folder=tmp_path, policy=scripted({}), seed=1)
    assert run_command(["replay", str(played.path)]) == 0


def test_the_printer_and_the_formatter_write_all_forms(tmp_path: Path) -> None:
    source = text(
        "event one when g.level > 2 m and now > 60 s until g.level < 1 m repeat every 5 min { change g.level to 3 m }",
        "event two at ~ uniform(2 tick, 5 tick) when mode == broadcast until now > 90 s { vanish buoy[1] }",
        "event three at 1 tick repeat every 60 s { change g.status to taken, weather { cloud = 1 } }",
    )
    mission = compiled(source)
    file, printed = tmp_path / "tide.ljs", tmp_path / "printed.ljs"
    file.write_text(source, encoding="utf-8")
    assert run_command(["compile", str(file), "--emit", "ljs", "-o", str(printed)]) == 0
    assert compiled(printed).events == mission.events
    assert run_command(["fmt", str(file)]) == 0
    assert compiled(file).events == mission.events


WRONG = {
    "event e when now > 1 s repeat every 0 s { vanish g }": ("LJ0206", "without end"),
    "event e when now { vanish g }": ("LJ0201", ""),
    "event e when now > 1 s until 5 s { vanish g }": ("LJ0201", ""),
    "event e when now > 1 s repeat every 5 m { vanish g }": ("LJ0203", ""),
    "event e when now > 1 s { change g.position to (0 m, 0 m) }": ("LJ0102", "is no state"),
    "event e when now > 1 s { change g.levl to 3 m }": ("LJ0102", "is no state"),
    "event e when now > 1 s { change g.level to 3 kg }": ("LJ0203", ""),
    "event e when now > 1 s { change g.status to takn }": ("LJ0109", "never"),
    "event e when now > 1 s { change boat.heading to 3 deg }": ("LJ0201", "only a target"),
    "event e when now > 1 s { change g to 3 m }": ("LJ0201", "another value"),
    "event e when now > 1 s { }": ("LJ0106", "changes nothing"),
    'event e when now > 1 s { goal "x" }': ("LJ0107", "no meaning"),
    'event e when now > 1 s { close road("x") }': ("LJ0201", "without a name"),
}


@pytest.mark.parametrize("event", WRONG)
def test_a_wrong_event_has_one_error_with_the_reason(event: str) -> None:
    code, words = WRONG[event]
    errors = [item for item in compile_text(text(event)).diagnostics if item.severity == "error"]
    assert [item.code for item in errors] == [code], errors
    assert words in errors[0].message


@pytest.mark.parametrize(
    "success",
    [
        "g.level > 2 m",
        "g.stock <= 0 kg",
        "g.status == taken",
        "sum(b.level for b in buoy) > 5 m",
        "not alive(boat) or g.level == 4 m",
    ],
)
def test_a_success_that_an_event_may_cause_is_not_proved_impossible(success: str) -> None:
    changes = "change g.level to 4 m, change g.stock to 0 kg, change g.status to taken, change buoy.level to 3 m"
    event = f"event e when now > 5 s {{ {changes} }}"
    winnable = text(event).replace("success when now > 115 s", f"success when {success}")
    assert [item for item in compile_text(winnable).diagnostics if item.severity == "error"] == []


@pytest.mark.parametrize("change", ["g.stock = 5 kg", "set g.stock = 5 kg"])
def test_the_error_of_an_assignment_in_an_event_offers_a_change_statement(change: str) -> None:
    compilation = compile_text(text(f"event drain when now > 20 s {{ {change} }}"))
    (error,) = compilation.diagnostics
    assert (error.code, error.message) == ("LJ0010", "`g.stock = …` is no statement")
    assert error.hint == "write `change g.stock to …`"
    assert error.fix is not None and error.fix.safe and error.fix.edits[0].text == "change g.stock to"


def test_an_assignment_elsewhere_is_one_error_that_names_the_block_of_its_entity() -> None:
    (error,) = compile_text(text("boat.speed = 3 m/s")).diagnostics
    assert error.message == "`boat.speed = …` is no statement"
    assert "stands in the block of its entity" in error.hint


def test_an_amount_never_falls_below_0() -> None:
    blaze = TEXT.replace("state stock = 50 kg", "state stock = 50 kg, state heat = 0.5")
    constant = blaze.format(events="event drain when now > 20 s { change g.heat to -4 }")
    (error,) = compile_text(constant).diagnostics
    assert (error.code, error.message) == ("LJ0206", "`heat` of `g` is never below 0")
    computed = blaze.format(events="event drain when now > 20 s { change g.heat to g.heat - 4 }")
    assert "changed drain: g heat 0" in [line for row in lines(computed, 4) for line in row]


@pytest.mark.parametrize("condition", ["held(g.level > 0 m, -3 s)", "within(g.level > 0 m, now > 3 s, 2 s - 5 s)"])
def test_a_function_over_time_has_a_time_of_0_or_more(condition: str) -> None:
    (error,) = compile_text(text(f"event e when {condition} {{ vanish g }}")).diagnostics
    assert error.code == "LJ0206" and error.message.endswith("is below 0 s")


def test_a_value_that_counts_hidden_members_is_a_leak() -> None:
    source = text(
        "param hidden people ~ integer(2, 5)",
        "target person[1..people] : person_in_water { hidden position ~ sites(box((0 m, -1500 m), (90 m, -1400 m))) }",
        "event e at 10 s { change g.stock to sum(1 kg for p in person) }",
    ).replace("use std.sea { lifeboat }", "use std.sea { lifeboat, person_in_water }")
    (error,) = compile_text(source).diagnostics
    assert error.code == "LJ0404" and "event `e`" in error.message and "`person`" in error.message


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("close quay, reopen quay", "LJ0103"),
        ("close quay, close quay", "LJ0103"),
        ("appear g, vanish g", "LJ0103"),
        ("change g.level to 2 m, change g.level to 3 m", "LJ0103"),
        ("comms { loss = 10 % }, comms { loss = 20 % }", "LJ0103"),
        ("weather { visibility = 1 km }, weather { visibility = 2 km }", "LJ0103"),
        ("reopen quay", "LJ0512"),
        ("comms { loss = 10 % }, comms { range <= 1 km }", ""),
        ("change g.level to 2 m, change g.stock to 3 kg", ""),
    ],
)
def test_effects_that_contradict_each_other_or_change_nothing_are_reported(body: str, code: str) -> None:
    quay = "region quay = box((0 m, -1340 m), (40 m, -1300 m))"
    assert [item.code for item in compile_text(text(quay, f"event e at 3 tick {{ {body} }}")).diagnostics] == (
        [code] if code else []
    )


def test_a_region_that_another_event_closes_may_be_reopened() -> None:
    quay = "region quay = box((0 m, -1340 m), (40 m, -1300 m))"
    events = ("event e at 3 tick { close quay }", "event f at 5 tick { reopen quay }")
    assert compile_text(text(quay, *events)).diagnostics == ()
