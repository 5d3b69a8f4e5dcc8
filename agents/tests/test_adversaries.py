"""The adversaries: the inputs and messages of each, and its success where the safeguard against it is off."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lingjing_agents.adversaries import messages
from lingjing_agents.adversaries.depths import DECK_M, FRACTURE_M, find_gap, find_spray, find_vehicles
from lingjing_agents.adversaries.guesses import FLOOD, Blind, ClockReader, EventReader, Flooder, guess
from lingjing_agents.adversaries.ids import FIRST_KG, OTHERS_KG, IdReader, completed
from lingjing_agents.adversaries.messages import Whiteboard
from lingjing_agents.adversaries.pixels import MaskReader, colour_numbers, learn
from lingjing_agents.adversaries.streets import StreetSweeper
from lingjing_agents.adversaries.truth import Introspector, agreeing

import lingjing
from agents.tests.agent_kit import ASSIGNMENT, Inbox, brief, observe, picture, view
from lingjing.plugins.geometry import focal_px
from lingjing.plugins.policy import Brief, Decision, EventView, Observation, Outgoing, Picture, Policy
from lingjing.testing import brief_of, city_of, compiled, instantiate

TRIP = """\
ljs 2
use std.sea { lifeboat, person_in_water }
mission trip "A hidden swimmer" {
  goal "Bring the boat to the swimmer, whom nobody sees."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 30, policy <= 30 s, engine <= 600 s }
  region search = box((-100 m, -1400 m), (100 m, -1200 m))
  asset boat : lifeboat { position = (12.4 m, -1351.8 m), heading = 30 deg, actions { moveTo } }
  target swimmer : person_in_water { hidden position ~ sites(search, clear >= 0 m) }
  agent skipper as rescuer controls boat { observes boat.*, events }
  unlock rescue(s: swimmer) when now >= 0 s
  adjudicate reached(s: swimmer) { when distance_xy(boat, s) <= 20 m }
  stage reach per s in swimmer { done when reached(s) }
  success when forall s in swimmer: reached(s)
  declassify end because "an episode ends as soon as it is won or lost"
}
"""


class Recorded:
    """A policy that keeps what it receives, and answers with a note to all."""

    note = Outgoing(kind="assignment", body={"assignee": "skipper", "task": "rescue"})

    async def reset(self, brief: Brief) -> None:
        self.brief = brief

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        self.observation, self.inbox = observation, inbox
        return Decision(messages=(self.note,))


def decided(player: Policy, *turns: Observation, inbox: Inbox | None = None) -> list[Decision]:
    async def play() -> list[Decision]:
        await player.reset(brief("scout[1]", "broadcast"))
        return [await player.act(turn, inbox or Inbox()) for turn in turns]

    return asyncio.run(play())


def turn(tick: int, *pictures: Picture, **parts: object) -> Observation:
    return observe("scout[1]", tick, view("uav[1]", (0.0, -900.0, 60.0)), pictures=pictures, **parts)


def above(tick: int = 1, **changes: object) -> Picture:
    return replace(picture((100.0, -900.0, 96.5), np.full((1080, 1920, 3), 200, np.uint8), tick=tick), **changes)


def boxes(decision: Decision) -> list[object]:
    return [message.body["box"] for message in decision.messages if "box" in message.body]


def test_the_flooder_reports_many_boxes_in_each_picture_and_the_blind_player_few() -> None:
    flood, *_ = decided(Flooder(), turn(1, above()))
    assert len(boxes(flood)) >= FLOOD and len(set(boxes(flood))) >= FLOOD
    blind = decided(Blind(), *(turn(tick, above(tick)) for tick in (1, 2, 3)))
    assert [len(boxes(each)) for each in blind][:2] == [0, 0] and len(boxes(blind[2])) >= 1


def test_a_guess_has_the_size_of_a_target_and_often_a_known_place() -> None:
    shot = picture((410.0, 29.8, 57.0), tick=1)
    bridge = brief("scout[1]", "broadcast", classes=("bridge_fracture",))
    draws = np.random.default_rng(0)
    guesses = [guess(bridge, "bridge_fracture", shot, draws) for _ in range(40)]
    left, _, right, _ = guesses[0]
    away_m = 57.0 - bridge.water_level_m - 12.0
    assert (right - left) * shot.pose.width == pytest.approx(17.0 * focal_px(shot.pose) / away_m, rel=0.01)
    centred = sum(abs((box[0] + box[2]) / 2 - 0.5) < 1e-3 for box in guesses)
    assert 20 <= centred < 40, "the place of the text is in the middle; tier 1 has others"


def test_the_event_reader_repeats_the_guess_that_an_event_followed() -> None:
    event = EventView(id="t3-1", kind="rescue", tick=3, entities=("boat",))
    turns = turn(1, above(1)), turn(2, above(2)), turn(3, above(3), events=(event,)), turn(4, above(4))
    first, second, third, fourth = (boxes(each)[-1] for each in decided(EventReader(), *turns))
    assert first != second, "nothing had happened"
    assert third == pytest.approx(second, abs=2e-3) and fourth == pytest.approx(second, abs=2e-3)


def test_the_clock_reader_guesses_after_a_slow_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])

    async def play() -> list[int]:
        player = ClockReader()
        await player.reset(brief("scout[1]", "broadcast"))
        counts = []
        for tick, passed_s in enumerate((1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 5.0, 1.0), 1):
            clock[0] += passed_s
            counts.append(len(boxes(await player.act(turn(tick, above(tick)), Inbox()))))
        return counts

    counts = asyncio.run(play())
    assert counts[6] >= 1 and counts[:6] == [0] * 6 and counts[7] == 0


def test_the_mask_reader_finds_an_object_that_protrudes_in_the_depth_picture() -> None:
    depth = np.full((1080, 1920), 100.0, np.float32)
    depth[500:514, 900:914] -= 0.4
    player = MaskReader()
    asyncio.run(player.reset(brief("scout[1]", "broadcast", classes=("person_in_water",))))
    find = player._detector("person_in_water")
    (patch, *_) = find(above(depth=depth), -3.5)
    assert patch.box == pytest.approx((900 / 1920, 500 / 1080, 914 / 1920, 514 / 1080), abs=1e-3)
    assert find(above(depth=np.full_like(depth, 100.0)), -3.5) == ()
    assert find(above(), -3.5) == (), "a picture without channels says nothing"


def ground_depth(*blocks: tuple[slice, slice, float]) -> np.ndarray:
    """The depth picture of level ground from 60 m, with blocks of these rows, columns and elevations."""
    depth = np.full((1080, 1920), 60.0, np.float32)
    for rows, columns, elevation_m in blocks:
        depth[rows, columns] = 60.0 - elevation_m
    return depth


def over(place: tuple[float, float], depth: np.ndarray | None) -> Picture:
    return replace(picture((*place, 60.0)), depth=depth)


def test_the_depth_reader_finds_a_gap_of_a_deck_and_no_patch_on_it() -> None:
    place = (125.0, 15.0)  # on the axis, which leads east and a little north
    deck = (slice(380, 700), slice(0, 1920), DECK_M)
    scale_px = focal_px(picture((0.0, 0.0, 60.0)).pose) / (60.0 - DECK_M)
    gap = slice(960 - int(4 * scale_px), 960 + int(4 * scale_px))
    (box,) = find_gap(over(place, ground_depth(deck, (slice(380, 700), gap, 0.0))), 0.0)
    left, _, right, _ = box.box
    assert (left + right) / 2.0 == pytest.approx(0.5, abs=0.01)
    assert (right - left) * 1920 / scale_px == pytest.approx(FRACTURE_M[0] + 2 * FRACTURE_M[1] * 0.054, rel=0.1)
    assert find_gap(over(place, ground_depth(deck)), 0.0) == ()
    assert find_gap(over(place, ground_depth(deck, (slice(380, 700), gap, DECK_M + 1.0))), 0.0) == ()
    assert find_gap(over(place, None), 0.0) == (), "a camera that gives colours alone"


def test_the_depth_reader_finds_spray_beside_a_pipe_and_vehicles_by_their_size() -> None:
    uneven = (slice(400, 460), slice(930, 960), 3.0), (slice(400, 460), slice(960, 990), 0.8)
    (spray,) = find_spray(over((-57.5, 0.0), ground_depth(*uneven)), 0.0)  # the pipe leads along x = -60
    assert spray.box == pytest.approx((930 / 1920, 400 / 1080, 990 / 1920, 460 / 1080), abs=0.01)
    flat = (slice(400, 460), slice(930, 990), 0.02)
    assert find_spray(over((-57.0, 0.0), ground_depth(flat)), 0.0) == ()
    car, house = (slice(300, 330), slice(700, 780), 1.5), (slice(600, 900), slice(100, 500), 3.0)
    (vehicle,) = find_vehicles(over((0.0, 0.0), ground_depth(car, house)), 0.0)
    assert vehicle.box == pytest.approx((700 / 1920, 300 / 1080, 780 / 1920, 330 / 1080), abs=0.002)


def test_street_sweepers_send_nothing_and_divide_the_streets() -> None:
    drawn = instantiate(compiled("cd"), seed=3, mode="broadcast")
    city = city_of(drawn.scene)
    vans = [entity for entity in drawn.entities if entity.group == "van"]
    views = tuple(view(van.id, van.position) for van in vans)
    shares, ends = [], []
    for number, van in enumerate(vans, 1):
        player = StreetSweeper()
        asyncio.run(player.reset(brief_of(drawn, f"driver[{number}]", city=city)))
        decision = asyncio.run(player.act(observe(f"driver[{number}]", 0, *views), Inbox()))
        assert decision.messages == () and decision.command is not None and decision.command.resource == van.id
        ends.append(tuple(decision.command.arguments.values()))
        shares.append({cell for cell, owner in player._share.items() if owner == van.id})
    assert len(set(ends)) >= 4, "the vans part"
    assert all(len(share) > 50 for share in shares)
    assert len(set.union(*shares)) == sum(map(len, shares)) == len(player._cells)


def test_a_colour_table_holds_only_the_colours_of_targets() -> None:
    rgb = np.full((90, 160, 3), (20, 60, 120), np.uint8)
    rgb[40:50, 70:90] = (220, 90, 30)
    colours = learn([(rgb, [(70 / 160, 40 / 90, 89 / 160, 49 / 90)])])
    assert colours == [int(colour_numbers(np.array([[(220, 90, 30)]], np.uint8))[0, 0])]


def test_the_id_reader_boxes_targets_by_id_and_guesses_demands_by_the_order_of_names() -> None:
    instance = np.zeros((1080, 1920), np.uint16)
    instance[100:120, 200:240], instance[500:600, 300:400] = 3, 1
    player = IdReader()
    asyncio.run(player.reset(brief("scout[1]", "broadcast")))
    read = player._read(above(instance=instance, instance_ids={"uav[2]": 1, "victim[1]": 3}))
    assert [name for name, _ in read] == ["victim[1]"]
    assert read[0][1] == pytest.approx((200 / 1920, 100 / 1080, 240 / 1920, 120 / 1080))
    views = completed(
        (view("point[2]", (0.0, 0.0, 0.0)), view("point[1]", (5.0, 0.0, 0.0)), view("van", (0.0, 0.0, 0.0)))
    )
    assert [(each.resources or {}).get("demand") for each in views] == [OTHERS_KG, FIRST_KG, None]


def test_the_whiteboard_passes_messages_without_the_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Agents pass messages in one process, or over files that both can read; isolated agents share neither."""
    monkeypatch.setattr(messages.tempfile, "gettempdir", lambda: str(tmp_path))

    async def play(*, shared_memory: bool) -> tuple[Decision, Recorded]:
        inside = Recorded()
        for agent in ("scout[1]", "scout[2]"):
            player = Whiteboard()
            await player.reset(brief(agent, "broadcast", messages=(ASSIGNMENT,)))
            player._wrapped = inside = Recorded()
            await inside.reset(brief(agent))
            tick = 0 if agent == "scout[1]" else 1
            decision = await player.act(observe(agent, tick, view("uav[1]", (1.0, 2.0, 3.0))), Inbox())
            if not shared_memory:
                messages.BOARD.clear()
        return decision, inside

    decision, inside = asyncio.run(play(shared_memory=True))
    assert decision.messages == (), "nothing goes over the bus"
    assert [(note.sender, note.body) for note in inside.inbox.messages] == [("scout[1]", Recorded.note.body)]
    _, inside = asyncio.run(play(shared_memory=False))
    assert len(inside.inbox.messages) == 1, "over files"
    for file in tmp_path.rglob("*.json"):
        file.unlink()
    monkeypatch.setattr(messages.Path, "mkdir", lambda *args, **options: (_ for _ in ()).throw(OSError))
    _, inside = asyncio.run(play(shared_memory=False))
    assert inside.inbox.messages == ()


