"""A synthetic sea rescue: three scouts sweep a bay and report the people that they detect, and a boat rescues them.

Motion, pictures, boxes, reports, events and digests are consistent. Only the waves are random, from a seed.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from lingjing.mission.expression import Binary, Call, Flag, Number, Quantified, Ref
from lingjing.mission.instance import (
    AgentSpec,
    Budget,
    CameraSpec,
    Cell,
    ChannelSpec,
    Clock,
    CommsSpec,
    Entity,
    Instance,
    MessageSpec,
    Region,
    SceneSpec,
    Weather,
)
from lingjing.mission.model import Rule, RuleParameter, Stage, Unlock
from lingjing.trace import images
from lingjing.trace.digest import START, next_digest, next_frames_digest
from lingjing.trace.records import (
    Action,
    AdjudicatedEvent,
    AgentBinding,
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
    Outcome,
    Receipt,
    Route,
    Snapshot,
    StageChange,
    TaskEvent,
    Usage,
)
from lingjing.trace.writer import TraceWriter

V, R = RuleParameter(name="v", domain="victim"), RuleParameter(name="r", domain="detection")
REACH = Binary("<=", Call("distance_xy", (Ref("boat", "entity"), Ref("v", "local"))), Number(50.0, "m"))
SEARCH = ((-123.7, -1100.5), (665.1, -1081.1), (665.1, -754.9), (-123.7, -750.2))
ALTITUDE, DATUM, HFOV = 100.0, -3.5, 84.0
STARTS = ((306.6, -620.2), (310.0, -590.1), (278.7, -590.1))
VICTIMS = ((40.0, -1010.0), (330.0, -880.0), (560.0, -990.0))
AGENTS = ("scout[1]", "scout[2]", "scout[3]", "skipper")


def instance(width: int = 640, height: int = 360) -> Instance:
    cells = []
    xs, ys = np.linspace(-123.7, 665.1, 4), np.linspace(-1095.0, -752.0, 4)
    for row in range(3):
        for column in range(3):
            x0, x1, y0, y1 = xs[column] - 20, xs[column + 1] + 20, ys[row] - 10, ys[row + 1] + 10
            cells.append(
                Cell(
                    name=f"cells-{row + 1}-{column + 1}",
                    grid="cells",
                    row=row + 1,
                    column=column + 1,
                    polygon=((x0, y0), (x1, y0), (x1, y1), (x0, y1)),
                    centre=(float(x0 + x1) / 2, float(y0 + y1) / 2),
                )
            )
    camera = CameraSpec(
        name="nadir",
        view="nadir",
        width=width,
        height=height,
        hfov_deg=HFOV,
        channels=("rgb", "depth", "semantic"),
        capture="on_request",
    )
    uavs = tuple(
        Entity(
            id=f"uav[{i}]",
            group="uav",
            index=i,
            role="asset",
            type="quadrotor",
            engine="multirotor",
            position=(*STARTS[i - 1], 1.1),
            cameras=(camera,),
        )
        for i in (1, 2, 3)
    )
    boat = Entity(
        id="boat",
        group="boat",
        index=0,
        role="asset",
        type="lifeboat",
        engine="vessel",
        position=(12.4, -1351.8, DATUM),
        heading_deg=30.0,
    )
    victims = tuple(
        Entity(
            id=f"victim[{i}]",
            group="victim",
            index=i,
            role="target",
            type="person_in_water",
            engine="city",
            position=(*VICTIMS[i - 1], DATUM),
            hidden=("position",),
        )
        for i in (1, 2, 3)
    )
    observes = (ChannelSpec(source="grid", name="cells"),)
    scouts = tuple(
        AgentSpec(
            id=f"scout[{i}]",
            name="scout",
            index=i,
            role="searcher",
            controls=(f"uav[{i}]",),
            commands=(f"uav[{i}]", "boat"),
            observes=observes,
        )
        for i in (1, 2, 3)
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
    kinds = tuple(
        MessageSpec(
            kind=kind, type=kind, category=category, fields=(), senders=("searcher", "rescuer"), recipients=("all",)
        )
        for kind, category in (("detection", "report"), ("assignment", "assignment"), ("progress", "target_status"))
    )
    return Instance(
        mission="ssr",
        title="Sea search and rescue",
        goal="Find every person in the water and bring the lifeboat to each of them.",
        seed=7,
        settings={"uavs": 3.0, "victims": 3.0, "altitude": ALTITUDE},
        scene=SceneSpec(kind="bay", datum_m=DATUM),
        clock=Clock(tick_s=10.0, sync_s=0.5),
        budget=Budget(ticks=60, policy_s=90.0, engine_s=30.0, capture_s=10.0),
        weather=Weather(wind_mps=4.0, wind_from_deg=220.0, wave_height_m=0.4, current_mps=0.15, current_to_deg=60.0),
        regions=(Region(name="search", polygon=SEARCH),),
        cells=tuple(cells),
        entities=(*victims, *uavs, boat),
        agents=(*scouts, skipper),
        messages=kinds,
        comms=CommsSpec(mode="broadcast", hub=None),
        rules=(
            Rule(name="matched", parameters=(V, R), condition=Flag(True), matching=True),
            Rule(name="reported", parameters=(V, R), condition=Flag(True)),
            Rule(name="rescued", parameters=(V,), condition=REACH),
        ),
        unlocks=(Unlock(interaction="rescue", parameters=(V,), condition=Flag(True)),),
        stages=tuple(
            Stage(name=name, condition=Flag(True), variable="v", domain="victim")
            for name in ("detect", "locate", "handoff", "execute")
        ),
        relations=(),
        success=Quantified("forall", "v", "victim", Call("rescued", (Ref("v", "local"),), rule=True)),
    )


def header(width: int = 640, height: int = 360) -> Header:
    return Header(
        instance=instance(width, height),
        bindings=tuple(AgentBinding(agent=agent, policy="heuristic") for agent in AGENTS),
        fingerprint={"cpu": "test"},
    )


def render(pose: CameraPose, people: dict[str, tuple[float, float]], seed: int) -> tuple[np.ndarray, tuple[Box, ...]]:
    """Return a nadir view of seeded waves with an orange rectangle per person, and the exact boxes."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[0 : pose.height, 0 : pose.width].astype(np.float32)
    shade = 14 * np.sin(columns / 9 + 2 * np.sin(rows / 31)) * np.sin(rows / 7 - columns / 23)
    shade += rng.normal(0, 4, shade.shape).astype(np.float32)
    rgb = np.clip(np.stack([shade + 28, shade + 78, shade + 104], -1), 0, 255).astype(np.uint8)
    metres = 2 * (pose.position[2] - DATUM) * math.tan(math.radians(pose.hfov_deg / 2)) / pose.width
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


