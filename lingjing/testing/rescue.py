"""A small rescue that is built by hand, with complete engines of point masses: tests of the kernel need no compiler.

Two scouts with a drone each search for victims, and a skipper brings the boat to them; in the mode `star` a commander
is the hub. `instance` makes the mission's instance, `kernel` its kernel, `RescueEngines` is the plug-in with the
engines. Subclasses of the engines play faults.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import msgspec
import numpy as np

from lingjing.kernel.step import Kernel
from lingjing.kernel.swapped_pictures import SwappedPictures
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.expression import Attr, Binary, Call, Expr, Number, Quantified, Ref, Symbol
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
from lingjing.plugins.engine import Boundary, CaptureRequest, EnginePlugin, EngineSpec, Frame
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.testing.decisions import CENTRE_BOX, reports
from lingjing.testing.decisions import Box as PictureBox
from lingjing.trace.records import (
    BodyState,
    Box,
    CameraPose,
    Command,
    Decision,
    DecisionRecord,
    FrameInfo,
    Receipt,
    Status,
    TaskEvent,
)

CITY = City(id="kit", origin=(31.0, 121.5), bounds=(-500.0, -500.0, 500.0, 500.0))
"""An empty city of 1 km x 1 km."""
SPEED_MPS = 10.0
"""The speed of every body, m/s (chosen: 100 m in one tick)."""
REACH_M = 400.0
"""The engine rejects places farther east or west than this, metres (chosen)."""
SIGHT_M = 30.0
"""Largest planar distance at which a victim is in a picture, metres (chosen)."""
RESCUE_M = 50.0
"""Largest planar distance from the boat at which a victim is rescued, metres."""


class PointMasses:
    """An engine of point masses: `go(x, y)` moves in a straight line at `SPEED_MPS`, exactly.

    `states` are the bodies and `jobs` their pending commands, by entity.
    """

    verbs_without_receipt: tuple[str, ...] = ("mute",)
    """Commands that the engine does not answer, which is a fault."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Return the boundary at time 0."""
        self.engine = spec.engine
        self.time_s = 0.0
        self.states = {e.id: BodyState(id=e.id, position=e.position, status="idle") for e in spec.owned()}
        self.jobs: dict[str, Command] = {}
        return Boundary(engine=self.engine, time_s=0.0, states=tuple(self.states.values()))

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit the commands, without a receipt for those of `verbs_without_receipt`."""
        return tuple(self.admit(command) for command in commands if command.verb not in self.verbs_without_receipt)

    def admit(self, command: Command) -> Receipt:
        """Start a command, and return the receipt of its admission."""
        if command.verb == "go" and abs(_number(command, "x")) > REACH_M:
            return self.receipt(command, "rejected", reason="unreachable")
        if command.verb == "stop":
            self.jobs.pop(command.resource, None)
        if command.verb == "go":
            self.jobs[command.resource] = command
        return self.receipt(command, "accepted")

    def receipt(self, command: Command, status: Status, reason: str = "", progress: float | None = None) -> Receipt:
        """Return a receipt for a command at the engine's time."""
        return command.receipt(self.engine, status, self.time_s, reason, progress=progress)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Move each body that has a command; at its goal the request is completed and `arrived` is emitted."""
        step_s, self.time_s = until - self.time_s, until
        receipts, events = [], []
        for name, command in list(self.jobs.items()):
            if self._moved(name, command, SPEED_MPS * step_s):
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

    def _moved(self, name: str, command: Command, step_m: float) -> bool:
        """Move a body by at most this distance, and return True at its goal."""
        state = self.states[name]
        dx = _number(command, "x") - state.position[0]
        dy = _number(command, "y") - state.position[1]
        left = math.hypot(dx, dy)
        reach = min(left, step_m)
        share = reach / left if left else 0.0
        place = (state.position[0] + dx * share, state.position[1] + dy * share, state.position[2])
        self.states[name] = BodyState(id=name, position=place, status="moving")
        return left - reach < 1e-9

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return no picture."""
        return ()

    def close(self) -> None:
        """Release nothing."""


