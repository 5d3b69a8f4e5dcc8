"""An outage that a policy reports counts only if the service does not answer the harness either."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import lingjing
from agents.tests.chat_server import Reply, serve
from agents.tests.test_recorded_calls import ARGUMENTS, KEY, TEXT, decisions, play, row
from lingjing import read as read_trace
from lingjing.errors import InfrastructureError
from lingjing.play.outages import SERVICE_GONE
from lingjing.play.recorded_calls import PROBE_TICK
from lingjing.testing import recorded_calls

PROBE = "Answer with the word yes."


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TEST_KEY", KEY)
    path = tmp_path / "glance.ljs"
    path.write_text(TEXT)
    return path


def refusing(request: dict[str, Any]) -> Reply:
    """A service that answers the harness and rejects the policy."""
    return Reply() if request["messages"][0]["content"] == PROBE else Reply(status=500)


def test_an_outage_that_the_harness_confirms_aborts_the_episode_and_its_replay(mission: Path, tmp_path: Path):
    with serve([Reply(status=401, body='{"error": "the key has expired"}')]) as server:
        played = play(mission, tmp_path / "a", server.url)
        assert PROBE in {request["messages"][0]["content"] for request in server.requests}
    assert played.reason == "infrastructure-abort"
    assert played.detail.startswith(SERVICE_GONE)
    assert "the key has expired" in played.detail
    again = play(mission, tmp_path / "b", server.url, calls="replay", calls_from=tmp_path / "a")
    assert row(played) == row(again)
    probes = [recorded_calls(tmp_path / name, PROBE_TICK) for name in ("a", "b")]
    assert len(probes[0]) == 1
    assert probes[0] == probes[1]


def test_a_service_that_rejects_only_the_policy_is_a_failure_of_the_policy(mission: Path, tmp_path: Path):
    with serve(refusing) as server:
        played = play(mission, tmp_path / "a", server.url, {"tries": "1"})
    assert (played.reason, played.ticks) == ("budget", 4)
    made = [decision for record in read_trace(played.trace).boundaries for decision in record.decisions]
    assert {decision.substituted for decision in made} == {"policy_error"}
    assert any("refused `scout[1]` 3 ticks in a row" in decision.detail for decision in made)
    again = play(mission, tmp_path / "b", server.url, {"tries": "1"}, calls="replay", calls_from=tmp_path / "a")
    assert decisions(played) == decisions(again)


class Accuser:
    """A policy with an error that would end an episode, or a whole suite, if it counted without confirmation."""

    async def reset(self, brief: Any) -> None:
        """Do nothing."""

    async def act(self, observation: Any, inbox: Any) -> Any:
        raise InfrastructureError("money: the limit does not cover another call")


def test_an_infrastructure_error_of_a_policy_without_a_service_aborts_no_episode(mission: Path, tmp_path: Path):
    report = lingjing.run(mission, policy=Accuser, overview=False, world="inline", out=tmp_path / "a")
    assert (report.reason, report.ticks) == ("budget", 4)
    assert report.metrics is not None
    assert report.metrics.substitutions == 8


def test_the_limit_of_money_aborts_an_episode(mission: Path, tmp_path: Path):
    with serve([Reply()]) as server:
        arguments = {**ARGUMENTS, "price_in": "1000", "price_out": "1000"}
        report = play(mission, tmp_path / "a", server.url, arguments, max_cost=0.001)
    assert report.reason == "infrastructure-abort"
    assert report.detail.startswith("money: ")
