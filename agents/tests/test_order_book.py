"""Orders learned from messages, and the players that a mission of tier 1 must defeat."""

from __future__ import annotations

import asyncio

import numpy as np
from lingjing_agents.adversaries.guesses import Blind
from lingjing_agents.adversaries.messages import Deaf, Loner
from lingjing_agents.heuristic.delivery_view import look
from lingjing_agents.heuristic.order_book import OrderBook, told_orders

from agents.tests.agent_kit import ASSIGNMENT, Inbox, brief, envelope, observe, picture, sent_by, view
from lingjing.plugins.policy import Brief, Decision, EntityView, Field, MessageSpec, Observation

CLAIM = sent_by(ASSIGNMENT, "searcher")
HANDOVER = MessageSpec(
    kind="handover", type="delivery", category="target_status", senders=("searcher",), recipients=("all",),
    fields=tuple(Field(name=name, type="name") for name in ("stop", "delivered", "left")),
)  # fmt: skip
DEPOT = EntityView(id="depot", type="warehouse", position=(0.0, 0.0, 0.0))
PLACES = {"p[1]": (300.0, 0.0), "p[2]": (0.0, 300.0)}


def van(at: tuple[float, float], load: float) -> EntityView:
    return EntityView(
        id="van", type="van", position=(*at, 0.0), velocity=(0.0, 0.0, 0.0), heading_deg=0.0, resources={"load": load}
    )


def test_places_without_demands_are_stops_and_are_sent_to_the_other_drivers() -> None:
    points = [EntityView(id=name, type="point", position=(*place, 0.0)) for name, place in PLACES.items()]
    seen = look(observe("driver[1]", 0, van((0.0, 0.0), 200.0), *points, DEPOT))
    assert (seen.places, seen.demands_kg, seen.depot) == (PLACES, {}, (0.0, 0.0))
    messages = told_orders(brief(messages=(CLAIM, HANDOVER)), seen)
    assert [(message.kind, message.body["task"]) for message in messages] == [
        (CLAIM.kind, "p[1]"),
        (CLAIM.kind, "p[2]"),
    ]


def test_demands_without_places_are_sent_by_name() -> None:
    points = [EntityView(id=name, type="point", resources={"demand": 100.0}) for name in PLACES]
    seen = look(observe("driver[2]", 0, van((0.0, 0.0), 200.0), *points, DEPOT))
    assert (seen.places, seen.demands_kg) == ({}, dict.fromkeys(PLACES, 100.0))
    messages = told_orders(brief(messages=(CLAIM, HANDOVER)), seen)
    assert [message.body for message in messages] == [{"stop": n, "delivered": 0.0, "left": 100.0} for n in PLACES]


def book() -> OrderBook:
    made = OrderBook()
    places = [
        envelope("driver[1]", CLAIM, {"assignee": "driver[1]", "task": name, "position": (*place, 0.0)})
        for name, place in PLACES.items()
    ]
    demands = [envelope("driver[2]", HANDOVER, {"stop": name, "delivered": 0.0, "left": 100.0}) for name in PLACES]
    made.learn(Inbox(messages=(*places, *demands)))
    return made


def after(made: OrderBook, at: tuple[float, float], load: float) -> dict[str, float]:
    own = van(at, load)
    return made.completed(look(observe("driver[3]", 1, own, DEPOT)), own).demands_kg


def test_received_orders_complete_the_view_and_own_deliveries_are_subtracted() -> None:
    made = book()
    assert after(made, (0.0, 0.0), 200.0) == {"p[1]": 100.0, "p[2]": 100.0}
    assert after(made, (295.0, 0.0), 140.0) == {"p[1]": 40.0, "p[2]": 100.0}
    for _ in range(2):
        left = after(made, (295.0, 0.0), 140.0)
    assert left == {"p[1]": 0.0, "p[2]": 100.0}, "nothing more is taken there"


class Recorded:
    """A policy that keeps what it receives."""

    async def reset(self, brief: Brief) -> None:
        self.brief = brief

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        self.observation, self.inbox = observation, inbox
        return Decision()


def received(player: Deaf | Loner | Blind) -> tuple[Recorded, Decision]:
    inside = Recorded()
    player._wrapped = inside  # `Blind` makes a new one at its reset
    white = picture((0.0, 0.0, 60.0), np.full((1080, 1920, 3), 255, np.uint8), tick=3)
    seen = observe("scout[1]", 3, view("uav[1]", (0.0, 0.0, 60.0)), pictures=(white,))

    async def play() -> Decision:
        await player.reset(brief("scout[1]", "star"))
        player._wrapped = inside
        return await player.act(seen, Inbox(messages=(envelope("commander", CLAIM, {"task": "go"}),)))

    return inside, asyncio.run(play())


def test_the_players_deaf_and_loner_receive_no_message() -> None:
    for player in (Deaf(), Loner()):
        inside, _ = received(player)
        assert inside.inbox.messages == () and inside.observation.pictures[0].rgb.any()
    assert inside.brief.hub is None


def test_the_player_blind_receives_black_pictures_and_reports_a_guess() -> None:
    inside, decision = received(Blind())
    assert inside.inbox.messages and not inside.observation.pictures[0].rgb.any()
    (guess,) = decision.messages
    assert guess.body["frame"] == inside.observation.pictures[0].frame