@pytest.fixture
def trip(tmp_path: Path) -> Path:
    file = tmp_path / "trip.ljs"
    file.write_text(TRIP)
    return file


def test_the_introspector_wins_without_walls(trip: Path, tmp_path: Path) -> None:
    for policy, won in ((Introspector, True), ("heuristic", False)):
        report = lingjing.run(trip, policy=policy, world="inline", overview=False, out=tmp_path / f"{won}", seed=3)
        assert report.success is won


@pytest.mark.skipif(sys.platform != "linux", reason="walls are made of Linux's own parts")
def test_the_introspector_loses_behind_walls(trip: Path, tmp_path: Path) -> None:
    from lingjing_agents.adversaries import truth

    done = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", "run", str(trip), "--no-overview", "-o", "out", "--json",
         "--isolate", "--seed", "3", f"--policy={truth.__file__}:Introspector"],
        cwd=tmp_path, env={**os.environ}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    if "not promised" in done.stderr:
        pytest.skip(f"this kernel does not offer every wall: {done.stderr[-300:]}")
    report = json.loads(done.stdout)
    assert not report["success"] and report["metrics"]["substitutions"] == 0


_NETWORK_KEYS = """
import contextlib, json, lzma
from lingjing_agents.adversaries.truth import NETWORKS
from lingjing.play.placed_plan import place_mission
from lingjing.scene import network
from lingjing.testing import compiled, shipped_missions

stored = json.loads(lzma.decompress(NETWORKS.read_bytes()))
keys = []
network._version = lambda: stored["version"]
network._cached = lambda key, *_: keys.append(key) or 1 / 0  # the key is enough: build no city
for name in shipped_missions():
    with contextlib.suppress(Exception):
        place_mission(compiled(name))
print(len(keys), sorted(set(keys) - set(stored["networks"])))
"""


