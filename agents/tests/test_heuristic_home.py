"""Guidance of a walker to the house of a picture: walls and doors from above, paths of few commands, confirmation."""

import math

import msgspec
import numpy as np
import pytest
from lingjing_agents.ground_plane import GroundRectangle
from lingjing_agents.heuristic.guidance.to_building import BuildingGuidance
from lingjing_agents.heuristic.policy import rules_for
from lingjing_agents.heuristic.route_coordinator import RouteCoordinator
from lingjing_agents.paths.fewest_commands import OpenGround, PointsFromAbove, fewest_commands, ground_of
from lingjing_agents.perception.building_walls import ColouredPoints, find_walls, reference_signature

from agents.tests.agent_kit import (
    ASSIGNMENT,
    GUIDANCE,
    JAM,
    STATUS,
    Inbox,
    brief,
    dog,
    envelope,
    observe,
    sent_by,
    view,
)
from lingjing.plugins.geometry import bearing_deg, camera_axes, focal_px
from lingjing.plugins.policy import (
    CameraPose,
    Peer,
    Picture,
    Region,
    Resource,
)

YELLOW, BLUE, GREY, GREEN, GLASS = (229, 200, 100), (130, 165, 200), (130, 130, 130), (70, 110, 40), (90, 95, 100)
YARD = ((0.0, 0.0), (100.0, 0.0), (100.0, 90.0), (0.0, 90.0))
AROUND = GroundRectangle.around(YARD, 12.0)

Box = tuple[tuple[float, float, float], tuple[float, float, float], tuple[int, int, int]]


def house(west: float, south: float, colour: tuple[int, int, int], door: float) -> tuple[Box, ...]:
    """Return a house of 30 x 12 x 9 m with a canopy at its southern wall."""
    return (
        ((west, south, 0.0), (west + 30.0, south + 12.0, 9.0), colour),
        ((west + door - 1.6, south - 1.6, 2.8), (west + door + 1.6, south, 3.0), GREY),
    )


HOUSES = (*house(10.0, 60.0, YELLOW, 15.0), *house(60.0, 60.0, BLUE, 12.0))


def picture_of(boxes: tuple[Box, ...], pose: CameraPose, camera: str, entity: str) -> Picture:
    """Return a camera's picture of boxes with grey roofs on a lawn: colours and depth, ray by ray."""
    right, down, forward = (np.array(axis) for axis in camera_axes(pose))
    u = (np.arange(pose.width) + 0.5 - pose.width / 2) / focal_px(pose)
    v = (np.arange(pose.height) + 0.5 - pose.height / 2) / focal_px(pose)
    rays = forward + u[None, :, None] * right + v[:, None, None] * down
    eye = np.array(pose.position)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(rays[..., 2] < 0.0, -eye[2] / rays[..., 2], np.inf)
        rgb = np.where(np.isfinite(depth)[..., None], np.array(GREEN), np.array((150, 190, 240)))
        for low, high, colour in boxes:
            near, far = (np.array(low) - eye) / rays, (np.array(high) - eye) / rays
            enter = np.minimum(near, far)
            start, end = enter.max(axis=2), np.maximum(near, far).min(axis=2)
            hit = (start > 0.0) & (start <= end) & (start < depth)
            on_roof = enter.argmax(axis=2) == 2
            depth = np.where(hit, start, depth)
            rgb = np.where(hit[..., None], np.where(on_roof[..., None], np.array(GREY), np.array(colour)), rgb)
    shaded = rgb.astype(np.uint8)
    return Picture(frame=f"f-{camera}", entity=entity, camera=camera, tick=1, time_s=20.0, pose=pose, rgb=shaded,
                   depth=depth.astype(np.float32))  # fmt: skip


def from_above(x: float, y: float) -> Picture:
    pose = CameraPose(position=(x, y, 60.0), heading_deg=0.0, tilt_deg=90.0, hfov_deg=84.0, width=960, height=540)
    return picture_of(HOUSES, pose, "nadir", "uav")


