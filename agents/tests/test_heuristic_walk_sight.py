"""The detections of dogs and their guides on rendered frames: flames, walls, leaks, the building of a reference
picture.
"""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from lingjing_agents.paths.obstacle_grid import ObstacleGrid
from lingjing_agents.perception.depth_points import close_what_stands, heights
from lingjing_agents.perception.facades import facade_box, find_facades, look_of
from lingjing_agents.perception.fires_ahead import find_fires_ahead
from lingjing_agents.perception.images import opencv
from lingjing_agents.perception.obstacles_ahead import near_walls
from lingjing_agents.perception.pipe_leaks import find_leaks

from lingjing.plugins.geometry import turn_deg
from lingjing.plugins.policy import CameraPose

FAR = CameraPose(position=(5.658, -5.230, 0.362), heading_deg=8.62, tilt_deg=5.86, roll_deg=-2.144, hfov_deg=90.0,
                 width=1280, height=720)  # fmt: skip
NEAR = CameraPose(position=(16.120, 32.691, 0.368), heading_deg=110.85, tilt_deg=5.297, roll_deg=-4.338, hfov_deg=90.0,
                  width=1280, height=720)  # fmt: skip
ABOVE = CameraPose(position=(-57.0, 13.006, 23.896), heading_deg=0.0, tilt_deg=90.0, hfov_deg=84.0, width=960,
                   height=540)  # fmt: skip
STREET = CameraPose(position=(147.877, 56.174, 0.402), heading_deg=41.955, tilt_deg=-0.558, roll_deg=-5.787,
                    hfov_deg=90.0, width=1280, height=720)  # fmt: skip

FIRE_1, FIRE_3 = (20.36, 28.763), (-13.65, 42.231)
LEAK = (-60.0, 15.0, 1.4)


def load(name: str) -> np.ndarray:
    cv2 = opencv()
    picture = cv2.imread(str(Path(__file__).with_name("pictures") / name))
    assert picture is not None
    return cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)


def iou(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    common = max(wide, 0.0) * max(high, 0.0)
    return common / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - common)


def test_far_flames_are_boxed_and_placed_within_a_fifth_of_their_distance():
    fires = find_fires_ahead(load("walk_flames_far.jpg"), FAR)
    truth = {FIRE_1: (0.625, 0.3778, 0.6430, 0.4264), FIRE_3: (0.1945, 0.3653, 0.2109, 0.3972)}
    assert len(fires) == 2
    for place, box in truth.items():
        fire = max(fires, key=lambda fire: iou(fire.box, box))
        away = math.dist(place, FAR.position[:2])
        assert iou(fire.box, box) >= 0.5
        assert math.dist(fire.place, place) < 0.2 * away


def test_near_flames_are_one_fire_half_hidden_by_a_tank():
    (fire,) = find_fires_ahead(load("walk_flames_near.jpg"), NEAR)
    assert iou(fire.box, (0.6656, 0.2306, 0.7656, 0.5181)) > 0.8
    assert math.dist(fire.place, FIRE_1) < 1.2  # the tank hides its foot, which makes it seem a little farther
    assert fire.confidence > 0.8


@pytest.mark.parametrize("name", ["walk_facade.jpg", "walk_reference.jpg"])
def test_red_and_orange_buildings_are_not_flames(name: str):
    assert find_fires_ahead(load(name), STREET) == ()


@pytest.mark.parametrize("side", [14, 60])
def test_a_lamp_has_the_colours_of_flames_and_is_smooth(side: int) -> None:
    picture = np.full((720, 1280, 3), (90, 95, 100), np.uint8)
    picture[420 - 2 * side : 420, 600 : 600 + side] = (242, 150, 48)
    assert find_fires_ahead(picture, STREET) == ()
    uneven = np.random.default_rng(1).integers(-25, 26, (2 * side, side))
    picture[420 - 2 * side : 420, 600 : 600 + side, 1] += uneven.astype(np.uint8)
    assert len(find_fires_ahead(picture, STREET)) == 1


def test_a_tank_close_ahead_is_a_wall_and_open_ground_is_none():
    walls = near_walls(load("walk_flames_near.jpg"), NEAR)
    ahead = [turn_deg(NEAR.heading_deg, math.degrees(math.atan2(x - NEAR.position[0], y - NEAR.position[1])))
             for x, y in walls]  # fmt: skip
    assert sum(1 for angle in ahead if angle < 15.0) >= 8
    assert all(math.dist(wall, NEAR.position[:2]) < 9.5 for wall in walls)
    assert near_walls(load("walk_flames_far.jpg"), FAR) == ()


def test_a_leak_is_boxed_with_its_spray_and_placed_at_its_clamp():
    leak = find_leaks(load("guide_leak.jpg"), ABOVE, 0.0)[0]
    assert iou(leak.box, (0.2536, 0.3204, 0.4370, 0.4231)) >= 0.5
    assert math.dist(leak.place, LEAK) < 1.0
    assert leak.confidence > 0.5


def test_a_whole_pipe_has_no_leak():
    assert find_leaks(load("guide_no_leak.jpg"), ABOVE, 0.0) == ()


def test_a_sunlit_white_building_is_found_by_a_reference_picture_in_the_shade():
    look = look_of(load("walk_reference.jpg"))
    facades = find_facades(load("walk_facade.jpg"), STREET, look)
    offs = [turn_deg(STREET.heading_deg, facade.bearing_deg) for facade in facades]
    assert len(facades) >= 5
    assert all(-34.0 <= off <= -16.0 for off in offs)
    assert max(facade.likeness for facade in facades) > 0.9


def test_nothing_is_seen_in_the_dark():
    black = np.zeros((720, 1280, 3), np.uint8)
    look = look_of(load("walk_reference.jpg"))
    assert find_fires_ahead(black, FAR) == ()
    assert find_leaks(black, ABOVE, 0.0) == ()
    assert find_facades(black, STREET, look) == () and facade_box(black, STREET, look) is None


def test_walls_with_a_small_gap_are_one_box_down_to_the_horizon_without_a_distant_wall():
    pose = msgspec.structs.replace(STREET, tilt_deg=0.0, roll_deg=0.0)
    wall = np.full((720, 1280, 3), (90, 130, 220), np.uint8)
    for left, right, top in ((0, 400, 40), (420, 700, 60), (1000, 1100, 200)):
        wall[top:361, left:right] = (200, 190, 180)
        for row in range(top + 30, 340, 40):
            wall[row : row + 15, left:right] = (40, 50, 60)
    reference = np.full((72, 128, 3), (200, 190, 180), np.uint8)
    box = facade_box(wall, pose, look_of(reference))
    assert box is not None and iou(box, (0.0, 0.06, 0.547, 0.5)) > 0.9


def test_depth_from_above_closes_obstacles_and_not_the_guided_body():
    pose = CameraPose(position=(0.0, 0.0, 30.0), heading_deg=0.0, tilt_deg=90.0, hfov_deg=84.0, width=192, height=108)
    depth = np.full((108, 192), 30.0, np.float32)
    depth[20:40, 100:140] = 26.0  # a box 4 m high, north-east of the middle
    depth[52:57, 93:99] = 29.4  # a body under the camera
    known = ObstacleGrid()
    close_what_stands(known, heights(depth, pose, 0.0, stride=1), (0.0, 0.0))
    assert (4, 4) in known.closed
    assert not {(0, 0), (-7, -4)} & known.closed