class Shore(PointMasses):
    """The engine of the victims: after `unlock.rescue` it emits `rescue` as soon as the boat is within `RESCUE_M`."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Return the boundary at time 0."""
        self.open: set[str] = set()
        return super().reset(spec, city, seed)

    def admit(self, command: Command) -> Receipt:
        """Unlock the rescue of a victim."""
        self.open.add(command.resource)
        return self.receipt(command, "accepted")

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Emit the rescues of the macro-step."""
        boundary = super().advance(until, mirrors)
        boat = next(mirror for mirror in mirrors if mirror.id == "boat")
        near = [
            name
            for name in sorted(self.open)
            if math.dist(self.states[name].position[:2], boat.position[:2]) <= RESCUE_M
        ]
        self.open -= set(near)
        events = tuple(TaskEvent(kind="rescue", entities=(name, "boat"), time_s=until) for name in near)
        return msgspec.structs.replace(boundary, events=events)


class TruthCamera:
    """A camera that shows every victim within `SIGHT_M` in each picture, in `CENTRE_BOX`, from directly above."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Return the boundary at time 0."""
        self.spec = spec
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Receive no command."""
        return ()

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Store the bodies of the other engines."""
        self.mirrors = {mirror.id: mirror for mirror in mirrors}
        return Boundary(engine=self.spec.engine, time_s=until)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return a picture for each request."""
        return tuple(self.draw(request) for request in requests)

    def draw(self, request: CaptureRequest) -> Frame:
        """Return one picture; its grey is 100 for each victim in it."""
        here = self.mirrors[request.entity].position
        boxes = tuple(
            Box(entity=name, cls="person", box=CENTRE_BOX, pixels=9)
            for name, mirror in self.mirrors.items()
            if name.startswith("victim") and math.dist(mirror.position[:2], here[:2]) <= SIGHT_M
        )
        pose = request.pose or CameraPose(position=here, heading_deg=0.0, tilt_deg=90.0)
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=msgspec.structs.replace(pose, width=8, height=6),
            channels=("rgb",),
            boxes=boxes,
        )
        return Frame(info, np.full((6, 8, 3), len(boxes) * 100, np.uint8))

    def close(self) -> None:
        """Release nothing."""


class RescueEngines:
    """The plug-in with the three engines `glider`, `shore` and `table`; subclasses of the engines may take their
    places.
    """

    def __init__(
        self,
        glider: type[PointMasses] = PointMasses,
        shore: type[Shore] = Shore,
        table: type[TruthCamera] = TruthCamera,
    ) -> None:
        self._glider, self._shore, self._table = glider, shore, table

    @hookimpl
    def lingjing_engines(self) -> list[EnginePlugin]:
        """Return the engines."""
        return [
            EnginePlugin(name="glider", factory=self._glider),
            EnginePlugin(name="shore", factory=self._shore),
            EnginePlugin(name="table", factory=self._table, place="camera", sensor=True),
        ]


def local(name: str) -> Ref:
    """Return the reference to a variable of a rule."""
    return Ref(name=name, kind="local")


def rule(name: str, condition: Expr, *parameters: tuple[str, str], matching: bool = False) -> Rule:
    """Return a rule; `parameters` are pairs of variable and domain."""
    pairs = tuple(RuleParameter(name=variable, domain=domain) for variable, domain in parameters)
    return Rule(name=name, parameters=pairs, condition=condition, matching=matching)


def called(name: str, *arguments: str, is_rule: bool = True) -> Call:
    """Return the call of a rule, or of a function, with variables as arguments."""
    return Call(function=name, arguments=tuple(local(argument) for argument in arguments), rule=is_rule)


def both(left: Expr, right: Expr) -> Binary:
    """Return the conjunction of two conditions."""
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
"""The report names the class `person` and its box overlaps the truth by a half."""
IN_SEARCH = Binary(operator="in", left=Attr(base=local("r"), name="position"), right=Ref(name="search", kind="region"))
"""The reported position is in the region `search`."""
REPORTED = rule("reported", both(called("matched", "v", "r"), IN_SEARCH), ("v", "victim"), ("r", "detection"))
"""The report is matched and lies in the region."""
SOME_REPORT = Quantified(quantifier="exists", variable="r", domain="detection", body=called("reported", "v", "r"))
"""Some report of the victim is accepted."""
NEAR = Binary(
    operator="<=",
    left=Call(function="distance_xy", arguments=(Ref(name="boat", kind="entity"), local("v"))),
    right=Number(value=RESCUE_M),
)
"""The boat is within `RESCUE_M` of the victim."""
EMITTED = Call(function="emitted", arguments=(Symbol(name="rescue"), local("v")))
"""An engine has emitted `rescue` for the victim."""
RESCUED = rule("rescued", both(EMITTED, both(NEAR, SOME_REPORT)), ("v", "victim"))
"""The victim was reported, and rescued while the boat was near."""
SUCCESS = Quantified(quantifier="forall", variable="v", domain="victim", body=called("rescued", "v"))
"""Every victim is rescued."""

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
"""The verbs of every asset."""
CAMERA = CameraSpec(
    name="nadir", view="nadir", width=8, height=6, hfov_deg=84.0, channels=("rgb",), capture="on_request"
)
"""The camera of the drones."""
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
"""The report of a victim."""
ORDER = MessageSpec(
    kind="order",
    type="assignment",
    category="assignment",
    fields=(Field(name="assignee", type="name"), Field(name="position", type="position", optional=True)),
    senders=("coordinator", "searcher"),
    recipients=("all",),
)
"""The assignment of a place to an agent."""
STAGES = (
    Stage(name="locate", condition=SOME_REPORT, variable="v", domain="victim"),
    Stage(
        name="handoff",
        condition=Call(function="assigned", arguments=(Ref(name="boat", kind="entity"), local("v"))),
        variable="v",
        domain="victim",
    ),
    Stage(name="execute", condition=called("rescued", "v"), variable="v", domain="victim"),
)
"""Locate, hand over, rescue: for each victim."""
RELATIONS = (
    Relation(kind="information_handoff", source="searcher", target="rescuer", carries="detection"),
    Relation(kind="cooperation", source="searcher", target="searcher", mutual=True, over="cells"),
    Relation(kind="competition", source="searcher", target="searcher", mutual=True, over="boat"),
    Relation(kind="guidance", source="coordinator", target="searcher", by="order"),
    Relation(kind="dependency", source="locate", target="execute", per="v"),
)
"""One relation of each kind of the paper that a trace can show."""
VICTIMS = ((100.0, 0.0), (-100.0, 0.0))
"""The places of the victims, below the drones, metres."""
SEARCH = ((-300.0, -300.0), (300.0, -300.0), (300.0, 300.0), (-300.0, 300.0))
"""The region `search`, metres."""


def agent(
    name: str, role: str, *controls: str, may: tuple[str, ...] = (), observes: Sequence[ChannelSpec] = ()
) -> AgentSpec:
    """Return an agent that controls some entities and may command those of `may` as well."""
    return AgentSpec(
        id=name, name=name, index=0, role=role, controls=controls, commands=(*controls, *may), observes=tuple(observes)
    )


def entity(
    name: str, x: float, y: float, engine: str = "glider", role: Literal["asset", "target"] = "asset", **more: Any
) -> Entity:
    """Return an entity at sea level; `x` and `y` are metres, `more` are further fields of `Entity`."""
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


def instance(
    mode: Literal["star", "broadcast"] = "broadcast",
    victims: Sequence[tuple[float, float]] = VICTIMS,
    ticks: int = 20,
    **changes: object,
) -> Instance:
    """Return the instance of the rescue with victims at these places, metres; `changes` replaces its fields."""
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
        regions=(Region(name="search", polygon=SEARCH),),
        cells=(Cell(name="cells-1-1", grid="cells", row=1, column=1, polygon=SEARCH, centre=(0.0, 0.0)),),
        entities=_entities(victims),
        agents=_agents(mode),
        messages=(DETECTION, ORDER),
        comms=CommsSpec(mode=mode, hub="commander" if mode == "star" else None),
        rules=(MATCHED, REPORTED, RESCUED),
        unlocks=(
            Unlock(interaction="rescue", parameters=(RuleParameter(name="v", domain="victim"),), condition=SOME_REPORT),
        ),
        stages=STAGES,
        relations=RELATIONS,
        success=SUCCESS,
    )
    return msgspec.structs.replace(base, **changes)


def _agents(mode: str) -> tuple[AgentSpec, ...]:
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
    return (*scouts, skipper, *commander)


def _entities(victims: Sequence[tuple[float, float]]) -> tuple[Entity, ...]:
    return (
        *(
            entity(f"victim[{n}]", x, y, engine="shore", role="target", hidden=("position",))
            for n, (x, y) in enumerate(victims, 1)
        ),
        entity("uav[1]", 100.0, 0.0, cameras=(CAMERA,), properties={"band_low_m": 20.0, "band_high_m": 160.0}),
        entity("uav[2]", -100.0, 0.0, cameras=(CAMERA,)),
        entity("boat", 0.0, -100.0),
    )


def kernel(
    played: Instance | None = None,
    plugin: object | None = None,
    *,
    neighbour: Instance | None = None,
    **options: Any,
) -> Kernel:
    """Return the kernel of an instance with engines of a plug-in, in this process; the defaults are those of this
    module. Agents receive the pictures of the instance `neighbour` if there is one. `options` are those of `Kernel`.
    """
    host = PluginHost(entry_points=False, extra=(plugin or RescueEngines(),))
    if neighbour is not None:
        options["swapped"] = SwappedPictures(InlineWorld(host), neighbour, CITY)
    return Kernel(played or instance(), CITY, InlineWorld(host), **options)


def decisions(**by_agent: Decision) -> tuple[DecisionRecord, ...]:
    """Return the argument of `Kernel.step`, in the given order; `scout_1` stands for `scout[1]`."""
    names = {"scout_1": "scout[1]", "scout_2": "scout[2]"}
    return tuple(DecisionRecord(agent=names.get(name, name), decision=made) for name, made in by_agent.items())


def report(
    frame: str,
    box: PictureBox = CENTRE_BOX,
    position: tuple[float, ...] = (100.0, 0.0),
    cls: str = "person",
    confidence: float = 0.9,
) -> Decision:
    """Return a decision with a report of a victim in a picture; the default is a true one of the first victim."""
    return reports("detection", frame, cls, position, box, confidence=confidence)


def _number(command: Command, name: str) -> float:
    value = command.arguments[name]
    assert isinstance(value, int | float), value
    return value


__all__ = [
    "CAMERA", "CITY", "DETECTION", "EMITTED", "IN_SEARCH", "MATCHED", "NEAR", "ORDER", "REACH_M", "RELATIONS",
    "REPORTED", "RESCUED", "RESCUE_M", "SEARCH", "SIGHT_M", "SOME_REPORT", "SPEED_MPS", "STAGES", "SUCCESS", "VERBS",
    "VICTIMS", "PointMasses", "RescueEngines", "Shore", "TruthCamera", "agent", "both", "called", "decisions",
    "entity", "instance", "kernel", "local", "report", "rule",
]  # fmt: skip
