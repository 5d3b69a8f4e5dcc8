"""`compose`: a seed → the text of a mission, put together from bodies, errands, places, stages and relations.

An *errand* is a type of target with the interaction that one kind of body performs on it. A *plan* is one of `PLANS`:
the errands of one group, two errands in a chain, an errand with the way back, or a meeting at one place. The plan gives
the stages, their dependencies and the condition of success; the roles and the mode give the relations. Budgets follow
from the distances in the place and the bodies' speeds. Equal seeds give equal texts.

A composed text is a proposal: `lingjing.authoring.screening` tests it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from random import Random
from typing import Literal

import msgspec

from lingjing.dsl.formatting.formatter import format_text

VERSION = 2
"""The version of the composition. Another one gives other missions for the same seeds."""

Engine = Literal["road", "quadruped", "multirotor", "vessel"]


class Body(msgspec.Struct, frozen=True, kw_only=True):
    """A kind of asset."""

    group: str
    type: str
    use: str
    """The library of its type."""
    engine: Engine
    role: str
    speed_mps: float
    """A cautious speed over a whole errand, with turns and stops (chosen)."""
    actions: str
    places: tuple[str, ...]
    """Positions at which its members begin."""
    extra: str = ""
    """Further properties."""


BODIES = (
    Body(
        group="truck", type="fire_truck", use="std.ground", engine="road", role="driver", speed_mps=5.0,
        actions="setDestination, stop", places=("(0 m, 10 m)", "(0 m, -10 m)", "(20 m, 0 m)"),
    ),
    Body(
        group="van", type="delivery_van", use="std.ground", engine="road", role="courier", speed_mps=5.0,
        actions="setDestination, stop", places=("(0 m, 12 m)", "(0 m, -12 m)", "(-20 m, 0 m)"),
    ),
    Body(
        group="dog", type="robot_dog", use="std.ground", engine="quadruped", role="walker", speed_mps=0.6,
        actions="forward <= 15 m, left <= 180 deg, right <= 180 deg, stop",
        places=("(0 m, 0 m)", "(6 m, 0 m)", "(-6 m, 0 m)"), extra="heading = 0 deg",
    ),
    Body(
        group="uav", type="quadrotor", use="std.air", engine="multirotor", role="pilot", speed_mps=5.0,
        actions="takeoff, setDestination, stop", extra="band = 0 m..40 m",
        places=("(0 m, 6 m, 0.3 m)", "(8 m, 6 m, 0.3 m)", "(-8 m, 6 m, 0.3 m)"),
    ),
    Body(
        group="boat", type="lifeboat", use="std.sea", engine="vessel", role="skipper", speed_mps=2.0,
        actions="moveTo", places=("(80 m, -1050 m)", "(130 m, -1050 m)", "(180 m, -1050 m)"), extra="heading = 0 deg",
    ),
)  # fmt: skip


class Errand(msgspec.Struct, frozen=True, kw_only=True):
    """A kind of target and the interaction with it."""

    group: str
    interaction: str
    engine: Engine
    type: str
    use: str = ""
    """The library of the type; "" for a type that the mission's file declares."""
    declaration: str = ""
    """The properties of a type of its own."""
    needs_roofs: bool = False
    """True for targets on flat roofs, which towns of houses with pitched roofs lack."""


def _own(name: str, interaction: str, engine: Engine, surface: str, within_m: int, lasting_s: int = 0) -> Errand:
    """An errand at a type of the mission's file. `surface`: the place of its targets; "" for the water."""
    stay = f", lasting = {lasting_s} s" if lasting_s else ""
    where = f"on = {surface}, " if surface else ""
    lines = f"engine = city\n  {where}look = none, shape = none\n"
    lines += f"  interaction {interaction} {{ by = {engine}, within = {within_m} m{stay}, told = all }}"
    return Errand(
        group=name, interaction=interaction, engine=engine, type=name, declaration=lines,
        needs_roofs=surface == "roof",
    )  # fmt: skip


