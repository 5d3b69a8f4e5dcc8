"""The walkers' rules, one situation at a time, without engines."""

import math

import msgspec
import numpy as np
import pytest
from lingjing_agents.capability import photo, team
from lingjing_agents.ground_plane import GroundRectangle, inside
from lingjing_agents.heuristic.dogs.building_finder import Belief, BuildingFinder, where_to_look
from lingjing_agents.heuristic.dogs.dog_rules import DogRules
from lingjing_agents.heuristic.dogs.fire_searcher import FireSearcher
from lingjing_agents.heuristic.dogs.known_fires import KnownFires
from lingjing_agents.heuristic.dogs.movement import DogMovement
from lingjing_agents.heuristic.dogs.seen_ground import OTHERS_M, SeenGround
from lingjing_agents.heuristic.dogs.step_executor import StepExecutor
from lingjing_agents.heuristic.guidance.to_leak import LeakGuidance, on_the_axis
from lingjing_agents.heuristic.policy import rules_for
from lingjing_agents.paths.kept_path import KeptPath
from lingjing_agents.paths.obstacle_grid import ObstacleGrid
from lingjing_agents.perception.facades import FacadeColumn
from lingjing_agents.perception.people_at_sea import FoundBox

import lingjing
from agents.tests.agent_kit import (
    ASSIGNMENT,
    EYE,
    GUIDANCE,
    REPORT,
    STATUS,
    Inbox,
    brief,
    dog,
    envelope,
    observe,
    quadrotor,
    sent_by,
    view,
)
from lingjing.plugins.geometry import offset_xy
from lingjing.plugins.policy import (
    CameraPose,
    Peer,
    Picture,
    Receipt,
    Region,
)
from lingjing.testing import instantiate, mission_file

YARD = ((0.0, 0.0), (100.0, 0.0), (100.0, 80.0), (0.0, 80.0))
EYE_M, FLAMES_M = 0.4, 1.7
"""Height of a dog's eye, and of the flames of a fire, metres."""
GATE = ((-5.0, 35.0), (5.0, 35.0), (5.0, 45.0), (-5.0, 45.0))


def refused(reason: str) -> Inbox:
    receipt = Receipt(request="c1-1", tick=1, sender="me", resource="dog", status="rejected", reason=reason)
    return Inbox(receipts=(receipt,))


class Walked:
    """A dog without delay in a world with one wall (x0, y0, x1, y1), which stops it a metre before."""

    def __init__(self, wall: tuple[float, float, float, float]) -> None:
        self.wall, self.at, self.heading, self.bumps = wall, (0.0, 0.0), 0.0, 0

    def obey(self, command) -> Inbox:
        if command.verb in ("left", "right"):
            turn = command.arguments["angle"] * (1 if command.verb == "right" else -1)
            self.heading = (self.heading + turn) % 360.0
            return Inbox()
        east, north = math.sin(math.radians(self.heading)), math.cos(math.radians(self.heading))
        x0, y0, x1, y1 = self.wall
        for _ in range(round(command.arguments["distance"] / 0.1)):
            x, y = self.at[0] + 0.1 * east, self.at[1] + 0.1 * north
            if x0 - 0.4 <= x <= x1 + 0.4 and y0 - 0.4 <= y <= y1 + 0.4:
                self.bumps += 1
                return refused("blocked")
            self.at = x, y
        return Inbox()

    def view(self):
        return view("dog", (*self.at, 0.3), heading=self.heading)


@pytest.mark.parametrize(
    ("wall", "most"),
    [((100.0, 0.0, 101.0, 1.0), 6), ((-10.0, 15.0, 10.0, 18.0), 40), ((-3.0, 12.0, 20.0, 30.0), 60)],
)
def test_a_dog_reaches_a_goal_around_unknown_walls(wall, most):
    world, inbox = Walked(wall), Inbox()
    legs = DogMovement(dog(), ObstacleGrid(GroundRectangle(-40, -40, 60, 60)))
    steps = 0
    while steps < 80:
        own = world.view()
        legs.feel(own, inbox)
        command = legs.towards(own, (5.0, 38.0), reach_m=1.0)
        if command is None:
            break
        inbox, steps = world.obey(command), steps + 1
    assert math.dist(world.at, (5.0, 38.0)) <= 1.0
    assert steps <= most


