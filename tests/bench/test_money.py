"""A paid suite: its estimate, its limit before it starts, and the limit while it is played."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import pytest

from lingjing import EpisodeReport, PlayOptions
from lingjing.bench.money import CostEstimate, is_paid, prices_of
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import (
    SMALL,
    TRIP,
    AnsweringExecutor,
    EpisodeTask,
    SuiteEpisode,
    SuitePlan,
    SuiteRow,
    SuiteRun,
    answered,
    estimates,
    made_row,
    open_results,
    read_plan,
    read_results,
)  # fmt: skip
from tests.play.report_kit import ABORTED, blank_metrics

PAID = SMALL.replace('policy = "oracle"', 'model = "gpt-5.5"').replace('["bi", "cd"]', '["bi"]')


@pytest.fixture
def suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for key in ("OPENAI_API_KEY", "OWN_KEY"):
        monkeypatch.delenv(key, raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "none"))  # the user's own list of models must not count
    file = tmp_path / "paid.toml"
    file.write_text(PAID)
    return file


def plan_of(file: Path) -> SuitePlan:
    return read_plan(file, PluginHost())


def estimated(file: Path, seeds: Iterable[int] = (0,), rows: Sequence[SuiteRow] = ()) -> list[CostEstimate]:
    plan = plan_of(file)
    episodes = [SuiteEpisode(cell, seed) for seed in seeds for cell in plan.cells]
    return estimates(episodes, plan.missions, rows, PluginHost())


def test_the_bound_counts_every_decision_with_the_repairs_of_the_options(suite: Path) -> None:
    (estimate,) = estimated(suite, range(10))
    assert (estimate.entrant, estimate.episodes) == ("GPT-5.5", 10)
    assert estimate.most.calls == 10 * 60 * 2  # one agent, 60 ticks, one repair: react's default
    model = plan_of(suite).players[0].model
    assert model is not None and prices_of(plan_of(suite).players[0]) == (model.price_in, model.price_out)
    tokens = estimate.most.prompt_tokens * model.price_in + estimate.most.completion_tokens * model.price_out
    assert estimate.most.cost_usd == pytest.approx(tokens / 1e6)
    suite.write_text(PAID.replace('model = "gpt-5.5"', 'model = "gpt-5.5"\nargs = { encoding = "paper" }'))
    (estimate,) = estimated(suite, range(10))
    assert estimate.most.calls == pytest.approx(estimate.full.calls) == 10 * 60, (
        "the encoding of the suites calls once for each decision"
    )
    assert estimate.most.prompt_tokens == 600 * (16_384 - 2_048) and estimate.most.completion_tokens == 600 * 2_048
    assert estimate.usual.calls <= estimate.full.calls
    assert estimate.full.prompt_tokens < estimate.most.prompt_tokens


def test_an_entrant_whose_decider_is_no_model_has_no_calls_and_no_cost(suite: Path) -> None:
    suite.write_text(PAID.replace('model = "gpt-5.5"', 'model = "gpt-5.5"\nargs = { decider = "sweep" }'))
    (estimate,) = estimated(suite)
    assert (estimate.usual.calls, estimate.most.calls, estimate.most.cost_usd) == (0, 0, 0)


def test_the_costs_of_played_episodes_of_a_cell_replace_its_estimate(suite: Path) -> None:
    rows = [
        made_row(entrant="GPT-5.5", mission="bi", mode="single", seed=seed, metrics={"cost_usd": cost, "calls": 7})
        for seed, cost in enumerate((0.5, 1.5))
    ]
    (estimate,) = estimated(suite, (2, 3), rows)
    assert (estimate.usual.cost_usd, estimate.usual.calls) == (2.0, 14)


def test_an_unmeasured_mission_is_estimated_with_the_means_of_others_and_named(
    suite: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (suite.parent / "short.ljs").write_text(TRIP)
    suite.write_text(PAID.replace('["bi"]', '["short.ljs"]'))
    (estimate,) = estimated(suite)
    assert estimate.unmeasured == ("trip",) and estimate.full.calls == 3
    assert run_command(["bench", str(suite), "--check", "-j", "2", "--answer-s", "9"]) == ExitCode.OK
    errors = capsys.readouterr().err
    assert "with 9 s an answer and 2 at a time" in errors and "with the means of the others: trip" in errors
    assert run_command(["bench", str(suite), "--check", "--answer-s", "0"]) == ExitCode.USAGE
    assert "--answer-s 0: must be a number of seconds above 0" in capsys.readouterr().err


def test_earlier_rows_of_the_folder_replace_the_estimate(suite: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = suite.parent / "out"
    with open_results(out) as results:
        metrics = {"cost_usd": 4.0, "calls": 11}
        results.add(made_row(entrant="GPT-5.5", mission="bi", mode="single", metrics=metrics))
    assert run_command(["bench", str(suite), "--check", "-o", str(out)]) == ExitCode.OK
    assert "GPT-5.5: 2 episodes, about 22 calls, $8.00" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("args", "paid", "prices"),
    [
        ("", True, (5.0, 30.0)),
        ("price_in = 1, price_out = 2.5", True, (1.0, 2.5)),
        ("price_in = 0, price_out = 0", False, (0.0, 0.0)),
    ],
)
def test_prices_of_a_suite_override_the_prices_of_the_model(
    args: str, paid: bool, prices: tuple[float, float], suite: Path
) -> None:
    suite.write_text(PAID.replace('model = "gpt-5.5"', f'model = "gpt-5.5"\nargs = {{ {args} }}'))
    player = plan_of(suite).players[0]
    assert (is_paid(player), prices_of(player)) == (paid, prices)
    assert not is_paid(plan_of(suite).players[1])


def test_a_paid_suite_does_not_start_without_a_key_a_limit_or_a_price(
    suite: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = suite.parent / "out"
    command = ["bench", str(suite), "-o", str(out)]
    assert run_command(command) == ExitCode.USAGE
    assert "\nerror: models cannot be called: GPT-5.5: OPENAI_API_KEY is not set" in capsys.readouterr().err
    suite.write_text(PAID.replace('model = "gpt-5.5"', 'model = "gpt-5.5"\nargs = { api_key_env = "OWN_KEY" }'))
    assert run_command(command) == ExitCode.USAGE
    assert "\nerror: models cannot be called: GPT-5.5: OWN_KEY is not set" in capsys.readouterr().err
    suite.write_text(PAID)
    monkeypatch.setenv("OPENAI_API_KEY", "a-key-that-nobody-may-see-1234")
    assert run_command(command) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert re.search(r"^GPT-5.5: 2 episodes, about \d+ calls, \$[\d.]+, [\d.]+ h; ", errors, re.M)
    assert "; at most 240 calls, $" in errors
    assert "set a limit with --max-cost USD" in errors and "a-key-that" not in errors
    for wrong in ("0", "-3", "nan", "inf"):
        assert run_command([*command, "--max-cost", wrong]) == ExitCode.USAGE
        assert "must be an amount of US dollars above 0" in capsys.readouterr().err
    models = suite.parent / "none" / "lingjing" / "models.toml"
    models.parent.mkdir(parents=True)
    models.write_text('[models."gpt-5.5"]\nservice = "openai"\nserved = "gpt-5.5"\n')
    assert run_command([*command, "--max-cost", "3"]) == ExitCode.USAGE
    assert "--max-cost needs prices, and those of gpt-5.5 are unknown" in capsys.readouterr().err
    assert not out.exists()


def spending(cost: float) -> AnsweringExecutor:
    def answer(task: EpisodeTask) -> EpisodeReport:
        return answered(task, metrics=blank_metrics(cost_usd=cost if task.options.policy == "react" else 0.0))

    return AnsweringExecutor(answer)


def test_no_episode_begins_above_the_cost_limit_and_a_higher_limit_continues(suite: Path) -> None:
    folder = suite.parent / "out"

    def play(limit: float) -> SuiteRun:
        plan = plan_of(suite)
        with open_results(folder) as results:
            run = SuiteRun(plan, results, "code", spending(1.0), max_cost=limit)
            run.check_resumable()
            run.play(run.due(range(6), plan.cells))
            return run

    run = play(2.5)
    assert run.is_out_of_money and run.spent() == 3.0
    assert len([row for row in read_results(folder) if row.model]) == 3
    run = play(100.0)
    assert not run.is_out_of_money and run.spent() == 6.0
    assert len(read_results(folder)) == 12
    kept = {row.entrant for row in read_results(folder) if row.report.trace}
    assert kept == {"GPT-5.5"}, "runs that cost money are kept, others are removed"


def test_an_episode_ended_by_the_limit_gives_no_row_and_counts_as_no_try(suite: Path) -> None:
    plan = plan_of(suite)
    ended = AnsweringExecutor(lambda task: answered(task, reason=ABORTED, detail="money: the limit of $1 is reached"))
    with open_results(suite.parent / "out") as results:
        run = SuiteRun(plan, results, "code", ended, max_cost=1.0)
        run.play(run.due((0,), plan.cells))
        assert run.is_out_of_money and results.rows == []
        assert [item.tries for item in run.due((0,), plan.cells)] == [1, 1]


@pytest.mark.parametrize(("isolate", "spent_usd"), [("no", 5.0), ("yes", 0.0)])
def test_the_cost_that_a_policy_behind_walls_claims_is_not_spent(suite: Path, isolate: str, spent_usd: float) -> None:
    claimed = made_row(metrics={"cost_usd": 5.0}, options=PlayOptions(mission="ssr", policy="p", isolate=isolate))
    with open_results(suite.parent / "out") as results:
        results.add(claimed)
        assert SuiteRun(plan_of(suite), results, "code", AnsweringExecutor()).spent() == spent_usd


def test_a_missing_record_of_calls_stops_the_suite_with_its_message(suite: Path) -> None:
    plan = plan_of(suite)
    missing = AnsweringExecutor(
        lambda task: answered(task, reason=ABORTED, detail="calls: nothing is recorded of tick 3")
    )
    with open_results(suite.parent / "out") as results:
        run = SuiteRun(plan, results, "code", missing, calls="replay", calls_from=suite.parent / "old")
        with pytest.raises(UsageError, match=r"bi-single-0.*: calls: nothing is recorded of tick 3"):
            run.play(run.due((0,), plan.cells))
        assert results.rows == []
    first = missing.tasks[0].options
    assert (first.calls, first.calls_from) == (
        "replay",
        str(suite.parent / "old" / "runs" / missing.tasks[0].folder.name),
    )


def test_episodes_without_a_record_of_calls_are_reported_before_any_replay(
    suite: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = tmp_path / "recorded"
    (recorded / "runs" / "GPT-5.5-bi-single-0").mkdir(parents=True)
    (recorded / "runs" / "GPT-5.5-bi-single-0" / "calls.sqlite").touch()
    (recorded / "salt").write_text("salt\n")
    command = ["bench", str(suite), "--seeds", "0-2", "-o", str(tmp_path / "out")]
    assert run_command([*command, "--calls", "replay", "--calls-from", str(recorded)]) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert "2 of 3 episodes have no record of model calls" in errors
    assert "the first is GPT-5.5-bi-single-1" in errors
    assert not (tmp_path / "out" / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--calls", "replay"), "--calls replay and --calls-from DIR need each other"),
        (("--calls-from", "somewhere"), "--calls replay and --calls-from DIR need each other"),
        (("--calls", "replay", "--calls-from", "nowhere"), "`nowhere` is not the results folder of a suite"),
    ],
)
def test_incomplete_replay_options_are_usage_errors(
    arguments: tuple[str, ...], message: str, suite: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["bench", str(suite), *arguments]) == ExitCode.USAGE
    assert message in capsys.readouterr().err
