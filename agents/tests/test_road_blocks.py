"""Blocked places of streets, in drawn pictures straight down."""

import math

import numpy as np
import pytest
from lingjing_agents.perception.road_blocks import _is_striped, blocks_of_vehicles, find_blocks

from lingjing.plugins.geometry import world_to_pixel
from lingjing.plugins.policy import CameraPose

POSE = CameraPose(position=(0.0, 0.0, 120.0), heading_deg=0.0, tilt_deg=90.0, hfov_deg=84.0, width=1920, height=1080)
LINE = ((1.65, -150.0), (1.65, 150.0))
OWN, OTHER = 1.65, -1.65
COLOURS = ((200, 30, 30), (230, 230, 230), (30, 60, 160), (180, 180, 60))


def street(*queues: tuple[float, float, float]) -> np.ndarray:
    """A grey picture with cars of 4.5 m every 6.5 m: (lane, first, last) of each queue, metres."""
    rgb = np.full((POSE.height, POSE.width, 3), 90, np.uint8)

    def paint(x0: float, y0: float, x1: float, y1: float, colour: tuple[int, int, int]) -> None:
        (u0, v1, *_), (u1, v0, *_) = (world_to_pixel(POSE, (x, y, 0.0)) for x, y in ((x0, y0), (x1, y1)))
        rgb[max(0, round(v0)) : max(0, round(v1)), max(0, round(u0)) : max(0, round(u1))] = colour

    for lane, first, last in queues:
        for number in range(int((last - first - 4.5) / 6.5) + 1):
            y = first + 6.5 * number
            paint(lane - 0.9, y, lane + 0.9, y + 4.5, COLOURS[number % len(COLOURS)])
    return rgb


@pytest.mark.parametrize("at", [-20.0, 0.0, 25.0])
def test_a_block_is_where_the_queues_of_both_directions_meet(at):
    rgb = street((OWN, at - 45.5, at + 6.0), (OTHER, at - 6.0, at + 45.5))
    block = find_blocks(rgb, POSE, 0.0, LINE)[0]
    assert block.certain
    assert math.dist(block.place, (1.65, at)) < 6.0
    assert block.box[1] < block.box[3]


def test_the_stripes_of_a_crossing_are_distinguished_from_a_vehicle():
    """A lane's piece, across and along: stripes lie along it, and a roof fills it."""
    lane = np.full((9, 20, 3), 90, np.uint8)
    stripes, roof = lane.copy(), lane.copy()
    stripes[1:3], stripes[4:6], stripes[7:9] = 240, 240, 240
    roof[:], roof[3:6, 8:12] = 200, 40
    assert [_is_striped(piece) for piece in (stripes, roof, lane)] == [True, False, False]


def test_a_queue_of_one_direction_is_no_block():
    assert find_blocks(street((OWN, -40.0, 6.0)), POSE, 0.0, LINE) == ()
    assert find_blocks(street(), POSE, 0.0, LINE) == ()
    assert find_blocks(np.zeros((POSE.height, POSE.width, 3), np.uint8), POSE, 0.0, LINE) == ()


def test_a_queue_cut_off_by_the_picture_is_an_uncertain_block():
    (block, *_) = find_blocks(street((OWN, 5.0, 63.0)), POSE, 0.0, LINE)
    assert not block.certain
    assert block.place[1] > 40.0


def boxed(*queues: tuple[float, float, float]) -> list[tuple[float, float, float, float]]:
    """The boxes of cars of 4.5 m every 13 m in the picture: (lane, first, last) of each queue, metres."""
    boxes = []
    for lane, first, last in queues:
        for y in np.arange(first, last - 4.4, 13.0):
            (u0, v1, *_), (u1, v0, *_) = (
                world_to_pixel(POSE, (lane + side, at, 0.0)) for side, at in ((-0.9, y), (0.9, y + 4.5))
            )
            box = (u0 / POSE.width, v0 / POSE.height, u1 / POSE.width, v1 / POSE.height)
            if box[1] < 1.0 and box[3] > 0.0:
                boxes.append((box[0], max(0.0, box[1]), box[2], min(1.0, box[3])))
    return boxes


@pytest.mark.parametrize("at", [-20.0, 0.0, 25.0])
def test_boxes_of_vehicles_show_where_the_queues_of_both_directions_meet(at):
    """Cars stand 13 m apart, as in the road engine; the front of each queue is up to 6 m beyond the place."""
    boxes = boxed((OWN, at - 50.5, at + 6.0), (OTHER, at - 6.0, at + 45.5))
    block = blocks_of_vehicles(boxes, POSE, 0.0, LINE)[0]
    assert block.certain and block.vehicles >= 6
    assert math.dist(block.place, (1.65, at)) < 6.0


def test_boxes_on_one_lane_or_beside_the_street_are_no_block_and_a_cut_off_queue_is_uncertain():
    assert blocks_of_vehicles([], POSE, 0.0, LINE) == ()
    assert blocks_of_vehicles(boxed((OWN, -40.0, 6.0)), POSE, 0.0, LINE) == ()
    assert blocks_of_vehicles(boxed((OWN + 15.0, -50.0, 6.0), (OTHER + 15.0, -6.0, 46.0)), POSE, 0.0, LINE) == ()
    (block, *_) = blocks_of_vehicles(boxed((OWN, 5.0, 63.0)), POSE, 0.0, LINE)
    assert not block.certain and block.place[1] > 40.0