def test_a_walk_rejected_as_unreachable_is_retried_at_half_the_distance():
    legs = DogMovement(dog(), ObstacleGrid())
    own = view("dog", (0.0, 0.0, 0.3))
    first = legs.step(own, 0.0, 10.0)
    legs.feel(own, refused("unreachable"))
    second = legs.step(own, 0.0, 10.0)
    assert (first.arguments["distance"], second.arguments["distance"]) == (10.0, 5.0)
    assert not legs.map.closed


def test_only_a_step_that_was_sent_can_meet_an_obstacle():
    legs = DogMovement(dog(), ObstacleGrid())
    own = view("dog", (0.0, 0.0, 0.3))
    legs.step(own, 0.0, 10.0)
    legs.sent(photo(dog(), EYE))
    assert not legs.feel(own, Inbox())
    legs.sent(legs.step(own, 0.0, 10.0))
    assert legs.feel(own, Inbox())  # it was sent, and the dog has not moved
    assert legs.map.closed


def searching() -> FireSearcher:
    shared = brief(
        "scout[1]", resources=(dog(),), cells=(), messages=(REPORT, STATUS), classes=("fire_source",),
        regions=(Region(name="yard", polygon=YARD),),
    )  # fmt: skip
    return FireSearcher(shared, dog(), EYE)


def test_a_dog_at_the_place_of_a_reported_fire_looks_in_all_directions():
    rules, heading, looks = searching(), 0.0, []
    pictures, inbox = (), Inbox(messages=(envelope("scout[2]", REPORT, {"position": (50.2, 40.1, 0.0)}),))
    for tick in range(1, 10):
        seen = observe("scout[1]", tick, view("dog", (50.0, 40.0, 0.3), heading=heading), pictures=pictures)
        command = rules.act(seen, inbox).command
        assert command is not None
        pictures, inbox = (), Inbox()
        if command.verb == "takePhoto":
            looks.append(heading)
            pose = CameraPose(position=(50.0, 40.0, 0.4), heading_deg=heading, tilt_deg=0.0, hfov_deg=90.0,
                              width=1280, height=720)  # fmt: skip
            pictures = (
                Picture(frame=f"f{tick}", entity="dog", camera="front", tick=tick, time_s=0.0, pose=pose,
                        rgb=np.zeros((720, 1280, 3), np.uint8)),
            )  # fmt: skip
        else:
            assert command.verb in ("left", "right")
            heading = (heading + command.arguments["angle"] * (1 if command.verb == "right" else -1)) % 360.0
    assert looks[:4] == [0.0, 90.0, 180.0, 270.0]


def test_the_last_claim_is_kept_for_a_fire_that_has_none():
    """Two claims for each dog: a nearer view of the first fire takes neither, and another fire takes the last one."""
    (declared,) = instantiate(lingjing.compile(mission_file("idf")), seed=1, mode="broadcast", tier=1).limits
    limit = msgspec.structs.replace(declared, most=2 * len(team(brief("scout[1]"))))
    shared = brief(
        "scout[1]", resources=(dog(),), cells=(), messages=(REPORT, STATUS), classes=("fire_source",), limits=(limit,),
        regions=(Region(name="yard", polygon=YARD),),
    )  # fmt: skip
    seen: list[FoundBox] = []
    rules = FireSearcher(shared, dog(), EYE, {"fire_source": lambda picture, level_m: tuple(seen)})

    def reports(tick: int, east: float, away_m: float) -> int:
        """Take a picture of a fire straight ahead, on the line y = 60 m, and count the reports of it."""
        at, high = (east, 60.0 - away_m), FLAMES_M / away_m
        pose = CameraPose(position=(*at, EYE_M), heading_deg=0.0, tilt_deg=0.0, hfov_deg=90.0, width=720, height=720)
        foot = 0.5 + 0.5 * EYE_M / away_m
        seen[:] = [FoundBox((0.5 - high / 4.0, foot - high / 2.0, 0.5 + high / 4.0, foot), 1.0)]
        picture = Picture(frame=f"f{tick}", entity="dog", camera="front", tick=tick, time_s=0.0, pose=pose,
                          rgb=np.zeros((720, 720, 3), np.uint8))  # fmt: skip
        state = observe("scout[1]", tick, view("dog", (*at, 0.0)), pictures=(picture,))
        return sum(message.kind == REPORT.kind for message in rules.act(state, Inbox()).messages)

    assert [reports(tick, 50.0, away) for tick, away in enumerate((12.0, 6.0, 3.0), 1)] == [1, 0, 0]
    assert reports(9, 10.0, 12.0) == 1


