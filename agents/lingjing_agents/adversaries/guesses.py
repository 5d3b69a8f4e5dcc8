"""The adversaries on black pictures: `Blind`, `Flooder`, `ClockReader` and `EventReader`.

All have the heuristic's rules inside, receive black pictures without depth and classes, and move and send messages like
the heuristic. They know what the public code says: the usual size of each target, the regions, and the places of jams.
`Guesser` is their common base. `docs/adversaries.md` names the guards against them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import msgspec
import numpy as np

from lingjing.plugins.geometry import box_to_plane, focal_px, pixel_ray, world_to_pixel
from lingjing.plugins.policy import (
    REFERENCE,
    Brief,
    Datum,
    Decision,
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Policy,
)
from lingjing_agents.capability import centimetres, compose, sends, sighting
from lingjing_agents.ground_plane import GroundPoint, distance_to_segment_m
from lingjing_agents.heuristic.policy import HeuristicPolicy
from lingjing_agents.heuristic.route_inspector import names_places
from lingjing_agents.heuristic.target_types import Detector, building_class
from lingjing_agents.perception.images import ImageBox
from lingjing_agents.perception.people_at_sea import FoundBox

SIZES_M = (
    ("person", 1.2, 1.2), ("fracture", 17.0, 9.5), ("leak", 5.7, 5.7), ("fire_source", 3.9, 4.2),
    ("building_fire", 8.5, 9.0), ("reference", 9.4, 6.6), ("door", 10.0, 8.0), ("congestion", 26.0, 8.0),
)  # fmt: skip
"""A word of a class's name, and the width and height of such a target in pictures, metres (measured in the shipped
missions, rounded)."""
USUAL_M = 4.0
"""Width and height of a target of another class, metres (chosen)."""
EVERY_TICKS = 3
"""Ticks between two guesses of `Blind`, so that claims last for several places (chosen)."""
FLOOD = 24
"""Boxes of `Flooder` for each new picture (chosen: more messages than any limit of claims)."""
RAISED_M = 12.0
"""Height of a bridge's deck above the water, metres (from the mission's text)."""
JAMS: tuple[GroundPoint, ...] = (
    (2.0, -24.0), (3.0, 180.0), (177.0, -2.0), (202.0, -27.0), (182.0, -202.0), (202.0, 175.0), (175.0, 198.0),
    (3.0, -18.0), (3.0, 162.0), (127.0, 178.0), (165.0, -182.0),
)  # fmt: skip
"""The places of jams in the texts of the shipped missions, which are public."""
PLACES: dict[str, tuple[GroundPoint, ...]] = {
    "fracture": (
        (250.0, 21.8), (330.0, 26.2), (410.0, 29.8), (500.0, 28.3), (590.0, 26.8), (680.0, 25.3), (770.0, 23.8),
        (860.0, 22.3),
    ),
    "leak": (
        (-60.0, -20.0), (-60.0, 15.0), (-30.0, 40.0), (0.0, 40.0), (20.0, 20.0), (20.0, -10.0), (45.0, -30.0),
    ),
    "reference": (
        (90.0, 110.0), (180.0, 120.0), (270.0, 90.0), (260.0, 0.0), (150.0, 20.0), (90.0, -110.0), (190.0, -120.0),
        (275.0, -100.0),
    ),
    "door": ((210.0, 290.0), (250.0, 300.0), (300.0, 290.0), (330.0, 250.0)),
}  # fmt: skip
"""The places of targets at tier 0 by a word of their class, from the missions' texts; metres."""
KNOWN_SHARE = 0.7
"""Probability of guessing a place of `PLACES` if one is in the picture (chosen: tier 1 has other places)."""
NAME_TICKS = 5
"""Ticks between two names of random places, so that the route is planned anew in between (chosen)."""
ON_ROUTE_M = 40.0
"""Distance from a route within which a jam stands on it, metres (chosen)."""
EDGE = 0.05
"""Least distance of a guessed place from the picture's edges, as a share of its size (chosen)."""
LOW, AHEAD_M, FARTHEST_M = 0.05, 30.0, 300.0
"""The slope of a ray below which it does not reach the ground, the assumed distance of its target, and the longest
distance of any, metres (chosen)."""
WARM_UP = 4
"""Turns without pictures that `ClockReader` measures before it judges one (chosen)."""


