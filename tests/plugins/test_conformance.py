"""The conformance kit: the built-in engines pass it, and each check catches an engine broken on purpose."""

import asyncio
import math
import os

import msgspec
import numpy as np
import pytest

from lingjing import builtin
from lingjing.errors import PluginError
from lingjing.mission.instance import ArgumentSpec, CameraSpec, Field, MessageSpec, SceneSpec, VerbSpec, Weather
from lingjing.plugins import conformance as kit
from lingjing.plugins.engine import Boundary, EnginePlugin, Frame
from lingjing.plugins.policy import Brief, PolicyPlugin, Resource
from lingjing.testing import PluginHost
from lingjing.trace.records import (
    Action,
    BodyState,
    CameraPose,
    Command,
    Decision,
    FrameInfo,
    Outgoing,
    Receipt,
    Route,
    TaskEvent,
)

BUILT_IN = {plugin.name: plugin for plugin in builtin.lingjing_engines()}
WEATHER = Weather(wind_mps=4.0, wind_from_deg=220.0, turbulence=0.2, wave_height_m=0.5, current_mps=0.15)


def order(number, resource, verb, origin="agent", **arguments):
    return Command(
        id=f"c0-{number}", tick=0, sender="test", resource=resource, verb=verb, arguments=arguments, origin=origin
    )


@pytest.fixture
def case(instance_of, uav, boat, victim, open_sea):
    entities = [uav(1), uav(2, (8.0, 0.0, 1.1)), boat((0.0, -20.0, -3.5)), victim(1), victim(2, (90.0, 0.0, -3.5))]
    commands = {
        "multirotor": (order(1, "uav[1]", "setDestination", x=90.0, y=9.0, z=50.0), order(2, "uav[2]", "takeoff")),
        "vessel": (order(1, "boat", "moveTo", x=40.0, y=40.0),),
        "city": (order(1, "victim[1]", "unlock.rescue", "kernel"), order(2, "victim[2]", "unlock.rescue", "kernel")),
    }
    near = BodyState(id="boat", position=(0.0, -20.0, -3.5), velocity=(1.0, 0.0, 0.0))

    def build(name, plugin=None):
        mirrors = (near,) if name == "city" else ()
        return kit.EngineCase(
            plugin or BUILT_IN[name], instance_of(entities, WEATHER), open_sea, commands[name], mirrors, 3, 20.0
        )

    return build


@pytest.mark.parametrize("name", ["multirotor", "vessel", "city"])
@pytest.mark.parametrize("check", kit.ENGINE_CHECKS, ids=kit.check_name)
def test_the_built_in_motion_engines_conform(case, name, check):
    check(case(name))


def test_the_plane_engine_conforms(instance_of, uav, open_sea):
    wings = [
        msgspec.structs.replace(uav(index, (300.0 * index, 0.0, 250.0)), id=f"wing[{index}]", engine="plane")
        for index in (1, 2)
    ]
    commands = (order(1, "wing[1]", "setDestination", x=3000.0, y=9.0, z=300.0), order(2, "wing[2]", "stop"))
    instance = instance_of([*wings, uav(3)], WEATHER)
    kit.check_engine(BUILT_IN["plane"], instance, open_sea, commands)


def test_the_satellite_engine_conforms(instance_of, uav, open_sea):
    eye = msgspec.structs.replace(uav(1), id="eye", engine="satellite", properties={}, verbs=())
    early = order(1, "eye", "takePhoto")
    kit.check_engine(BUILT_IN["satellite"], instance_of([eye, uav(2)]), open_sea, (early,), placed=False)


def test_check_engine_runs_everything_at_once(case):
    whole = case("vessel")
    kit.check_engine(whole.plugin, whole.instance, whole.city, whole.commands, seconds=10.0)


