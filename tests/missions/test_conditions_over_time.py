"""`held`, `within`, `before` and `count`: their values at macro-steps and boundaries, their memory, their readers."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.plugins.tasks import OpenGoal, goals
from lingjing.testing import Stage, compile_text, compiled, does, episode, instantiate, play, run_command, scripted

TEXT = """ljs 2
use std.sea {{ lifeboat }}

target gauge {{
  engine = city
  state level = 1 m
  interaction read {{ by = vessel, within = 30 m }}
}}
mission tide "Tide" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= 12 }}
  target g : gauge {{ position = (20 m, -1330 m) }}
  target h : gauge {{ position = (200 m, -1330 m) }}
  asset boat : lifeboat {{ position = (10 m, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat {{ observes boat.*, g.*, events }}
  {lines}
  success when now > 115 s
}}
"""


def text(*lines: str) -> str:
    return TEXT.format(lines="\n  ".join(lines))


def east(time_s: float) -> tuple[float, float, float]:
    """The boat leaves the neighbourhood of `g` from 24 s to 26 s and from 60 s on."""
    away = 24.0 <= time_s < 26.0 or time_s >= 60.0
    return (150.0 if away else 10.0, -1350.0, 0.0)


def times(*lines: str, moving: bool = True) -> dict[str, list[float]]:
    """The times at which each rule came true, and the ticks of marks of events as negative or positive seconds."""
    stage = Stage(places={"boat": east} if moving else {})
    with episode(text(*lines), seed=1, stage=stage) as run:
        run.wait(11)
        came = {event.kind: [event.time_s] for event in run.events}
        for published in run.all:
            for event in published.record.task_events:
                if event.name and event.kind in ("occurred", "undone"):
                    sign = 1.0 if event.kind == "occurred" else -1.0
                    came.setdefault(event.name, []).append(sign * event.time_s)
    return came


NEAR = "distance_xy(boat, g) <= 40 m"


def test_an_interruption_between_two_boundaries_restarts_the_duration_of_held() -> None:
    came = times(
        f"adjudicate early() {{ when held({NEAR}, 20 s) }}", f"adjudicate late() {{ when held({NEAR}, 24 s) }}"
    )
    assert came == {"early": [20.0], "late": [26.0 + 24.0]}


def test_held_with_a_duration_of_zero_is_true_at_time_zero() -> None:
    assert times(f"adjudicate at_once() {{ when held({NEAR}, 0 s) }}", moving=False) == {"at_once": [0.0]}
    assert times("adjudicate never() { when held(g.level > 2 m, 0 s) }", moving=False) == {}


def test_the_duration_of_held_is_counted_for_each_member() -> None:
    came = times("adjudicate close() { when exists t in h: held(distance_xy(boat, t) <= 60 m, 10 s) }")
    assert came == {"close": [70.0]}
    per = times("adjudicate stayed(b: boat) { when held(distance_xy(b, g) <= 40 m, 25 s) }")
    assert per == {"stayed": [51.0]}


def test_within_is_true_if_the_second_condition_follows_in_time() -> None:
    away, back = "distance_xy(boat, g) > 40 m", NEAR
    came = times(
        f"adjudicate soon() {{ when within({away}, {back}, 2 s) }}",
        f"adjudicate too_late() {{ when within({away}, {back}, 1 s) }}",
        f"adjudicate reverse() {{ when within({back}, {away}, 30 s) }}",
    )
    assert came == {"soon": [26.0], "reverse": [24.0]}


def test_before_is_true_if_the_first_condition_holds_first() -> None:
    came = times(
        "adjudicate never() { when before(now >= 30 s, distance_xy(boat, h) <= 60 m) }",
        "adjudicate first() { when before(distance_xy(boat, h) <= 60 m, now >= 30 s) }",
        "adjudicate alone() { when before(now >= 20 s, g.level > 5 m) }",
        "adjudicate same() { when before(now >= 30 s, now >= 29.5 s) }",
    )
    assert came == {"first": [24.0], "alone": [20.0]}


def test_count_counts_events_and_interactions() -> None:
    came = times(
        "event gust at 1 tick repeat every 30 s { weather { cloud = 1 } }",
        "adjudicate third() { when count(gust) >= 3 }",
        "unlock read(t: g) when true",
        "adjudicate done() { when count(read, g) == 1 and count(read) == 1 }",
        "adjudicate other() { when count(read, h) > 0 }",
        moving=False,
    )
    assert came["gust"] == [10.0, 40.0, 70.0, 100.0]
    assert came["third"] == [80.0]  # the rules of a boundary come before its events
    assert "other" not in came and len(came["done"]) == 1


HELD, WON = f"held({NEAR}, 24 s)", "success when now > 115 s"
PLACES = {
    "success": (f"success when {HELD}", "success", 5),
    "failure": (f"failure when {HELD}\n  {WON}", "failure", 5),
    "stage": (f"stage s {{ done when {HELD}, ticks <= 3 }}\n  {WON}", "late", 3),
    "constraint": (f"constraint hard c {{ always not {HELD} }}\n  {WON}", "constraint", 5),
}


@pytest.mark.parametrize("place", PLACES)
def test_held_is_evaluated_in_every_kind_of_condition(place: str) -> None:
    lines, reason, tick = PLACES[place]
    with episode(text().replace(WON, lines), seed=1, stage=Stage(places={"boat": east})) as run:
        run.wait(11)
        assert (run.published.evaluation.reason, run.published.record.tick) == (reason, tick)


def test_held_triggers_and_undoes_events() -> None:
    came = times(f"event calm when held({NEAR}, 24 s) until held(not ({NEAR}), 25 s) {{ weather {{ cloud = 0 }} }}")
    assert came == {"calm": [50.0, -90.0]}


def test_a_permit_with_held_accepts_commands_exactly_while_the_condition_has_held() -> None:
    permit = f"permit boat.moveTo when held({NEAR}, 15 s)"
    with episode(text(permit), seed=1, stage=Stage(places={"boat": east})) as run:
        for _ in range(6):
            run.do({"skipper": does("moveTo", x=10.0, y=-1350.0)})
        first = [published.record.receipts[0] for published in run.all[1:]]  # further ones are of interactions
    refused, accepted = ("rejected", "not_permitted"), ("accepted", "")
    assert [(receipt.status, receipt.reason) for receipt in first] == [
        refused, refused, accepted, refused, refused, accepted,
    ]  # fmt: skip


def test_the_memory_of_held_is_part_of_the_state_and_a_replay_agrees(tmp_path: Path) -> None:
    lines = (f"adjudicate stayed() {{ when held({NEAR}, 30 s) }}", "event e when count(read) > 0 { vanish h }")
    with episode(text(*lines), seed=1, stage=Stage(places={"boat": east})) as run:
        before = run.kernel.state
        run.wait(4)
        assert before.registry.memory != run.kernel.state.registry.memory
    played = play(text(*lines), tmp_path, policy=scripted({}), seed=1)
    assert run_command(["replay", str(played.path)]) == 0


def test_the_printer_writes_functions_over_time(tmp_path: Path) -> None:
    source = text(
        f"adjudicate a(t: g) {{ when held({NEAR} and t.level > 1 m, 30 s) and before(now > 3 s, count(read, t) > 1) }}",
        "event e at 3 tick { vanish h }",
        "adjudicate b() { when within(a(g), count(e) == 1, 2 min) }",
    )
    mission = compiled(source)
    file, printed = tmp_path / "tide.ljs", tmp_path / "printed.ljs"
    file.write_text(source, encoding="utf-8")
    assert run_command(["compile", str(file), "--emit", "ljs", "-o", str(printed)]) == 0
    assert compiled(printed).rules == mission.rules


WRONG = {
    "adjudicate r() { when held(now, 3 s) }": ("LJ0201", "condition"),
    "adjudicate r() { when held(now > 3 s, 3) }": ("LJ0202", ""),
    "adjudicate r() { when held(now > 3 s) }": ("LJ0306", "2 arguments"),
    "adjudicate r() { when count(reed) > 1 }": ("LJ0101", "reed"),
    "adjudicate r() { when count(read, boat) > 1 }": ("LJ0201", "no interaction"),
    "param p = held(now > 3 s, 3 s)": ("LJ0304", "while the mission runs"),
    "adjudicate held() { when now > 3 s }": ("LJ0104", "built-in"),
    "event read at 3 s { vanish h }\n  adjudicate r() { when count(read) > 1 }": ("LJ0104", "both an event"),
    "event e when count(e) > 0 { vanish h }": ("LJ0308", "e → e"),
    "event e when now > 3 s until count(e) > 0 { vanish h }": ("LJ0308", "e → e"),
    "event a when count(b) > 0 { vanish g }\n  event b when r() { vanish h }\n  adjudicate r() { when count(a) > 0 }": (
        "LJ0308", "a → b → a",
    ),
}  # fmt: skip


@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_use_of_a_function_over_time_has_one_error_with_the_reason(line: str) -> None:
    code, words = WRONG[line]
    errors = [item for item in compile_text(text(line)).diagnostics if item.severity == "error"]
    assert [item.code for item in errors] == [code], errors
    assert words in errors[0].message


WINNABLE = (
    "held(distance_xy(boat, g) <= 10 m, 20 s)",
    "within(now > 20 s, emitted(read, g), 60 s)",
    "before(now > 20 s, g.level > 5 m)",
    "count(e) >= 2 and not held(g.level > 3 m, 60 s)",
    "held(count(read, g) >= 1, 5 s)",
)


@pytest.mark.parametrize("success", WINNABLE)
def test_a_winnable_condition_over_time_has_a_goal_and_no_proof_of_infeasibility(success: str) -> None:
    lines = ("unlock read(t: g) when true", "event e when now > 10 s repeat every 20 s { change g.level to 2 m }")
    source = text(*lines).replace("success when now > 115 s", f"success when {success}")
    assert [item for item in compile_text(source).diagnostics if item.severity == "error"] == []
    assert not isinstance(goals(instantiate(source, seed=1)), OpenGoal)


@pytest.mark.parametrize(
    "success", ["held(g.level > 3 m, 5 s)", "before(g.level > 3 m, now > 5 s)", "within(now > 3 s, g.level > 3 m, 5 s)"]
)
def test_a_function_over_a_condition_that_never_holds_is_proved_impossible(success: str) -> None:
    source = text().replace("success when now > 115 s", f"success when {success}")
    assert "LJ0612" in [item.code for item in compile_text(source).diagnostics]