ERRANDS = (
    Errand(
        group="fire", interaction="extinguish", engine="road", type="building_fire", use="std.fire", needs_roofs=True
    ),
    Errand(group="stop", interaction="arrive", engine="road", type="destination", use="std.traffic"),
    _own("parcel", "collect", "road", "road", 30),
    _own("patient", "load", "road", "road", 40, 20),
    Errand(group="ember", interaction="extinguish", engine="quadruped", type="fire_source", use="std.fire"),
    Errand(group="door", interaction="receive", engine="quadruped", type="delivery_door", use="std.logistics"),
    _own("valve", "close", "quadruped", "ground", 6),
    _own("sensor", "read", "quadruped", "ground", 8, 10),
    Errand(group="jam", interaction="record", engine="multirotor", type="congestion", use="std.traffic"),
    _own("roof", "survey", "multirotor", "roof", 25),
    _own("mast", "scan", "multirotor", "ground", 25, 20),
    Errand(group="victim", interaction="rescue", engine="vessel", type="person_in_water", use="std.sea"),
    _own("buoy", "service", "vessel", "", 20, 10),
)

PLANS = ("each", "chain", "return", "meet")
"""The courses of a mission: all errands of one group; a second group that waits for the first; an errand and the way
back to the start; all bodies at one place."""
_LAND = ("residential", "industrial", "commercial", "campus", "logistics")
_WITH_FLAT_ROOFS = ("industrial", "commercial", "campus", "logistics")
_REACH_M: dict[Engine, tuple[int, int]] = {
    "road": (150, 220), "quadruped": (30, 60), "multirotor": (150, 220), "vessel": (250, 330)
}  # fmt: skip
"""Half the side of the region of an engine's targets, least and most, metres (chosen: small, so that episodes are
short, and large against the reach of the errands, so that random ways rarely pass all targets)."""
_LEAST_TARGETS: dict[Engine, int] = {"road": 1, "quadruped": 1, "multirotor": 2, "vessel": 2}
"""Fewest targets of an engine: one target alone is often passed by chance where nothing is in the way."""
_MEETING_M: dict[Engine, tuple[int, int]] = {
    "road": (150, 60), "quadruped": (100, 30), "multirotor": (150, 60), "vessel": (250, 60)
}  # fmt: skip
"""Distance of the region of a meeting from the start and half its side, metres: no place in it is within the 40 m of a
meeting from the start."""
_SIDES = ((0, 1), (0, -1), (1, 0), (-1, 0))
"""Directions from the start to a meeting, east and north."""
_SEAWARD = ((0, -1), (1, 0), (-1, 0))
"""Directions from the start of boats to a meeting: land lies north of them."""
_BOATS = (130, -1050)
"""Middle of the places where boats begin, metres."""
_WATER, _TO_WATER_M = (100, -1250), 200.0
"""Centre of the regions at sea, and its distance from the start of boats, metres."""
_SLACK = 1.5
"""Budget of ticks over the estimate (chosen)."""
_LEAST_TICKS = 8


class Composed(msgspec.Struct, frozen=True, kw_only=True):
    """A composed mission."""

    name: str
    text: str
    plan: str
    bodies: tuple[str, ...]
    errands: tuple[str, ...]
    mode: str
    ticks: int
    """Budget of the episode."""


class _Part(msgspec.Struct, frozen=True):
    """A group of targets with the group of bodies that serves it."""

    errand: Errand
    body: Body
    targets: int
    bodies: int
    half_m: int
    centre: tuple[int, int]
    """Centre of the region, metres east and north."""
    way_m: float
    """Distance from the start to the centre of the region."""
    hidden: bool

    @property
    def region(self) -> str:
        return f"{self.errand.group}_area"