def from_the_ground(x: float, y: float) -> Picture:
    pose = CameraPose(position=(x, y, 0.5), heading_deg=0.0, tilt_deg=5.0, hfov_deg=90.0, width=640, height=360)
    return picture_of(HOUSES, pose, "front", "dog")


def reference(x: float) -> Picture:
    """Return a photograph, taken from across the street, of the house with a door at `x`."""
    pose = CameraPose(position=(x, 36.0, 4.0), heading_deg=0.0, tilt_deg=0.0, hfov_deg=75.0, width=640, height=360)
    return picture_of(HOUSES, pose, "reference", "house")


REFERENCE = {"yellow": reference(25.0), "blue": reference(72.0)}


def test_walls_have_the_colours_and_doors_that_show_from_above():
    above = ColouredPoints.of(from_above(50.0, 46.0), 0.0, AROUND)
    assert above is not None
    walls = {(round(wall.middle[0] / 5) * 5, round(wall.bearing_deg)): wall for wall in find_walls((above,), AROUND)}
    yellow, blue = walls[25, 180], walls[75, 180]
    assert yellow.door == pytest.approx((25.0, 60.0), abs=0.7)
    assert blue.door == pytest.approx((72.0, 60.0), abs=0.7)
    look = reference_signature(REFERENCE["yellow"].rgb)
    assert yellow.colours is not None
    assert blue.colours is not None
    assert look.likeness(yellow.colours) > 0.8
    assert look.likeness(blue.colours) < 0.3
    assert yellow.long
    assert not walls[40, 90].long
    assert walls[25, 0].colours is None  # it looks away


def test_a_picture_without_depth_shows_no_walls():
    assert ColouredPoints.of(without_depth(from_above(50.0, 46.0)), 0.0, AROUND) is None


def without_depth(shown: Picture) -> Picture:
    return Picture(frame="f", entity="uav", camera="nadir", tick=1, time_s=0.0, pose=shown.pose, rgb=shown.rgb)


def test_a_tree_closes_only_the_ground_at_its_stem_and_a_building_all_its_ground():
    above = ColouredPoints.of(picture_of(
        (*HOUSES, ((48.0, 20.0, 2.6), (53.0, 25.0, 7.0), GREEN), ((20.0, 20.0, 0.0), (24.0, 22.0, 1.5), BLUE)),
        from_above(50.0, 46.0).pose, "nadir", "uav",
    ), 0.0, AROUND)  # fmt: skip
    assert above is not None
    ground = ground_of([PointsFromAbove(above.over, above.points)], AROUND, (50.0, 10.0))
    free = [(50.5, 27.0), (48.3, 20.3), (60.0, 40.0), (22.0, 26.0)]
    shut = [(50.5, 22.5), (25.0, 66.0), (22.0, 21.0)]
    for place, closed in [*((place, False) for place in free), *((place, True) for place in shut)]:
        row, column = int((place[1] - AROUND.south) / 0.5), int((place[0] - AROUND.west) / 0.5)
        assert bool(ground.closed[row, column]) is closed, place


def test_the_way_of_fewest_commands_goes_through_the_gap_and_stops_near_the_goal():
    bounds = GroundRectangle(0.0, 0.0, 100.0, 100.0)
    closed = np.zeros((200, 200), bool)
    closed[98:102] = True
    closed[98:102, 150:162] = False  # a gap at x 75 to 81
    ground, start, goal = OpenGround(bounds, closed), (20.0, 20.0), (80.0, 90.0)
    way = fewest_commands(ground, bounds, start, 0.0, goal, 9.0, 25.0)
    assert 2 <= len(way) <= 3
    assert math.dist(way[-1], goal) <= 9.0
    for a, b in zip((start, *way), way, strict=False):
        assert ground.open_lines(a, np.array([b])).all()
    closed[98:102] = True
    assert fewest_commands(OpenGround(bounds, closed), bounds, start, 0.0, goal, 9.0, 25.0) == ()
    assert fewest_commands(ground, bounds, goal, 0.0, goal, 9.0, 25.0) == ()