def test_a_detected_building_is_reported_nearby_and_as_often_as_claims_allow():
    (declared,) = instantiate(lingjing.compile(mission_file("vdn")), seed=1, mode="single", tier=1).limits
    shared = brief(
        "scout[1]", resources=(dog(),), cells=(), messages=(REPORT,), classes=("reference_building",),
        regions=(Region(name="yard", polygon=YARD),), limits=(msgspec.structs.replace(declared, most=1),),
    )  # fmt: skip
    seen: list[FoundBox] = []
    rules = BuildingFinder(
        shared, dog(), EYE, None, (50.0, 0.0), {"reference_building": lambda picture, level_m: tuple(seen)}
    )

    def reports(tick: int, away_m: float) -> int:
        """Take a picture from y = 0 of a building with its foot so far ahead, and count the reports of it."""
        pose = CameraPose(position=(50.0, 0.0, EYE_M), heading_deg=0.0, tilt_deg=0.0, hfov_deg=90.0, width=720,
                          height=720)  # fmt: skip
        seen[:] = [FoundBox((0.4, 0.3, 0.6, 0.5 + 0.5 * EYE_M / away_m), 1.0)]
        picture = Picture(frame=f"f{tick}", entity="dog", camera="front", tick=tick, time_s=0.0, pose=pose,
                          rgb=np.zeros((720, 720, 3), np.uint8))  # fmt: skip
        state = observe("scout[1]", tick, view("dog", (50.0, 0.0, 0.0)), pictures=(picture,))
        return sum(message.kind == REPORT.kind for message in rules.act(state, Inbox()).messages)

    assert [reports(tick, away_m) for tick, away_m in enumerate((80.0, 40.0, 30.0), 1)] == [0, 1, 0]


def test_a_false_fire_that_is_seen_again_is_reopened_with_half_its_tries():
    fires = KnownFires()
    fire = fires.add((0.0, 10.0), 8.0)
    fire.state, fire.tries = "false", 15
    assert fires.add((0.0, 9.0), 4.0) is fire
    assert (fire.state, fire.tries, fire.place) == ("open", 7, (0.0, 9.0))


def test_a_path_is_kept_until_it_is_blocked():
    known = ObstacleGrid(GroundRectangle(-30, -30, 30, 30))
    for x in range(-9, 10):
        known.close((float(x), 10.0))
    way = KeptPath(known, 1.0)
    first = way.ahead((0.0, 0.0), (0.0, 20.0), 1.0)
    side = math.copysign(1.0, first[0][0])
    assert way.ahead((-side * 0.4, 0.0), (0.3, 20.0), 1.0)[0] == first[0]
    known.close(first[0])
    assert way.ahead((0.0, 0.0), (0.0, 20.0), 1.0)[0] != first[0]


def test_an_enclosed_walker_forgets_its_obstacles_once_for_each_goal():
    known = ObstacleGrid(GroundRectangle(-12, -12, 12, 12))
    ring = [(x, y) for x in range(-4, 5) for y in range(-4, 5) if max(abs(x), abs(y)) >= 3]
    for x, y in ring:
        known.close((float(x), float(y)))
    assert known.route((0.0, 0.0), (10.0, 0.0)) == ()
    way = KeptPath(known, 1.0)
    assert way.ahead((0.0, 0.0), (10.0, 0.0), 1.0)
    for x, y in ring:
        known.close((float(x), float(y)))
    assert way.ahead((0.0, 0.0), (10.0, 0.0), 1.0) == ()


