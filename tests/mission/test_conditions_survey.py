"""The survey of conditions: each leaf with what it reads, what changes that, and what the condition gates."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing.mission.conditions.quantities import Cause
from lingjing.mission.conditions.survey import Condition, Gate, Survey, survey_instance, survey_mission
from lingjing.testing import at_tier, compile_text, instantiate, mission_file

NINE = ("bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn")

YARD = (Path(__file__).parents[1] / "kernel" / "data" / "locker.ljs").read_text()


def survey(text: str) -> Survey:
    compilation = compile_text(text)
    assert compilation.mission is not None, compilation.diagnostics
    return survey_mission(compilation.mission)


def condition(of: Survey, at: str) -> Condition:
    (matching,) = [condition for condition in of.conditions if condition.at == at]
    return matching


@pytest.fixture(scope="module")
def ssr() -> Survey:
    return survey_mission(lingjing.compile(str(mission_file("ssr"))))


def test_a_leaf_has_the_quantities_of_both_sides_and_their_causes(ssr: Survey) -> None:
    (leaf,) = [leaf for leaf in condition(ssr, "rule/rescued").leaves if leaf.text.startswith("distance_xy")]
    boat, victim = leaf.quantities
    assert (boat.key, boat.hidden) == ("boat.position", False)
    assert boat.causes == (Cause(kind="verb", name="moveTo", by=("rescuer", "searcher")),)
    assert (victim.key, victim.hidden) == ("victim.position", True)
    assert victim.causes == (Cause(kind="engine", name="city"),), "a person in the water drifts"


def test_a_condition_lists_each_leaf_of_the_rules_that_it_calls_once(ssr: Survey) -> None:
    success = condition(ssr, "success")
    ways = {leaf.via for leaf in success.leaves}
    assert ways == {(), ("rescued",), ("rescued", "reported"), ("rescued", "reported", "matched")}
    assert success.hidden and success.private
    texts = [(leaf.text, leaf.via) for leaf in success.leaves]
    assert len(texts) == len(set(texts))


def test_an_event_is_caused_by_the_interaction_and_its_actors(ssr: Survey) -> None:
    (leaf,) = [leaf for leaf in condition(ssr, "rule/rescued").leaves if leaf.text.startswith("emitted")]
    assert [cause for quantity in leaf.quantities for cause in quantity.causes] == [
        Cause(kind="interaction", name="rescue", by=("boat",))
    ]


def test_the_causes_of_a_state_are_the_interactions_that_change_it() -> None:
    cd = survey_mission(lingjing.compile(str(mission_file("cd"))))
    (demand,) = condition(cd, "unlock/deliver").leaves[1].quantities
    assert demand.key == "point.demand_kg"
    assert demand.causes == (Cause(kind="interaction", name="deliver", by=("van",)),)


def test_gates_name_the_outcome_command_interaction_or_event_of_each_condition() -> None:
    upr = survey_mission(lingjing.compile(str(mission_file("upr"))))
    gates = {condition.at: condition.gates for condition in upr.conditions}
    assert gates["success"] == (Gate(kind="end"),)
    assert gates["permit/dog.forward"] == (Gate(kind="command", name="dog.forward"),)
    assert gates["unlock/seal"] == (Gate(kind="interaction", name="seal"),)
    assert gates["rule/sealed"] == (Gate(kind="event", name="sealed"),)


def test_one_permit_of_the_shipped_missions_depends_on_hidden_values() -> None:
    paths_of = {
        name: [c.at for c in survey_mission(lingjing.compile(str(mission_file(name)))).of_kind("permit") if c.hidden]
        for name in NINE
    }
    assert {name: paths for name, paths in paths_of.items() if paths} == {"upr": ["permit/dog.forward"]}


@pytest.mark.parametrize("name", NINE)
def test_the_survey_of_an_instance_agrees_with_that_of_its_mission(name: str) -> None:
    mission = at_tier(lingjing.compile(str(mission_file(name))))
    for mode in mission.modes.allowed:
        of = survey_instance(instantiate(mission, seed=1, mode=mode))
        whole = {condition.at: condition for condition in survey_mission(mission).conditions}
        for read in of.of_kind("success", "failure", "rule", "unlock", "stage"):
            assert (read.hidden, read.private) == (whole[read.at].hidden, whole[read.at].private), read.at
        assert of.open_events <= survey_mission(mission).open_events


@pytest.mark.parametrize(
    ("text", "hidden"),
    [
        ("now > 20 s", False),
        ("box.position.north < 0 m", False),
        ("tidy()", False),
        ("distance_xy(boat, victim) <= 40 m", True),
        ("near(victim)", True),
        ("victim in pool", True),
        ("alive(victim)", True),
        ("count(near(v) for v in victim) >= 1", True),
        ("exists v in victim: v.position.north < 0 m", True),
        ("not (now > 3 s and victim.heading > 9 deg)", True),
        ("min(distance_xy(boat, v) for v in victim) < 9 m", True),
        ("emitted(rescue)", True),
        ("assigned(boat, victim)", True),
        ("exists r in detection: r.class == person_in_water", False),
        ("exists r in detection: iou(r.box, truth(victim, r.frame).box) > 0.5", True),
    ],
)
def test_a_hidden_value_taints_the_condition_in_every_form_of_expression(text: str, hidden: bool) -> None:
    of = survey(YARD.replace("CONDITION", text))
    unlock = condition(of, "unlock/open")
    assert unlock.hidden is hidden
    assert (("open", "box") in of.declarations.taint.interactions) is hidden


@pytest.mark.parametrize(
    ("text", "necessary"),
    [
        ("now > 20 s and boat in pool", {"now > 20 s", "boat in pool"}),
        ("now > 20 s or boat in pool", set()),
        ("not (now > 20 s or boat in pool)", {"now > 20 s", "boat in pool"}),
        ("not (now > 20 s and boat in pool)", set()),
        ("boat in pool and (now > 20 s or not (now > 30 s and now > 40 s))", {"boat in pool"}),
        ("exists v in victim: boat in pool and alive(v)", {"boat in pool", "alive(v)"}),
        ("count(near(v) for v in victim) >= 1", {"count(near(v) for v in victim) >= 1"}),
        ("tidy()", {"tidy()", "box.position.north < 0 m", "now > 20 s"}),
    ],
)
def test_a_part_is_necessary_if_the_condition_cannot_hold_without_it(text: str, necessary: set[str]) -> None:
    unlock = condition(survey(YARD.replace("CONDITION", text)), "unlock/open")
    assert {leaf.text for leaf in unlock.leaves if leaf.necessary} == necessary


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("distance_xy(boat, victim) <= 40 m", {"boat.position", "victim.position"}),
        ("exists v in victim: distance_xy(boat, v) <= 40 m", {"presence victim", "boat.position"}),
        ("exists v in victim: near(v)", {"rule near"}),
        ("count(near(v) for v in victim) >= 1", {"rule near"}),
        ("count(alive(v) for v in victim) >= 1", {"presence victim"}),
        ("alive(boat)", {"presence boat"}),
        ("b.position.north < 0 m", set()),
    ],
)
def test_a_quantity_is_indirect_if_the_part_does_not_name_its_owner(text: str, named: set[str]) -> None:
    unlock = condition(survey(YARD.replace("CONDITION", text)), "unlock/open")
    assert {q.key for leaf in unlock.own for q in leaf.quantities if not q.indirect} == named