def block(west: float, south: float, east: float, north: float, top: float) -> np.ndarray:
    """Return points (n, 3) of a block's top, half a metre apart."""
    x, y = np.meshgrid(np.arange(west, east, 0.5), np.arange(south, north, 0.5))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, top)], axis=1)


def test_obstacles_at_a_place_are_read_from_the_picture_taken_nearest_above_it():
    bounds = GroundRectangle(0.0, 0.0, 60.0, 60.0)
    level = block(0.0, 0.0, 60.0, 60.0, 0.0)
    aside = PointsFromAbove((30.0, 0.0), np.vstack([level, block(20.0, 20.0, 40.0, 45.0, 16.0)]))  # house and tree
    above = PointsFromAbove((30.0, 40.0), np.vstack([level, block(20.0, 20.0, 40.0, 34.0, 16.0)]))
    beside_it = np.array([(50.0, 40.0)])
    for views, is_open in (((aside,), False), ((above, aside), True), ((aside, above), True)):
        ground = ground_of(views, bounds, (10.0, 40.0))
        assert ground.open_lines((10.0, 40.0), beside_it).tolist() == [is_open]
        assert ground.open_lines((10.0, 25.0), np.array([(50.0, 25.0)])).tolist() == [False]
    # The nearest one shows no ground here.
    hidden = PointsFromAbove((30.0, 40.0), above.points[above.points[:, 1] < 38.0])
    assert ground_of((hidden, aside), bounds, (10.0, 40.0)).open_lines((10.0, 40.0), beside_it).tolist() == [False]


def test_a_long_narrow_object_closes_its_ground_and_is_not_a_tree_crown():
    bounds = GroundRectangle(0.0, 0.0, 60.0, 60.0)
    level, fence, crown = (
        block(0.0, 0.0, 60.0, 60.0, 0.0),
        block(20.0, 20.0, 22.5, 34.0, 8.0),
        block(40.0, 20.0, 45.0, 25.0, 8.0),
    )
    ground = ground_of([PointsFromAbove((30.0, 30.0), np.vstack([level, fence, crown]))], bounds, (10.0, 10.0))
    for y in (22.0, 27.0, 33.0):
        assert ground.open_lines((10.0, y), np.array([(30.0, y)])).tolist() == [False]
    assert ground.open_lines((38.0, 20.3), np.array([(50.0, 20.3)])).tolist() == [True]


def test_a_path_avoids_a_tree_crown_unless_the_detour_is_long():
    bounds = GroundRectangle(0.0, 0.0, 100.0, 60.0)
    level, crown = block(0.0, 0.0, 100.0, 60.0, 0.0), block(47.0, 10.0, 53.0, 17.0, 3.0)
    near_wall, start, goal = block(0.0, 14.5, 44.0, 60.0, 1.5), (20.0, 11.5), (80.0, 11.5)
    ways = {}
    for name, blocks in (
        ("open", ()),
        ("walled", (block(44.0, 17.0, 100.0, 60.0, 1.5), block(0.0, 0.0, 100.0, 8.5, 1.5))),
    ):
        views = [PointsFromAbove((50.0, 30.0), np.vstack([level, crown, near_wall, *blocks]))]
        ground = ground_of(views, bounds, start)
        way = fewest_commands(ground, bounds, start, 90.0, goal, 3.0, 25.0)
        assert way
        ways[name] = [bool(ground.hidden_lines(a, np.array([b]))[0]) for a, b in zip((start, *way), way, strict=False)]
    assert not any(ways["open"])
    assert any(ways["walled"])


