"""A suite with a model over HTTP: cost is counted, the limit holds, and the record replays without the service."""

from __future__ import annotations

from pathlib import Path

import pytest

from agents.tests.chat_server import NOOP, Reply, serve
from lingjing.errors import ExitCode
from lingjing.testing import run_command
from tests.bench.suite_kit import TRIP, read_results

SUITE = """
suite = 1
name = "paid"
missions = ["short.ljs"]
seeds = [1]
tables = ["cost"]

[[entrants]]
name = "tester"
policy = "react"
args = { model = "test-model", base_url = "URL", price_in = 10, price_out = 20, max_tokens = 64 }
"""


@pytest.mark.slow
def test_money_is_counted_its_limit_holds_and_the_record_replays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "short.ljs").write_text(TRIP)
    suite, out = tmp_path / "paid.toml", tmp_path / "out"
    with serve(lambda request: Reply(NOOP)) as server:
        suite.write_text(SUITE.replace("URL", server.url))
        play = ["bench", str(suite), "-o", str(out)]
        assert run_command([*play, "--max-cost", "0.001"]) == ExitCode.USAGE, "less than one call may cost"
        assert (
            "the rest of $0.001 may not pay for another call ($0.00 spent): 1 of 1 episodes are not played"
            in capsys.readouterr().err
        )
        assert read_results(out) == [] and server.requests == []
        assert run_command([*play, "--max-cost", "5"]) == ExitCode.OK
        requests = len(server.requests)
    rows = read_results(out)
    assert [(row.standing, row.tries, row.report.metrics.calls) for row in rows] == [("counted", 1, 3)]
    assert requests == 3 and rows[0].report.metrics.cost_usd == pytest.approx(3 * (100 * 10 + 20 * 20) / 1e6)
    assert all((out / row.report.trace).with_name("calls.sqlite").is_file() for row in rows)
    again = ["bench", str(suite), "-o", str(tmp_path / "again"), "--calls", "replay", "--calls-from", str(out)]
    assert run_command(again) == ExitCode.OK, "the service is gone"
    replayed = read_results(tmp_path / "again")
    assert [(row.seed, row.policy_seed, row.report.digest) for row in replayed] == [
        (row.seed, row.policy_seed, row.report.digest) for row in rows
    ]
