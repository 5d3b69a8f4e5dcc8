"""Rectangles around obstacles in a depth picture from above, and the depths that the request-only player reads."""

import dataclasses

import msgspec
import numpy as np
import pytest
from lingjing_agents.react.pictures import in_words
from lingjing_agents.react.standing import MOST, _top_m, standing
from lingjing_agents.reader.request_text import depth_from

from agents.tests.agent_kit import brief, picture
from lingjing.plugins.geometry import camera_axes, focal_px, world_to_pixel
from lingjing.plugins.policy import Picture

HOUSES = ((-60, -20, -20, 0, 9.0), (-14, -20, 40, 0, 12.0), (-50, 20, 30, 36, 6.0))
CAR = (2, 8, 4, 13, 1.5)
GROUND_M = 3.0


def _view(blocks: tuple[tuple[float, ...], ...], waves_m: float = 0.0) -> Picture:
    """Return a picture from 100 m above the ground at the origin, with the depths of blocks by ray casting."""
    shot = picture((0.0, 0.0, 100.0 + GROUND_M))
    pose = msgspec.structs.replace(shot.pose, width=960, height=540)
    right, down, forward = (np.array(axis) for axis in camera_axes(pose))
    focal = focal_px(pose)
    u, v = np.meshgrid(
        (np.arange(pose.width) + 0.5 - pose.width / 2) / focal, (np.arange(pose.height) + 0.5 - pose.height / 2) / focal
    )
    rays = forward + u[..., None] * right + v[..., None] * down
    depth = (GROUND_M - pose.position[2]) / rays[..., 2]
    for west, south, east, north, height in blocks:
        reach = (GROUND_M + height - pose.position[2]) / rays[..., 2]
        x, y = pose.position[0] + reach * rays[..., 0], pose.position[1] + reach * rays[..., 1]
        met = (x >= west) & (x < east) & (y >= south) & (y < north) & (reach < depth)
        depth = np.where(met, reach, depth)
    if waves_m:
        depth = depth + waves_m * np.sin(np.arange(pose.width) / 9.0)
    return dataclasses.replace(shot, pose=pose, depth=depth.astype(np.float32))


def test_houses_their_gap_and_a_car_are_described_within_a_metre() -> None:
    seen = standing(_view((*HOUSES, CAR)))
    assert seen is not None and (seen.ground_m, seen.left_out) == (pytest.approx(GROUND_M, abs=0.05), 0)
    true = sorted((*block[:4], round(GROUND_M + block[4])) for block in (*HOUSES, CAR))
    assert np.abs(np.array(sorted(seen.rectangles)) - np.array(true)).max() <= 1
    areas = [(east - west) * (north - south) for west, south, east, north, _ in seen.rectangles]
    assert areas == sorted(areas, reverse=True)


def test_the_depths_that_the_player_reads_are_those_of_the_picture() -> None:
    shot = _view((*HOUSES, CAR))
    read = depth_from(in_words(shot, brief("scout[1]", "broadcast")), shot.pose)
    assert read is not None and shot.depth is not None
    assert np.mean(np.abs(read - shot.depth) > 1.0) < 0.03


def test_lamps_are_described_as_places_and_appear_in_the_depths_of_the_reader() -> None:
    lamps = ((10, -30, 10.6, -29.4, 6.0), (-30, 9, -29.4, 9.6, 6.0))
    shot = _view((*HOUSES, *lamps))
    seen = standing(shot)
    assert seen is not None and len(seen.rectangles) == len(HOUSES)
    assert [(abs(x - at[0]) <= 1, abs(y - at[1]) <= 1) for (x, y), at in zip(seen.posts, lamps[::-1], strict=True)] == [
        (True, True)
    ] * 2
    read = depth_from(in_words(shot, brief("scout[1]", "broadcast")), shot.pose)
    assert read is not None
    u, v, _ = world_to_pixel(shot.pose, (seen.posts[0][0] + 0.5, seen.posts[0][1] + 0.5, GROUND_M + 4.0)) or (0, 0, 0)
    assert read[int(v), int(u)] == pytest.approx(96.0, abs=0.5)


def test_objects_beyond_the_limit_are_counted_and_the_largest_are_kept() -> None:
    cars = tuple((x, y, x + 2, y + 5, 1.5) for x in range(-80, 80, 8) for y in (-44, -32, -20, 4, 14, 24))
    seen = standing(_view((*cars, (-70, -8, 70, 0, 8.0))))
    assert seen is not None and (len(seen.rectangles), seen.left_out) == (MOST, len(cars) + 1 - MOST)
    assert seen.rectangles[0][2] - seen.rectangles[0][0] >= 139


def test_waves_have_no_ground_and_keep_the_table_of_depths() -> None:
    shot = _view((), waves_m=2.0)
    assert standing(shot) is None
    described = in_words(shot, brief("scout[1]", "broadcast"))
    assert "standing" not in described and "depth_m" in described


def test_bare_ground_adds_no_description() -> None:
    described = in_words(_view(()), brief("scout[1]", "broadcast"))
    assert not {"standing", "depth_m"} & described.keys()


def test_a_rectangle_in_a_hidden_gap_is_as_high_as_its_highest_neighbour() -> None:
    """A tower hides a gap of two metres. Regression: its rectangle had no top, and the agent lost its turn."""
    tops = np.full((6, 8), -np.inf)
    tops[:, :3], tops[:, 5:] = 40.0, 25.0
    assert _top_m(tops, (3, 0, 5, 6)) == 40.0
    assert _top_m(tops, (5, 0, 8, 6)) == 25.0
