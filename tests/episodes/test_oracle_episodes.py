"""Whole episodes of the oracle with the real engines: bodies of every kind, and the relations that occur."""

from pathlib import Path

import pytest

import lingjing
from lingjing import read as read_trace

pytestmark = pytest.mark.episodes


@pytest.mark.parametrize(
    "mission, mode, settings, relations",
    [
        ("bi", None, {}, {"dependency"}),
        ("upr", None, {}, {"information_handoff", "cooperation", "guidance", "dependency"}),
        ("cd", "star", {"points": 5}, {"information_handoff", "cooperation", "guidance", "dependency"}),
        ("cd", "broadcast", {"points": 5}, {"cooperation", "dependency"}),
    ],
)
def test_the_oracle_wins_and_the_declared_relations_occur(mission, mode, settings, relations, tmp_path: Path):
    result = lingjing.run(
        mission, policy="oracle", seed=3, mode=mode, settings=settings, out=tmp_path / "run", overview=False
    )
    assert result.success, result.reason
    # vans are put on the road
    assert [warning for warning in result.warnings if not warning.startswith("moved from")] == []
    records = [relation for record in read_trace(result.trace).boundaries for relation in record.relations]
    assert relations <= {record.kind for record in records}
    assert all(record.source and record.target and record.by for record in records)


@pytest.mark.parametrize("oracle", ["coordinator", "inspector", "driver"])
def test_a_team_of_heuristics_with_one_oracle_wins(oracle: str, tmp_path: Path) -> None:
    played = lingjing.run(
        "cr", mode="star", seed=2, policy="heuristic", policies_for={oracle: "oracle"}, out=tmp_path, overview=False
    )
    assert (played.reason, played.score) == ("success", 1.0)


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_the_oracle_wins_and_the_trace_records_the_privilege(mode: str, tmp_path: Path):
    result = lingjing.run("ssr", policy="oracle", seed=7, mode=mode, overview=False, out=tmp_path / "run")
    assert result.success
    assert result.ticks < 60
    assert result.scr == pytest.approx(1.0)
    assert result.metrics.false_positives == 0
    trace = read_trace(result.trace)
    assert {binding.privileged for binding in trace.header.bindings} == {True}
