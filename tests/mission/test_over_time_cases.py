"""Missions with conditions over time, events and drawn params: those that cannot be won have an error, near ones have
none, and the oracle wins a sample of these."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing.testing import compile_text
from tests.mission.language_cases import Variant
from tests.mission.over_time_cases import IMPOSSIBLE, WINNABLE
from tests.mission.test_proofs_of_played_missions import moments_are_early, played

PLAYED = (
    "held-as-long-as-there-is-time",
    "within-of-two-events",
    "before-not-itself",
    "count-of-repeats",
    "appears-by-time",
    "vanishes-and-comes-back",
    "permit-of-an-event",
    "status-set",
    "serial-stages",
    "a-drawn-budget",
)
"""Winnable missions that the oracle plays."""


def reasons(variant: Variant) -> list[str]:
    """The codes of the errors that are proofs."""
    items = compile_text(variant.text).diagnostics
    assert {item.code[:4] for item in items if item.severity == "error"} <= {"LJ06", "LJ05"}, items
    return [item.code for item in items if item.severity == "error"]


@pytest.mark.parametrize("variant", IMPOSSIBLE, ids=lambda variant: variant.name)
def test_an_impossible_mission_has_an_error(variant: Variant) -> None:
    assert reasons(variant)


@pytest.mark.parametrize("variant", WINNABLE, ids=lambda variant: variant.name)
def test_a_winnable_mission_has_no_error(variant: Variant) -> None:
    assert reasons(variant) == []


@pytest.mark.parametrize("name", PLAYED)
def test_the_oracle_wins_a_winnable_mission(name: str, tmp_path: Path, session: lingjing.Session) -> None:
    (variant,) = (each for each in WINNABLE if each.name == name)
    trace = played(variant, tmp_path, session)
    assert trace.outcome is not None and trace.outcome.success
    moments_are_early(trace)
