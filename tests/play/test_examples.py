"""Missions of `scenarios/examples`: the oracle wins them with what they show."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.analysis.registries import registries
from lingjing.data import data_path
from lingjing.testing import PlayedEpisode, play


def played(name: str, folder: Path, seed: int = 0, policy: str = "oracle") -> PlayedEpisode:
    return play(data_path("scenarios") / "examples" / f"{name}.ljs", folder, policy=policy, seed=seed)


@pytest.mark.slow
def test_a_post_counts_with_a_free_line_of_sight_and_a_battery_above_its_reserve(tmp_path: Path) -> None:
    trace = played("overwatch", tmp_path).trace
    assert trace.outcome is not None and trace.outcome.success
    kinds = [event.kind for boundary in trace.boundaries for event in boundary.events]
    assert kinds.count("covered") == kinds.count("above") == 2 and "reserve" not in kinds
    assert all(boundary.faithful for boundary in registries(trace)), "the lines are found again from the trace"


@pytest.mark.slow
def test_a_parcel_that_is_late_ends_the_mission(tmp_path: Path) -> None:
    won, lost = played("parcels", tmp_path), played("parcels", tmp_path, policy="random")
    assert won.trace.outcome is not None and won.trace.outcome.success
    deadlines = {
        e.id: e.properties["deadline_s"] for e in lost.trace.header.instance.entities if "deadline_s" in e.properties
    }
    assert len(set(deadlines.values())) == 3 and all(90.0 <= float(each) <= 150.0 for each in deadlines.values())
    first = min(deadlines, key=deadlines.__getitem__)
    outcome = lost.trace.outcome
    assert outcome is not None and outcome.reason == "late"
    assert f"`deliver` of {first} was not done by its deadline, {deadlines[first]:g} s" in outcome.detail