def test_turns_and_places_are_chosen_by_the_unseen_ground():
    views = SeenGround((YARD,))
    assert views.best_turn((0.0, 40.0), 90.0, 45.0) == 0.0
    views.see((0.0, 40.0), 90.0, 45.0)
    assert views.best_turn((0.0, 40.0), 90.0, 45.0) in (-90.0, 90.0)
    views.see_around((50.0, 40.0))
    left = min(math.dist(place, (50.0, 40.0)) for place in views.unseen)
    assert OTHERS_M < left < views.far_m  # the search of another dog counts within a smaller radius than its own
    east = views.next_place((0.0, 40.0), ((100.0, 40.0),))
    assert east is not None
    assert east[0] <= 50.0


def test_a_nearer_view_moves_a_fire_and_an_extinguished_fire_stays_out():
    fires = KnownFires()
    far = fires.add((0.0, 60.0), 60.0)
    assert fires.add((3.0, 47.0), 40.0) is far
    assert far.place == (3.0, 47.0)
    assert fires.put_out((4.0, 46.0), 3.2) is far
    assert fires.add((4.0, 60.0), 50.0).state == "out"
    assert fires.add((40.0, 47.0), 12.0) is not far


def test_ashes_are_not_a_new_fire_from_any_side():
    fires = KnownFires()
    fires.burnt((0.0, 50.0))
    fires.burnt((2.0, 51.0))
    assert len(fires.of("out")) == 1
    assert fires.is_behind_ashes((0.0, 10.0), -2.0, 2.0) and fires.is_behind_ashes((0.0, 10.0), 1.0, 3.0)
    assert not fires.is_behind_ashes((0.0, 10.0), 8.0, 12.0)
    assert fires.is_behind_ashes((40.0, 50.0), 268.0, 272.0)
    assert fires.is_behind_ashes((1.0, 49.0), 100.0, 130.0)  # beside it the ashes fill the picture


def test_wide_boxes_of_unknown_distance_outweigh_narrow_boxes_on_another_bearing():
    belief = Belief(YARD)
    for _ in range(4):
        belief.add((50.0, 5.0), 0.0, 45.0, (FacadeColumn(40.0, math.inf, 0.2),))
    for here in ((10.0, 10.0), (90.0, 10.0)):
        bearing = math.degrees(math.atan2(50.0 - here[0], 60.0 - here[1]))
        belief.add(here, bearing, 45.0, (FacadeColumn(bearing, math.inf, 1.0),))
    best, _ = belief.best((50.0, 5.0))
    assert best is not None and math.dist(best, (50.0, 60.0)) < 12.0


def test_the_belief_combines_bearings_and_removes_visited_places():
    belief = Belief(YARD)
    goal = (70.0, 50.0)
    for here in ((10.0, 10.0), (60.0, 5.0)):
        bearing = math.degrees(math.atan2(goal[0] - here[0], goal[1] - here[1]))
        belief.add(here, bearing, 45.0, (FacadeColumn(bearing, math.dist(here, goal) * 1.3, 0.9),))
    best, score = belief.best((60.0, 5.0))
    assert best is not None
    assert math.dist(best, goal) < 12.0
    assert score > 1.2
    belief.strike(goal, 40.0)
    assert belief.at(goal) == 0.0


def test_a_walker_outside_enters_by_the_smallest_region():
    outside = brief(regions=(Region(name="yard", polygon=YARD), Region(name="gate", polygon=GATE)), cells=())
    assert where_to_look(outside, (-60.0, 40.0)) == (YARD, (0.0, 40.0))
    assert where_to_look(outside, (50.0, 40.0)) == (YARD, None)


