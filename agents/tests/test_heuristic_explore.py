"""The first goals of a searcher of a building: ground where a stage would be late, and a glimpse of a detector."""

import ast
import math

import numpy as np
import pytest
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.heuristic.dogs.dog_rules import DogRules
from lingjing_agents.heuristic.dogs.seen_ground import SeenGround
from lingjing_agents.heuristic.dogs.timely_stages import timely_distances_m
from lingjing_agents.heuristic.target_types import Detectors
from lingjing_agents.perception.people_at_sea import FoundBox

from agents.tests.agent_kit import Inbox, brief, dog, observe, view
from agents.tests.test_react_request import brief_of, placed
from lingjing.plugins.geometry import bearing_deg
from lingjing.plugins.policy import Brief, CameraPose, Picture, Region

WIDE = ((0.0, -150.0), (300.0, -150.0), (300.0, 150.0), (0.0, 150.0))
HERE = (5.0, 0.0)
STAGE = (
    "the stage *search* must be done within 40 ticks of the end of *enter*, or the mission ends; it is done when the "
    "horizontal distance from `dog` to `home` is at most `200 m` [≤ 200 m]"
)


def navigator(*rules: str) -> Brief:
    return brief("skipper", role="navigator", resources=(dog(longest_m=25.0),), messages=(), cells=(), rules=rules,
                 regions=(Region(name="compound", polygon=WIDE),), classes=("reference_building",))  # fmt: skip


def first_goal(of: Brief, detectors: Detectors) -> GroundPoint:
    """Return where the dog wants to go from `HERE`, in the open, after its pictures to the sides."""
    plain = np.full((720, 1280, 3), (90, 140, 230), np.uint8)  # sky to the horizon
    plain[360:] = 120
    rules, heading = DogRules(of, of.resources[0], detectors), 90.0
    for tick in range(8):
        pose = CameraPose(
            position=(*HERE, 0.36), heading_deg=heading, tilt_deg=0.0, hfov_deg=90.0, width=1280, height=720
        )
        shown = Picture(frame="f", entity="dog", camera="front", tick=tick, time_s=0.0, pose=pose, rgb=plain)
        seen = observe("skipper", tick, view("dog", (*HERE, 0.33), heading=heading), pictures=(shown,))
        decision = rules.act(seen, Inbox())
        goal = ast.literal_eval(decision.thought.removeprefix("towards "))
        if goal is not None:
            return goal
        assert decision.command is not None
        angle = decision.command.arguments["angle"]
        heading = (heading + (angle if decision.command.verb == "right" else -angle)) % 360.0
    raise AssertionError("the dog only turns")


@pytest.mark.parametrize(
    ("column", "agent", "distances_m"), [("vdn-single", "navigator", (150.0, 90.0)), ("ld-star", "courier", ())]
)
def test_distances_of_stages_with_a_time_limit_are_read_from_the_rules(
    column: str, agent: str, distances_m: tuple[float, ...]
) -> None:
    (spec,) = (spec for spec in placed(column)[0].agents if spec.id == agent)
    assert timely_distances_m(brief_of(column, spec)) == distances_m


def test_arrival_marks_the_ground_within_one_view_length_as_seen():
    ground = SeenGround((WIDE,), (120.0,))
    ground.come_to(HERE)
    assert min(math.dist(place, HERE) for place in ground.unseen) > 120.0
    assert min(math.dist(place, (0.0, 150.0)) for place in ground.unseen) < 12.0


def test_a_searcher_first_goes_to_the_ground_that_it_might_reach_too_late():
    nothing: Detectors = {"reference_building": lambda picture, ground_m: ()}
    assert math.dist(first_goal(navigator(STAGE), nothing), HERE) > 200.0
    assert math.dist(first_goal(navigator(), nothing), HERE) < 200.0


def test_a_searcher_goes_towards_a_detection():
    glimpse: Detectors = {"reference_building": lambda picture, ground_m: (FoundBox((0.9, 0.4, 0.92, 0.45), 1.0),)}
    goal = first_goal(navigator(STAGE), glimpse)
    assert bearing_deg(HERE, goal) == pytest.approx(90.0 + math.degrees(math.atan(0.41 / 0.5)), abs=6.0)