class Sound:
    """A small engine that keeps every promise: each request takes four seconds. Faults are subclasses of it."""

    made = 0
    verbs = ("moveTo", "stop")

    def reset(self, spec, city, seed):
        self.name, self.owned, self.now = spec.engine, spec.owned(), 0.0
        self.pending, self.outbox, self.process = {}, [], os.getpid()
        return self.boundary()

    def submit(self, commands):
        return tuple(self.admit(command) for command in commands)

    def admit(self, command):
        if command.verb not in self.verbs or command.resource not in {entity.id for entity in self.owned}:
            return self.receipt(command, "rejected", "unknown_verb")
        if not all(self.is_number(value) for value in command.arguments.values()):
            return self.receipt(command, "rejected", "bad_argument")
        if command.resource in self.pending and command.verb != "stop":
            return self.busy(command)
        self.preempt(command)
        self.pending[command.resource] = (command, self.now)
        return self.receipt(command, "accepted")

    def is_number(self, value):
        return isinstance(value, float) and math.isfinite(value)

    def busy(self, command):
        return self.receipt(command, "rejected", "busy")

    def preempt(self, command):
        if command.resource in self.pending:
            self.outbox.append(self.receipt(self.pending.pop(command.resource)[0], "rejected", "preempted"))

    def advance(self, until, mirrors):
        self.now = until
        for command, since in list(self.pending.values()):
            if until - since >= 4.0:
                del self.pending[command.resource]
                self.outbox.append(self.receipt(command, "completed"))
            else:
                self.outbox.append(self.receipt(command, "running", progress=(until - since) / 4.0))
        return self.boundary()

    def capture(self, requests):
        return ()

    def close(self):
        pass

    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position)

    def events(self):
        return ()

    def ambient(self):
        return ()

    def routes(self):
        return ()

    def unreachable_links(self):
        return ()

    def boundary(self):
        receipts, self.outbox = tuple(self.outbox), []
        states = tuple(self.state(entity) for entity in self.owned)
        return Boundary(
            engine=self.name,
            time_s=self.now,
            states=states,
            receipts=receipts,
            events=self.events(),
            ambient=self.ambient(),
            routes=self.routes(),
            unreachable_links=self.unreachable_links(),
        )

    def receipt(self, command, status, reason="", progress=None):
        return Receipt(
            request=command.id,
            tick=command.tick,
            sender=command.sender,
            resource=command.resource,
            status=status,
            reason=reason,
            by=self.name,
            time_s=self.now,
            progress=progress,
        )


class Misplaced(Sound):
    def state(self, entity):
        return BodyState(id=entity.id, position=(entity.position[0] + 1.0, 0.0, 0.0))


class LateStart(Sound):
    def reset(self, spec, city, seed):
        return msgspec.structs.replace(super().reset(spec, city, seed), time_s=0.5)


class Ignorant(Sound):
    verbs = ("stop",)


class Forgetful(Sound):
    def submit(self, commands):
        return super().submit(commands)[1:]


class Backwards(Sound):
    verbs = ("moveTo", "stop", "takeoff", "setDestination")

    def submit(self, commands):
        return super().submit(commands)[::-1]


class Eager(Sound):
    def admit(self, command):
        return msgspec.structs.replace(super().admit(command), status="completed")


class Obliging(Sound):
    def admit(self, command):
        return self.receipt(command, "accepted")


class Speechless(Sound):
    def admit(self, command):
        return msgspec.structs.replace(super().admit(command), reason="")


class Slow(Sound):
    def advance(self, until, mirrors):
        return super().advance(until - 0.1, mirrors)


class Losing(Sound):
    def advance(self, until, mirrors):
        boundary = super().advance(until, mirrors)
        return msgspec.structs.replace(boundary, states=boundary.states[1:])


class Infinite(Sound):
    def state(self, entity):
        place = entity.position if self.now == 0.0 else (float("nan"), 0.0, 0.0)
        return BodyState(id=entity.id, position=place)


class Overturned(Sound):
    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position, heading_deg=360.0 if self.now else 0.0)


class Prophetic(Sound):
    def events(self):
        return (TaskEvent(kind="arrived", entities=("boat",), time_s=self.now + 60.0),) if self.now else ()


class Boundless(Sound):
    def events(self):
        values = {"speed_mps": math.inf}
        return (TaskEvent(kind="hit", entities=("boat",), time_s=self.now, values=values),) if self.now else ()


class Crowded(Sound):
    shown = BodyState(id="traffic/1", kind="car", position=(0.0, 0.0, 0.0))

    def ambient(self):
        return (self.shown,)


class Clashing(Crowded):
    shown = BodyState(id="uav[1]", kind="car", position=(0.0, 0.0, 0.0))


class Nameless(Crowded):
    shown = BodyState(id="traffic/1", position=(0.0, 0.0, 0.0))


class Doubled(Crowded):
    def ambient(self):
        return (self.shown, self.shown)


class Boiling(Crowded):
    shown = BodyState(id="traffic/1", kind="car", position=(0.0, 0.0, math.nan))


