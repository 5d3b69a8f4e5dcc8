"""Counting people in line on drawn pictures, and the orders to walkers."""

import math

import msgspec
import numpy as np
import pytest
from lingjing_agents.heuristic.line_counter import LineCounter
from lingjing_agents.perception.people_in_line import STEP_M, find_line

from agents.tests.agent_kit import ASSIGNMENT, Inbox, brief, envelope, observe, quadrotor, sent_by, view
from lingjing.plugins.geometry import world_to_pixel
from lingjing.plugins.policy import CameraPose, Field, MessageSpec, Peer

POSE = CameraPose(position=(0.0, 0.0, 45.0), heading_deg=30.0, tilt_deg=90.0, width=1920, height=1080, hfov_deg=84.0)
CLOTHES = ((180, 40, 40), (60, 130, 60), (70, 90, 190), (230, 230, 235), (210, 180, 60), (140, 70, 150))
PAVEMENT = (150, 148, 142)


def square(rgb, east, north, side_m, colour):
    u, v, _ = world_to_pixel(POSE, (east, north, 0.0))
    half = max(1, round(side_m / 2 * 1066 / 45.0))
    rgb[int(v) - half : int(v) + half, int(u) - half : int(u) + half] = colour


def picture(people, bearing_deg=70.0, head=(3.0, -2.0), dark=()):
    """Return a picture of a pavement with a line of people behind `head`; those in `dark` have the pavement's
    colour.
    """
    rgb = np.empty((POSE.height, POSE.width, 3), np.uint8)
    rgb[:] = PAVEMENT
    ahead = math.sin(math.radians(bearing_deg)), math.cos(math.radians(bearing_deg))
    for k in range(1, people + 1):
        place = head[0] + STEP_M * k * ahead[0], head[1] + STEP_M * k * ahead[1]
        square(rgb, place[0] + 0.4, place[1] + 0.5, 0.4, (100, 99, 95))  # the shadow
        square(rgb, *place, 0.45, PAVEMENT if k in dark else CLOTHES[k % len(CLOTHES)])
    return rgb


@pytest.mark.parametrize("people", [1, 3, 5, 8, 12, 17])
@pytest.mark.parametrize("bearing", [0.0, 70.0, 215.0])
def test_every_person_in_a_line_is_counted(people, bearing):
    line = find_line(picture(people, bearing), POSE, (3.0, -2.0), 0.0)
    assert line is not None and line.people == people


def test_people_of_the_colour_of_the_ground_are_counted_by_the_gap_in_the_line():
    line = find_line(picture(12, dark=(6, 7, 8)), POSE, (3.0, -2.0), 0.0)
    assert line is not None and line.people == 12 and line.confidence < 1.0


def test_a_lamp_behind_the_last_person_is_not_counted():
    rgb = picture(3)
    ahead = math.sin(math.radians(70.0)), math.cos(math.radians(70.0))
    square(rgb, 3.0 + 6 * STEP_M * ahead[0], -2.0 + 6 * STEP_M * ahead[1], 0.5, (200, 210, 230))
    line = find_line(rgb, POSE, (3.0, -2.0), 0.0)
    assert line is not None and line.people == 3


def test_the_box_contains_the_whole_line():
    line = find_line(picture(8), POSE, (3.0, -2.0), 0.0)
    assert line is not None
    for k in (1, 8):
        u, v, _ = world_to_pixel(
            POSE,
            (3.0 + STEP_M * k * math.sin(math.radians(70.0)), -2.0 + STEP_M * k * math.cos(math.radians(70.0)), 0.0),
        )
        assert line.box[0] < u / POSE.width < line.box[2] and line.box[1] < v / POSE.height < line.box[3]


def test_a_picture_without_people_has_no_line():
    assert find_line(picture(0), POSE, (3.0, -2.0), 0.0) is None
    assert find_line(np.zeros((1080, 1920, 3), np.uint8), POSE, (3.0, -2.0), 0.0) is None


TALLY = MessageSpec(
    kind="tally", type="count", category="report", senders=("counter",), recipients=("all",),
    fields=tuple(Field(name=name, type="name") for name in ("frame", "class", "box", "position", "people")),
)  # fmt: skip
SHOPS = {"shop[1]": (-90.0, 70.0, 0.0), "shop[2]": (20.0, 95.0, 0.0), "shop[3]": (100.0, -60.0, 0.0)}
DOGS = {"dog[1]": (0.0, 0.0, 0.0), "dog[2]": (90.0, -50.0, 0.0)}


def counter(rank: int) -> LineCounter:
    """Return the `rank`-th of two counters, with two walkers that can be sent."""
    everyone = [Peer(id=f"counter[{k}]", role="counter", resources=(f"uav[{k}]",)) for k in (1, 2)]
    everyone += [Peer(id=f"walker[{k}]", role="walker", resources=(f"dog[{k}]",)) for k in (1, 2)]
    me = f"counter[{rank}]"
    peers = tuple(peer for peer in everyone if peer.id != me)
    messages = (TALLY, sent_by(ASSIGNMENT, "counter"))
    shared = brief(
        resources=(quadrotor(rank),), peers=peers, messages=messages, role="counter", classes=("queue_of_people",)
    )
    return LineCounter(msgspec.structs.replace(shared, agent=me), quadrotor(rank))


def seen(rank: int, tick: int = 1):
    shops = [msgspec.structs.replace(view(name, place), type="queue_of_people") for name, place in SHOPS.items()]
    dogs = [view(name, place) for name, place in DOGS.items()]
    return observe(f"counter[{rank}]", tick, *shops, *dogs, view(f"uav[{rank}]", (0.0, -20.0 + 12.0 * rank, 45.0)))


def test_two_counters_fly_to_different_lines_at_different_levels():
    going = [counter(rank).act(seen(rank), Inbox()).command for rank in (1, 2)]
    places = [(command.arguments["x"], command.arguments["y"]) for command in going]
    assert places == [SHOPS["shop[3]"][:2], SHOPS["shop[2]"][:2]]  # nearer of two; only one of the other line
    assert abs(going[0].arguments["z"] - going[1].arguments["z"]) >= 2.5


def test_a_counter_without_an_own_line_waits_before_it_counts_another():
    rules, tally = counter(2), envelope("counter[1]", TALLY, {"people": 5.0, "position": SHOPS["shop[2]"]})
    assert rules.act(seen(2, tick=3), Inbox(messages=(tally,))).command is None
    assert rules.act(seen(2, tick=14), Inbox()).command is None
    assert rules.act(seen(2, tick=15), Inbox()).command is not None


def test_counted_lines_are_not_counted_again_and_one_counter_sends_the_nearest_walker():
    tallies = tuple(
        envelope("counter[2]", TALLY, {"people": float(people), "position": place})
        for people, place in zip((3, 5, 12), SHOPS.values(), strict=True)
    )
    first, second = counter(1), counter(2)
    (order,) = first.act(seen(1), Inbox(messages=tallies)).messages
    assert order.body["assignee"] == "walker[2]" and order.body["position"] == (100.0, -60.0, 0.0)
    assert second.act(seen(2), Inbox(messages=tallies)).messages == ()
    assert first.act(seen(1, tick=2), Inbox()).messages == (), "it is not said again at once"
