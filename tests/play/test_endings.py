"""The reason for the end of an episode is in its outcome, its result and the printed summary."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing import PlayOptions
from lingjing import read as read_trace
from lingjing.cli.progress import LiveProgress
from lingjing.cli.scorecard import plain, scorecard
from lingjing.kernel.episode import LOST_AT_START, WON_AT_START
from lingjing.play.parallel import play_here
from lingjing.testing import compile_text

MISSION = """\
ljs 1
use std.sea { lifeboat }
target raft {
  engine = city
  state people = 4 kg
}
mission raft "A raft" {
  goal "Wait."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 2 }
  target a : raft { position = (60 m, -900 m) }
  asset boat : lifeboat { position = (0 m, -900 m) }
  agent skipper as skipper controls boat { observes boat.* }
  success when a.people <= MOST
}
"""


def test_only_a_success_at_the_start_causes_a_warning(tmp_path: Path) -> None:
    for most, reason, ticks, expected in (("4 kg", "success", 0, (WON_AT_START,)), ("0 kg", "budget", 2, ())):
        mission = compile_text(MISSION.replace("MOST", most)).mission
        assert mission is not None
        folder = tmp_path / most
        result = lingjing.run(mission, policy="random", out=folder, world="inline", overview=False)
        assert (result.reason, result.ticks) == (reason, ticks)
        assert tuple(line for line in result.warnings if line == WON_AT_START) == expected
        outcome = read_trace(result.trace).outcome
        assert outcome is not None and outcome.detail == "".join(expected)


@pytest.mark.parametrize(
    ("rule", "reason", "detail"),
    [
        (
            "stage early { done when now < 0 s, ticks <= 1 }",
            "late",
            "the stage `early` was not done in the 1 tick it had (from tick 0 to tick 1)",
        ),
        (
            "constraint hard dry { always not boat.status == idle }",
            "constraint",
            "the constraint `dry` was broken at 0 s",
        ),
        ("failure when now > 0 s", "failure", ""),
        ("failure when boat.status == idle", "failure", LOST_AT_START),
        ("", "budget", ""),
    ],
)
def test_each_cause_of_an_end_has_its_own_reason(tmp_path: Path, rule: str, reason: str, detail: str) -> None:
    """In the trace, in the row that a study keeps, and in the summary, on a terminal and in a pipe."""
    file = tmp_path / "raft.ljs"
    file.write_text(MISSION.replace("  success when", f"  {rule}\n  success when").replace("MOST", "0 kg"))
    options = PlayOptions(mission=str(file), policy="random", world="inline", overview=False)
    (report,) = play_here(options, [(0, tmp_path / "run")], LiveProgress)
    assert (report.reason, report.detail, report.success) == (reason, detail, False)
    trace = read_trace(Path(report.trace))
    assert trace.outcome is not None and trace.complete
    assert (trace.outcome.reason, trace.outcome.detail) == (reason, detail)
    shown = {"failure": "the mission's failure condition holds", "budget": "the budget of ticks ran out"}
    assert dict(dict(scorecard(report))["Outcome"])["success"] == f"no: {detail or shown[reason]}"
    piped = dict(dict(plain(report))["outcome"])
    assert (piped["success"], piped["detail"]) == (f"no ({reason})", detail or "N/A")