class Routed(Sound):
    route = Route(entity="boat", number=1, waypoints=((1.0, 2.0, 0.0),), length_m=5.0, duration_s=2.0, time_s=0.0)

    def routes(self):
        return (self.route,) if self.now == 1.0 else ()


class Miscounting(Routed):
    route = msgspec.structs.replace(Routed.route, number=2)


class Pointless(Routed):
    route = msgspec.structs.replace(Routed.route, waypoints=())


class Poaching(Routed):
    route = msgspec.structs.replace(Routed.route, entity="uav[1]")


class Foreseeing(Routed):
    route = msgspec.structs.replace(Routed.route, time_s=9.0)


class Deaf(Sound):
    pair = ("uav[1]", "boat")

    def unreachable_links(self):
        return (self.pair,)


class Reversed(Deaf):
    pair = ("boat", "uav[1]")


class Unacquainted(Deaf):
    pair = ("uav[1]", "moon")


class Gullible(Sound):
    def is_number(self, value):
        return isinstance(value, float)


class Literal(Sound):
    def is_number(self, value):
        return isinstance(value, str) or math.isfinite(value)


class Grasping(Sound):
    def admit(self, command):
        self.owned = (
            self.owned if command.resource == "boat" else (msgspec.structs.replace(self.owned[0], id="uav[1]"),)
        )
        return super().admit(command)


class Interrupting(Sound):
    def busy(self, command):
        self.preempt(command)
        self.pending[command.resource] = (command, self.now)
        return self.receipt(command, "accepted")


class Distracted(Sound):
    def busy(self, command):
        pending, _ = self.pending[command.resource]
        self.pending[command.resource] = (pending, self.now)
        return super().busy(command)


class Slipping(Sound):
    def receipt(self, command, status, reason="", progress=None):
        return super().receipt(command, status, reason, None if progress is None else 1.0 - progress)


class Echoing(Sound):
    def advance(self, until, mirrors):
        self.seen = tuple(state for state in mirrors if state.kind)
        return super().advance(until, mirrors)

    def ambient(self):
        return getattr(self, "seen", ())


class Fragile(Sound):
    def advance(self, until, mirrors):
        if any(state.kind == "conformance.noSuchKind" for state in mirrors):
            raise kit.ConformanceError("what is that?")
        return super().advance(until, mirrors)


class Counting(Sound):
    calls = 0

    def advance(self, until, mirrors):
        self.calls += 1
        return super().advance(until, mirrors)

    def reset(self, spec, city, seed):
        self.calls = 0
        return super().reset(spec, city, seed)

    def state(self, entity):
        return BodyState(id=entity.id, position=(*entity.position[:2], float(self.calls)))


class Chatty(Sound):
    def advance(self, until, mirrors):
        self.outbox += [self.receipt(command, "running", progress=0.1) for command, _ in self.pending.values()]
        return super().advance(until, mirrors)


class Undead(Sound):
    def advance(self, until, mirrors):
        self.outbox += [self.receipt(command, "completed") for command, _ in self.pending.values()]
        return super().advance(until, mirrors)


class Boastful(Sound):
    def receipt(self, command, status, reason="", progress=None):
        return super().receipt(command, status, reason, None if progress is None else 2.0)


class Anonymous(Sound):
    def receipt(self, *arguments, **more):
        return msgspec.structs.replace(super().receipt(*arguments, **more), by="kernel")


class Stubborn(Sound):
    def preempt(self, command):
        self.pending.pop(command.resource, None)


class Moody(Sound):
    def state(self, entity):
        Moody.made += 1
        height = 0.0 if self.now == 0.0 else float(Moody.made)
        return BodyState(id=entity.id, position=(*entity.position[:2], height))


class Residual(Sound):
    runs = 0

    def reset(self, spec, city, seed):
        self.runs += 1
        return super().reset(spec, city, seed)

    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position, pitch_deg=float(self.runs))


class Loose(Sound):
    def state(self, entity):
        return BodyState(id=entity.id, position=list(entity.position))


class Rooted(Sound):
    def state(self, entity):
        away = 0.0 if os.getpid() == self.process else 1.0
        return BodyState(id=entity.id, position=entity.position, roll_deg=away)


class Snapping(Sound):
    def capture(self, requests):
        return (None,)


class Brittle(Sound):
    def close(self):
        if getattr(self, "gone", False):
            raise kit.ConformanceError("closed twice")
        self.gone = hasattr(self, "name")


