"""Every agent of the shipped missions has rules with its role and message records."""

import re
from pathlib import Path

import pytest
from lingjing_agents.heuristic.policy import ROLE_RULES, rules_for

import lingjing
from lingjing.plugins.decisions import sendable
from lingjing.testing import brief_of, instantiate

SCENARIOS = Path(__file__).parents[2] / "scenarios"
MISSIONS = sorted(SCENARIOS.glob("*.ljs"))


def test_records_are_those_of_the_standard_library():
    text = (SCENARIOS / "std/messages.ljs").read_text()
    known = set(re.findall(r"^record (\w+) :", text, re.MULTILINE))
    for rules in ROLE_RULES:
        assert rules.reads or rules.sends, rules
        assert {*rules.reads, *rules.sends} <= known, rules


@pytest.mark.parametrize("path", MISSIONS, ids=lambda path: path.stem)
def test_rules_serve_the_roles_and_records_of_a_mission(path: Path):
    mission = lingjing.compile(path)
    for mode in mission.modes.allowed or ("",):
        instance = instantiate(mission, mode=mode or None)
        classes = tuple(dict.fromkeys(entity.type for entity in instance.entities))
        for agent in instance.agents:
            brief = brief_of(instance, agent.id, classes)
            rules = rules_for(brief)
            assert rules is not None, agent.id
            assert agent.role in rules.roles, (agent.id, type(rules))
            records = {message.type for message in sendable(brief)}
            assert not records or not rules.sends or records.intersection(rules.sends), (agent.id, type(rules))
