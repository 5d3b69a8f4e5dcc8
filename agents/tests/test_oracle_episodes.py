"""Whole episodes of the oracle with the real engines: bodies of every kind, and the relations that come about."""

from pathlib import Path

import pytest

import lingjing
from lingjing.trace.reader import read_trace

pytestmark = pytest.mark.slow

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.mark.parametrize(
    "mission, mode, settings, relations",
    [
        ("bi", None, {}, {"dependency"}),
        ("upr", None, {}, {"information_handoff", "cooperation", "guidance", "dependency"}),
        ("cd", "star", {"points": 5}, {"information_handoff", "cooperation", "guidance", "dependency"}),
        ("cd", "broadcast", {"points": 5}, {"cooperation", "dependency"}),
    ],
)
def test_the_oracle_wins_and_the_declared_relations_come_about(mission, mode, settings, relations, tmp_path: Path):
    compiled = lingjing.compile(SCENARIOS / f"{mission}.ljs")
    result = lingjing.run(
        compiled, policy="oracle", seed=3, mode=mode, settings=settings, out=tmp_path / "run", overview=False
    )
    assert result.success, result.reason
    assert result.warnings == ()
    records = [relation for record in read_trace(result.trace).boundaries for relation in record.relations]
    assert relations <= {record.kind for record in records}
    assert all(record.source and record.target and record.by for record in records)