def test_a_path_leads_along_a_passage_between_two_rows_of_the_lattice():
    bounds = GroundRectangle(0.0, 0.0, 100.0, 100.0)
    closed = np.zeros((200, 200), bool)
    closed[60:114, 20:180] = True  # a block from y 30 to 57
    closed[118:160, 20:180] = True  # and one from y 59: a passage of 2 m, between the lattice's rows at 56 and 60
    ground, start, goal = OpenGround(bounds, closed), (5.0, 20.0), (50.0, 58.0)
    way = fewest_commands(ground, bounds, start, 0.0, goal, 3.0, 25.0)
    assert way, "a passage without a corner"
    assert 57.0 <= way[-1][1] <= 59.0
    for a, b in zip((start, *way), way, strict=False):
        assert ground.open_lines(a, np.array([b])).all()


MESSAGES = (
    sent_by(GUIDANCE, "boss", to=("courier",)), sent_by(JAM, "boss", "eye"), sent_by(ASSIGNMENT, "boss"), STATUS,
)  # fmt: skip
PEERS = (
    Peer(id="eye", role="eye", resources=("uav",)),
    Peer(id="driver", role="driver", resources=("van",)),
    Peer(id="courier", role="courier", resources=("dog",)),
)


def brief_of(name: str, *resources: Resource):
    return msgspec.structs.replace(
        brief(), agent=name, role=name, resources=resources, messages=MESSAGES, cells=(), settings={}, tick_s=20.0,
        ticks=50, peers=tuple(peer for peer in PEERS if peer.id != name), water_level_m=0.0,
        regions=(Region(name="yard", polygon=YARD),),
    )  # fmt: skip


def at(tick: int, *pictures: Picture, walker=(50.0, 10.0, 0.33), heading: float = 0.0):
    return observe("boss", tick, view("dog", walker, heading=heading), pictures=pictures)


def guide_of(colour: str) -> BuildingGuidance:
    guide = BuildingGuidance.of(brief_of("boss"), at(0, REFERENCE[colour]))
    assert guide is not None
    return guide


def steps(messages) -> list[tuple[str, tuple[float, float]]]:
    return [(note.body["step"], tuple(note.body["position"][:2])) for note in messages]


@pytest.mark.parametrize(("colour", "door"), [("yellow", (25.0, 60.0)), ("blue", (72.0, 60.0))])
def test_a_walker_is_guided_to_the_front_of_the_house_in_the_reference_picture(colour: str, door: tuple[float, float]):
    guide = guide_of(colour)
    guide.see(at(1, from_above(50.0, 46.0)))
    sent_steps = steps(guide.lead(at(1), waited=True))
    assert [step for step, _ in sent_steps] == ["walk"] * (len(sent_steps) - 1) + ["face"]
    assert math.dist(sent_steps[-2][1], door) <= 9.5
    assert math.dist(sent_steps[-1][1], door) <= 0.7
    assert guide.lead(at(2), waited=True) == ()  # it is on its way


def test_a_facade_is_given_up_if_the_walkers_picture_shows_another_house():
    guide = guide_of("yellow")
    guide.see(at(1, from_above(50.0, 46.0)))
    ((_, first),) = steps(guide.lead(at(1), waited=True))[-1:]
    assert first[0] < 50.0
    wrong = from_the_ground(72.0, 45.0)
    guide.see(at(5, shown_at(wrong, (25.0, 45.0)), walker=(25.0, 45.0, 0.33)))
    ((_, second),) = steps(guide.lead(at(5, walker=(25.0, 45.0, 0.33)), waited=True))[-1:]
    assert math.dist(first, second) > 20.0


def shown_at(shown: Picture, here: tuple[float, float]) -> Picture:
    pose = msgspec.structs.replace(shown.pose, position=(*here, 0.5), heading_deg=bearing_deg(here, (25.0, 60.0)))
    return Picture(frame="f", entity="dog", camera="front", tick=5, time_s=0.0, pose=pose, rgb=shown.rgb)


