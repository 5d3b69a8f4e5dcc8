"""Hidden positions in the sea rescue: instances that differ only there look the same to every policy at first."""

from pathlib import Path

import msgspec
import pytest

from lingjing.dsl.loading.load import load_mission
from lingjing.kernel.step import Kernel
from lingjing.kernel.world import open_world
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.host import PluginHost

ROOT = Path(__file__).parents[2]


def moved(instance: Instance) -> Instance:
    """Move every victim 100 m further west, inside the searched region or not: no input may change."""
    entities = tuple(
        msgspec.structs.replace(entity, position=(entity.position[0] - 100.0, *entity.position[1:]))
        if "position" in entity.hidden
        else entity
        for entity in instance.entities
    )
    assert entities != instance.entities
    return msgspec.structs.replace(instance, entities=entities)


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_hidden_positions_leave_boundary_zero_and_a_blind_tick_unchanged(mode):
    host = PluginHost()
    first = instantiate(load_mission(ROOT / "scenarios" / "ssr.ljs"), seed=7, mode=mode)
    seen = []
    for instance in (first, moved(first)):
        world = open_world("inline", host=host)
        kernel = Kernel(instance, host.scene(instance.scene.kind).build(instance.scene), world)
        records = [kernel.reset().record, kernel.step(()).record]
        seen.append(
            (
                kernel.briefs(),
                [[record_of_agent.sha256 for record_of_agent in record.observations] for record in records],
            )
        )
        world.close()
    assert seen[0] == seen[1]
