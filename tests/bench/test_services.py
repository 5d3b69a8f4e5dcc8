"""A suite waits for a service that is down, goes on with other entrants, and plays lost episodes again on request."""

from __future__ import annotations

import collections
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from lingjing import EpisodeReport
from lingjing.bench.services import EntrantServices, probe_entrant
from lingjing.errors import ExitCode, InfrastructureError
from lingjing.play.outages import SERVICE_GONE
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import (
    SMALL,
    AnsweringExecutor,
    EpisodeTask,
    SuiteCell,
    SuitePlan,
    SuiteRun,
    answered,
    open_results,
    read_plan,
    read_results,
)
from tests.play.report_kit import ABORTED

GONE = f"{SERVICE_GONE}the harness gets no answer for `a` either: connection refused"


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> SuitePlan:
    file = tmp_path_factory.mktemp("suite") / "small.toml"
    file.write_text(SMALL)
    return read_plan(file, PluginHost())


@dataclass
class World:
    """A service of the entrant `oracle` that is down until a time, and a clock that only `sleep` advances."""

    up_at_s: float
    now_s: float = 0.0
    lines: list[str] = field(default_factory=list)
    probes: list[tuple[float, str]] = field(default_factory=list)

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds

    def probe(self, cell: SuiteCell) -> str:
        self.probes.append((self.now_s, cell.player.name))
        return "" if self.now_s >= self.up_at_s else "connection refused"

    def answer(self, task: EpisodeTask) -> EpisodeReport:
        if task.options.policy == "oracle" and self.now_s < self.up_at_s:
            return answered(task, success=False, reason=ABORTED, detail=GONE, metrics=None)
        return answered(task)

    def services(self, longest_wait_s: float = 3600.0) -> EntrantServices:
        return EntrantServices(self.probe, longest_wait_s, self.lines.append, self.sleep)


def play(plan: SuitePlan, folder: Path, world: World, *, retry: bool = False, **how: float) -> AnsweringExecutor:
    executor = AnsweringExecutor(world.answer)
    with open_results(folder) as results:
        run = SuiteRun(plan, results, "code", executor, services=world.services(**how))
        if retry:
            run.retry_lost()
        run.play(run.due((0, 1), plan.cells))
        results.compact()
    return executor


def test_an_outage_costs_one_try_and_other_entrants_continue(plan: SuitePlan, tmp_path: Path) -> None:
    world = World(up_at_s=100.0)
    executor = play(plan, tmp_path / "a", world)
    rows = read_results(tmp_path / "a")
    aborted = [row for row in rows if row.standing == "aborted"]
    assert len(aborted) == 1, "the episodes behind it wait instead of being tried"
    counted = collections.Counter(row.entrant for row in rows if row.standing == "counted")
    assert counted == {"oracle": 6, "random": 6}
    first = [task.options.policy for task in executor.tasks[:7]]
    assert first == ["oracle", *["random"] * 6], "other entrants are played meanwhile"
    assert [moment for moment, _ in world.probes] == [15.0, 45.0, 105.0], "the pauses double"
    assert world.lines[0] == "waiting 15 s for the service of oracle; 6 episodes are left"
    assert world.lines[-1] == "the service of oracle answers again"


def test_a_suite_stops_at_the_wait_limit_and_the_same_command_continues(plan: SuitePlan, tmp_path: Path) -> None:
    world = World(up_at_s=10_000.0)
    with pytest.raises(InfrastructureError, match=r"no service answered for 2 min, and 6 episodes are left") as raised:
        play(plan, tmp_path / "a", world, longest_wait_s=120.0)
    assert "oracle: connection refused" in str(raised.value) and world.now_s == 120.0
    world.now_s = 10_000.0
    play(plan, tmp_path / "a", world)
    assert collections.Counter(row.standing for row in read_results(tmp_path / "a")) == {"counted": 12, "aborted": 1}


def test_without_waiting_an_episode_is_lost_after_three_aborts_and_a_retry_plays_it_again(
    plan: SuitePlan, tmp_path: Path
) -> None:
    world = World(up_at_s=1.0)
    play(plan, tmp_path / "a", world, longest_wait_s=0.0)
    rows = read_results(tmp_path / "a")
    assert collections.Counter(row.standing for row in rows) == {"counted": 6, "aborted": 12, "lost": 6}
    play(plan, tmp_path / "a", world, retry=True, longest_wait_s=0.0)
    standings = collections.Counter(row.standing for row in read_results(tmp_path / "a"))
    assert standings == {"counted": 6, "aborted": 30, "lost": 6}, "three further tries of each"
    world.now_s = 1.0
    play(plan, tmp_path / "a", world, retry=True)
    rows = read_results(tmp_path / "a")
    assert collections.Counter(row.standing for row in rows) == {"counted": 12, "aborted": 36}
    assert {row.tries for row in rows if row.entrant == "oracle" and row.standing == "counted"} == {7}


def test_a_service_is_checked_by_the_probe_of_its_policy(tmp_path: Path) -> None:
    file = tmp_path / "paid.toml"
    args = '{ model = "mine", base_url = "http://127.0.0.1:9/v1" }'
    file.write_text(SMALL.replace('policy = "oracle"', f'policy = "react"\nargs = {args}'))
    cells = read_plan(file, PluginHost()).cells
    assert "127.0.0.1:9" in probe_entrant(cells[0]), "nothing listens there"
    other = next(cell for cell in cells if cell.player.name == "random")
    assert probe_entrant(other) == ""


def test_a_negative_wait_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["bench", "reference", "--wait", "-1", "--check"]) == ExitCode.USAGE
    assert "--wait -1: must be a number of minutes, 0 or more" in capsys.readouterr().err
