"""Coordinates of messages and of the world, and the states of bodies from poses.

Messages have Unreal's centimetres (X east, Y south, Z up; `yaw` clockwise from X) or degrees of WGS84
(`lingjing.mission.frames`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from lingjing.engines.remote.messages import Document
from lingjing.mission.frames import compass_from_yaw, from_geodetic, from_unreal, to_unreal
from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.trace.records import BodyState

_GROUPS = ("drones", "agents", "fleet", "cars", "dogs", "ships", "planes", "vehicles", "satellites")
"""Fields of observations that hold bodies by name, or in a list."""
NAMES = (
    "name", "id", "agent", "droneID", "droneId", "dronesId", "dogID", "dogId", "unmannedDogId", "carID", "carId",
    "car_id", "autocarId", "shipId", "shipID", "planeId", "satelliteId", "equipmentCode", "equipmentId",
)  # fmt: skip
"""Fields that name a body, in the spellings of the paper's engines."""
_SHARES = {"multirotor": "battery", "quadruped": "battery", "plane": "fuel"}
"""The share of energy left, 0 to 1, that rules read of a body. It is 1 until a pose holds it."""
FARTHEST_M = 1e6
"""A pose beyond this distance is refused, metres: no scene is that wide."""
_STILL_MPS = 0.2
"""Speed below which a body counts as standing, m/s (chosen)."""

_WORDS = {
    "multirotor": ("hovering", "moving"), "plane": ("loitering", "moving"), "quadruped": ("standing", "walking"),
    "road": ("parked", "driving"), "vessel": ("idle", "moving"), "satellite": ("in_view", "in_view"),
}  # fmt: skip
"""The status words of a body that stands, and of one that moves, as our engines publish them."""
_LISTS = {
    "droneEntityList": "multirotor", "unmannedDogEntityList": "quadruped", "autoVehicleEntityList": "road",
    "shipEntityList": "vessel", "planeEntityList": "plane", "satelliteEntityList": "satellite",
}  # fmt: skip
"""The lists of a document, with the engine of ours that moves their bodies."""


def engine_of(entity: Entity) -> str:
    """Return the engine of ours that moves bodies of this kind: that of a list of documents."""
    if entity.engine in _WORDS:
        return entity.engine
    words = " ".join((entity.type, *entity.bases)).lower()
    engines = {
        "dog": "quadruped", "car": "road", "van": "road", "truck": "road", "vehicle": "road", "boat": "vessel",
        "ship": "vessel", "fixed_wing": "plane", "satellite": "satellite",
    }  # fmt: skip
    return next((engine for word, engine in engines.items() if word in words), "multirotor")


def list_of(entity: Entity) -> str:
    """Return the list of a document that holds this body."""
    kind = engine_of(entity)
    return next(name for name, engine in _LISTS.items() if engine == kind)


def number_of(document: Document, *names: str) -> float | None:
    """Return the first finite number under these names; None without one."""
    for name in names:
        value = document.get(name)
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    return None


def position_of(pose: Document, instance: Instance, before: Vector) -> Vector | None:
    """Return the place of a pose in metres; None if it has none. A missing height is that of `before`."""
    x, y = number_of(pose, "X", "x"), number_of(pose, "Y", "y")
    if x is not None and y is not None:
        z = number_of(pose, "Z", "z")
        east, north, up = from_unreal(x, y, 0.0 if z is None else z)
        place = east, north, before[2] if z is None else up
    else:
        longitude, latitude = number_of(pose, "lon", "longitude"), number_of(pose, "lat", "latitude")
        if longitude is None or latitude is None:
            return None
        altitude = number_of(pose, "alt", "altitude")
        east, north = from_geodetic(latitude, longitude, instance.scene.origin)
        place = east, north, before[2] if altitude is None else altitude
    return place if all(abs(metres) <= FARTHEST_M for metres in place) else None


def heading_of(pose: Document) -> float | None:
    """Return the compass heading of a pose in degrees; None if it has none."""
    yaw = number_of(pose, "yaw", "Yaw", "caryaw")
    if yaw is not None:
        return compass_from_yaw(yaw)
    heading = number_of(pose, "heading")
    return None if heading is None else heading % 360.0


def centimetres(place: Vector) -> dict[str, float]:
    """Return a place of the world as the fields X, Y and Z of a message."""
    x, y, z = to_unreal(*place)
    return {"X": x, "Y": y, "Z": z}


def poses_in(message: Document) -> Iterator[tuple[str, Document]]:
    """Yield (name, pose) of the bodies in an observation or an event; "" for a pose without a name."""
    for group in _GROUPS:
        bodies = message.get(group)
        if isinstance(bodies, Mapping):
            yield from ((str(name), _pose(body)) for name, body in bodies.items() if isinstance(body, Mapping))
        elif isinstance(bodies, list):
            yield from ((name_in(body), _pose(body)) for body in bodies if isinstance(body, Mapping))
    pose = _pose(message)
    if number_of(pose, "X", "x", "lon", "longitude") is not None:
        yield name_in(message), pose