def _boat_route(number: int, time_s: float) -> Route:
    """Return a route of the boat, in the form in which a road engine publishes it."""
    way = ((12.4, -1351.8, DATUM), (*VICTIMS[0], DATUM))
    length = math.dist(*way)
    return Route(entity="boat", number=number, waypoints=way, length_m=length, duration_s=length / 3.0, time_s=time_s)


Step = tuple[BoundaryRecord, tuple[tuple[FrameInfo, bytes, np.ndarray | None, np.ndarray | None], ...]]


@dataclass
class World:
    """Positions and headings of all entities. Entities move along straight lines."""

    places: dict[str, list[float]]
    headings: dict[str, float]

    def move(self, name: str, goal: tuple[float, float], speed: float, dt: float) -> tuple[float, float]:
        place = self.places[name]
        dx, dy = goal[0] - place[0], goal[1] - place[1]
        far = math.hypot(dx, dy)
        step = min(far, speed * dt)
        if far < 1e-9:
            return 0.0, 0.0
        self.headings[name] = math.degrees(math.atan2(dx, dy)) % 360.0
        place[0] += dx / far * step
        place[1] += dy / far * step
        return dx / far * step / dt, dy / far * step / dt


def episode(  # noqa: C901  one loop reads like the episode it makes
    ticks: int = 48, width: int = 640, height: int = 360, depth: bool = False
) -> Iterator[Step]:
    """Yield the boundaries of one episode with their pictures and chained digests."""
    spec = instance(width, height)
    world = World(
        {entity.id: list(entity.position) for entity in spec.entities},
        {entity.id: entity.heading_deg for entity in spec.entities},
    )
    lanes = _lanes(spec)
    waiting: list[str] = []  # detected victims, in the order of their rescue
    rescued: set[str] = set()
    seen: set[str] = set()
    assigned: set[str] = set()
    visited: dict[str, tuple[int, str]] = {}
    digest, time_s = START, 0.0
    delivered: list[Envelope] = []
    for tick in range(ticks + 1):
        snapshots, task_events = [], []
        for _ in range(20 if tick else 1):
            if tick:
                time_s += 0.5
            states = []
            for name, place in world.places.items():
                velocity = (0.0, 0.0)
                if tick and name.startswith("uav"):
                    place[2] = min(ALTITUDE + DATUM, place[2] + 2.0)
                    lane = lanes[name]
                    velocity = world.move(name, lane[0], 14.0, 0.5)
                    if math.hypot(place[0] - lane[0][0], place[1] - lane[0][1]) < 1.0 and len(lane) > 1:
                        lane.pop(0)
                elif tick and name == "boat" and waiting:
                    goal = world.places[waiting[0]]
                    velocity = world.move(name, (goal[0], goal[1]), 3.0, 0.5)
                    if math.hypot(place[0] - goal[0], place[1] - goal[1]) < 40.0:
                        rescued.add(waiting[0])
                        task_events.append(TaskEvent(kind="rescue", entities=(waiting.pop(0), "boat"), time_s=time_s))
                elif tick and name.startswith("victim") and name not in rescued:
                    velocity = (0.08, 0.05)
                    place[0] += 0.04
                    place[1] += 0.025
                states.append(
                    BodyState(
                        id=name,
                        position=(place[0], place[1], place[2]),
                        velocity=(*velocity, 0.0),
                        heading_deg=world.headings[name],
                        status="rescued" if name in rescued else "adrift" if name.startswith("victim") else "moving",
                        resources={"battery": max(0.0, 1.0 - time_s / 900.0)} if name.startswith("uav") else {},
                    )
                )
            snapshots.append(Snapshot(time_s=time_s, states=tuple(states)))
        pictures, messages, events, stages, decisions, receipts = [], [], [], [], [], []
        for task in task_events:
            events.append(
                AdjudicatedEvent(
                    id=f"e{tick}-{len(events) + 1}",
                    kind="rescued",
                    tick=tick,
                    time_s=time_s,
                    bindings=(task.entities[0],),
                    evidence={"distance_m": 38.0},
                )
            )
            stages.append(StageChange(stage="execute", subject=task.entities[0], tick=tick, time_s=time_s))
        people = {n: (p[0], p[1]) for n, p in world.places.items() if n.startswith("victim") and n not in rescued}
        for i in (1, 2, 3) if tick >= 3 and tick % 2 else ():
            place = world.places[f"uav[{i}]"]
            pose = CameraPose(
                position=(place[0], place[1], place[2]),
                heading_deg=world.headings[f"uav[{i}]"],
                tilt_deg=90.0,
                hfov_deg=HFOV,
                width=width,
                height=height,
            )
            rgb, boxes = render(pose, people, seed=tick * 10 + i)
            for cell in spec.cells:
                (x0, y0), _, (x1, y1), _ = cell.polygon
                if x0 <= place[0] <= x1 and y0 <= place[1] <= y1:
                    visited.setdefault(cell.name, (tick, f"uav[{i}]"))
            jpeg = images.encode_jpeg(rgb)
            info = FrameInfo(
                id=f"f{tick}-uav[{i}]-nadir",
                entity=f"uav[{i}]",
                camera="nadir",
                tick=tick,
                time_s=time_s,
                pose=pose,
                channels=("rgb", "depth", "semantic") if depth else ("rgb",),
                boxes=boxes,
                sha256=hashlib.sha256(jpeg).hexdigest(),
            )
            range_m = np.full((height, width), pose.position[2] - DATUM, np.float32) if depth else None
            ids = np.ones((height, width), np.uint8) if depth else None
            pictures.append((info, jpeg, range_m, ids))
        for place_in_list, (info, _, _, _) in enumerate(pictures):
            scout = f"scout[{place_in_list + 1}]"
            for truth in info.boxes:
                mid = f"m{tick}-{len({m.id for m in messages}) + 1}"
                x0, y0, x1, y1 = truth.box
                there = people[truth.entity]
                wrong = (tick * 7 + place_in_list * 5) % 11
                position = (there[0] + wrong - 3.0, there[1] + 4.0 - wrong / 2, DATUM)
                body = {
                    "frame": info.id,
                    "class": "person_in_water",
                    "box": (x0 + 0.001, y0, x1 + 0.001, y1),
                    "position": position,
                    "confidence": 0.9,
                }
                messages += _broadcast(mid, tick, scout, "detection", "report", body)
                overlap = (x1 - x0 - 0.001) / (x1 - x0 + 0.001)
                error = math.dist(position[:2], there)
                for kind, stage in (("matched", "detect"), ("reported", "locate")):
                    events.append(
                        AdjudicatedEvent(
                            id=f"e{tick}-{len(events) + 1}",
                            kind=kind,
                            tick=tick,
                            time_s=time_s,
                            bindings=(truth.entity, mid),
                            evidence={"iou": overlap, "loc_error_m": error},
                        )
                    )
                    if truth.entity not in seen:
                        stages.append(StageChange(stage=stage, subject=truth.entity, tick=tick, time_s=time_s))
                if truth.entity not in seen:
                    seen.add(truth.entity)
                    waiting.append(truth.entity)
            if info.tick == 9 and place_in_list == 0:
                body = {
                    "frame": info.id,
                    "class": "person_in_water",
                    "box": (0.1, 0.1, 0.14, 0.15),
                    "position": (100.0, -800.0, DATUM),
                    "confidence": 0.4,
                }
                mid = f"m{tick}-{len({m.id for m in messages}) + 1}"
                messages += _broadcast(mid, tick, scout, "detection", "report", body)
        if waiting and waiting[0] not in assigned:
            assigned.add(waiting[0])
            body = {"assignee": "boat", "task": waiting[0]}
            mid = f"m{tick}-{len({m.id for m in messages}) + 1}"
            messages += _broadcast(mid, tick, "scout[1]", "assignment", "assignment", body)
            stages.append(StageChange(stage="handoff", subject=waiting[0], tick=tick, time_s=time_s))
        commands = []
        for n, agent in enumerate(AGENTS if tick else ()):
            resource = f"uav[{n + 1}]" if n < 3 else "boat"
            action = Action(verb="takePhoto" if n < 3 and tick % 2 else "setDestination", resource=resource)
            decisions.append(
                DecisionRecord(
                    agent=agent,
                    decision=Decision(
                        command=action,
                        thought="keep sweeping",
                        usage=Usage(calls=1, prompt_tokens=800, completion_tokens=60, cost_usd=0.001),
                    ),
                    policy_wall_s=0.01 * tick,
                )
            )
            commands.append(Command(id=f"c{tick}-{n}", tick=tick, sender=agent, resource=resource, verb=action.verb))
            rejected = tick == 12 and n == 1
            receipts.append(
                Receipt(
                    request=f"c{tick}-{n}",
                    tick=tick,
                    sender=agent,
                    resource=resource,
                    status="rejected" if rejected else "accepted",
                    reason="conflict" if rejected else "",
                    time_s=time_s,
                )
            )
        record = BoundaryRecord(
            tick=tick,
            time_s=time_s,
            snapshots=tuple(snapshots),
            engines=(EngineStatus(engine="multirotor", time_s=time_s, frame=tick * 20, wait_wall_s=0.01),),
            task_events=tuple(task_events),
            frames=tuple(picture[0] for picture in pictures),
            observations=tuple(
                ObservationRecord(agent=agent, cells=_seen_cells(visited), sha256="0" * 64) for agent in AGENTS
            ),
            inboxes=tuple(
                InboxRecord(agent=agent, messages=tuple(m.id for m in delivered if m.recipient == agent))
                for agent in AGENTS
            ),
            decisions=tuple(decisions),
            commands=tuple(commands),
            messages=tuple(messages),
            receipts=tuple(receipts),
            events=tuple(events),
            stages=tuple(stages),
            relations=(),
            reward=len(rescued) / 3,
            scr=len(rescued) / 3,
            done=len(rescued) == 3,
            wall_s=0.1 * tick,
            routes=(_boat_route(tick, time_s),),
            unreachable_links=(("uav[1]", "boat"),),
        )
        delivered = messages
        digest = next_digest(digest, record)
        yield msgspec.structs.replace(record, digest=digest), tuple(pictures)
        if record.done:
            return


