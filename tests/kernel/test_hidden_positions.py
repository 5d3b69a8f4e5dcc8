"""Hidden positions in the sea rescue: instances that differ only there look the same to every policy at first."""

import msgspec
import pytest

from lingjing.mission.instance import Instance
from lingjing.testing import city_of, episode, instantiate


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
def test_hidden_positions_do_not_change_inputs_before_the_first_picture(mode):
    first = instantiate("ssr", seed=7, mode=mode)
    seen = []
    for instance in (first, moved(first)):
        with episode((instance, city_of(instance.scene))) as game:
            records = [game.published.record, game.do().record]
            hashes = [[record_of_agent.sha256 for record_of_agent in record.observations] for record in records]
            seen.append((game.kernel.briefs(), hashes))
    assert seen[0] == seen[1]
