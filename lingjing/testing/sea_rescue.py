"""A sea rescue that was not played: consistent records of three scouts that sweep a bay and a boat that rescues people.

Tests of what reads traces need many ticks, pictures and messages, and no engine: `write_episode` writes them in less
than a second. Motion, pictures, boxes, reports, events and digests are consistent. Only the waves are random, from a
seed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.mission.expression import Binary, Call, Flag, Number, Quantified, Ref
from lingjing.mission.instance import (
    AgentSpec,
    Budget,
    CameraSpec,
    Cell,
    ChannelSpec,
    Clock,
    CommsSpec,
    Datum,
    Entity,
    Instance,
    MessageSpec,
    Region,
    SceneSpec,
    Weather,
)
from lingjing.mission.model import Rule, RuleParameter, Stage, Unlock
from lingjing.testing.traces import header_of, outcome_of
from lingjing.trace import images
from lingjing.trace.digest import START, next_digest
from lingjing.trace.records import (
    Action,
    AdjudicatedEvent,
    BodyState,
    BoundaryRecord,
    Box,
    CameraPose,
    CellView,
    Command,
    Decision,
    DecisionRecord,
    EngineStatus,
    Envelope,
    FrameInfo,
    Header,
    InboxRecord,
    ObservationRecord,
    Receipt,
    Route,
    Snapshot,
    StageChange,
    TaskEvent,
    Usage,
)
from lingjing.trace.writer import TraceWriter

Rgb = npt.NDArray[np.uint8]
Picture = tuple[FrameInfo, bytes, npt.NDArray[np.float32] | None, Rgb | None]
"""The truth of a picture, its JPEG, its depth in metres and its classes."""
BoundaryStep = tuple[BoundaryRecord, tuple[Picture, ...]]
"""A boundary and its pictures, the arguments of `TraceWriter.boundary`."""

_V, _R = RuleParameter(name="v", domain="victim"), RuleParameter(name="r", domain="detection")
_REACH = Binary("<=", Call("distance_xy", (Ref("boat", "entity"), Ref("v", "local"))), Number(50.0, "m"))

SEARCH = ((-123.7, -1100.5), (665.1, -1081.1), (665.1, -754.9), (-123.7, -750.2))
"""The searched region, metres."""
ALTITUDE_M = 100.0
"""The height of the drones above the water, metres."""
DATUM_M = -3.5
"""The elevation of the water, metres; that of the shipped bay."""
HFOV_DEG = 84.0
"""The horizontal field of view of the cameras, degrees."""
STARTS = ((306.6, -620.2), (310.0, -590.1), (278.7, -590.1))
"""The places of the drones at the start, metres."""
VICTIMS = ((40.0, -1010.0), (330.0, -880.0), (560.0, -990.0))
"""The places of the people at the start, metres."""
AGENTS = ("scout[1]", "scout[2]", "scout[3]", "skipper")
"""The agents, in the order of their declaration."""
MessageCategory = Literal["report", "assignment", "target_status"]

CATEGORIES: dict[str, MessageCategory] = {
    "detection": "report",
    "assignment": "assignment",
    "progress": "target_status",
}
"""The category of each kind of message."""
MACRO_STEP_S = 0.5
"""The interval of two snapshots, seconds."""
MACRO_STEPS = 20
"""The macro-steps of one tick of 10 s."""
DRONE_MPS = 14.0
"""The speed of the drones, m/s (chosen)."""
CLIMB_M = 2.0
"""The climb of a drone in one macro-step, metres (chosen)."""
BOAT_MPS = 3.0
"""The speed of the boat, m/s; that of the shipped mission."""
RESCUE_M = 40.0
"""The distance at which the boat rescues, metres (chosen: within the 50 m of the rule)."""


def instance(width: int = 640, height: int = 360) -> Instance:
    """Return the instance of the episode; `width` and `height` are those of the pictures, pixels."""
    return Instance(
        mission="ssr",
        title="Sea search and rescue",
        goal="Find every person in the water and bring the lifeboat to each of them.",
        seed=7,
        settings={"uavs": 3.0, "victims": 3.0, "altitude": ALTITUDE_M},
        scene=SceneSpec(kind="bay", datum_m=DATUM_M),
        clock=Clock(tick_s=10.0, sync_s=MACRO_STEP_S),
        budget=Budget(ticks=60, policy_s=90.0, engine_s=30.0, capture_s=10.0),
        weather=Weather(wind_mps=4.0, wind_from_deg=220.0, wave_height_m=0.4, current_mps=0.15, current_to_deg=60.0),
        regions=(Region(name="search", polygon=SEARCH),),
        cells=tuple(_cell(row, column) for row in range(3) for column in range(3)),
        entities=_entities(width, height),
        agents=_agents(),
        messages=tuple(_message_kind(kind, category) for kind, category in CATEGORIES.items()),
        comms=CommsSpec(mode="broadcast", hub=None),
        rules=(
            Rule(name="matched", parameters=(_V, _R), condition=Flag(True), matching=True),
            Rule(name="reported", parameters=(_V, _R), condition=Flag(True)),
            Rule(name="rescued", parameters=(_V,), condition=_REACH),
        ),
        unlocks=(Unlock(interaction="rescue", parameters=(_V,), condition=Flag(True)),),
        stages=tuple(
            Stage(name=name, condition=Flag(True), variable="v", domain="victim")
            for name in ("detect", "locate", "handoff", "execute")
        ),
        relations=(),
        success=Quantified("forall", "v", "victim", Call("rescued", (Ref("v", "local"),), rule=True)),
    )


def _message_kind(kind: str, category: MessageCategory) -> MessageSpec:
    return MessageSpec(
        kind=kind, type=kind, category=category, fields=(), senders=("searcher", "rescuer"), recipients=("all",)
    )


def _cell(row: int, column: int) -> Cell:
    """Return a cell of the search grid; cells overlap by 40 m and 20 m."""
    xs = [float(x) for x in np.linspace(-123.7, 665.1, 4)]
    ys = [float(y) for y in np.linspace(-1095.0, -752.0, 4)]
    x0, x1, y0, y1 = xs[column] - 20, xs[column + 1] + 20, ys[row] - 10, ys[row + 1] + 10
    return Cell(
        name=f"cells-{row + 1}-{column + 1}",
        grid="cells",
        row=row + 1,
        column=column + 1,
        polygon=((x0, y0), (x1, y0), (x1, y1), (x0, y1)),
        centre=((x0 + x1) / 2, (y0 + y1) / 2),
    )


def _entities(width: int, height: int) -> tuple[Entity, ...]:
    camera = CameraSpec(
        name="nadir",
        view="nadir",
        width=width,
        height=height,
        hfov_deg=HFOV_DEG,
        channels=("rgb", "depth", "semantic"),
        capture="on_request",
    )
    drones = tuple(
        Entity(
            id=f"uav[{number}]",
            group="uav",
            index=number,
            role="asset",
            type="quadrotor",
            engine="multirotor",
            position=(x, y, 1.1),
            cameras=(camera,),
        )
        for number, (x, y) in enumerate(STARTS, 1)
    )
    boat = Entity(
        id="boat",
        group="boat",
        index=0,
        role="asset",
        type="lifeboat",
        engine="vessel",
        position=(12.4, -1351.8, DATUM_M),
        heading_deg=30.0,
    )
    victims = tuple(
        Entity(
            id=f"victim[{number}]",
            group="victim",
            index=number,
            role="target",
            type="person_in_water",
            engine="city",
            position=(x, y, DATUM_M),
            hidden=("position",),
        )
        for number, (x, y) in enumerate(VICTIMS, 1)
    )
    return (*victims, *drones, boat)


def _agents() -> tuple[AgentSpec, ...]:
    observes = (ChannelSpec(source="grid", name="cells"),)
    scouts = tuple(
        AgentSpec(
            id=f"scout[{number}]",
            name="scout",
            index=number,
            role="searcher",
            controls=(f"uav[{number}]",),
            commands=(f"uav[{number}]", "boat"),
            observes=observes,
        )
        for number in (1, 2, 3)
    )
    skipper = AgentSpec(
        id="skipper",
        name="skipper",
        index=0,
        role="rescuer",
        controls=("boat",),
        commands=("boat",),
        observes=observes,
    )
    return (*scouts, skipper)


def header(width: int = 640, height: int = 360) -> Header:
    """Return the header of the trace; `width` and `height` are those of the pictures, pixels."""
    return header_of(instance(width, height))


def episode(ticks: int = 48, width: int = 640, height: int = 360, depth: bool = False) -> Iterator[BoundaryStep]:
    """Yield the boundaries of the episode with their pictures and chained digests, at most `ticks` after boundary 0.

    With `depth`, pictures have depth and classes too. The episode ends when all three people are rescued.
    """
    rescue = _SeaRescue(instance(width, height), width, height, depth)
    for tick in range(ticks + 1):
        record, pictures = rescue.boundary(tick)
        yield record, pictures
        if record.done:
            return


def write_episode(
    path: Path, *, ticks: int = 48, width: int = 640, height: int = 360, depth: bool = False
) -> list[BoundaryRecord]:
    """Write the episode as a whole trace, and return its boundaries."""
    records = []
    with TraceWriter(path, header(width, height)) as writer:
        for record, pictures in episode(ticks, width, height, depth):
            writer.boundary(record, pictures)
            records.append(record)
        writer.finish(outcome_of(records))
    return records


class _SeaRescue:
    """The state of the episode: places, detections and messages up to the last boundary."""

    def __init__(self, spec: Instance, width: int, height: int, depth: bool) -> None:
        self._spec, self._size, self._depth = spec, (width, height), depth
        self._places = {entity.id: list(entity.position) for entity in spec.entities}
        self._headings = {entity.id: entity.heading_deg for entity in spec.entities}
        self._lanes = _lanes(spec)
        self._waiting: list[str] = []
        """Detected victims, in the order of their rescue."""
        self._rescued: set[str] = set()
        self._seen: set[str] = set()
        self._assigned: set[str] = set()
        self._visited: dict[str, tuple[int, str]] = {}
        self._digest, self._time_s = START, 0.0
        self._delivered: list[Envelope] = []

    def boundary(self, tick: int) -> BoundaryStep:
        """Play one tick, and return its record and pictures."""
        self._tick = tick
        self._events: list[AdjudicatedEvent] = []
        self._stages: list[StageChange] = []
        self._messages: list[Envelope] = []
        self._task_events: list[TaskEvent] = []
        snapshots = tuple(self._macro_step() for _ in range(MACRO_STEPS if tick else 1))
        for task in self._task_events:
            self._event("rescued", (task.entities[0],), distance_m=38.0)
            self._stage("execute", task.entities[0])
        people = {
            name: (place[0], place[1])
            for name, place in self._places.items()
            if name.startswith("victim") and name not in self._rescued
        }
        pictures = tuple(self._photograph(drone, people) for drone in (1, 2, 3) if tick >= 3 and tick % 2)
        for number, picture in enumerate(pictures):
            self._report(number, picture[0], people)
        self._assign()
        record = self._record(snapshots, tuple(picture[0] for picture in pictures))
        self._delivered = self._messages
        self._digest = next_digest(self._digest, record)
        return msgspec.structs.replace(record, digest=self._digest), pictures

    def _macro_step(self) -> Snapshot:
        if self._tick:
            self._time_s += MACRO_STEP_S
        return Snapshot(time_s=self._time_s, states=tuple(self._state(name) for name in self._places))

    def _state(self, name: str) -> BodyState:
        velocity = self._moved(name) if self._tick else (0.0, 0.0)
        x, y, z = self._places[name]
        status = "rescued" if name in self._rescued else "adrift" if name.startswith("victim") else "moving"
        return BodyState(
            id=name,
            position=(x, y, z),
            velocity=(*velocity, 0.0),
            heading_deg=self._headings[name],
            status=status,
            resources={"battery": max(0.0, 1.0 - self._time_s / 900.0)} if name.startswith("uav") else {},
        )

    def _moved(self, name: str) -> tuple[float, float]:
        """Move an entity for one macro-step, and return its velocity, m/s."""
        place = self._places[name]
        if name.startswith("uav"):
            lane = self._lanes[name]
            place[2] = min(ALTITUDE_M + DATUM_M, place[2] + CLIMB_M)
            velocity = self._towards(name, lane[0], DRONE_MPS)
            if math.hypot(place[0] - lane[0][0], place[1] - lane[0][1]) < 1.0 and len(lane) > 1:
                lane.pop(0)
            return velocity
        if name == "boat" and self._waiting:
            goal = self._places[self._waiting[0]]
            velocity = self._towards(name, (goal[0], goal[1]), BOAT_MPS)
            if math.hypot(place[0] - goal[0], place[1] - goal[1]) < RESCUE_M:
                victim = self._waiting.pop(0)
                self._rescued.add(victim)
                self._task_events.append(TaskEvent(kind="rescue", entities=(victim, "boat"), time_s=self._time_s))
            return velocity
        if name.startswith("victim") and name not in self._rescued:
            place[0] += 0.04
            place[1] += 0.025
            return 0.08, 0.05
        return 0.0, 0.0

    def _towards(self, name: str, goal: tuple[float, float], speed_mps: float) -> tuple[float, float]:
        """Move an entity along a straight line for one macro-step, and return its velocity, m/s."""
        place = self._places[name]
        dx, dy = goal[0] - place[0], goal[1] - place[1]
        distance = math.hypot(dx, dy)
        step = min(distance, speed_mps * MACRO_STEP_S)
        if distance < 1e-9:
            return 0.0, 0.0
        self._headings[name] = math.degrees(math.atan2(dx, dy)) % 360.0
        place[0] += dx / distance * step
        place[1] += dy / distance * step
        return dx / distance * step / MACRO_STEP_S, dy / distance * step / MACRO_STEP_S

    def _photograph(self, drone: int, people: dict[str, tuple[float, float]]) -> Picture:
        name, (width, height) = f"uav[{drone}]", self._size
        x, y, z = self._places[name]
        pose = CameraPose(
            position=(x, y, z),
            heading_deg=self._headings[name],
            tilt_deg=90.0,
            hfov_deg=HFOV_DEG,
            width=width,
            height=height,
        )
        rgb, boxes = _render(pose, people, seed=self._tick * 10 + drone)
        for cell in self._spec.cells:
            (x0, y0), _, (x1, y1), _ = cell.polygon
            if x0 <= x <= x1 and y0 <= y <= y1:
                self._visited.setdefault(cell.name, (self._tick, name))
        jpeg = images.encode_jpeg(rgb)
        info = FrameInfo(
            id=f"f{self._tick}-{name}-nadir",
            entity=name,
            camera="nadir",
            tick=self._tick,
            time_s=self._time_s,
            pose=pose,
            channels=("rgb", "depth", "semantic") if self._depth else ("rgb",),
            boxes=boxes,
            sha256=hashlib.sha256(jpeg).hexdigest(),
        )
        range_m = np.full((height, width), z - DATUM_M, np.float32) if self._depth else None
        classes = np.ones((height, width), np.uint8) if self._depth else None
        return info, jpeg, range_m, classes

    def _report(self, number: int, info: FrameInfo, people: dict[str, tuple[float, float]]) -> None:
        """Report each person in a picture, and once a person that is not there."""
        scout = f"scout[{number + 1}]"
        for truth in info.boxes:
            x0, y0, x1, y1 = truth.box
            x, y = people[truth.entity]
            error = (self._tick * 7 + number * 5) % 11
            position = (x + error - 3.0, y + 4.0 - error / 2, DATUM_M)
            message = self._detection(scout, info.id, (x0 + 0.001, y0, x1 + 0.001, y1), position, 0.9)
            overlap = (x1 - x0 - 0.001) / (x1 - x0 + 0.001)
            for kind, stage in (("matched", "detect"), ("reported", "locate")):
                self._event(kind, (truth.entity, message), iou=overlap, loc_error_m=math.dist(position[:2], (x, y)))
                if truth.entity not in self._seen:
                    self._stage(stage, truth.entity)
            if truth.entity not in self._seen:
                self._seen.add(truth.entity)
                self._waiting.append(truth.entity)
        if info.tick == 9 and number == 0:
            self._detection(scout, info.id, (0.1, 0.1, 0.14, 0.15), (100.0, -800.0, DATUM_M), 0.4)

    def _detection(
        self,
        scout: str,
        frame: str,
        box: tuple[float, ...],
        position: tuple[float, ...],
        confidence: float,
    ) -> str:
        """Send a report, and return the id of its message."""
        body: dict[str, Datum] = {
            "frame": frame,
            "class": "person_in_water",
            "box": box,
            "position": position,
            "confidence": confidence,
        }
        return self._send(scout, "detection", "report", body)

    def _assign(self) -> None:
        """Assign the boat to the next victim."""
        if self._waiting and self._waiting[0] not in self._assigned:
            victim = self._waiting[0]
            self._assigned.add(victim)
            self._send("scout[1]", "assignment", "assignment", {"assignee": "boat", "task": victim})
            self._stage("handoff", victim)

    def _send(self, sender: str, kind: str, category: str, body: dict[str, Datum]) -> str:
        message = f"m{self._tick}-{len({envelope.id for envelope in self._messages}) + 1}"
        size = len(msgspec.json.encode(body))
        self._messages += [
            Envelope(
                id=message,
                tick=self._tick,
                sender=sender,
                recipient=agent,
                kind=kind,
                category=category,
                body=body,
                bytes=size,
                deliver_at=self._tick + 1,
            )
            for agent in AGENTS
            if agent != sender
        ]
        return message

    def _event(self, kind: str, bindings: tuple[str, ...], **evidence: Datum) -> None:
        number = len(self._events) + 1
        self._events.append(
            AdjudicatedEvent(
                id=f"e{self._tick}-{number}",
                kind=kind,
                tick=self._tick,
                time_s=self._time_s,
                bindings=bindings,
                evidence=evidence,
            )
        )

    def _stage(self, stage: str, subject: str) -> None:
        self._stages.append(StageChange(stage=stage, subject=subject, tick=self._tick, time_s=self._time_s))

    def _commands(self) -> tuple[Command, ...]:
        """Return a command of each agent: drones take pictures at odd ticks; none at boundary 0."""
        tick = self._tick
        return tuple(
            Command(
                id=f"c{tick}-{number}",
                tick=tick,
                sender=agent,
                resource=f"uav[{number + 1}]" if number < 3 else "boat",
                verb="takePhoto" if number < 3 and tick % 2 else "setDestination",
            )
            for number, agent in enumerate(AGENTS if tick else ())
        )

    def _receipt(self, command: Command, number: int) -> Receipt:
        rejected = self._tick == 12 and number == 1
        return Receipt(
            request=command.id,
            tick=self._tick,
            sender=command.sender,
            resource=command.resource,
            status="rejected" if rejected else "accepted",
            reason="conflict" if rejected else "",
            time_s=self._time_s,
        )

    def _decision(self, command: Command) -> DecisionRecord:
        decision = Decision(
            command=Action(verb=command.verb, resource=command.resource),
            thought="keep sweeping",
            usage=Usage(calls=1, prompt_tokens=800, completion_tokens=60, cost_usd=0.001),
        )
        return DecisionRecord(agent=command.sender, decision=decision, policy_wall_s=0.01 * self._tick)

    def _record(self, snapshots: tuple[Snapshot, ...], frames: tuple[FrameInfo, ...]) -> BoundaryRecord:
        tick, commands = self._tick, self._commands()
        cells = tuple(CellView(name=name, visited_tick=at, visited_by=by) for name, (at, by) in self._visited.items())
        return BoundaryRecord(
            tick=tick,
            time_s=self._time_s,
            snapshots=snapshots,
            engines=(EngineStatus(engine="multirotor", time_s=self._time_s, frame=tick * 20, wait_wall_s=0.01),),
            task_events=tuple(self._task_events),
            frames=frames,
            observations=tuple(ObservationRecord(agent=agent, cells=cells, sha256="0" * 64) for agent in AGENTS),
            inboxes=tuple(
                InboxRecord(agent=agent, messages=tuple(m.id for m in self._delivered if m.recipient == agent))
                for agent in AGENTS
            ),
            decisions=tuple(map(self._decision, commands)),
            commands=commands,
            messages=tuple(self._messages),
            receipts=tuple(self._receipt(command, number) for number, command in enumerate(commands)),
            events=tuple(self._events),
            stages=tuple(self._stages),
            relations=(),
            reward=len(self._rescued) / 3,
            scr=len(self._rescued) / 3,
            done=len(self._rescued) == 3,
            wall_s=0.1 * tick,
            routes=(_boat_route(tick, self._time_s),),
            unreachable_links=(("uav[1]", "boat"),),
        )


def _boat_route(number: int, time_s: float) -> Route:
    """Return a route of the boat, in the form in which a road engine publishes it."""
    way = ((12.4, -1351.8, DATUM_M), (*VICTIMS[0], DATUM_M))
    length = math.dist(*way)
    return Route(entity="boat", number=number, waypoints=way, length_m=length, duration_s=length / 3.0, time_s=time_s)


def _render(pose: CameraPose, people: dict[str, tuple[float, float]], seed: int) -> tuple[Rgb, tuple[Box, ...]]:
    """Return a nadir view of seeded waves with an orange rectangle per person, and the exact boxes."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[0 : pose.height, 0 : pose.width].astype(np.float32)
    shade = 14 * np.sin(columns / 9 + 2 * np.sin(rows / 31)) * np.sin(rows / 7 - columns / 23)
    shade += rng.normal(0, 4, shade.shape).astype(np.float32)
    rgb = np.clip(np.stack([shade + 28, shade + 78, shade + 104], -1), 0, 255).astype(np.uint8)
    metres = 2 * (pose.position[2] - DATUM_M) * math.tan(math.radians(pose.hfov_deg / 2)) / pose.width
    heading = math.radians(pose.heading_deg)
    boxes = []
    for name, (east, north) in people.items():
        dx, dy = east - pose.position[0], north - pose.position[1]
        u = pose.width / 2 + (dx * math.cos(heading) - dy * math.sin(heading)) / metres
        v = pose.height / 2 - (dx * math.sin(heading) + dy * math.cos(heading)) / metres
        half_w, half_h = 0.9 / metres + 2, 0.6 / metres + 1
        x0, x1, y0, y1 = round(u - half_w), round(u + half_w), round(v - half_h), round(v + half_h)
        if x0 < 0 or y0 < 0 or x1 >= pose.width or y1 >= pose.height:
            continue
        rgb[y0:y1, x0:x1] = (230, 110, 30)
        box = (x0 / pose.width, y0 / pose.height, x1 / pose.width, y1 / pose.height)
        boxes.append(Box(entity=name, cls="person_in_water", box=box, pixels=(x1 - x0) * (y1 - y0)))
    return rgb, tuple(boxes)


def _lanes(spec: Instance) -> dict[str, list[tuple[float, float]]]:
    lanes: dict[str, list[tuple[float, float]]] = {}
    for i in (1, 2, 3):
        cells = [cell for cell in spec.cells if cell.column == i]
        order = sorted(cells, key=lambda cell: -cell.row)
        lanes[f"uav[{i}]"] = [
            (cell.centre[0] + side, cell.centre[1] + dy)
            for cell in order
            for dy in (40.0, -40.0)
            for side in ((-90.0, 90.0) if dy > 0 else (90.0, -90.0))
        ]
    return lanes


__all__ = [
    "AGENTS", "VICTIMS", "BoundaryStep", "Picture", "episode", "header", "instance", "outcome_of", "write_episode",
]  # fmt: skip
