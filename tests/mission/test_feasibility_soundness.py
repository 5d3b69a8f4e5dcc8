"""No false alarm: a mission that can be won is never proved infeasible, and more time never adds an error."""

from __future__ import annotations

import itertools
import math
from functools import cache
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lingjing.mission.conditions.condition_needs import needs
from lingjing.mission.conditions.needs import mandatory
from lingjing.mission.conditions.outline import of_instance, of_mission, too_large
from lingjing.mission.evaluate import Interval, Scope, evaluate
from lingjing.mission.feasibility import prove, prove_instance
from lingjing.mission.feasibility.limits import episode
from lingjing.mission.feasibility.tour import tours
from lingjing.mission.instance import Instance
from lingjing.testing import compile_file, instantiate
from lingjing.testing import declarations as m
from lingjing.testing import expressions as ex

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"
BOAT_MPS = 3.0
RADIUS_M = 50.0
SPOT = st.tuples(st.floats(-3000, 3000), st.floats(-3000, 3000))


@cache
def sea_rescue() -> m.Mission:
    """The mission, compiled once: a test of many examples cannot take it from a fixture."""
    mission = compile_file(str(SCENARIOS / "ssr.ljs")).mission
    assert mission is not None
    return mission


@pytest.fixture(scope="module")
def ssr() -> m.Mission:
    return sea_rescue()


@pytest.mark.parametrize("file", sorted(SCENARIOS.glob("*.ljs")), ids=lambda file: file.stem)
def test_shipped_missions_have_needs_and_no_proof_of_infeasibility(file: Path) -> None:
    mission = compile_file(str(file)).mission
    assert mission is not None
    for mode in mission.modes.allowed:
        outline = of_mission(mission, mode)
        assert needs(outline.instance.success, outline, "success")
    assert prove(mission) == ()


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_no_seed_of_the_sea_rescue_is_proved_infeasible(ssr: m.Mission, mode: str) -> None:
    assert [s for s in range(100) if prove_instance(instantiate(ssr, seed=s, mode=mode))] == []


def test_no_setting_of_the_sea_rescue_is_proved_infeasible(ssr: m.Mission) -> None:
    for parameter in ssr.parameters:
        if parameter.is_switch:
            assert prove_instance(instantiate(ssr, settings={parameter.name: 1.0})) == ()
            continue
        bounds = evaluate(parameter.bounds, Scope()) if parameter.bounds else None
        assert isinstance(bounds, Interval)
        step = 20.0 if bounds.high > 50 else 1.0
        for k in range(int((bounds.high - bounds.low) / step) + 1):
            value = bounds.low + k * step
            for seed, mode in itertools.product(range(3), ssr.modes.allowed):
                instance = instantiate(ssr, seed=seed, mode=mode, settings={parameter.name: value})
                assert prove_instance(instance) == (), (parameter.name, value, seed, mode)


def test_the_sea_rescue_needs_visits_reports_pictures_and_interactions(ssr: m.Mission) -> None:
    outline = of_instance(instantiate(ssr, seed=7))
    leaves = mandatory(needs(outline.instance.success, outline, "success"))
    kinds = {type(leaf).__name__ for leaf in leaves}
    assert kinds == {"VisitNeed", "ReportNeed", "PictureNeed", "Performed"}
    (tour,) = tours(leaves, episode(outline), outline)
    assert len(tour.visits) == 3 and tour.metres > 0


def placed(instance: Instance, spots: list[tuple[float, float]], ticks: int, drift: float = 0.0) -> Instance:
    """The instance with its victims at the spots and another budget."""
    where = iter(spots)
    entities = tuple(
        msgspec.structs.replace(
            entity, position=(*next(where), 0.0), properties={**entity.properties, "drift_mps": drift}
        )
        if entity.group == "victim"
        else entity
        for entity in instance.entities
    )
    budget = msgspec.structs.replace(instance.budget, ticks=ticks)
    return msgspec.structs.replace(instance, entities=entities, budget=budget)


@settings(max_examples=60, deadline=None)
@given(spots=st.lists(SPOT, min_size=6, max_size=6), ticks=st.integers(1, 300), more=st.integers(0, 300))
def test_more_time_never_adds_an_error(spots: list[tuple[float, float]], ticks: int, more: int) -> None:
    instance = instantiate(sea_rescue(), settings={"victims": 6})
    fewer = {proof.code for proof in prove_instance(placed(instance, spots, ticks))}
    longer = {proof.code for proof in prove_instance(placed(instance, spots, ticks + more))}
    assert bool(longer) <= bool(fewer)


@settings(max_examples=60, deadline=None)
@given(spots=st.lists(SPOT, min_size=4, max_size=4), drift=st.floats(0, 0.3))
def test_a_schedule_that_a_boat_can_sail_is_never_proved_infeasible(
    spots: list[tuple[float, float]], drift: float
) -> None:
    """The witness: straight to each victim in the best order at the declared speed, with ticks for the pictures."""
    instance = instantiate(sea_rescue(), settings={"victims": 4})
    boat = next(entity for entity in instance.entities if entity.id == "boat").position[:2]
    metres = min(sailed(boat, order) for order in itertools.permutations(spots))
    ticks = max(5, math.ceil(metres / BOAT_MPS / instance.clock.tick_s))
    assert prove_instance(placed(instance, spots, ticks, drift)) == ()


def sailed(start: tuple[float, ...], order: tuple[tuple[float, float], ...]) -> float:
    """Metres from stop to stop. The boat stops as soon as the radius reaches the next victim."""
    here, total = (start[0], start[1]), 0.0
    for spot in order:
        way = math.dist(here, spot)
        total += max(0.0, way - RADIUS_M)
        if way > RADIUS_M:
            share = (way - RADIUS_M) / way
            here = here[0] + share * (spot[0] - here[0]), here[1] + share * (spot[1] - here[1])
    return total


def test_a_very_large_mission_is_not_analysed(ssr: m.Mission) -> None:
    crowd = tuple(msgspec.structs.replace(ssr.groups[1], name=f"uav{k}", when=None) for k in range(2001))
    assert prove(msgspec.structs.replace(ssr, groups=ssr.groups + crowd)) == ()


def test_a_very_large_group_is_detected_before_its_members_are_created(ssr: m.Mission) -> None:
    crowd = tuple(
        msgspec.structs.replace(group, count=ex.Number(100_000.0)) if group.name == "victim" else group
        for group in ssr.groups
    )
    assert too_large(msgspec.structs.replace(ssr, groups=crowd), "star")
    assert not too_large(ssr, "star")