def test_an_executor_carries_out_one_step_after_another_and_reports_each_result():
    status = sent_by(STATUS, "executor")
    rules = rules_for(brief("skipper", role="executor", resources=(dog(eyes=False),), cells=(), messages=(status,)))
    assert isinstance(rules, DogRules)
    steps = [("right", 30.0), ("forward", 7.5), ("jump", 1.0)]
    guidance = [envelope("pilot", GUIDANCE, {"assignee": "skipper", "step": step, "amount": amount})
            for step, amount in steps]  # fmt: skip
    at = view("dog", (0.0, 0.0, 0.3))
    first = rules.act(observe("skipper", 1, at), Inbox(messages=tuple(guidance)))
    assert first.command is not None
    assert (first.command.verb, first.command.arguments) == ("right", {"angle": 30.0})
    waiting = rules.act(observe("skipper", 2, at), Inbox())
    assert waiting.command is None
    assert first.messages == waiting.messages == ()
    ended = Receipt(request="c1-1", tick=1, sender="skipper", resource="dog", status="completed")
    second = rules.act(observe("skipper", 3, at), Inbox(receipts=(ended,)))
    assert second.command is not None
    assert (second.command.verb, second.command.arguments) == ("forward", {"distance": 7.5})
    last = rules.act(observe("skipper", 4, at), refused("blocked"))
    assert last.command is None
    for decision, state in ((second, "done"), (last, "blocked")):
        (message,) = decision.messages
        assert message.kind == "progress"
        assert message.body == {"task": "step", "state": state, "position": (0.0, 0.0, 0.3)}


def test_an_executor_ignores_steps_for_another_agent():
    rules = StepExecutor(brief("skipper", resources=(dog(eyes=False),), cells=()), dog(eyes=False))
    other = envelope("pilot", GUIDANCE, {"assignee": "someone", "step": "forward", "amount": 5.0})
    at = view("dog", (0.0, 0.0, 0.3))
    assert rules.act(observe("skipper", 1, at), Inbox(messages=(other,))).command is None


def test_a_pilot_that_guides_flies_over_the_narrow_region_first():
    peers = (Peer(id="walker", role="executor", resources=("dog",)),)
    line = Region(name="line", polygon=((0.0, 0.0), (10.0, 0.0), (10.0, 80.0), (0.0, 80.0)))
    pilot = brief("scout[1]", resources=(quadrotor(1),), cells=(), peers=peers, role="pilot",
                 messages=(sent_by(GUIDANCE, "pilot", to=("executor",)),),
                 regions=(Region(name="area", polygon=YARD), line))  # fmt: skip
    rules = rules_for(pilot)
    assert isinstance(rules, LeakGuidance)
    seen = observe("scout[1]", 1, view("uav[1]", (0.0, 0.0, 1.0)), view("dog", (50.0, 0.0, 0.33)))
    command = rules.act(seen, Inbox()).command
    assert command is not None
    assert command.verb == "setDestination"
    assert 0.0 <= float(command.arguments["x"]) <= 10.0
    assert 12.0 <= float(command.arguments["z"]) <= 60.0


LINE = ((0.0, -6.0), (120.0, -6.0), (120.0, 6.0), (0.0, 6.0))


def test_a_leak_near_a_line_is_placed_on_the_axis_of_the_line():
    assert on_the_axis(LINE, (50.2, 3.1)) == pytest.approx((50.2, 0.0), abs=0.6)
    assert on_the_axis((), (50.2, 3.1)) == (50.2, 3.1), "without a line the place stays"
    assert on_the_axis(LINE, (50.0, 40.0)) == (50.0, 40.0), "and far from it too"


def believing_pilot() -> LeakGuidance:
    """A pilot that believes in a leak at (80, 0), and observes the dog."""
    peers = (Peer(id="scout[2]", role="pilot", resources=("uav[2]",)),
             Peer(id="walker", role="executor", resources=("dog",)))  # fmt: skip
    rules = rules_for(
        brief("scout[1]", role="pilot", resources=(quadrotor(1),), cells=(), peers=peers,
              messages=(sent_by(REPORT, "pilot"), sent_by(GUIDANCE, "pilot")),
              regions=(Region(name="line", polygon=LINE),))
    )  # fmt: skip
    assert isinstance(rules, LeakGuidance)
    return rules


FOUND = Inbox(messages=(envelope("scout[2]", REPORT, {"position": (80.0, 0.0, 0.0)}),))


def test_guidance_pauses_when_the_leak_is_in_reach_and_then_leads_nearer():
    rules = believing_pilot()
    own, beside = view("uav[1]", (60.0, 12.0, 30.0)), view("dog", (76.0, 0.0, 0.33), heading=90.0)
    sent = [rules.act(observe("scout[1]", 5, own, beside), FOUND).messages]
    sent += [rules.act(observe("scout[1]", tick, own, beside), Inbox()).messages for tick in range(6, 12)]
    steps = [tick for tick, messages in enumerate(sent, 5) if messages]
    assert steps and steps[0] >= 8, "4 m from the leak it waits first"


