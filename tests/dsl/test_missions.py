"""The nine missions of the paper compile without errors, instantiate in every mode, and match the paper's tables.

`golden/missions.txt` holds a summary of each (`pytest tests/dsl --update` rewrites it).
"""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import pytest

from lingjing import Mission
from lingjing.mission.instance import Instance, StateSpec
from lingjing.testing import compile_file, instantiate
from lingjing.testing.documents import decode, encode

ROOT = Path(__file__).parents[2]
GOLDEN = Path(__file__).with_name("golden") / "missions.txt"
NAMES = ("bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn")
# mission, modes, engines of its assets, ticks, seconds a tick (Table 2, tab:engine-protocol)
PAPER = [
    ("vdn", {"single"}, {"quadruped"}, 140, 20),
    ("bi", {"single"}, {"multirotor"}, 60, 10),
    ("ld", {"star"}, {"multirotor", "road", "quadruped"}, 50, 20),
    ("idf", {"broadcast"}, {"quadruped"}, 300, 10),
    ("upr", {"star"}, {"multirotor", "quadruped"}, 300, 5),
    ("ufr", {"star", "broadcast"}, {"multirotor", "road"}, 60, 20),
    ("cr", {"star"}, {"multirotor", "road"}, 60, 20),
    ("ssr", {"star", "broadcast"}, {"multirotor", "vessel"}, 60, 10),
    ("cd", {"star", "broadcast"}, {"road"}, 60, 20),
]
# mission, interaction, inclusive radius in metres (tab:task-adjudication)
RADII = [
    ("vdn", "arrive", 30), ("bi", "inspect", 25), ("idf", "extinguish", 2), ("upr", "seal", 5),
    ("ufr", "extinguish", 30), ("cr", "record", 25), ("cr", "arrive", 30), ("ssr", "rescue", 50),
    ("cd", "deliver", 30), ("cd", "restock", 50),
]  # fmt: skip
# sweep of the paper, its values in SI
SWEEPS = [
    ("ssr", "team", "uavs", [1, 2, 3]), ("ssr", "altitude", "altitude", [60, 100, 140]),
    ("ssr", "cells", "side", [2, 3, 4]), ("ssr", "overlap", "overlap", [0.1, 0.2, 0.4]),
    ("ufr", "workload", "fires", [2, 3, 4, 5, 6]), ("cd", "workload", "points", [5, 10, 15, 20]),
    ("ld", "moves", "moves_most", [25, 50, 75]), ("cr", "replans", "replans_most", [0, 3, 6]),
    ("upr", "guidance", "guidance_steps", [10, 20, 30]),
]  # fmt: skip


def mission(name: str) -> Mission:
    compilation = compile_file(str(ROOT / "scenarios" / f"{name}.ljs"))
    assert compilation.diagnostics == ()
    assert compilation.mission is not None
    return compilation.mission


