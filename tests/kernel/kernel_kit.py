"""A small world for the kernel's tests, of complete engines with the five methods.

Point masses obey exactly, a shore performs unlocked interactions, and a camera has a table as its ground truth.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from lingjing.kernel.step import Kernel
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.expression import Attr, Binary, Call, Number, Quantified, Ref, Symbol
from lingjing.mission.instance import (
    AgentSpec,
    ArgumentSpec,
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
    VerbSpec,
    Weather,
)
from lingjing.mission.model import Field, Relation, Rule, RuleParameter, Stage, Unlock
from lingjing.plugins.engine import Boundary, EnginePlugin, Frame
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.records import (
    Action,
    BodyState,
    Box,
    CameraPose,
    Decision,
    DecisionRecord,
    FrameInfo,
    Outgoing,
    Receipt,
    TaskEvent,
)

CITY = City(id="kit", origin=(31.0, 121.5), bounds=(-500.0, -500.0, 500.0, 500.0))
SPEED = 10.0
TRUE_BOX = (0.4, 0.4, 0.6, 0.6)


class Glider:
    """An engine of point masses: `go(x, y)` moves in a straight line at `SPEED`, exactly."""

    verbs_without_receipt = ("mute",)

    def reset(self, spec, city, seed):
        self.engine = spec.engine
        self.time_s = 0.0
        self.states = {e.id: BodyState(id=e.id, position=e.position, status="idle") for e in spec.owned()}
        self.jobs = {}
        return Boundary(engine=self.engine, time_s=0.0, states=tuple(self.states.values()))

    def submit(self, commands):
        return tuple(self.admit(command) for command in commands if command.verb not in self.verbs_without_receipt)

    def admit(self, command):
        if command.verb == "go" and abs(command.arguments["x"]) > 400:
            return self.receipt(command, "rejected", reason="unreachable")
        if command.verb == "stop":
            self.jobs.pop(command.resource, None)
        if command.verb == "go":
            self.jobs[command.resource] = command
        return self.receipt(command, "accepted")

    def receipt(self, command, status, **more):
        return Receipt(
            request=command.id,
            tick=command.tick,
            sender=command.sender,
            resource=command.resource,
            status=status,
            by=self.engine,
            time_s=self.time_s,
            **more,
        )

    def advance(self, until, mirrors):
        step, self.time_s = until - self.time_s, until
        receipts, events = [], []
        for name, command in list(self.jobs.items()):
            state = self.states[name]
            dx = command.arguments["x"] - state.position[0]
            dy = command.arguments["y"] - state.position[1]
            left = math.hypot(dx, dy)
            reach = min(left, SPEED * step)
            share = reach / left if left else 0.0
            place = (state.position[0] + dx * share, state.position[1] + dy * share, state.position[2])
            self.states[name] = BodyState(id=name, position=place, status="moving")
            if left - reach < 1e-9:
                del self.jobs[name]
                receipts.append(self.receipt(command, "completed", progress=1.0))
                events.append(TaskEvent(kind="arrived", entities=(name,), time_s=until))
        return Boundary(
            engine=self.engine,
            time_s=until,
            states=tuple(self.states.values()),
            receipts=tuple(receipts),
            events=tuple(events),
        )

    def capture(self, requests):
        return ()

    def close(self):
        pass


class Shore(Glider):
    """An engine that owns the targets: after `unlock.rescue` it emits `rescue` as soon as the boat is within 50 m."""

    def reset(self, spec, city, seed):
        self.open = set()
        return super().reset(spec, city, seed)

    def admit(self, command):
        self.open.add(command.resource)
        return self.receipt(command, "accepted")

    def advance(self, until, mirrors):
        boundary = super().advance(until, mirrors)
        boat = next(mirror for mirror in mirrors if mirror.id == "boat")
        near = [n for n in sorted(self.open) if math.dist(self.states[n].position[:2], boat.position[:2]) <= 50]
        self.open -= set(near)
        events = tuple(TaskEvent(kind="rescue", entities=(name, "boat"), time_s=until) for name in near)
        return msgspec.structs.replace(boundary, events=events)


class Table:
    """A camera that shows every victim within 30 m in each picture, in `TRUE_BOX`, from directly above."""

    def reset(self, spec, city, seed):
        self.spec = spec
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands):
        return ()

    def advance(self, until, mirrors):
        self.mirrors = {mirror.id: mirror for mirror in mirrors}
        return Boundary(engine=self.spec.engine, time_s=until)

    def capture(self, requests):
        return tuple(self.draw(request) for request in requests)

    def draw(self, request):
        here = self.mirrors[request.entity].position
        boxes = tuple(
            Box(entity=name, cls="person", box=TRUE_BOX, pixels=9)
            for name, mirror in self.mirrors.items()
            if name.startswith("victim") and math.dist(mirror.position[:2], here[:2]) <= 30
        )
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=CameraPose(position=here, heading_deg=0.0, tilt_deg=90.0, width=8, height=6),
            channels=("rgb",),
            boxes=boxes,
        )
        return Frame(info, np.full((6, 8, 3), len(boxes) * 100, np.uint8))

    def close(self):
        pass


class KitPlugin:
    def __init__(self, glider=Glider, shore=Shore, table=Table):
        self.engines = (glider, shore, table)

    @hookimpl
    def lingjing_engines(self):
        glider, shore, table = self.engines
        return [
            EnginePlugin(name="glider", factory=glider),
            EnginePlugin(name="shore", factory=shore),
            EnginePlugin(name="table", factory=table, place="camera", sensor=True),
        ]


def local(name):
    return Ref(name=name, kind="local")


def rule(name, condition, *parameters, matching=False):
    pairs = tuple(RuleParameter(name=variable, domain=domain) for variable, domain in parameters)
    return Rule(name=name, parameters=pairs, condition=condition, matching=matching)


def called(name, *arguments, is_rule=True):
    return Call(function=name, arguments=tuple(local(argument) for argument in arguments), rule=is_rule)


def both(left, right):
    return Binary(operator="and", left=left, right=right)


MATCHED = rule(
    "matched",
    both(
        Binary(operator="==", left=Attr(base=local("r"), name="class"), right=Symbol(name="person")),
        Binary(
            operator=">=",
            left=Call(
                function="iou",
                arguments=(
                    Attr(base=local("r"), name="box"),
                    Attr(
                        base=Call(function="truth", arguments=(local("v"), Attr(base=local("r"), name="frame"))),
                        name="box",
                    ),
                ),
            ),
            right=Number(value=0.5),
        ),
    ),
    ("v", "victim"),
    ("r", "detection"),
    matching=True,
)
IN_SEARCH = Binary(operator="in", left=Attr(base=local("r"), name="position"), right=Ref(name="search", kind="region"))
REPORTED = rule("reported", both(called("matched", "v", "r"), IN_SEARCH), ("v", "victim"), ("r", "detection"))
SOME_REPORT = Quantified(quantifier="exists", variable="r", domain="detection", body=called("reported", "v", "r"))
NEAR = Binary(
    operator="<=",
    left=Call(function="distance_xy", arguments=(Ref(name="boat", kind="entity"), local("v"))),
    right=Number(value=50.0),
)
EMITTED = Call(function="emitted", arguments=(Symbol(name="rescue"), local("v")))
RESCUED = rule("rescued", both(EMITTED, both(NEAR, SOME_REPORT)), ("v", "victim"))
SUCCESS = Quantified(quantifier="forall", variable="v", domain="victim", body=called("rescued", "v"))

VERBS = (
    VerbSpec(
        name="go",
        arguments=(
            ArgumentSpec(name="x", unit="m"),
            ArgumentSpec(name="y", unit="m"),
            ArgumentSpec(name="z", optional=True),
        ),
    ),
    VerbSpec(name="hop", arguments=(ArgumentSpec(name="distance", unit="m", minimum=0.0, maximum=50.0),)),
    VerbSpec(name="mute"),
    VerbSpec(name="stop"),
    VerbSpec(name="takePhoto", arguments=(ArgumentSpec(name="camera", unit="name", optional=True),)),
)
CAMERA = CameraSpec(
    name="nadir", view="nadir", width=8, height=6, hfov_deg=84.0, channels=("rgb",), capture="on_request"
)
DETECTION = MessageSpec(
    kind="detection",
    type="report",
    category="report",
    fields=(
        Field(name="frame", type="frame"),
        Field(name="class", type="name"),
        Field(name="box", type="box"),
        Field(name="position", type="position"),
        Field(name="confidence", type="number", minimum=0.0, maximum=1.0),
    ),
    senders=("searcher",),
    recipients=("all",),
)
ORDER = MessageSpec(
    kind="order",
    type="assignment",
    category="assignment",
    fields=(Field(name="assignee", type="name"), Field(name="position", type="position", optional=True)),
    senders=("coordinator", "searcher"),
    recipients=("all",),
)


def agent(name, role, *controls, may=(), observes=()):
    return AgentSpec(
        id=name, name=name, index=0, role=role, controls=controls, commands=(*controls, *may), observes=tuple(observes)
    )


def entity(name, x, y, engine="glider", role="asset", **more):
    group, _, number = name.partition("[")
    return Entity(
        id=name,
        group=group,
        index=int(number.rstrip("]") or 0) if number else 0,
        role=role,
        type="person" if role == "target" else "craft",
        engine=engine,
        position=(x, y, 0.0),
        verbs=VERBS if role == "asset" else (),
        **more,
    )


def make_instance(mode="broadcast", victims=((100.0, 0.0), (-100.0, 0.0)), ticks=20, **changes):
    own = (ChannelSpec(source="grid", name="cells"), ChannelSpec(source="events"))
    scouts = tuple(
        agent(
            f"scout[{n}]",
            "searcher",
            f"uav[{n}]",
            may=("boat",) if mode == "broadcast" else (),
            observes=(
                ChannelSpec(source="entity", name=f"uav[{n}]"),
                ChannelSpec(source="peers", fields=("position",)),
                *own,
            ),
        )
        for n in (1, 2)
    )
    skipper = agent(
        "skipper", "rescuer", "boat", observes=(ChannelSpec(source="entity", name="boat"), ChannelSpec(source="events"))
    )
    commander = (agent("commander", "coordinator", observes=own),) if mode == "star" else ()
    square = ((-300.0, -300.0), (300.0, -300.0), (300.0, 300.0), (-300.0, 300.0))
    base = Instance(
        mission="kit",
        title="Kit",
        goal="find them",
        seed=3,
        settings={"victims": float(len(victims))},
        scene=SceneSpec(kind="kit"),
        clock=Clock(tick_s=10.0, sync_s=0.5),
        budget=Budget(ticks=ticks, policy_s=60.0, engine_s=20.0, capture_s=20.0),
        weather=Weather(),
        regions=(Region(name="search", polygon=square),),
        cells=(Cell(name="cells-1-1", grid="cells", row=1, column=1, polygon=square, centre=(0.0, 0.0)),),
        entities=(
            *(
                entity(f"victim[{n}]", x, y, engine="shore", role="target", hidden=("position",))
                for n, (x, y) in enumerate(victims, 1)
            ),
            entity("uav[1]", 100.0, 0.0, cameras=(CAMERA,), properties={"band_low_m": 20.0, "band_high_m": 160.0}),
            entity("uav[2]", -100.0, 0.0, cameras=(CAMERA,)),
            entity("boat", 0.0, -100.0),
        ),
        agents=(*scouts, skipper, *commander),
        messages=(DETECTION, ORDER),
        comms=CommsSpec(mode=mode, hub="commander" if mode == "star" else None),
        rules=(MATCHED, REPORTED, RESCUED),
        unlocks=(
            Unlock(interaction="rescue", parameters=(RuleParameter(name="v", domain="victim"),), condition=SOME_REPORT),
        ),
        stages=(
            Stage(name="locate", condition=SOME_REPORT, variable="v", domain="victim"),
            Stage(
                name="handoff",
                condition=Call(function="assigned", arguments=(Ref(name="boat", kind="entity"), local("v"))),
                variable="v",
                domain="victim",
            ),
            Stage(name="execute", condition=called("rescued", "v"), variable="v", domain="victim"),
        ),
        relations=(
            Relation(kind="information_handoff", source="searcher", target="rescuer", carries="detection"),
            Relation(kind="cooperation", source="searcher", target="searcher", mutual=True, over="cells"),
            Relation(kind="competition", source="searcher", target="searcher", mutual=True, over="boat"),
            Relation(kind="guidance", source="coordinator", target="searcher", by="order"),
            Relation(kind="dependency", source="locate", target="execute", per="v"),
        ),
        success=SUCCESS,
    )
    return msgspec.structs.replace(base, **changes)


def make_kernel(instance=None, plugin=None, **options):
    host = PluginHost(entry_points=False, extra=(plugin or KitPlugin(),))
    return Kernel(instance or make_instance(), CITY, InlineWorld(host), **options)


def decisions(**by_agent):
    """Return decision records in declaration order; `scout_1` stands for `scout[1]`."""
    names = {"scout_1": "scout[1]", "scout_2": "scout[2]"}
    return tuple(DecisionRecord(agent=names.get(name, name), decision=made) for name, made in by_agent.items())


def does(verb, resource=None, **arguments):
    return Decision(command=Action(verb=verb, arguments=arguments, resource=resource))


def says(kind, to=(), **body):
    return Decision(messages=(Outgoing(kind=kind, body=body, to=to),))


def report(frame, box=TRUE_BOX, position=(100.0, 0.0), cls="person", confidence=0.9):
    return says("detection", frame=frame, **{"class": cls}, box=box, position=position, confidence=confidence)


def joined(*parts):
    """Return one decision with the first command and all messages."""
    command = next((part.command for part in parts if part.command), None)
    return replace_decision(command, tuple(message for part in parts for message in part.messages))


def replace_decision(command, messages):
    return Decision(command=command, messages=messages)
