"""A trace's mission with fixed draws, and with parts removed."""

import msgspec
import pytest

import lingjing
from lingjing import Mission
from lingjing.bench.columns import Column, columns
from lingjing.causal.reduced_mission import ReducibleMission, RemovablePart
from lingjing.dsl.printing.printer import to_ljs
from lingjing.mission.instance import Instance
from lingjing.testing import compile_text, instantiate, shipped_missions

COLUMNS = columns(shipped_missions())
SEED = 7


def drawn(text: str, mode: str, seed: int = SEED) -> Instance:
    compiled = compile_text(text)
    assert compiled.mission is not None, compiled.diagnostics
    return instantiate(compiled.mission, seed=seed, mode=mode)


def comparable(instance: Instance) -> Instance:
    """Return an instance without the parts that shrinking changes on purpose: regions of draws, and guards of the
    mode.
    """
    return msgspec.structs.replace(
        instance,
        entities=tuple(msgspec.structs.replace(item, drawn_in=()) for item in instance.entities),
        **{name: tuple(msgspec.structs.replace(item, when=None) for item in getattr(instance, name))
           for name in ("relations", "constraints")},
    )  # fmt: skip


@pytest.mark.parametrize("column", COLUMNS, ids=[column.name for column in COLUMNS])
def test_the_mission_with_all_parts_gives_the_same_instance_for_any_seed(column: Column) -> None:
    mission = lingjing.compile(column.path)
    instance = instantiate(mission, seed=SEED, mode=column.mode)
    whole = ReducibleMission(mission, instance)
    text = to_ljs(whole.keeping(whole.parts, instance.budget.ticks).mission)
    assert "sites(" not in text
    for seed in (SEED, SEED + 1):
        again = drawn(text, column.mode, seed)
        other = msgspec.structs.replace(again, seed=SEED, scene=instance.scene) if seed != SEED else again
        assert comparable(other) == comparable(instance)


@pytest.fixture
def ssr() -> tuple[Mission, Instance]:
    mission = lingjing.compile("ssr")
    return mission, instantiate(mission, seed=SEED, mode="broadcast")


def test_remaining_entities_keep_their_positions(ssr: tuple[Mission, Instance]) -> None:
    mission, instance = ssr
    whole = ReducibleMission(mission, instance)
    removed = {RemovablePart("target", "victim[2]"), RemovablePart("agent", "scout[1]")}
    reduced = whole.keeping([part for part in whole.parts if part not in removed], 40)
    left = drawn(to_ljs(reduced.mission), "broadcast")
    places = {entity.id: entity.position for entity in instance.entities}
    now = {entity.id: entity.position for entity in left.entities}
    assert now == {
        "victim[1]": places["victim[1]"], "victim[2]": places["victim[3]"],
        "uav[1]": places["uav[2]"], "uav[2]": places["uav[3]"], "boat": places["boat"],
    }  # fmt: skip
    assert reduced.agents == {"scout[1]": "scout[2]", "scout[2]": "scout[3]", "skipper": "skipper"}
    assert left.budget.ticks == 40
    assert "one of 2 UAVs" in left.agents[0].prompt  # the parameter that counts them was lowered with them


def test_a_body_that_another_agent_may_command_stays_without_its_agent(ssr: tuple[Mission, Instance]) -> None:
    whole = ReducibleMission(*ssr)
    reduced = whole.keeping([part for part in whole.parts if part.name != "skipper"], 40)
    left = drawn(to_ljs(reduced.mission), "broadcast")
    assert "boat" in {item.id for item in left.entities}
    assert {item.id for item in left.agents} == {"scout[1]", "scout[2]", "scout[3]"}


def test_messages_of_required_assignments_are_kept(ssr: tuple[Mission, Instance]) -> None:
    """A stage requires them: without them every handoff fails, and not as in the episode."""
    kinds = [part.name for part in ReducibleMission(*ssr).parts if part.kind == "message"]
    assert kinds == ["detection", "progress"]


def test_a_mission_without_a_required_message_does_not_compile(ssr: tuple[Mission, Instance]) -> None:
    whole = ReducibleMission(*ssr)
    without_reports = whole.keeping([part for part in whole.parts if part.name != "detection"], 40)
    compiled = compile_text(to_ljs(without_reports.mission))
    assert compiled.mission is None
    assert "detection" in compiled.diagnostics[0].message
