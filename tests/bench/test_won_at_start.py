"""An episode that is won before anybody acts says so: in its outcome, and to whoever reads the result."""

from __future__ import annotations

from pathlib import Path

import lingjing
from lingjing.dsl import compile_text
from lingjing.kernel.episode import WON_AT_START
from lingjing.trace.reader import read_trace

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


def test_a_success_at_the_start_is_said_and_one_that_never_holds_is_none(tmp_path: Path) -> None:
    for most, reason, ticks, said in (("4 kg", "success", 0, (WON_AT_START,)), ("0 kg", "budget", 2, ())):
        mission = compile_text(MISSION.replace("MOST", most)).mission
        assert mission is not None
        folder = tmp_path / most
        result = lingjing.run(mission, policy="random", out=folder, world="inline", overview=False)
        assert (result.reason, result.ticks) == (reason, ticks)
        assert tuple(line for line in result.warnings if line == WON_AT_START) == said
        outcome = read_trace(result.trace).outcome
        assert outcome is not None and outcome.detail == "".join(said)