def test_a_walker_without_success_is_sent_nearer_and_then_to_another_house():
    guide = guide_of("yellow")
    guide.see(at(1, from_above(50.0, 46.0)))
    ways = [steps(guide.lead(at(1), waited=True))]
    for tick in range(2, 20):
        way = steps(guide.lead(at(tick, walker=(*ways[-1][-2][1], 0.33)), waited=True))
        ways += [way] if way else []
    first, nearer, other = (way[-2][1] for way in ways[:3])
    assert 5.0 < math.dist(first, (25.0, 60.0)) <= 9.5
    assert math.dist(nearer, (25.0, 60.0)) <= 5.0
    assert math.dist(other, (25.0, 60.0)) > 20.0


def test_guidance_needs_a_reference_picture_and_a_similar_wall():
    assert BuildingGuidance.of(brief_of("boss"), at(0)) is None
    guide = guide_of("blue")
    guide.viewpoints((50.0, -5.0), 9)
    far = msgspec.structs.replace(from_above(50.0, 46.0).pose, position=(-20.0, 46.0, 60.0))
    guide.see(at(1, picture_of(HOUSES[:2], far, "nadir", "uav")))
    assert guide.lead(at(1), waited=False) == ()


def test_viewpoints_in_the_region_start_at_the_side_of_the_route():
    places = guide_of("blue").viewpoints((50.0, -5.0), 9)
    assert [round(x) for x, _ in places] == [50, 50, 50]
    assert [y for _, y in places] == sorted(y for _, y in places)
    assert places[0][1] == pytest.approx(15.0)
    assert guide_of("blue").viewpoints((50.0, 5.0), 9) == places[1:], "the end of the route has a picture"


@pytest.mark.parametrize(("moves", "looks"), [(50.0, 3), (12.0, 2), (10.0, 1)])
def test_a_coordinator_orders_as_many_pictures_after_the_route_as_the_moves_allow(moves: float, looks: int):
    boss = RouteCoordinator(msgspec.structs.replace(brief_of("boss"), settings={"moves_most": moves}))
    boss.act(at(0, REFERENCE["blue"]), Inbox())
    van = msgspec.structs.replace(view("van", (0.0, -60.0, 0.0)), route=((50.0, -60.0, 0.0), (50.0, -5.0, 0.0)))
    decision = boss.act(observe("boss", 1, van, view("dog", (50.0, 10.0, 0.33))), Inbox())
    tasks = [note.body["task"] for note in decision.messages]
    assert tasks == ["inspect", "inspect", *["look"] * looks]


DOG = dog(shortest_m=1.0, longest_m=25.0)


def test_a_guided_walker_waits_walks_the_path_and_photographs_the_facade():
    rules = rules_for(brief_of("courier", DOG))
    assert rules is not None
    start = view("dog", (50.0, 10.0, 0.33), heading=0.0)
    assert rules.act(observe("courier", 0, start, pictures=(REFERENCE["blue"],)), Inbox()).command is None
    way = [("walk", (50.0, 30.0)), ("face", (80.0, 30.0))]
    notes = tuple(
        envelope("boss", GUIDANCE, {"assignee": "courier", "step": step, "position": (*place, 0.0)})
        for step, place in way
    )
    walk = rules.act(observe("courier", 1, start), Inbox(messages=notes)).command
    assert walk is not None
    assert walk.verb == "forward"
    there = view("dog", (50.0, 29.0, 0.33), heading=0.0)
    turn = rules.act(observe("courier", 2, there), Inbox()).command
    assert turn is not None
    assert turn.verb == "right"
    facing = view("dog", (50.0, 29.0, 0.33), heading=88.0)
    look = rules.act(observe("courier", 3, facing), Inbox()).command
    assert look is not None
    assert look.verb == "takePhoto"
    assert rules.act(observe("courier", 4, facing), Inbox()).command is None  # it waits for an answer to the report