class Clinging(Sound):
    def close(self):
        if not hasattr(self, "name"):
            raise kit.ConformanceError("closed before it was reset")


class Racing(Sound):
    """An engine with a boat that moves 30 m in a second; its `kinds.json` allows far less."""

    def state(self, entity):
        x, y, z = entity.position
        return BodyState(id=entity.id, position=(x + 30.0 * self.now, y, z))


class Mumbling(Sound):
    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position, status="mumbling" if self.now else "")


class Leaderless(Sound):
    def reset(self, spec, city, seed):
        super().reset(spec, city, seed)


BROKEN = [
    (Racing, kit.check_speed),
    (Mumbling, kit.check_words),
    (Leaderless, kit.check_ready),
    (Misplaced, kit.check_ready),
    (LateStart, kit.check_ready),
    (Ignorant, kit.check_commands),
    (Forgetful, kit.check_admission),
    (Backwards, kit.check_admission),
    (Eager, kit.check_admission),
    (Anonymous, kit.check_admission),
    (Obliging, kit.check_refusals),
    (Speechless, kit.check_refusals),
    (Slow, kit.check_advance),
    (Losing, kit.check_advance),
    (Infinite, kit.check_advance),
    (Overturned, kit.check_advance),
    (Prophetic, kit.check_advance),
    (Boundless, kit.check_advance),
    (Clashing, kit.check_advance),
    (Nameless, kit.check_advance),
    (Doubled, kit.check_advance),
    (Boiling, kit.check_advance),
    (Miscounting, kit.check_advance),
    (Pointless, kit.check_advance),
    (Poaching, kit.check_advance),
    (Foreseeing, kit.check_advance),
    (Reversed, kit.check_advance),
    (Unacquainted, kit.check_advance),
    (Gullible, kit.check_arguments),
    (Literal, kit.check_arguments),
    (Grasping, kit.check_refusals),
    (Interrupting, kit.check_busy),
    (Distracted, kit.check_busy),
    (Slipping, kit.check_receipts),
    (Echoing, kit.check_strangers),
    (Fragile, kit.check_strangers),
    (Counting, kit.check_cuts),
    (Chatty, kit.check_receipts),
    (Undead, kit.check_receipts),
    (Boastful, kit.check_receipts),
    (Stubborn, kit.check_preemption),
    (Moody, kit.check_repeatable),
    (Residual, kit.check_repeatable),
    (Loose, kit.check_values),
    (Rooted, kit.check_fork),
    (Snapping, kit.check_capture),
    (Clinging, kit.check_close),
    (Brittle, kit.check_close),
]


def declared(engine, name="vessel", **more):
    return EnginePlugin(name=name, factory=engine, **more)


@pytest.mark.parametrize("check", kit.ENGINE_CHECKS, ids=kit.check_name)
def test_a_sound_engine_passes(case, check):
    check(case("vessel", declared(Sound)))


@pytest.mark.parametrize("engine", [Crowded, Routed, Deaf])
def test_background_routes_and_silence_are_fine_as_such(case, engine):
    kit.check_advance(case("vessel", declared(engine)))


@pytest.mark.parametrize(("broken", "check"), BROKEN, ids=[engine.__name__ for engine, _ in BROKEN])
def test_each_fault_is_caught_by_its_check(case, broken, check):
    name = "multirotor" if broken is Backwards else "vessel"
    with pytest.raises(kit.ConformanceError):
        check(case(name, declared(broken, name)))


def test_every_check_has_an_engine_that_fails_it():
    assert {check for _, check in BROKEN} | {kit.check_options} == set(kit.ENGINE_CHECKS)


def test_a_model_of_options_that_does_not_load_is_caught(case):
    with pytest.raises(PluginError, match="the options of engine `vessel` cannot be loaded from `nowhere:Nope`"):
        kit.check_options(case("vessel", declared(Sound, options="nowhere:Nope")))


def test_a_boat_that_drifts_with_wind_and_current_is_not_too_fast(case):
    """The described speed is that of a driven boat; without a command wind and current alone move it."""

    class Drifting(Racing):
        def state(self, entity):
            x, y, z = entity.position
            return BodyState(id=entity.id, position=(x + 1.5 * self.now, y, z))

    kit.check_speed(case("vessel", declared(Drifting)))
    plain = case("vessel", declared(Drifting))
    idle = kit.EngineCase(plain.plugin, plain.instance, plain.city, (), (), 3, 20.0)
    with pytest.raises(
        kit.ConformanceError, match=r"\(1.50 m/s\), and its `kinds.json` allows .* m/s without a command"
    ):
        kit.check_speed(idle)


