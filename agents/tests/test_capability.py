"""The facts that a policy of this package takes from its brief."""

from __future__ import annotations

import pytest
from lingjing_agents.capability import claims_limit

from lingjing.testing import instantiate, mission_file
from lingjing.testing.missions import brief_of


@pytest.mark.parametrize(("tier", "most"), [(0, None), (1, 9)])
def test_the_limit_of_claims_is_that_of_the_mission(tier: int, most: int | None) -> None:
    instance = instantiate(mission_file("idf"), tier=tier)
    brief = brief_of(instance, instance.agents[0].id)
    assert claims_limit(brief) == most
    assert any(limit.most == most for limit in brief.limits) == (most is not None)