@pytest.mark.parametrize(("middle_m", "first"), [(77.0, "forward"), (70.0, "left")])
def test_spray_beside_the_leak_is_not_an_obstacle_and_a_wall_before_the_leak_is(middle_m, first):
    rules = believing_pilot()
    led = view("dog", (62.0, 0.0, 0.33), heading=90.0)
    pose = CameraPose(position=(middle_m, 0.0, 30.0), heading_deg=0.0, tilt_deg=90.0, hfov_deg=84.0, width=192,
                      height=108)  # fmt: skip
    depth = np.full((108, 192), 30.0, np.float32)
    depth[30:82, 88:105] = 26.0  # 4 m high, 4 m from west to east and 13 m from south to north
    shown = Picture(frame="f", entity="uav[1]", camera="nadir", tick=5, time_s=0.0, pose=pose, depth=depth,
                    rgb=np.zeros((108, 192, 3), np.uint8))  # fmt: skip
    rules.act(observe("scout[1]", 5, view("uav[1]", (middle_m, 0.0, 30.0))), FOUND)  # no dog to guide yet
    own = view("uav[1]", (middle_m, 0.0, 30.0))
    (step,) = rules.act(observe("scout[1]", 6, own, led, pictures=(shown,)), Inbox()).messages
    assert step.body["step"] == first


def test_a_pilot_sends_no_guidance_after_the_limit_is_reached():
    rules = believing_pilot()
    own, led = view("uav[1]", (60.0, 12.0, 30.0)), view("dog", (50.0, 0.0, 0.33), heading=90.0)
    (step,) = rules.act(observe("scout[1]", 5, own, led), FOUND).messages
    assert step.kind == "guide"
    spent = Receipt(request="m6-1", tick=6, sender="scout[1]", resource="guide", status="rejected", reason="limit")
    rules.act(observe("scout[1]", 6, own, led), Inbox(receipts=(spent,)))
    for tick in range(7, 40):
        assert rules.act(observe("scout[1]", tick, own, led), Inbox()).messages == ()


def test_pilots_divide_the_line_and_use_the_reports_of_other_pilots():
    line = Region(name="line", polygon=((0.0, -3.0), (120.0, -3.0), (120.0, 3.0), (0.0, 3.0)))
    everyone = [Peer(id=f"scout[{k}]", role="pilot", resources=(f"uav[{k}]",)) for k in (1, 2)]
    walker = Peer(id="walker", role="executor", resources=("dog",))
    guide = sent_by(GUIDANCE, "pilot")
    flown = []
    for k in (1, 2):
        peers = (*(peer for peer in everyone if peer.id != f"scout[{k}]"), walker)
        rules = rules_for(
            brief(f"scout[{k}]", role="pilot", resources=(quadrotor(k),), cells=(), regions=(line,), peers=peers,
                  messages=(sent_by(REPORT, "pilot"), guide))
        )  # fmt: skip
        own, led = view(f"uav[{k}]", (60.0, 12.0 * k, 30.0)), view("dog", (50.0, 0.0, 0.33))
        flown.append(rules.act(observe(f"scout[{k}]", 1, own, led), Inbox()).command)
        if k == 1:
            report = Inbox(messages=(envelope("scout[2]", REPORT, {"position": (80.0, 0.0, 0.0)}),))
            (step,) = rules.act(observe("scout[1]", 5, own, led), report).messages
            assert step.kind == "guide" and step.body["assignee"] == "walker"
    assert flown[0].arguments["x"] <= 62.0 <= flown[1].arguments["x"]
    assert abs(flown[0].arguments["z"] - flown[1].arguments["z"]) >= 2.5


def test_pictures_without_facades_leave_the_belief_at_zero():
    belief = Belief(YARD)
    belief.add((50.0, 40.0), 0.0, 45.0, ())
    assert belief.best((50.0, 40.0))[1] == 0.0
    assert np.isfinite(belief.at((10.0, 10.0)))


