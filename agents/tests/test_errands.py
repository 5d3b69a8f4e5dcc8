"""Bodies with an errand: a picture, a place to fly to; both policies win with them."""

from pathlib import Path

import pytest
from lingjing_agents.heuristic.errand_rules import GoalFlyer, PictureTaker
from lingjing_agents.heuristic.policy import rules_for

import lingjing
from lingjing.errors import ExitCode
from lingjing.testing import brief_of, instantiate, run_command

RESET = Path(__file__).parents[2] / "scenarios" / "reset"


@pytest.mark.parametrize(("mission", "rules"), [("free", PictureTaker), ("goals", GoalFlyer)])
def test_rules_are_chosen_by_the_success_condition(mission: str, rules: type) -> None:
    instance = instantiate(lingjing.compile(RESET / f"{mission}.ljs"))
    for agent in instance.agents:
        chosen = rules_for(brief_of(instance, agent.id, ("quadrotor",)))
        assert isinstance(chosen, rules) and agent.role in rules.roles


@pytest.mark.parametrize(("mission", "policy"), [("free", "heuristic"), ("goals", "heuristic"), ("goals", "oracle")])
def test_the_mission_is_won(mission: str, policy: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["run", str(RESET / f"{mission}.ljs"), "--policy", policy, "--no-overview", "-o", str(tmp_path / "out")]
    assert run_command(arguments) == ExitCode.OK
    assert "success: yes" in capsys.readouterr().out
