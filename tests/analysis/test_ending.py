"""The explanation of an episode's end: unmet parts of success with values, the cause, and earlier troubles."""

import math
from pathlib import Path

import msgspec
import pytest

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.analysis.clauses import condition_text, unmet_parts
from lingjing.analysis.ending import why
from lingjing.analysis.registries import registries
from lingjing.testing import mission_file, play, run_command, sea_rescue, shortened
from lingjing.testing.expressions import Attr, Binary, Call, Number, Quantified, Ref
from lingjing.trace.records import BoundaryRecord, Decision, DecisionRecord, Outcome

replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Thirty ticks of the sea rescue, in which the boat has reached one of three targets."""
    path = tmp_path_factory.mktemp("lost") / "trace.mcap"
    sea_rescue.write_episode(path, ticks=30, width=32, height=18)
    return read_trace(path)


def distances(trace: Trace, first: str, second: str) -> list[float]:
    values = []
    for record in trace.boundaries:
        at = {state.id: state.position for state in record.snapshots[-1].states}
        values.append(math.dist(at[first][:2], at[second][:2]))
    return values


def with_(trace: Trace, records: tuple[BoundaryRecord, ...] | None = None, outcome: Outcome | None = None) -> Trace:
    return Trace(trace.path, trace.header, records or trace.boundaries, outcome, False, trace.places)


def test_unmet_clauses_are_listed_with_their_last_and_nearest_values(lost: Trace) -> None:
    ending = why(lost)
    assert ending.episode == "ssr broadcast seed 7, heuristic: tick 30 of 60 (300 s), score 0.33, SCR 0.33"
    apart = distances(lost, "boat", "victim[1]")
    least = min(apart)
    measured = f"{apart[-1]:.4g} (least {least:.4g} at tick {apart.index(least)})"
    assert ending.lacking[0] == "rescued(victim[1]): never came true"
    assert ending.lacking[1] == f"  distance_xy(boat, victim[1]) <= 50 m: distance_xy(boat, victim[1]) = {measured}"
    assert ending.lacking[2] == "rescued(victim[2]): never came true"
    assert ending.lacking[-1] == "1 other part of it held"


def test_the_progress_of_each_target_is_listed(lost: Trace) -> None:
    first, _, done = why(lost).targets
    pictures = [frame for frame in lost.frames.values() if any(box.entity == "victim[1]" for box in frame.boxes)]
    assert first.startswith(f"victim[1]: in {len(pictures)} of {len(lost.frames)} pictures, first {pictures[0].id}, ")
    assert first.endswith("first matched at tick 9; detect at 9, locate at 9, handoff at 29, execute never")
    assert done == "completed: victim[3] at tick 29"


def test_refusals_and_substitutions_are_counted_and_the_first_is_named(lost: Trace) -> None:
    troubles = why(lost).troubles
    assert troubles[0] == "scout[2]: 1 refused (conflict), first setDestination at tick 12"
    crash = DecisionRecord(agent="scout[1]", decision=Decision(), substituted="policy_error", detail="KeyError: 'x'")
    records = tuple(
        replace(
            record,
            decisions=tuple(
                crash if entry.agent == "scout[1]" and record.tick > 20 else entry for entry in record.decisions
            ),
        )
        for record in lost.boundaries
    )
    troubles = why(with_(lost, records, lost.outcome)).troubles
    assert troubles[0] == "scout[1]: 10 of 30 answers replaced (policy_error), first at tick 20: KeyError: 'x'"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"reason": "budget"}, "the mission's ticks ran out: 60 ticks, and no stage's own bound was passed before"),
        ({"reason": "late", "detail": "the stage `a` …"}, "a stage used up its own ticks: the stage `a` …"),
        ({"reason": "infrastructure-abort", "detail": "camera died", "hint": "restart"}, "camera died (hint: restart)"),
        ({"reason": "interrupted"}, "interrupted from outside"),
        ({"reason": "error"}, "an error of a program"),
    ],
)
def test_the_cause_distinguishes_a_stages_deadline_from_the_budget(
    lost: Trace, changes: dict[str, object], words: str
) -> None:
    assert lost.outcome is not None
    ending = why(with_(lost, outcome=replace(lost.outcome, **changes)))  # type: ignore[arg-type]
    assert words in ending.cause


def test_a_killed_episode_and_one_without_a_boundary_are_explained(lost: Trace) -> None:
    ending = why(with_(lost, lost.boundaries[:10]))
    assert "no outcome" in ending.cause and "tick 9 of 60" in ending.episode and ending.lacking
    ending = why(Trace(lost.path, lost.header, (), None, False))
    assert "no boundary" in ending.episode and ending.lacking == ending.targets == ending.troubles == ()


def test_a_won_episode_has_no_unmet_parts(lost: Trace) -> None:
    assert lost.outcome is not None
    ending = why(with_(lost, outcome=replace(lost.outcome, reason="success", success=True)))
    assert ending.lacking == () and "every part" in ending.cause


def test_an_unmet_exists_descends_to_its_closest_candidate(lost: Trace) -> None:
    history = list(registries(lost))
    kind = lost.header.instance.messages[0].kind
    assert kind == "detection"
    near = Binary("<=", Call("distance_xy", (Ref("boat", "entity"), Ref("v", "local"))), Number(1.0, "m"))
    condition = Quantified("exists", "v", "victim", near)
    (unmet,) = unmet_parts(condition, history)
    assert (unmet.text, unmet.had) == ("exists v: distance_xy(boat, v) <= 1 m", "none of 3")
    without_candidates = Quantified("exists", "r", "detection", near)
    parts = list(unmet_parts(without_candidates, history[:1]))
    assert [part.had for part in parts] == ["there was no detection"]
    victim = next(entity for entity in lost.header.instance.entities if entity.id == "victim[2]")
    assert condition_text(near, {"v": victim}) == "distance_xy(boat, victim[2]) <= 1 m"


def test_only_variables_are_replaced_and_in_one_pass(lost: Trace) -> None:
    """The value of a variable may contain the name of another one, and a field may have the name of a variable."""
    boat, victim = (
        next(entity for entity in lost.header.instance.entities if entity.id == name) for name in ("boat", "victim[2]")
    )
    same = Binary("==", Attr(Ref("v", "local"), "victim"), Ref("victim", "local"))
    assert condition_text(same, {"v": victim, "victim": boat}) == "victim[2].victim == boat"


def test_the_closest_candidate_belongs_to_the_target(lost: Trace) -> None:
    """The boat is at victim[3]. The unmet part for victim[1] is the distance of the boat, not the identity."""
    joint = Binary("<=", Call("distance_xy", (Ref("v", "local"), Ref("w", "local"))), Number(1.0, "m"))
    near = Binary("<=", Call("distance_xy", (Ref("boat", "entity"), Ref("v", "local"))), Number(60.0, "m"))
    condition = Quantified("exists", "v", "victim", Binary("and", joint, near))
    victim = next(entity for entity in lost.header.instance.entities if entity.id == "victim[1]")
    _, lack = unmet_parts(condition, list(registries(lost)), {"w": victim})
    assert lack.text == "distance_xy(boat, victim[1]) <= 60 m"


def test_the_text_of_a_policy_stays_on_one_line(lost: Trace) -> None:
    forged = DecisionRecord(agent="skipper", decision=Decision(), substituted="policy_error", detail="x\nended by: won")
    records = (*lost.boundaries[:-1], replace(lost.boundaries[-1], decisions=(forged,)))
    assert lost.outcome is not None
    outcome = replace(lost.outcome, reason="error", detail="bad\r\nunmet parts of success:\x85nothing")
    lines = why(with_(lost, records, outcome)).text.splitlines()
    assert [line for line in lines if line.startswith("ended by")] == [lines[1]]
    assert "unmet parts of success:" in lines[1] and "nothing" in lines[1]


def test_the_command_why_prints_at_most_24_lines(lost: Trace, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["why", str(lost.path)]) == 0
    out = capsys.readouterr().out.splitlines()
    assert len(out) <= 24 and out[1].startswith("ended by: ") and "unmet parts of success:" in out
    assert run_command(["why", "--output-format", "json", str(lost.path)]) == 0
    assert '"cause"' in capsys.readouterr().out
    assert run_command(["why", str(Path("nothing.mcap"))]) == 2


def test_the_command_why_accepts_the_folder_of_a_run(
    lost: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["why", str(tmp_path)]) == 2
    capsys.readouterr()
    for name in ("trace.mcap.part", "trace.mcap"):
        (tmp_path / name).symlink_to(lost.path)
        assert run_command(["why", str(tmp_path)]) == 0
        assert "ended by: " in capsys.readouterr().out


@pytest.mark.slow
def test_lines_of_sight_are_recomputed_from_a_trace(tmp_path: Path) -> None:
    """The registry rebuilds the city. Without a city, a line of sight has no value and the events would differ."""
    mission = shortened(mission_file("ssr").parent / "examples" / "overwatch.ljs", 9)
    trace = play(mission, tmp_path, policy="oracle").trace
    assert any(event.kind == "covered" for boundary in trace.boundaries for event in boundary.events)
    assert all(boundary.faithful for boundary in registries(trace))


TIDE = """ljs 2
use std.sea { lifeboat }

mission tide "Tide" {
  goal "Wait."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 8 }
  asset boat : lifeboat { position = (10 m, -1350 m), heading = 30 deg }
  agent skipper as rescuer controls boat { observes boat.*, events }
  event gale when now > 15 s until now > 35 s repeat every 20 s { weather { wind = 15 m/s from 220 deg } }
  adjudicate calm() { when held(count(gale) >= 1 and now < 900 s, 20 s) and before(now >= 0 s, now >= 40 s) }
  success when now > 75 s and count(gale) == 2
}
"""


def test_rebuilt_registries_have_the_events_and_the_memory_of_the_episode(tmp_path: Path) -> None:
    played = play(TIDE, tmp_path, policy="random", seed=1)
    rebuilt = list(registries(played.trace))
    assert all(boundary.faithful for boundary in rebuilt)
    assert [(item.tick, item.undone) for item in rebuilt[-1].registry.occurrences] == [(2, 4), (6, 7)]
    assert len(rebuilt[-1].registry.memory) == 2
    assert played.report.success and [event.kind for event in played.events] == ["calm"]