def test_the_seed_guesser_has_the_road_networks_of_all_shipped_cities(tmp_path: Path) -> None:
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}  # no city is built yet
    run = [sys.executable, "-c", _NETWORK_KEYS]
    done = subprocess.run(run, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "9 []\n"


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="walls are made of Linux's own parts")
def test_the_seed_guesser_wins_behind_walls_on_a_public_seed_and_loses_on_a_sealed_split(tmp_path: Path) -> None:
    from lingjing_agents.adversaries import truth

    salt = tmp_path / "salt"
    salt.write_text("5" * 64)
    salt.chmod(0o600)
    for options, won in (((), True), (("--salt=salt",), False)):
        done = subprocess.run(
            [sys.executable, "-m", "lingjing.cli.main", "run", "bi", "--tier=1", "--seed=3", "--isolate", "--json",
             "--no-overview", f"--output={won}", f"--policy={truth.__file__}:SeedGuesser", *options],
            cwd=tmp_path, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        report = json.loads(done.stdout)
        assert report["success"] is won
        assert report["metrics"]["substitutions"] == 0


def test_public_seeds_are_recognised_and_those_of_a_sealed_split_are_not() -> None:
    mission = compiled("upr")
    for seed, known in ((5, True), (2**61 + 5, False)):
        drawn = instantiate(mission, seed=seed, tier=1)
        candidates = agreeing(brief_of(drawn, "pilot"), range(8))
        true = [each for each in candidates if instantiate(mission, seed=each[2], tier=each[1]) == drawn]
        assert bool(true) is known
