"""Missions of `scenarios/examples`: the oracle wins each with the feature that it demonstrates."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.testing import PlayedEpisode, mission_file, play

EXAMPLES = mission_file("ssr").parent / "examples"


def played(name: str, folder: Path, seed: int = 0, policy: str = "oracle") -> PlayedEpisode:
    return play(EXAMPLES / f"{name}.ljs", folder, policy=policy, seed=seed)


@pytest.mark.slow
def test_overwatch_is_won_with_a_line_of_sight_and_a_battery_above_its_reserve(tmp_path: Path) -> None:
    trace = played("overwatch", tmp_path).trace
    assert trace.outcome is not None and trace.outcome.success
    kinds = [event.kind for boundary in trace.boundaries for event in boundary.events]
    assert kinds.count("covered") == kinds.count("above") == 2 and "reserve" not in kinds


@pytest.mark.slow
def test_a_parcel_that_is_late_ends_the_mission(tmp_path: Path) -> None:
    won, lost = played("parcels", tmp_path), played("parcels", tmp_path, policy="random")
    assert won.trace.outcome is not None and won.trace.outcome.success
    entities = lost.trace.header.instance.entities
    deadlines = {each.id: each.number_or("deadline_s", 0.0) for each in entities if "deadline_s" in each.properties}
    assert len(set(deadlines.values())) == 3 and all(90.0 <= time_s <= 150.0 for time_s in deadlines.values())
    outcome = lost.trace.outcome
    assert outcome is not None and outcome.reason == "late" and "was not done by its deadline" in outcome.detail
    named = [order for order in deadlines if order in outcome.detail]
    assert named and all(deadlines[order] <= 10.0 * outcome.ticks for order in named)


@pytest.mark.thorough
def test_stages_count_in_their_order(tmp_path: Path) -> None:
    trace = played("rounds", tmp_path).trace
    assert trace.outcome is not None and trace.outcome.success
    ticks = {change.stage: change.tick for boundary in trace.boundaries for change in boundary.stages}
    assert (
        ticks["rise"] < min(ticks["survey"], ticks["walk"]) <= max(ticks["survey"], ticks["walk"]) < ticks["come_home"]
    )


@pytest.mark.slow
def test_a_hidden_number_of_people_is_drawn_and_all_are_rescued(tmp_path: Path) -> None:
    counts = set()
    for seed in (0, 1):
        trace = played("castaways", tmp_path, seed).trace
        assert trace.outcome is not None and trace.outcome.success
        rescued = [event for boundary in trace.boundaries for event in boundary.events if event.kind == "rescued"]
        instance = trace.header.instance
        assert len(rescued) == instance.settings["people"] and instance.hidden_settings == ("people",)
        counts.add(len(rescued))
    assert counts == {3, 4}


@pytest.mark.thorough
def test_the_oracle_comes_near_targets_that_flee_wander_and_follow(tmp_path: Path) -> None:
    trace = played("chase", tmp_path).trace
    assert trace.outcome is not None and trace.outcome.success
    first, last = trace.boundaries[0].snapshots[0], trace.boundaries[-1].snapshots[-1]
    start, end = ({body.id: body.position for body in snapshot.states} for snapshot in (first, last))
    strays = [entity.id for entity in trace.header.instance.entities if entity.role == "target"]
    assert len(strays) == 3 and all(start[name] != end[name] for name in strays)
