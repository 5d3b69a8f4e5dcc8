"""The matrix of adversaries, the choice of the worst, the sequential test, and the command."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest

from lingjing.bench.adversaries import (
    FIRST_FRESH,
    PLAN,
    RATE,
    AdversaryRun,
    Look,
    Verdict,
    chosen,
    hours,
    make_salt,
    pass_probability,
    plan_of,
    read_matrix,
    result_lines,
    verdict_of,
)
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import PluginHost, compiled, run_command, shipped_missions
from tests.bench.suite_kit import (
    AnsweringExecutor,
    EpisodeTask,
    SuitePlan,
    SuiteRun,
    answered,
    made_row,
    open_results,
)

Capture = pytest.CaptureFixture[str]


def test_the_joint_error_of_all_looks_is_five_per_cent() -> None:
    assert 0.0499 < pass_probability(PLAN, RATE) <= 0.05
    earlier = (PLAN[0], Look(PLAN[1].played - 1, PLAN[1].wins))
    assert pass_probability(earlier, RATE) > 0.05, "the second look comes as early as the error allows"
    assert pass_probability((PLAN[0], Look(153, 3)), RATE) > 0.07, "two looks can be valid alone and not together"
    assert pass_probability(PLAN, 0.0) == 1.0


@pytest.mark.parametrize("look", [Look(59, 0), Look(153, 3)])
def test_one_look_has_the_error_of_the_binomial_distribution(look: Look) -> None:
    from scipy.stats import binom  # here: loading scipy.stats takes most of a second in each process of the tests

    for rate in (0.01, RATE, 0.2):
        assert pass_probability((look,), rate) == pytest.approx(binom.cdf(look.wins, look.played, rate))
    assert pass_probability((look,), RATE) < 0.05


def test_the_recursion_counts_every_path() -> None:
    """Against the sum over all sequences of a small plan."""
    plan, rate = (Look(3, 0), Look(6, 1)), 0.3
    total = 0.0
    for code in range(2**6):
        wins = [bool(code >> bit & 1) for bit in range(6)]
        if verdict_of(wins, plan) is Verdict.PASSED:
            total += rate ** sum(wins) * (1 - rate) ** (6 - sum(wins))
    assert pass_probability(plan, rate) == pytest.approx(total)


@pytest.mark.parametrize(
    ("wins", "verdict"),
    [
        ([], Verdict.OPEN),
        ([False] * 58, Verdict.OPEN),
        ([False] * 59, Verdict.PASSED),
        ([True] + [False] * 58, Verdict.OPEN),
        ([True] + [False] * 230, Verdict.PASSED),
        ([True] * 3 + [False] * 228, Verdict.PASSED),
        ([True] * 4, Verdict.FAILED),
        ([False] * 30 + [True] * 4, Verdict.FAILED),
        ([True] * 3 + [False] * 227 + [True], Verdict.FAILED),
        ([False] * 59 + [True] * 4, Verdict.PASSED),
    ],
)
def test_a_column_passes_at_a_look_and_fails_with_the_fourth_win(wins: list[bool], verdict: Verdict) -> None:
    assert verdict_of(wins) is verdict


@pytest.fixture(scope="module")
def plan() -> SuitePlan:
    return plan_of(read_matrix(), PluginHost(), "no")


def test_the_matrix_covers_every_column_and_its_classes_exist(plan: SuitePlan) -> None:
    matrix = read_matrix()
    assert len(matrix.adversaries) == 14
    pairs = {(cell.player.name, cell.column_name) for cell in plan.cells}
    assert pairs == {(each.name, column) for each in matrix.adversaries for column in each.columns}
    missions = [compiled(path) for path in shipped_missions() if path.stem != "queue"]
    known = {f"{mission.name}-{mode}" for mission in missions for mode in mission.modes.allowed}
    assert {column for _, column in pairs} == known == set(matrix.seconds)
    assert all(cell.column.tier == 1 and not cell.player.privileged for cell in plan.cells)
    assert {cell.player.name for cell in plan.cells if cell.player.blank_pictures} == {
        "blind", "flooder", "event-reader", "clock-reader",
    }  # fmt: skip
    assert all(cell.player.foreign for cell in plan.cells), "adversaries run behind walls like any entrant"


def test_hours_grow_with_looks_and_fall_with_jobs() -> None:
    first, least, most = hours(read_matrix(), PLAN, 3, 1)
    assert 0 < first < least < most
    assert hours(read_matrix(), PLAN, 3, 2) == (first / 2, least / 2, most / 2)


SMALL_PLAN = (Look(3, 0), Look(8, 1))
"""A plan that is quick to play; its error does not matter here."""

RunOf = Callable[..., AdversaryRun]


@pytest.fixture
def run_of(plan: SuitePlan, tmp_path: Path) -> Iterator[RunOf]:
    """Makes a run of two adversaries in one column; `wins` decides an episode by adversary and public seed."""
    part = [cell for cell in plan.cells if cell.column_name == "upr-star"]
    cells = [cell for cell in part if cell.player.name in ("blind", "flooder")]
    with open_results(tmp_path / "out") as results:

        def made(wins: Callable[[str, int], bool]) -> AdversaryRun:
            def answer(task: EpisodeTask) -> object:
                won = wins(task.options.policy.rpartition(":")[2], task.options.seed)
                return answered(task, success=won, scr=1.0 if won else 0.1)

            executor = AnsweringExecutor(answer)
            run = SuiteRun(plan, results, "c", executor, salt=str(make_salt(results.folder)))
            return AdversaryRun(run, cells, range(2), SMALL_PLAN)

        yield made


def seeds_of(run: AdversaryRun) -> list[tuple[str, int]]:
    return [(task.options.policy.rpartition(":")[2], task.options.seed) for task in run.run.executor.tasks]


def test_the_worst_adversary_is_chosen_on_public_seeds_and_tested_on_fresh_seeds(run_of: RunOf) -> None:
    run = run_of(lambda name, seed: name == "Flooder" and seed == 0)
    run.select()
    assert (run.worst("upr-star") or run.cells[0]).player.name == "flooder"
    run.test()
    played = seeds_of(run)
    assert [seed for name, seed in played if name == "Flooder"] == [0, 1, *range(FIRST_FRESH, FIRST_FRESH + 3)]
    assert [seed for name, seed in played if name == "Blind"] == [0, 1]
    (result,) = run.results()
    assert (result.verdict, result.won, result.played) == (Verdict.PASSED, 0, 3)
    assert result.selection == (("blind", 0, 2), ("flooder", 1, 2))
    assert "| upr-star | flooder | 0 of 3 | passed | blind 0/2, flooder 1/2 |" in result_lines([result])


def test_a_run_stops_when_the_column_has_failed_and_continues_after_an_interrupt(run_of: RunOf) -> None:
    def wins(name: str, seed: int) -> bool:
        if seed == FIRST_FRESH + 2 and pauses:
            pauses.clear()
            raise KeyboardInterrupt
        return name == "Flooder" and seed != FIRST_FRESH + 1

    pauses = ["before the third fresh seed"]
    run = run_of(wins)
    run.select()
    with pytest.raises(KeyboardInterrupt):
        run.test()
    assert run.results()[0].verdict is Verdict.OPEN
    again = run_of(wins)
    again.select()
    again.test()
    assert seeds_of(again) == [("Flooder", FIRST_FRESH + 2)], (
        "nothing is played twice, and nothing after the fourth win"
    )
    assert (again.results()[0].won, again.results()[0].verdict) == (2, Verdict.FAILED)


def test_the_estimate_counts_the_choice_and_the_way_to_the_next_look(run_of: RunOf) -> None:
    run = run_of(lambda name, seed: False)
    assert len(run.left()) == 4 + SMALL_PLAN[0].played
    assert run.left_s() == 7 * 60.0, "the usual seconds of a column without rows"
    run.select()
    assert len(run.left()) == 3
    run.test()
    assert (run.left(), run.left_s()) == ([], 0.0)


def test_after_a_win_the_way_leads_to_the_last_look(run_of: RunOf) -> None:
    run = run_of(lambda name, seed: seed == FIRST_FRESH)
    run.select()
    run.run.play(run.run.due([FIRST_FRESH], [run.worst("upr-star") or run.cells[0]]))
    assert len(run.left()) == 2, "the first look is at three episodes"
    run.run.play(run.run.due(range(FIRST_FRESH, FIRST_FRESH + 3), [run.worst("upr-star") or run.cells[0]]))
    assert len(run.left()) == 5, "the last one is at eight"


def test_a_lost_episode_counts_as_a_win_of_the_adversary(run_of: RunOf) -> None:
    run = run_of(lambda name, seed: False)
    run.select()
    run.test()
    rows = run.run.results.rows
    fresh = next(row for row in rows if row.report.seed == FIRST_FRESH)
    run.run.results.replace(msgspec.structs.replace(fresh, standing="lost"))
    assert (run.results()[0].won, run.results()[0].verdict) == (1, Verdict.OPEN)


def test_the_salt_file_is_private_and_keeps_its_content(tmp_path: Path) -> None:
    file = make_salt(tmp_path)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    before = file.read_text()
    assert make_salt(tmp_path).read_text() == before and len(before) == 65
    with pytest.raises(UsageError, match="cannot write"):
        make_salt(tmp_path / "absent")


def test_a_missing_salt_that_has_drawn_rows_is_not_replaced(tmp_path: Path) -> None:
    public, sealed = made_row(), msgspec.structs.replace(made_row(), split_sha256="ab" * 32)
    assert make_salt(tmp_path, [public]).exists()
    make_salt(tmp_path).unlink()
    with pytest.raises(UsageError, match="is missing: it has drawn 2 rows there"):
        make_salt(tmp_path, [public, sealed, sealed])
    assert list(tmp_path.iterdir()) == []


def test_unknown_names_and_empty_selections_are_usage_errors() -> None:
    with pytest.raises(UsageError, match="--columns upr: the matrix has no such name") as error:
        chosen(read_matrix(), ["upr"], [])
    assert "upr-star" in str(error.value.hint)
    part = chosen(read_matrix(), ["cd-star", "cr-star"], ["deaf", "blind"])
    assert [(each.name, each.columns) for each in part.adversaries] == [
        ("blind", ("cr-star",)), ("deaf", ("cd-star", "cr-star")),
    ]  # fmt: skip
    with pytest.raises(UsageError, match="no chosen adversary is plausible in a chosen column"):
        chosen(read_matrix(), ["bi-single"], ["deaf"])


def test_errors_of_a_matrix_are_reported(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text('suite = 1\nname = "m"\n[[adversaries]]\nname = "a"\npolicy = "a.b"\ncolumns = []\nguard = "g"\n')
    with pytest.raises(UsageError, match=r"adversaries\.0\.policy: .*adversaries\.0\.columns: "):
        read_matrix(file)
    file.write_text(
        'suite = 1\nname = "m"\n[[adversaries]]\nname = "a"\npolicy = "a.b:C"\ncolumns = ["bi-single"]\nguard = "g"\n'
    )
    with pytest.raises(UsageError, match=r"the module of the policy `a\.b:C` is not installed"):
        plan_of(read_matrix(file), PluginHost(), "no")


def test_the_command_prints_pairs_and_hours_and_plays_nothing(capsys: Capture) -> None:
    assert run_command(["bench", "adversaries", "--columns", "cd-star", "--check"]) == ExitCode.OK
    printed = capsys.readouterr().err
    assert "5 pairs in 1 column" in printed and "59 to 231 fresh seeds a column" in printed
    assert run_command(["bench", "adversaries", "--quick", "--select", "2"]) == ExitCode.USAGE


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        (("--columns", "bi"), "did you mean bi-single?"),
        (("--columns", "cd"), "did you mean cd-star or cd-broadcast?"),
        (("--select", "1001"), "choose fewer seeds"),
        (("-o", __file__), "choose another folder with -o"),
    ],
)
def test_a_wrong_option_is_refused_before_the_size_is_printed(
    options: tuple[str, ...], hint: str, capsys: Capture
) -> None:
    assert run_command(["bench", "adversaries", "--check", *options]) == ExitCode.USAGE
    printed = capsys.readouterr().err
    assert hint in printed and "pairs" not in printed


@pytest.mark.parametrize(
    ("options", "won", "code"),
    [(["--quick"], False, ExitCode.UNDECIDED), ([], True, ExitCode.MISSION), ([], False, ExitCode.OK)],
)
def test_the_exit_code_depends_on_the_verdict(
    options: list[str], won: bool, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    executor = AnsweringExecutor(lambda task: answered(task, success=won, scr=1.0 if won else 0.0))
    monkeypatch.setattr("lingjing.bench.executors.LocalExecutor", lambda jobs: executor)
    line = ["bench", "adversaries", "-o", str(tmp_path / "o"), "--columns", "upr-star", "--adversaries", "blind"]
    assert run_command([*line, *options]) == code
    shown = capsys.readouterr()
    assert "| upr-star | blind |" in shown.out
    assert (tmp_path / "o" / "adversaries.md").read_text() in shown.out
    assert all(task.options.isolate == "yes" and task.options.salt for task in executor.tasks)
    assert not options or "undecided" in shown.out