class Failing(Sound):
    def advance(self, until, mirrors):
        return 1 / 0


class Choking(Sound):
    def is_number(self, value):
        return isinstance(value, float) and int(value) == int(value)


def test_an_engine_that_raises_is_named_with_its_line_once(case):
    broken = case("vessel", declared(Failing))
    with pytest.raises(kit.ConformanceError, match=r"engine `vessel` breaks its contract: ") as caught:
        kit.check_engine(broken.plugin, broken.instance, broken.city, broken.commands)
    assert str(caught.value).count("ZeroDivisionError: division by zero (tests/plugins/test_conformance.py:") == 1
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def test_an_argument_for_which_submit_raises_is_named(case):
    message = r"submit: `moveTo` \{'x': nan, 'y': 40.0\} for `boat`: ValueError: cannot convert float NaN to integer"
    with pytest.raises(kit.ConformanceError, match=message):
        kit.check_arguments(case("vessel", declared(Choking)))


def test_a_number_that_is_not_finite_is_one_fault_and_no_other(case):
    broken = case("vessel", declared(Infinite))
    with pytest.raises(kit.ConformanceError) as caught:
        kit.check_engine(broken.plugin, broken.instance, broken.city, broken.commands)
    faults = str(caught.value).partition("breaks its contract: ")[2].split("; ")
    assert {fault.partition(": ")[2].rpartition(" at ")[0] for fault in faults} == {"`boat`"}, faults


class Hopeless(Slow, Boastful):
    pass


def test_all_faults_are_told_at_once(case):
    broken = case("vessel", declared(Hopeless))
    with pytest.raises(kit.ConformanceError, match=r"engine `vessel` breaks its contract: .*advance.*: .*receipts: "):
        kit.check_engine(broken.plugin, broken.instance, broken.city, broken.commands)


class Painter(Sound):
    """A sensor that paints flat pictures as declared."""

    height, dtype = 4, np.uint8

    def capture(self, requests):
        return tuple(self.paint(request) for request in requests)

    def paint(self, request):
        pose = CameraPose(position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=90.0)
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=pose,
            channels=("rgb",),
        )
        return Frame(info=info, rgb=np.zeros((self.height, 6, 3), self.dtype))


class Cropping(Painter):
    height = 3


class Floating(Painter):
    dtype = np.float32


class Dropping(Painter):
    def capture(self, requests):
        return super().capture(requests)[1:]


class Counting(Painter):
    """A renderer that paints the number of received states, and uses the number as the key of its cache."""

    told = 0

    def advance(self, until, mirrors):
        self.told += 1
        return super().advance(until, mirrors)

    def paint(self, request):
        frame = super().paint(request)
        frame.rgb[:] = self.told
        return frame

    def picture_key(self, request):
        return bytes([self.told])


class Forgetful(Counting):
    def picture_key(self, request):
        return b"always"


class Wordy(Counting):
    def picture_key(self, request):
        return str(self.told)


@pytest.mark.parametrize(
    ("painter", "conforms"),
    [
        (Painter, True), (Cropping, False), (Floating, False), (Dropping, False),
        (Counting, True), (Forgetful, False), (Wordy, False),
    ],
)  # fmt: skip
def test_pictures_are_checked_against_their_declaration(case, painter, conforms):
    camera = CameraSpec(
        name="nadir", view="nadir", width=6, height=4, hfov_deg=84.0, channels=("rgb",), capture="on_request"
    )
    plain = case("vessel", declared(painter, "camera", place="camera", sensor=True))
    entities = tuple(msgspec.structs.replace(entity, cameras=(camera,)) for entity in plain.instance.entities[:2])
    instance = msgspec.structs.replace(plain.instance, entities=entities)
    pictured = kit.EngineCase(plain.plugin, instance, plain.city)
    if conforms:
        kit.check_capture(pictured)
        return
    with pytest.raises(kit.ConformanceError, match=r"capture|picture_key"):
        kit.check_capture(pictured)


class Calm:
    """A policy that says where it goes, and goes."""

    made = 0
    command = Action(verb="moveTo", arguments={"x": 1.0, "y": 2.0})
    message = Outgoing(kind="note", body={"text": "going"})

    async def reset(self, brief):
        self.brief = brief

    async def act(self, observation, inbox):
        await asyncio.sleep(0)
        return Decision(command=self.command, messages=(self.message,))