@pytest.fixture(scope="module")
def nine() -> dict[str, Mission]:
    return {name: mission(name) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_five_seeds_give_five_different_instances_in_every_mode(nine: dict[str, Mission], name: str) -> None:
    compiled = nine[name]
    for mode in compiled.modes.allowed:
        made = [instantiate(compiled, seed=seed, mode=mode) for seed in range(5)]
        assert msgspec.json.encode(made[0]) == msgspec.json.encode(instantiate(compiled, seed=0, mode=mode))
        assert len({msgspec.json.encode(instance) for instance in made}) == 5
        for instance in made:
            assert instance.agents and instance.entities
            assert not any(re.search(r"\{\w", agent.prompt) for agent in instance.agents)
            assert all(agent.prompt for agent in instance.agents)


@pytest.mark.parametrize("name", NAMES)
def test_mission_json_is_stable(nine: dict[str, Mission], name: str) -> None:
    assert decode(encode(nine[name]), name) == nine[name]
    assert mission(name) == nine[name]


@pytest.mark.parametrize(("name", "modes", "engines", "ticks", "seconds"), PAPER)
def test_modes_engines_and_budgets_are_those_of_the_paper(
    nine: dict[str, Mission], name: str, modes: set[str], engines: set[str], ticks: int, seconds: float
) -> None:
    compiled = nine[name]
    instance = instantiate(compiled)
    assert set(compiled.modes.allowed) == modes
    assert {entity.engine for entity in instance.entities if entity.role == "asset"} == engines
    assert (instance.budget.ticks, instance.clock.tick_s) == (ticks, seconds)


@pytest.mark.parametrize(("name", "interaction", "radius"), RADII)
def test_interaction_radii_are_those_of_the_paper(
    nine: dict[str, Mission], name: str, interaction: str, radius: float
) -> None:
    acts = [act for entity in instantiate(nine[name]).entities for act in entity.interactions]
    assert {act.within_m for act in acts if act.name == interaction} == {float(radius)}


@pytest.mark.parametrize(("name", "sweep", "param", "values"), SWEEPS)
def test_sweeps_are_those_of_the_paper(
    nine: dict[str, Mission], name: str, sweep: str, param: str, values: list[float]
) -> None:
    declared = next(item for item in nine[name].sweeps if item.name == sweep)
    assert declared.parameters == (param,)
    assert [getattr(value, "value", None) for value in declared.values[0]] == pytest.approx(values)
    for value in values:
        assert instantiate(nine[name], settings={param: value}).settings[param] == value


def test_actions_have_the_declared_argument_bounds(nine: dict[str, Mission]) -> None:
    def bounds(name: str, entity: str, verb: str) -> tuple[float | None, float | None]:
        owner = next(e for e in instantiate(nine[name]).entities if e.id == entity)
        argument = next(v for v in owner.verbs if v.name == verb).arguments[0]
        return argument.minimum, argument.maximum

    assert bounds("vdn", "dog", "forward") == (5.0, 25.0)
    assert bounds("vdn", "dog", "left") == bounds("vdn", "dog", "right") == (1.0, 90.0)
    assert bounds("idf", "dog[1]", "forward") == (0.0, 10.0)


def test_missions_have_the_declared_stage_budgets_and_counted_limits(nine: dict[str, Mission]) -> None:
    vdn = instantiate(nine["vdn"])
    assert {getattr(stage.ticks, "value", None) for stage in vdn.stages} == {40.0}
    cr = instantiate(nine["cr"], settings={"replans_most": 0})
    assert [(limit.name, limit.most) for limit in cr.limits] == [("replans", 0)]
    ld = instantiate(nine["ld"])
    assert {item.resource for item in ld.limits[0].counts} == {"uav", "van"}


def test_each_mission_hides_the_positions_of_the_expected_groups(nine: dict[str, Mission]) -> None:
    hidden = {
        name: sorted({e.group for e in instantiate(compiled).entities if "position" in e.hidden})
        for name, compiled in nine.items()
    }
    assert hidden == {
        "bi": ["fracture"], "cd": [], "cr": ["jam"], "idf": ["fire"], "ld": ["house", "jam"], "ssr": ["victim"],
        "ufr": ["fire"], "upr": ["leak"], "vdn": ["home"],
    }  # fmt: skip


def test_one_order_exceeds_the_payload_of_a_van(nine: dict[str, Mission]) -> None:
    entities = instantiate(nine["cd"]).entities
    demands = [e.properties["demand_kg"] for e in entities if e.group == "point"]
    assert sorted(demands) == [100.0] * 19 + [250.0]
    assert {e.properties["payload_kg"] for e in entities if e.group == "van"} == {200.0}
    assert {e.state for e in entities if e.group == "van"} == {(StateSpec(name="load", unit="kg"),)}


def test_summaries_equal_the_golden_file(nine: dict[str, Mission], request: pytest.FixtureRequest) -> None:
    text = "\n".join(summary(nine[name]) for name in NAMES)
    if request.config.getoption("--update", default=False):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")


def summary(mission: Mission) -> str:
    """A mission in some twenty lines: agents, places, rules, and the draws of seed 0."""
    lines = [
        f"# {mission.name}: {mission.title}",
        f"scene {mission.scene.kind}, modes {', '.join(mission.modes.allowed)}",
    ]
    for mode in mission.modes.allowed:
        instance: Instance = instantiate(mission, mode=mode)
        lines.append(f"{mode}: {', '.join(f'{a.id} as {a.role}' for a in instance.agents)}")
        lines.append(f"  messages: {', '.join(m.kind for m in instance.messages) or 'none'}")
        lines.append(f"  relations: {', '.join(f'{r.kind} {r.source}-{r.target}' for r in instance.relations)}")
    instance = instantiate(mission)
    for entity in instance.entities:
        east, north, _ = entity.position
        hides = f" hides {', '.join(entity.hidden)}" if entity.hidden else ""
        verbs = f": {', '.join(verb.name for verb in entity.verbs)}" if entity.verbs else ""
        lines.append(f"{entity.id} ({entity.type}) at {east:g}, {north:g}{hides}{verbs}")
    lines.append(f"stages: {', '.join(stage.name for stage in mission.stages)}")
    lines.append(f"rules: {', '.join(rule.name for rule in mission.rules)}")
    bound = [*mission.limits, *mission.permits, *mission.constraints, *mission.inspections, *mission.sweeps]
    names = [getattr(item, "name", "permit") for item in bound]
    lines.append(f"bound by: {', '.join(names) or 'nothing more'}")
    lines.append(f"success: {msgspec.json.encode(mission.success).decode()}")
    return "\n".join(lines) + "\n"
