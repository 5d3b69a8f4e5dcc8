"""Synthetic suites and rows, an executor that answers at once, and the readers of plans and results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from lingjing import EpisodeReport, PlayOptions
from lingjing.bench.evidence import AuditRecord, audit_file, audit_marks, read_audit, row_faults, row_sha256
from lingjing.bench.folder import RESULTS, ResultsFolder, open_results, read_results
from lingjing.bench.leaderboard import OPEN, leaderboard, ranking
from lingjing.bench.money import estimates
from lingjing.bench.parquet import encode_rows, read_rows
from lingjing.bench.planning import SuiteCell, SuitePlan, read_plan
from lingjing.bench.rows import SuiteRow, code_sha256
from lingjing.bench.running import Shard, SuiteEpisode, SuiteRun
from lingjing.bench.suite import find_suite, shipped_suites
from lingjing.bench.tables import TABLES, make_tables
from lingjing.play.options import without_places
from lingjing.play.parallel import EpisodeTask
from tests.play.report_kit import ABORTED, blank_metrics, made_report

__all__ = [
    "OPEN", "RESULTS", "SMALL", "TABLES", "TRIP", "AnsweringExecutor", "AuditRecord", "EpisodeTask", "ResultsFolder",
    "Shard", "SuiteCell", "SuiteEpisode", "SuitePlan", "SuiteRow", "SuiteRun", "answered", "audit_file", "audit_marks",
    "code_sha256", "encode_rows", "estimates", "find_suite", "leaderboard", "made_row", "make_tables", "open_results",
    "ranking", "read_audit", "read_plan", "read_results", "read_rows", "row_faults", "row_sha256", "shipped_suites",
    "without_places",
]  # fmt: skip

SMALL = """
suite = 1
name = "small"
title = "A small suite"
missions = ["bi", "cd"]
seeds = 2
tables = ["success", "modes"]

[[entrants]]
policy = "oracle"

[[entrants]]
policy = "random"
"""


TRIP = """\
ljs 1
use std.sea { lifeboat, person_in_water }
mission trip "A short trip" {
  goal "Bring the boat to the swimmer."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 3, policy <= 8 s, engine <= 600 s }
  asset boat : lifeboat { position = (12.4 m, -1351.8 m), heading = 30 deg, actions { moveTo } }
  target swimmer : person_in_water { position = (12.4 m, -1299.8 m) }
  agent skipper as rescuer controls boat { observes boat.*, swimmer.position, events }
  adjudicate reached(s: swimmer) { when distance_xy(boat, s) <= 51.5 m }
  stage reach per s in swimmer { done when reached(s) }
  success when forall s in swimmer: reached(s)
}
"""
"""One boat without a camera; it wins in three ticks if it sails to the swimmer."""


def made_row(*, success: bool = True, scr: float | None = None, **changes: object) -> SuiteRow:
    """Return a counted row of `ssr` in star mode with these changes; `metrics` and `perceived` belong to its report."""
    metrics, perceived = changes.pop("metrics", {}), changes.pop("perceived", None)
    ended = {} if changes.get("standing", "counted") == "counted" else {"reason": ABORTED}
    report = changes.pop("report", None) or made_report(
        seed=changes.get("seed", 0), success=success, scr=(1.0 if success else 0.5) if scr is None else scr,
        metrics=blank_metrics(**metrics) if isinstance(metrics, dict) else metrics, perceived=perceived, **ended,
    )  # fmt: skip
    plain = {"suite": "small", "entrant": "e", "mission": "ssr", "mode": "star", "seed": 0, "policy": "p", "code": "c",
             "options": PlayOptions(mission="ssr", policy="p"), "report": report}  # fmt: skip
    return SuiteRow(**{**plain, **changes})  # type: ignore[arg-type]


def answered(task: EpisodeTask, **changes: object) -> EpisodeReport:
    """The report of a task that was not played."""
    options = task.options
    plain = {"mission": Path(options.mission).stem, "seed": options.seed, "mode": options.mode,
             "policy": options.policy, "policy_seed": options.policy_seed,
             "trace": str(task.folder / "trace.mcap")}  # fmt: skip
    return made_report(**{**plain, **changes})


@dataclass
class AnsweringExecutor:
    """An executor that returns `answer` of each task without playing it; `tasks` are the received ones."""

    answer: Callable[[EpisodeTask], EpisodeReport] = answered
    jobs: int = 1
    tasks: list[EpisodeTask] = field(default_factory=list)

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        for task in tasks:
            self.tasks.append(task)
            task.folder.mkdir(parents=True)
            (task.folder / "trace.mcap.part").touch()
            yield task, self.answer(task)