def compose(seed: int) -> Composed:
    """Return the mission of a seed."""
    chance = Random(f"lingjing-compose-{VERSION}-{seed}")
    plan = chance.choice(PLANS)
    at_sea = chance.random() < 0.2
    bodies = [body for body in BODIES if (body.engine == "vessel") == at_sea]
    count = 2 if plan == "chain" else 1
    chosen = [chance.choice(bodies) for _ in range(count)]
    if len(chosen) == 2 and chosen[0] == chosen[1] and not at_sea:
        chosen[1] = chance.choice([body for body in bodies if body != chosen[0]])
    parts: list[_Part] = []
    for body in chosen:
        names = {part.errand.group for part in parts}
        fitting = [errand for errand in ERRANDS if errand.engine == body.engine and errand.group not in names]
        hidden = chance.random() < 0.25
        least = _LEAST_TARGETS[body.engine]
        targets, members = (
            (1, chance.randint(2, 3)) if plan == "meet" else (chance.randint(least, 3), chance.randint(1, 2))
        )
        centre, half_m, way_m = _region(chance, plan, body.engine)
        parts.append(_Part(chance.choice(fitting), body, targets, members, half_m, centre, way_m, hidden))
    if at_sea and len(parts) == 2:  # one fleet serves both groups
        parts[1] = msgspec.structs.replace(parts[1], body=parts[0].body, bodies=parts[0].bodies)
    towns = _WITH_FLAT_ROOFS if any(part.errand.needs_roofs for part in parts) else _LAND
    scene = "bay" if at_sea else chance.choice(towns)
    return _Composer(seed, chance, plan, parts, scene).compose()


def _region(chance: Random, plan: str, engine: Engine) -> tuple[tuple[int, int], int, float]:
    """The centre of a region, half its side, and the distance from the start to the centre; metres."""
    if plan == "meet":
        away, half = _MEETING_M[engine]
        east, north = chance.choice(_SEAWARD if engine == "vessel" else _SIDES)
        x, y = _BOATS if engine == "vessel" else (0, 0)
        return (x + away * east, y + away * north), half, away
    half = chance.randint(*_REACH_M[engine])
    return (_WATER, half, _TO_WATER_M) if engine == "vessel" else ((0, 0), half, 0.0)