def _broadcast(mid: str, tick: int, sender: str, kind: str, category: str, body: dict[str, object]) -> list[Envelope]:
    size = len(msgspec.json.encode(body))
    return [
        Envelope(
            id=mid,
            tick=tick,
            sender=sender,
            recipient=agent,
            kind=kind,
            category=category,
            body=body,  # type: ignore[arg-type]
            bytes=size,
            deliver_at=tick + 1,
        )
        for agent in AGENTS
        if agent != sender
    ]


def _seen_cells(visited: dict[str, tuple[int, str]]) -> tuple[CellView, ...]:
    return tuple(CellView(name=name, visited_tick=tick, visited_by=by) for name, (tick, by) in visited.items())


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


def outcome_of(records: list[BoundaryRecord]) -> Outcome:
    frames = START
    for record in records:
        frames = next_frames_digest(frames, record.frames)
    done = sum(event.kind == "rescued" for record in records for event in record.events)
    return Outcome(
        success=done == 3,
        reason="success" if done == 3 else "budget",
        scr=records[-1].scr,
        score=records[-1].reward,
        ticks=records[-1].tick,
        digest=records[-1].digest,
        frames_digest=frames,
        wall_s=12.5,
    )


def write_episode(path: Path, **options: int | bool) -> list[BoundaryRecord]:
    """Write a whole episode, and return its boundaries."""
    records = []
    width, height = int(options.get("width", 640)), int(options.get("height", 360))
    with TraceWriter(path, header(width, height)) as writer:
        for record, pictures in episode(**options):  # type: ignore[arg-type]
            writer.boundary(record, pictures)
            records.append(record)
        writer.finish(outcome_of(records))
    return records