class Trespassing(Calm):
    command = Action(verb="moveTo", resource="uav[1]")


class Inventive(Calm):
    command = Action(verb="dive")


class Verbose(Calm):
    command = Action(verb="moveTo", arguments={"x": 1.0, "y": 2.0, "mood": "good"})


class Whispering(Calm):
    message = Outgoing(kind="secret", body={})


class Terse(Calm):
    message = Outgoing(kind="note", body={})


class Lost(Calm):
    message = Outgoing(kind="note", body={"text": "?"}, to=("nobody",))


class Endless(Calm):
    command = Action(verb="moveTo", arguments={"x": math.nan, "y": 2.0})


class Silent(Calm):
    command = Action(verb="moveTo", arguments={"x": 1.0})


class Raising(Calm):
    async def reset(self, brief):
        self.brief = brief.nothing


class Vague(Calm):
    message = Outgoing(kind="note", body={"text": math.inf})


class Wordless(Calm):
    async def act(self, observation, inbox):
        return {"command": None}


class Fickle(Calm):
    async def act(self, observation, inbox):
        Fickle.made += 1
        return Decision(thought=str(Fickle.made))


@pytest.fixture
def brief():
    arguments = (ArgumentSpec(name="x", unit="m"), ArgumentSpec(name="y", unit="m"))
    boat = Resource(id="boat", type="lifeboat", embodied=True, verbs=(VerbSpec(name="moveTo", arguments=arguments),))
    note = MessageSpec(
        kind="note",
        type="note",
        category="other",
        fields=(Field(name="text", type="text"),),
        senders=("rescuer",),
        recipients=("all",),
    )
    return Brief(
        agent="skipper",
        role="rescuer",
        index=1,
        goal="",
        prompt="",
        mode="broadcast",
        hub=None,
        tick_s=10.0,
        ticks=60,
        seed=1,
        resources=(boat,),
        peers=(),
        messages=(note,),
        regions=(),
        cells=(),
        classes=(),
        weather=Weather(),
        water_level_m=0.0,
    )


def test_a_sound_policy_passes(brief):
    kit.check_policy(PolicyPlugin(name="calm", factory=Calm), brief)


@pytest.mark.parametrize(
    ("broken", "complaint"),
    [
        (Trespassing, "may not command"),
        (Inventive, "no verb `dive`"),
        (Verbose, "takes no mood"),
        (Whispering, "a message `secret`"),
        (Terse, "without text"),
        (Lost, "unknown agent"),
        (Wordless, "a value of type `dict` instead of a Decision"),
        (
            Endless,
            "policy `broken` breaks its contract: decisions: act: `moveTo`: `x` is nan, a finite number is due\nhint",
        ),
        (Silent, "act: `moveTo` without y"),
        (Vague, "act: a `note`: `text` is inf, finite numbers are due"),
        (
            Raising,
            r"AttributeError: 'Brief' object has no attribute 'nothing' \(tests/plugins/test_conformance.py:\d+\)",
        ),
        (Fickle, "decide differently"),
    ],
)
def test_a_broken_policy_is_caught(brief, broken, complaint):
    with pytest.raises(kit.ConformanceError, match=complaint):
        kit.check_policy(PolicyPlugin(name="broken", factory=broken), brief)


def test_a_policy_over_a_model_need_not_repeat_itself(brief):
    kit.check_policy(PolicyPlugin(name="fickle", factory=Fickle), brief, deterministic=False)


def test_the_host_finds_the_built_in_plug_ins_through_the_door_of_all():
    host = PluginHost(entry_points=False, extra=(builtin,))
    named = {"multirotor", "plane", "quadruped", "road", "vessel", "satellite", "remote", "city", "camera"}
    assert set(host.engines) == named
    assert [name for name, plugin in host.engines.items() if plugin.sensor] == ["camera"]
    assert host.engine("camera").place == "camera"
    assert host.scene("bay").build(SceneSpec(kind="bay", datum_m=-3.5)).waters


def test_nothing_heavy_is_loaded_to_declare_the_built_in_plug_ins():
    import subprocess
    import sys

    code = "import sys, lingjing.builtin as b; b.lingjing_engines(); b.lingjing_scenes(); "
    code += "heavy = ('jsbsim', 'sgp4', 'mujoco', 'libsumo', 'cv2', 'moderngl', 'scipy', 'shapely'); "
    code += "print([m for m in heavy if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