def name_in(message: Document) -> str:
    """Return the name of the body that a message is about; "" without one."""
    for name in NAMES:
        value = message.get(name)
        if isinstance(value, str | int) and not isinstance(value, bool) and value != "":
            return str(value)
    return ""


def _pose(body: Document) -> Document:
    for name in ("pose", "position", "shipPosition", "location"):
        inner = body.get(name)
        if isinstance(inner, Mapping):
            return {**body, **inner}
    return body


@dataclass
class Names:
    """The names of bodies on the wire."""

    entities: tuple[Entity, ...]
    wire: dict[str, str] = field(default_factory=dict)
    """The name on the wire, by entity; until the session says otherwise, its code in the document: its label or id."""

    def learn(self, names: Sequence[str]) -> str:
        """Take over the names that a session acknowledges. Returns the fault; "" without one.

        A name stands for the entity with this id or label; else names and entities go together in their order.
        """
        if not names:
            return ""
        known = {_fold(text): entity.id for entity in self.entities for text in (entity.label, entity.id) if text}
        matched = {known[_fold(name)]: name for name in names if _fold(name) in known}
        if len(matched) < len(self.entities):
            if len(names) != len(self.entities):
                mine = ", ".join(entity.id for entity in self.entities)
                return f"the session has the bodies {', '.join(names)[:200]}, and the mission {mine}"
            matched = {entity.id: name for entity, name in zip(self.entities, names, strict=True)}
        self.wire = matched
        return ""

    def of(self, entity: str) -> str:
        """Return the name of an entity on the wire."""
        return self.wire.get(entity) or next(each.label or each.id for each in self.entities if each.id == entity)

    def entity(self, name: str) -> str:
        """Return the entity with this name on the wire; "" if there is none. A nameless pose is that of a single
        body."""
        if not name:
            return self.entities[0].id if len(self.entities) == 1 else ""
        folded = _fold(name)
        for entity in self.entities:
            if folded in (_fold(self.of(entity.id)), _fold(entity.id), _fold(entity.label) if entity.label else None):
                return entity.id
        return ""


def _fold(name: str) -> str:
    return "".join(letter for letter in name if letter.isalnum()).casefold()


@dataclass
class Bodies:
    """The states of the bodies of a session, from the poses that it has sent."""

    instance: Instance
    entities: tuple[Entity, ...]
    states: dict[str, BodyState] = field(default_factory=dict)
    since_s: dict[str, float] = field(default_factory=dict)
    """Mission time of the last pose of each entity, seconds."""

    def __post_init__(self) -> None:
        for entity in self.entities:
            share = _SHARES.get(engine_of(entity))
            self.states[entity.id] = BodyState(
                id=entity.id,
                position=entity.position,
                heading_deg=entity.heading_deg,
                status=_WORDS[engine_of(entity)][0],
                resources={share: 1.0} if share else {},
            )
            self.since_s[entity.id] = 0.0

    def take(self, entity: str, pose: Document, time_s: float) -> bool:
        """Take over a pose. Returns False if it holds no place."""
        before = self.states[entity]
        place = position_of(pose, self.instance, before.position)
        if place is None:
            return False
        passed = time_s - self.since_s[entity]
        moved = tuple(now - then for now, then in zip(place, before.position, strict=True))
        velocity = (0.0, 0.0, 0.0) if passed <= 0.0 else (moved[0] / passed, moved[1] / passed, moved[2] / passed)
        heading = heading_of(pose)
        if heading is None:
            turned = math.degrees(math.atan2(moved[0], moved[1])) % 360.0
            heading = turned if math.hypot(moved[0], moved[1]) > _STILL_MPS else before.heading_deg
        left = {name: number_of(pose, name) for name in before.resources}
        resources = before.resources | {
            name: min(max(share, 0.0), 1.0) for name, share in left.items() if share is not None
        }
        self.states[entity] = BodyState(
            id=entity,
            position=place,
            velocity=velocity,
            heading_deg=heading,
            pitch_deg=number_of(pose, "pitch") or 0.0,
            roll_deg=number_of(pose, "roll") or 0.0,
            status=self.word(entity, moving=math.hypot(*velocity) > _STILL_MPS),
            resources=resources,
        )
        self.since_s[entity] = time_s
        return True

    def hold(self, entity: str) -> None:
        """Let a body without a new pose stand where it was."""
        state = self.states[entity]
        if state.velocity != (0.0, 0.0, 0.0):
            self.states[entity] = BodyState(
                id=entity,
                position=state.position,
                heading_deg=state.heading_deg,
                pitch_deg=state.pitch_deg,
                roll_deg=state.roll_deg,
                status=self.word(entity, moving=False),
                resources=state.resources,
            )

    def word(self, entity: str, *, moving: bool) -> str:
        """Return the status word of a body."""
        kind = next(engine_of(each) for each in self.entities if each.id == entity)
        return _WORDS[kind][1 if moving else 0]