class _Composer:
    """Writes one mission."""

    def __init__(self, seed: int, chance: Random, plan: str, parts: list[_Part], scene: str) -> None:
        self.name = f"generated_{seed}"
        self.chance = chance
        self.plan = plan
        self.parts = parts
        self.scene = scene
        fleets = {part.body.group: part for part in parts}
        self.fleets = list(fleets.values())
        self.agents = sum(part.bodies for part in self.fleets)
        self.mode = "single" if self.agents == 1 else chance.choice(("broadcast", "star"))
        self.tick_s = chance.choice((10, 20))
        self.ticks = self._budget()

    def compose(self) -> Composed:
        """Return the mission."""
        blocks = ["\n".join(self._head()), *self._types(), self._mission()]
        return Composed(
            name=self.name,
            text=format_text("\n\n".join(blocks) + "\n").text or "",
            plan=self.plan,
            bodies=tuple(part.body.type for part in self.fleets),
            errands=tuple(f"{part.errand.interaction} {part.errand.type}" for part in self.parts),
            mode=self.mode,
            ticks=self.ticks,
        )

    # -- estimates

    def _budget(self) -> int:
        """Ticks for each part in turn: every target's way across its region, shared by the bodies."""
        seconds = 0.0
        for part in self.parts:
            trips = 2 if self.plan == "return" else 1
            legs = math.ceil(part.targets / part.bodies) + trips - 1
            seconds += (legs * 2.2 * part.half_m + trips * part.way_m + 60.0) / part.body.speed_mps + 30.0 * legs
        return max(_LEAST_TICKS, math.ceil(_SLACK * seconds / self.tick_s))

    # -- the text

    def _head(self) -> Iterator[str]:
        uses: dict[str, list[str]] = {}
        for part in self.parts:
            uses.setdefault(part.body.use, []).append(part.body.type)
            if part.errand.use:
                uses.setdefault(part.errand.use, []).append(part.errand.type)
        if self.agents > 1:
            uses["std.messages"] = ["assignment", "status"] if self.mode == "star" else ["status"]
        yield "ljs 2"
        for path in sorted(uses):
            yield f"use {path} {{ {', '.join(sorted(set(uses[path])))} }}"

    def _types(self) -> Iterator[str]:
        for part in self.parts:
            if part.errand.declaration:
                yield f"target {part.errand.type} {{\n  {part.errand.declaration}\n}}"

    def _mission(self) -> str:
        paragraphs = [
            list(lines)
            for lines in (self._settings(), self._places(), self._entities(), self._agents(), self._course())
        ]
        inner = "\n\n".join("\n".join(f"  {line}" for line in lines) for lines in paragraphs)
        return f'mission {self.name} "{self._title()}" {{\n{inner}\n}}'

    def _title(self) -> str:
        served = " and ".join(f"{part.errand.interaction} by {part.body.engine}" for part in self.parts)
        return f"Composed: {self.plan}, {served}"

    def _settings(self) -> Iterator[str]:
        yield f'goal "{self._goal()}"'
        if self.scene == "bay":
            yield "scene bay { datum = sea level at -3.5 m }"
        else:
            blocks = self.chance.randint(2, 4)
            yield f"scene {self.scene} {{ extent = 500 m, blocks = {blocks} by {blocks}, height = 6 m..18 m }}"
        yield f"clock {{ tick = {self.tick_s} s, sync = 500 ms }}"
        yield f"budget {{ ticks <= {self.ticks} }}"
        wind = self.chance.choice(("", "wind = 3 m/s from 220 deg", "wind ~ uniform(1 m/s, 5 m/s) from 220 deg"))
        if wind:
            yield f"weather {{ {wind} }}"
        yield f"mode {self.mode}"

    def _goal(self) -> str:
        if self.plan == "meet":
            return f"Bring every {self.parts[0].body.group} to the {self.parts[0].errand.group}."
        words = [f"{part.errand.interaction} every {part.errand.group}" for part in self.parts]
        back = ", then come back to the start" if self.plan == "return" else ""
        text = ", and only then ".join(words) + back
        return f"{text[0].upper()}{text[1:]}."

    def _places(self) -> Iterator[str]:
        for part in self.parts:
            half, (x, y) = part.half_m, part.centre
            corners = f"({x - half} m, {y - half} m), ({x + half} m, {y + half} m)"
            yield f"region {part.region} = box({corners})"
        if self.plan == "return":
            low, high = (
                ("(50 m, -1080 m)", "(210 m, -1020 m)") if self.scene == "bay" else ("(-35 m, -35 m)", "(35 m, 35 m)")
            )
            yield f"region start = box({low}, {high})"

    def _entities(self) -> Iterator[str]:
        for part in self.parts:
            hidden = "hidden " if part.hidden else ""
            apart = f", apart >= {max(8, part.half_m // 3)} m" if part.targets > 1 else ""
            index = f"[1..{part.targets}]" if part.targets > 1 else ""
            place = f"{hidden}position ~ sites({part.region}{apart})"
            yield f"target {part.errand.group}{index} : {part.errand.type} {{ {place} }}"
        for part in self.fleets:
            body = part.body
            index = f"[1..{part.bodies}]" if part.bodies > 1 else ""
            where = f"at(i, [{', '.join(body.places[: part.bodies])}])" if part.bodies > 1 else body.places[0]
            extra = f", {body.extra}" if body.extra else ""
            actions = f"actions {{ {body.actions} }}"
            yield f"asset {body.group}{index} : {body.type} {{ position = {where}{extra}, {actions} }}"

    def _agents(self) -> Iterator[str]:
        roles = []
        for part in self.fleets:
            body = part.body
            roles.append(body.role)
            own = f"{body.group}[i]" if part.bodies > 1 else body.group
            index = f"[i in 1..{part.bodies}]" if part.bodies > 1 else ""
            seen = [f"{own}.*", *(f"{each.errand.group}.position" for each in self.parts if not each.hidden)]
            seen += ["peers.position"] if self.agents > 1 else []
            channels = ", ".join([*seen, "events"])
            yield f"agent {body.role}_agent{index} as {body.role} controls {own} {{ observes {channels} }}"
        if self.mode == "star":
            yield "agent lead as coordinator { observes events }"
            yield f"message order : assignment from coordinator to {', '.join(roles)}"
            yield f"message progress : status from {', '.join([*roles, 'coordinator'])} to all"
            yield "comms { hub = lead when mode == star, delay = 1 tick }"
        elif self.agents > 1:
            yield f"message progress : status from {', '.join(roles)} to all"
        for role in roles if self.mode == "star" else ():
            yield f"relation guidance coordinator -> {role} by order"
        if len(roles) == 2:
            yield f"relation information_handoff {roles[0]} -> {roles[1]} carries progress"
        elif self.agents > 1 and self.plan != "meet":
            yield f"relation cooperation {roles[0]} <-> {roles[0]} over {self.parts[0].region}"

    def _course(self) -> Iterator[str]:
        yield from self._stages()
        if any(part.hidden for part in self.parts):
            yield 'declassify end because "an episode ends as soon as it is won"'
        seconds = self.ticks * self.tick_s
        if self.chance.random() < 0.3:
            yield f"failure when now > {seconds} s"
        yield f"success when {self._success()}"
        yield "expect {"
        yield f"  oracle wins within {self.ticks} ticks for seeds 0..4"
        yield "  idle loses for seeds 0..2"
        yield "  random loses for seeds 0..2"
        yield from (f"  draws spread over {part.region}" for part in self.parts)
        yield "}"

    def _stages(self) -> Iterator[str]:
        if self.plan == "meet":
            body = self.parts[0].body
            place = self.parts[0].errand.group
            yield f"stage gather per b in {body.group} {{ done when distance_xy(b, {place}) <= 40 m }}"
            return
        for part in self.parts:
            yield f"stage {part.errand.group}_done{self._per(part)} {{ done when {self._served(part)} }}"
        if self.plan == "chain":
            first, second = self.parts
            yield f"unlock {second.errand.interaction}(v: {second.errand.group}) when {self._all(first)}"
            yield f"relation dependency {first.errand.group}_done -> {second.errand.group}_done"
        if self.plan == "return":
            part = self.parts[0]
            yield f"stage back {{ done when {self._back(part)} and {self._all(part)} }}"
            yield f"relation dependency {part.errand.group}_done -> back"

    def _per(self, part: _Part) -> str:
        return f" per v in {part.errand.group}" if part.targets > 1 else ""

    def _served(self, part: _Part) -> str:
        return f"emitted({part.errand.interaction}, {'v' if part.targets > 1 else part.errand.group})"

    def _all(self, part: _Part) -> str:
        every = f"(forall v in {part.errand.group}: {self._served(part)})"
        return every if part.targets > 1 else self._served(part)

    def _back(self, part: _Part) -> str:
        group = part.body.group
        return f"(forall b in {group}: b in start)" if part.bodies > 1 else f"{group} in start"

    def _success(self) -> str:
        if self.plan == "meet":
            body, place = self.parts[0].body, self.parts[0].errand.group
            return f"forall b in {body.group}: distance_xy(b, {place}) <= 40 m"
        conditions = [self._all(part) for part in self.parts]
        if self.plan == "return":
            conditions.append(self._back(self.parts[0]))
        return " and ".join(conditions)