def test_a_navigator_walks_through_the_gate_and_then_goes_on():
    navigator = brief("skipper", role="navigator", resources=(dog(longest_m=25.0),), messages=(), cells=(),
                 regions=(Region(name="yard", polygon=YARD), Region(name="gate", polygon=GATE)))  # fmt: skip
    rules = rules_for(navigator)
    white = np.full((720, 1280, 3), (139, 149, 160), np.uint8)
    street = np.full((720, 1280, 3), (90, 140, 230), np.uint8)  # sky to the horizon
    street[360:] = 120
    reference = seen("reference", (0.0, 0.0), white)
    outside = observe("skipper", 0, view("dog", (-30.0, 40.0, 0.33), heading=90.0),
                      pictures=(seen("front", (-30.0, 40.0), street), reference))  # fmt: skip
    first = rules.act(outside, Inbox()).command
    assert first is not None
    assert (first.verb, first.arguments) == ("forward", {"distance": 25.0})
    in_the_gate = (-1.0, 40.0)
    turned = observe("skipper", 2, view("dog", (*in_the_gate, 0.33), heading=90.0),
                     pictures=(seen("front", in_the_gate, street),))  # fmt: skip
    second = rules.act(turned, Inbox()).command
    assert second is not None
    assert second.verb in ("left", "right")
    off_deg = second.arguments["angle"] * (1.0 if second.verb == "right" else -1.0)
    assert abs(off_deg) < 45.0, "within the open view of the picture"
    heading = 90.0 + off_deg
    third = rules.act(observe("skipper", 3, view("dog", (*in_the_gate, 0.33), heading=heading)), Inbox()).command
    assert third is not None
    assert third.verb == "forward"
    there = offset_xy(in_the_gate, heading, third.arguments["distance"])
    assert inside(YARD, there)
    further = observe(
        "skipper", 4, view("dog", (*there, 0.33), heading=heading), pictures=(seen("front", there, street),)
    )
    fourth = rules.act(further, Inbox()).command
    assert fourth is not None
    assert fourth.verb == "forward", "it does not turn back to the gate"


def seen(camera: str, here: tuple[float, float], rgb: np.ndarray) -> Picture:
    pose = CameraPose(position=(*here, 0.36), heading_deg=90.0, tilt_deg=0.0, hfov_deg=90.0, width=1280, height=720)
    return Picture(frame="f", entity="dog", camera=camera, tick=0, time_s=0.0, pose=pose, rgb=rgb)


@pytest.mark.parametrize(
    ("spec", "task"), [(GUIDANCE, {"step": "go"}), (ASSIGNMENT, {"task": "deliver"})], ids=["guidance", "assignment"]
)
def test_a_walker_without_a_reference_picture_goes_to_the_ordered_place(spec, task):
    """The place is 41 m away in the direction of 14 degrees."""
    walker = brief("skipper", role="courier", resources=(dog(longest_m=25.0),), cells=(), messages=(spec,),
                 regions=(Region(name="yard", polygon=YARD),), classes=("delivery_door",))  # fmt: skip
    street = np.full((720, 1280, 3), (90, 140, 230), np.uint8)
    street[360:] = 120

    def command(rules, tick, here, heading, *messages):
        at = observe("skipper", tick, view("dog", (*here, 0.33), heading=heading),
                     pictures=(seen("front", here, street),))  # fmt: skip
        decided = rules.act(at, Inbox(messages=messages)).command
        return (decided.verb, decided.arguments) if decided is not None else None

    def order(assignee):
        return envelope("pilot", spec, {"assignee": assignee, **task, "position": (60.0, 70.0, 0.0)})

    start, later = (50.0, 30.0), offset_xy((50.0, 30.0), 14.0, 25.0)
    rules = rules_for(walker)
    assert command(rules, 1, start, 0.0, order("skipper")) == ("right", {"angle": 14.0})
    assert command(rules, 2, start, 14.0) == ("forward", {"distance": 25.0})
    assert command(rules, 3, later, 14.0) == ("forward", {"distance": 14.73})
    for others in ((), (order("somebody"),)):
        assert command(rules_for(walker), 1, start, 14.0, *others) != ("forward", {"distance": 25.0})