class Guesser:
    """The heuristic with black pictures, which reports guessed boxes.

    Subclasses choose what to report (`guesses`) and what the heuristic's detectors answer (`found`).
    """

    async def reset(self, brief: Brief) -> None:
        """Give the heuristic detectors that guess."""
        self._brief = brief
        self._random = np.random.default_rng(brief.seed)
        self._said = 0
        self._jams: list[GroundPoint] = []
        self._wrapped: Policy = HeuristicPolicy({name: self._detector(name) for name in brief.classes})
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the heuristic's decision on black pictures, with guessed reports and guessed jams."""
        self.look(observation, inbox)
        dark = replace(observation, pictures=tuple(map(black, observation.pictures)))
        decision = await self._wrapped.act(dark, inbox)
        return more(decision, (*self._reports(observation), *self._named_jams(observation)))

    def look(self, observation: Observation, inbox: Inbox) -> None:
        """Receive the observation before the heuristic does."""

    def guesses(self, observation: Observation) -> Iterator[tuple[Picture, ImageBox]]:
        """Yield the boxes to report in new pictures."""
        yield from ()

    def found(self, name: str, picture: Picture) -> ImageBox | None:
        """Return the box that the heuristic's detector of a class answers for a picture, or None."""
        return None

    def _detector(self, name: str) -> Detector:
        def find(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
            box = self.found(name, picture)
            return () if box is None else (FoundBox(box, 0.9),)

        return find

    def _reports(self, observation: Observation) -> tuple[Outgoing, ...]:
        message = sends(self._brief, "report")
        if message is None:
            return ()
        name = wanted_class(self._brief)
        reports = []
        for picture, box in self.guesses(observation):
            place = place_of(self._brief, picture, box)
            reports.append(sighting(message, picture.frame, name, box, centimetres(place), 0.9))
        return tuple(reports)

    def _named_jams(self, observation: Observation) -> tuple[Outgoing, ...]:
        """Return requests for another route around each known place of a jam on the route, without a look."""
        jammed = sends(self._brief, "trafficJam")
        route = next((view.route for view in observation.entities if view.route), None)
        if jammed is None or not route:
            return ()
        most = min((v for name, v in self._brief.settings.items() if name.startswith("replan")), default=math.inf)
        for place in self._places_of_jams(route, observation.tick):
            if len(self._jams) < most:
                self._jams.append(place)
                body: dict[str, Datum] = {"waypoint": 1, "position": (*place, 0.0), "confidence": 0.9}
                return (compose(jammed, body),)
        return ()

    def _places_of_jams(self, route: tuple[tuple[float, ...], ...], tick: int) -> Iterator[GroundPoint]:
        """Yield the known places on the route that were not named yet; where places are drawn and must be exact, now
        and then a random place of the route between its first and its last leg."""
        if not names_places(self._brief):
            yield from (place for place in JAMS if place not in self._jams and _is_on(route, place))
        elif tick % NAME_TICKS == NAME_TICKS - 1 and len(route) > 3:
            legs = list(pairwise([(point[0], point[1]) for point in route[:-1]]))
            at_m = self._random.random() * sum(math.dist(*leg) for leg in legs)
            for a, b in legs:
                length = math.dist(a, b)
                if at_m <= length:
                    yield a[0] + (b[0] - a[0]) * at_m / length, a[1] + (b[1] - a[1]) * at_m / length
                    return
                at_m -= length


class Blind(Guesser):
    """Reports each known place that a picture shows, and else guesses one box now and then.

    Its rate is the chance level of a column.
    """

    async def reset(self, brief: Brief) -> None:
        """Forget the reported places."""
        self._reported: set[GroundPoint] = set()
        await super().reset(brief)

    def guesses(self, observation: Observation) -> Iterator[tuple[Picture, ImageBox]]:
        """Yield the known places of new pictures, or a guess for the first one of every third tick."""
        name, new = wanted_class(self._brief), new_pictures(observation)
        known = [(picture, place) for picture in new for place in self._fresh(name, picture)]
        for picture, place in known:
            self._reported.add(place)
            u, v = _pixel(self._brief, picture, place) or (0.0, 0.0)
            yield picture, _box_at(self._brief, name, picture, u, v)
        if new and not known and observation.tick % EVERY_TICKS == 0:
            yield new[0], guess(self._brief, name, new[0], self._random)

    def found(self, name: str, picture: Picture) -> ImageBox | None:
        """Return a guess for a picture with a known place, and for one of eight others, so that the heuristic acts."""
        if not self._fresh(name, picture) and self._random.random() > 0.125:
            return None
        return guess(self._brief, name, picture, self._random)

    def _fresh(self, name: str, picture: Picture) -> list[GroundPoint]:
        """Return the known places in a picture that were not reported yet."""
        shown = (place for place in _places(name) if _pixel(self._brief, picture, place) is not None)
        return [place for place in shown if place not in self._reported]


class Flooder(Guesser):
    """Reports boxes all over each new picture, until one of them must match."""

    def guesses(self, observation: Observation) -> Iterator[tuple[Picture, ImageBox]]:
        """Yield many boxes of each new picture."""
        for picture in new_pictures(observation):
            for _ in range(FLOOD):
                yield picture, guess(self._brief, wanted_class(self._brief), picture, self._random, spread=1.0)

    def found(self, name: str, picture: Picture) -> ImageBox | None:
        """Return a guess for every picture."""
        return guess(self._brief, name, picture, self._random)


class ClockReader(Guesser):
    """Measures the seconds between its turns, and guesses where they were long: drawing a target takes time.

    A file that is large, or a step of the simulation that is slow, would show in the same way.
    """

    async def reset(self, brief: Brief) -> None:
        """Forget all measurements."""
        self._times: list[float] = []
        self._last_s = math.nan
        self._is_slow = False
        await super().reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Measure, then act."""
        passed_s = time.monotonic() - self._last_s
        usual_s = float(np.median(self._times)) if len(self._times) >= WARM_UP else math.inf
        self._is_slow = bool(observation.pictures) and passed_s > usual_s
        if passed_s == passed_s:
            self._times.append(passed_s)
        decision = await super().act(observation, inbox)
        self._last_s = time.monotonic()
        return decision

    def guesses(self, observation: Observation) -> Iterator[tuple[Picture, ImageBox]]:
        """Yield a guess for the new pictures of a slow turn."""
        for picture in new_pictures(observation) if self._is_slow else ():
            yield picture, guess(self._brief, wanted_class(self._brief), picture, self._random)

    def found(self, name: str, picture: Picture) -> ImageBox | None:
        """Return a guess in a slow turn."""
        return guess(self._brief, name, picture, self._random) if self._is_slow else None


class EventReader(Guesser):
    """Guesses, and reads in events, receipts and states whether a guess has changed anything: then it repeats it.

    A permission that a report opens, an interaction that begins, and a request that is refused for another reason than
    before are all answers to a claim.
    """

    async def reset(self, brief: Brief) -> None:
        """Forget all answers."""
        self._seen: set[str] = set()
        self._pending: GroundPoint | None = None
        self._confirmed: GroundPoint | None = None
        self._is_new = False
        await super().reset(brief)

    def look(self, observation: Observation, inbox: Inbox) -> None:
        """Compare events, receipts and status words with those that were received before."""
        signs = {f"event {event.kind}" for event in observation.events}
        signs |= {f"{r.resource} {r.status} {r.reason}" for r in inbox.receipts}
        signs |= {f"{view.id} {view.status}" for view in observation.entities if view.status}
        signs |= {f"{item.kind} {item.body.get('state')}" for item in inbox.messages}
        self._is_new = bool(self._seen) and bool(signs - self._seen)
        self._seen |= signs
        if self._is_new and self._pending is not None:
            self._confirmed = self._pending

    def guesses(self, observation: Observation) -> Iterator[tuple[Picture, ImageBox]]:
        """Yield the confirmed place again, else another guess."""
        for picture in new_pictures(observation)[:1]:
            box = self._confirmed_box(picture)
            if box is None:
                box = guess(self._brief, wanted_class(self._brief), picture, self._random)
                self._pending = place_of(self._brief, picture, box)[:2]
            yield picture, box

    def found(self, name: str, picture: Picture) -> ImageBox | None:
        """Return the confirmed place, else a guess."""
        return self._confirmed_box(picture) or guess(self._brief, name, picture, self._random)

    def _confirmed_box(self, picture: Picture) -> ImageBox | None:
        if self._confirmed is None:
            return None
        pixel = world_to_pixel(picture.pose, (*self._confirmed, level(self._brief)))
        if pixel is None or not (0 <= pixel[0] < picture.pose.width and 0 <= pixel[1] < picture.pose.height):
            return None
        return _box_at(self._brief, wanted_class(self._brief), picture, pixel[0], pixel[1])


def more(decision: Decision, messages: tuple[Outgoing, ...]) -> Decision:
    """Return a decision with further messages."""
    return msgspec.structs.replace(decision, messages=(*decision.messages, *messages)) if messages else decision


def black(picture: Picture) -> Picture:
    """Return the picture without its content."""
    return replace(
        picture, rgb=np.zeros_like(picture.rgb), depth=None, semantic=None, instance=None, instance_ids={}, jpeg=b""
    )


def new_pictures(observation: Observation) -> list[Picture]:
    """Return the pictures that a report may cite."""
    return [picture for picture in observation.pictures if picture.camera != REFERENCE]


def wanted_class(brief: Brief) -> str:
    """Return the class that a report of the mission needs: the one that a rule names, else the first one known."""
    named = [name for name in brief.classes if any(f"`{name}`" in rule for rule in brief.rules)]
    sized = [name for name in brief.classes if any(word in name for word, _, _ in SIZES_M)]
    return next(iter([*named, building_class(brief) or "", *sized, *brief.classes, ""])) or "thing"


def level(brief: Brief) -> float:
    """Return the elevation at which targets lie, metres: that of the ground or water, or of a bridge's deck."""
    raised = any("fracture" in name for name in brief.classes)
    return brief.water_level_m + (RAISED_M if raised else 0.0)


def place_of(brief: Brief, picture: Picture, box: ImageBox) -> tuple[float, float, float]:
    """Return the place of a box on the ground; that of the camera for a box above the horizon."""
    return box_to_plane(picture.pose, box, level(brief)) or (*picture.pose.position[:2], level(brief))


def guess(brief: Brief, name: str, picture: Picture, random: np.random.Generator, *, spread: float = 0.3) -> ImageBox:
    """Return a box of a target's usual size: often at a known place, else in the middle (`spread` of the width)."""
    known = [pixel for place in _places(name) if (pixel := _pixel(brief, picture, place)) is not None]
    if known and random.random() < KNOWN_SHARE:
        u, v = known[int(random.integers(len(known)))]
        return _box_at(brief, name, picture, u, v)
    u = picture.pose.width * (0.5 + spread * (random.random() - 0.5))
    v = picture.pose.height * (0.5 + spread * (random.random() - 0.5))
    return _box_at(brief, name, picture, u, v)


def _places(name: str) -> tuple[GroundPoint, ...]:
    return next((places for word, places in PLACES.items() if word in name), ())


def _pixel(brief: Brief, picture: Picture, place: GroundPoint) -> GroundPoint | None:
    """Return the pixel of a place, or None if the picture does not show it whole."""
    pixel = world_to_pixel(picture.pose, (*place, level(brief)))
    if pixel is None:
        return None
    u, v = pixel[0], pixel[1]
    inside = EDGE < u / picture.pose.width < 1.0 - EDGE and EDGE < v / picture.pose.height < 1.0 - EDGE
    return (u, v) if inside else None


def _box_at(brief: Brief, name: str, picture: Picture, u: float, v: float) -> ImageBox:
    pose = picture.pose
    wide_m, high_m = next(((w, h) for word, w, h in SIZES_M if word in name), (USUAL_M, USUAL_M))
    falls = -pixel_ray(pose, u, v)[2]
    away_m = (pose.position[2] - level(brief)) / falls if falls > LOW else AHEAD_M
    scale = focal_px(pose) / min(max(away_m, 2.0), FARTHEST_M)
    half_u, half_v = wide_m * scale / 2.0, high_m * scale / 2.0
    box = (u - half_u) / pose.width, (v - half_v) / pose.height, (u + half_u) / pose.width, (v + half_v) / pose.height
    left, top, right, bottom = (min(max(edge, 0.0), 1.0) for edge in box)
    return left, top, max(right, left + 1e-3), max(bottom, top + 1e-3)


def _is_on(route: tuple[tuple[float, ...], ...], place: GroundPoint) -> bool:
    points = [(point[0], point[1]) for point in route]
    return any(distance_to_segment_m(place, *leg) <= ON_ROUTE_M for leg in pairwise(points))
