"""The conformance kit: the built-in engines pass it, and each check detects an engine with a planted fault."""

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


def test_check_engine_runs_all_checks(case):
    whole = case("vessel")
    kit.check_engine(whole.plugin, whole.instance, whole.city, whole.commands, seconds=10.0)


class Faultless:
    """A small engine without faults. Each request takes four seconds. Engines with one fault are subclasses."""

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


class WrongStartPosition(Faultless):
    def state(self, entity):
        return BodyState(id=entity.id, position=(entity.position[0] + 1.0, 0.0, 0.0))


class WrongStartTime(Faultless):
    def reset(self, spec, city, seed):
        return msgspec.structs.replace(super().reset(spec, city, seed), time_s=0.5)


class LacksVerb(Faultless):
    verbs = ("stop",)


class DropsReceipt(Faultless):
    def submit(self, commands):
        return super().submit(commands)[1:]


class ReversesReceipts(Faultless):
    verbs = ("moveTo", "stop", "takeoff", "setDestination")

    def submit(self, commands):
        return super().submit(commands)[::-1]


class CompletesAtAdmission(Faultless):
    def admit(self, command):
        return msgspec.structs.replace(super().admit(command), status="completed")


class AcceptsEveryCommand(Faultless):
    def admit(self, command):
        return self.receipt(command, "accepted")


class RejectsWithoutReason(Faultless):
    def admit(self, command):
        return msgspec.structs.replace(super().admit(command), reason="")


class ReturnsEarlierTime(Faultless):
    def advance(self, until, mirrors):
        return super().advance(until - 0.1, mirrors)


class DropsBody(Faultless):
    def advance(self, until, mirrors):
        boundary = super().advance(until, mirrors)
        return msgspec.structs.replace(boundary, states=boundary.states[1:])


class NonFinitePosition(Faultless):
    def state(self, entity):
        place = entity.position if self.now == 0.0 else (float("nan"), 0.0, 0.0)
        return BodyState(id=entity.id, position=place)


class HeadingOf360(Faultless):
    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position, heading_deg=360.0 if self.now else 0.0)


class FutureEvent(Faultless):
    def events(self):
        return (TaskEvent(kind="arrived", entities=("boat",), time_s=self.now + 60.0),) if self.now else ()


class NonFiniteEvent(Faultless):
    def events(self):
        values = {"speed_mps": math.inf}
        return (TaskEvent(kind="hit", entities=("boat",), time_s=self.now, values=values),) if self.now else ()


class WithBackground(Faultless):
    shown = BodyState(id="traffic/1", kind="car", position=(0.0, 0.0, 0.0))

    def ambient(self):
        return (self.shown,)


class BackgroundWithEntityId(WithBackground):
    shown = BodyState(id="uav[1]", kind="car", position=(0.0, 0.0, 0.0))


class BackgroundWithoutKind(WithBackground):
    shown = BodyState(id="traffic/1", position=(0.0, 0.0, 0.0))


class RepeatedBackground(WithBackground):
    def ambient(self):
        return (self.shown, self.shown)


class NonFiniteBackground(WithBackground):
    shown = BodyState(id="traffic/1", kind="car", position=(0.0, 0.0, math.nan))


class WithRoute(Faultless):
    route = Route(entity="boat", number=1, waypoints=((1.0, 2.0, 0.0),), length_m=5.0, duration_s=2.0, time_s=0.0)

    def routes(self):
        return (self.route,) if self.now == 1.0 else ()


class WrongRouteNumber(WithRoute):
    route = msgspec.structs.replace(WithRoute.route, number=2)


class RouteWithoutPoints(WithRoute):
    route = msgspec.structs.replace(WithRoute.route, waypoints=())


class RouteOfForeignBody(WithRoute):
    route = msgspec.structs.replace(WithRoute.route, entity="uav[1]")


class FutureRoute(WithRoute):
    route = msgspec.structs.replace(WithRoute.route, time_s=9.0)


class WithUnreachableLink(Faultless):
    pair = ("uav[1]", "boat")

    def unreachable_links(self):
        return (self.pair,)


class LinkInWrongOrder(WithUnreachableLink):
    pair = ("boat", "uav[1]")


class LinkToUnknownBody(WithUnreachableLink):
    pair = ("uav[1]", "moon")


class AcceptsNonFiniteArgument(Faultless):
    def is_number(self, value):
        return isinstance(value, float)


class AcceptsTextArgument(Faultless):
    def is_number(self, value):
        return isinstance(value, str) or math.isfinite(value)


class AcceptsForeignBody(Faultless):
    def admit(self, command):
        self.owned = (
            self.owned if command.resource == "boat" else (msgspec.structs.replace(self.owned[0], id="uav[1]"),)
        )
        return super().admit(command)


class ReplacesRunningCommand(Faultless):
    def busy(self, command):
        self.preempt(command)
        self.pending[command.resource] = (command, self.now)
        return self.receipt(command, "accepted")


class RestartsRunningCommand(Faultless):
    def busy(self, command):
        pending, _ = self.pending[command.resource]
        self.pending[command.resource] = (pending, self.now)
        return super().busy(command)


class DecreasingProgress(Faultless):
    def receipt(self, command, status, reason="", progress=None):
        return super().receipt(command, status, reason, None if progress is None else 1.0 - progress)


class EchoesMirrors(Faultless):
    def advance(self, until, mirrors):
        self.seen = tuple(state for state in mirrors if state.kind)
        return super().advance(until, mirrors)

    def ambient(self):
        return getattr(self, "seen", ())


class RaisesForUnknownKind(Faultless):
    def advance(self, until, mirrors):
        if any(state.kind == "conformance.noSuchKind" for state in mirrors):
            raise kit.ConformanceError("what is that?")
        return super().advance(until, mirrors)


class CountsCallsOfAdvance(Faultless):
    calls = 0

    def advance(self, until, mirrors):
        self.calls += 1
        return super().advance(until, mirrors)

    def reset(self, spec, city, seed):
        self.calls = 0
        return super().reset(spec, city, seed)

    def state(self, entity):
        return BodyState(id=entity.id, position=(*entity.position[:2], float(self.calls)))


class RepeatsRunningReceipt(Faultless):
    def advance(self, until, mirrors):
        self.outbox += [self.receipt(command, "running", progress=0.1) for command, _ in self.pending.values()]
        return super().advance(until, mirrors)


class RepeatsCompletedReceipt(Faultless):
    def advance(self, until, mirrors):
        self.outbox += [self.receipt(command, "completed") for command, _ in self.pending.values()]
        return super().advance(until, mirrors)


class ProgressAboveOne(Faultless):
    def receipt(self, command, status, reason="", progress=None):
        return super().receipt(command, status, reason, None if progress is None else 2.0)


class WrongReceiptAuthor(Faultless):
    def receipt(self, *arguments, **more):
        return msgspec.structs.replace(super().receipt(*arguments, **more), by="kernel")


class PreemptsWithoutReceipt(Faultless):
    def preempt(self, command):
        self.pending.pop(command.resource, None)


class DiffersBetweenInstances(Faultless):
    def state(self, entity):
        DiffersBetweenInstances.made += 1
        height = 0.0 if self.now == 0.0 else float(DiffersBetweenInstances.made)
        return BodyState(id=entity.id, position=(*entity.position[:2], height))


class KeepsStateOverReset(Faultless):
    runs = 0

    def reset(self, spec, city, seed):
        self.runs += 1
        return super().reset(spec, city, seed)

    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position, pitch_deg=float(self.runs))


class PositionAsList(Faultless):
    def state(self, entity):
        return BodyState(id=entity.id, position=list(entity.position))


class DiffersInFork(Faultless):
    def state(self, entity):
        away = 0.0 if os.getpid() == self.process else 1.0
        return BodyState(id=entity.id, position=entity.position, roll_deg=away)


class CapturesWithoutRequest(Faultless):
    def capture(self, requests):
        return (None,)


class FailsAtSecondClose(Faultless):
    def close(self):
        if getattr(self, "gone", False):
            raise kit.ConformanceError("closed twice")
        self.gone = hasattr(self, "name")


class FailsAtCloseBeforeReset(Faultless):
    def close(self):
        if not hasattr(self, "name"):
            raise kit.ConformanceError("closed before it was reset")


class TooFast(Faultless):
    """An engine with a boat that moves 30 m in a second; its `kinds.json` allows far less."""

    def state(self, entity):
        x, y, z = entity.position
        return BodyState(id=entity.id, position=(x + 30.0 * self.now, y, z))


class UndescribedStatus(Faultless):
    def state(self, entity):
        return BodyState(id=entity.id, position=entity.position, status="mumbling" if self.now else "")


class ResetWithoutBoundary(Faultless):
    def reset(self, spec, city, seed):
        super().reset(spec, city, seed)


BROKEN = [
    (TooFast, kit.check_speed),
    (UndescribedStatus, kit.check_words),
    (ResetWithoutBoundary, kit.check_ready),
    (WrongStartPosition, kit.check_ready),
    (WrongStartTime, kit.check_ready),
    (LacksVerb, kit.check_commands),
    (DropsReceipt, kit.check_admission),
    (ReversesReceipts, kit.check_admission),
    (CompletesAtAdmission, kit.check_admission),
    (WrongReceiptAuthor, kit.check_admission),
    (AcceptsEveryCommand, kit.check_refusals),
    (RejectsWithoutReason, kit.check_refusals),
    (ReturnsEarlierTime, kit.check_advance),
    (DropsBody, kit.check_advance),
    (NonFinitePosition, kit.check_advance),
    (HeadingOf360, kit.check_advance),
    (FutureEvent, kit.check_advance),
    (NonFiniteEvent, kit.check_advance),
    (BackgroundWithEntityId, kit.check_advance),
    (BackgroundWithoutKind, kit.check_advance),
    (RepeatedBackground, kit.check_advance),
    (NonFiniteBackground, kit.check_advance),
    (WrongRouteNumber, kit.check_advance),
    (RouteWithoutPoints, kit.check_advance),
    (RouteOfForeignBody, kit.check_advance),
    (FutureRoute, kit.check_advance),
    (LinkInWrongOrder, kit.check_advance),
    (LinkToUnknownBody, kit.check_advance),
    (AcceptsNonFiniteArgument, kit.check_arguments),
    (AcceptsTextArgument, kit.check_arguments),
    (AcceptsForeignBody, kit.check_refusals),
    (ReplacesRunningCommand, kit.check_busy),
    (RestartsRunningCommand, kit.check_busy),
    (DecreasingProgress, kit.check_receipts),
    (EchoesMirrors, kit.check_strangers),
    (RaisesForUnknownKind, kit.check_strangers),
    (CountsCallsOfAdvance, kit.check_cuts),
    (RepeatsRunningReceipt, kit.check_receipts),
    (RepeatsCompletedReceipt, kit.check_receipts),
    (ProgressAboveOne, kit.check_receipts),
    (PreemptsWithoutReceipt, kit.check_preemption),
    (DiffersBetweenInstances, kit.check_repeatable),
    (KeepsStateOverReset, kit.check_repeatable),
    (PositionAsList, kit.check_values),
    (DiffersInFork, kit.check_fork),
    (CapturesWithoutRequest, kit.check_capture),
    (FailsAtCloseBeforeReset, kit.check_close),
    (FailsAtSecondClose, kit.check_close),
]


def declared(engine, name="vessel", **more):
    return EnginePlugin(name=name, factory=engine, **more)


@pytest.mark.parametrize("check", kit.ENGINE_CHECKS, ids=kit.check_name)
def test_an_engine_without_faults_passes_every_check(case, check):
    check(case("vessel", declared(Faultless)))


@pytest.mark.parametrize("engine", [WithBackground, WithRoute, WithUnreachableLink])
def test_background_bodies_routes_and_unreachable_links_are_accepted(case, engine):
    kit.check_advance(case("vessel", declared(engine)))


@pytest.mark.parametrize(("broken", "check"), BROKEN, ids=[engine.__name__ for engine, _ in BROKEN])
def test_each_fault_is_detected_by_its_check(case, broken, check):
    name = "multirotor" if broken is ReversesReceipts else "vessel"
    with pytest.raises(kit.ConformanceError):
        check(case(name, declared(broken, name)))


def test_every_check_has_an_engine_that_fails_it():
    assert {check for _, check in BROKEN} | {kit.check_options} == set(kit.ENGINE_CHECKS)


def test_a_model_of_options_that_cannot_be_loaded_is_reported(case):
    with pytest.raises(PluginError, match="the options of engine `vessel` cannot be loaded from `nowhere:Nope`"):
        kit.check_options(case("vessel", declared(Faultless, options="nowhere:Nope")))


def test_a_boat_that_drifts_with_wind_and_current_is_not_too_fast(case):
    """The described speed is that of a driven boat. Without a command, only wind and current move the boat."""

    class Drifting(TooFast):
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


class RaisesInAdvance(Faultless):
    def advance(self, until, mirrors):
        return 1 / 0


class RaisesForNonFiniteArgument(Faultless):
    def is_number(self, value):
        return isinstance(value, float) and int(value) == int(value)


def test_an_exception_of_an_engine_is_reported_once_with_its_line(case):
    broken = case("vessel", declared(RaisesInAdvance))
    with pytest.raises(kit.ConformanceError, match=r"engine `vessel` breaks its contract: ") as caught:
        kit.check_engine(broken.plugin, broken.instance, broken.city, broken.commands)
    assert str(caught.value).count("ZeroDivisionError: division by zero (tests/plugins/test_conformance.py:") == 1
    assert isinstance(caught.value.__cause__, ZeroDivisionError)


def test_an_argument_for_which_submit_raises_is_named(case):
    message = r"submit: `moveTo` \{'x': nan, 'y': 40.0\} for `boat`: ValueError: cannot convert float NaN to integer"
    with pytest.raises(kit.ConformanceError, match=message):
        kit.check_arguments(case("vessel", declared(RaisesForNonFiniteArgument)))


def test_a_number_that_is_not_finite_causes_no_further_faults(case):
    broken = case("vessel", declared(NonFinitePosition))
    with pytest.raises(kit.ConformanceError) as caught:
        kit.check_engine(broken.plugin, broken.instance, broken.city, broken.commands)
    faults = str(caught.value).partition("breaks its contract: ")[2].split("; ")
    assert {fault.partition(": ")[2].rpartition(" at ")[0] for fault in faults} == {"`boat`"}, faults


class TwoFaults(ReturnsEarlierTime, ProgressAboveOne):
    pass


def test_all_faults_of_an_engine_are_reported_together(case):
    broken = case("vessel", declared(TwoFaults))
    with pytest.raises(kit.ConformanceError, match=r"engine `vessel` breaks its contract: .*advance.*: .*receipts: "):
        kit.check_engine(broken.plugin, broken.instance, broken.city, broken.commands)


class Painter(Faultless):
    """A sensor that returns black pictures of the declared size."""

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


class WrongPictureSize(Painter):
    height = 3


class FloatPixels(Painter):
    dtype = np.float32


class DropsPicture(Painter):
    def capture(self, requests):
        return super().capture(requests)[1:]


class PaintsNumberOfStates(Painter):
    """A renderer that paints the number of received states, and uses the number as the key of its cache."""

    received = 0

    def advance(self, until, mirrors):
        self.received += 1
        return super().advance(until, mirrors)

    def paint(self, request):
        frame = super().paint(request)
        frame.rgb[:] = self.received
        return frame

    def picture_key(self, request):
        return bytes([self.received])


class ConstantPictureKey(PaintsNumberOfStates):
    def picture_key(self, request):
        return b"always"


class TextAsPictureKey(PaintsNumberOfStates):
    def picture_key(self, request):
        return str(self.received)


@pytest.mark.parametrize(
    ("painter", "conforms"),
    [
        (Painter, True), (WrongPictureSize, False), (FloatPixels, False), (DropsPicture, False),
        (PaintsNumberOfStates, True), (ConstantPictureKey, False), (TextAsPictureKey, False),
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


class FaultlessPolicy:
    """A policy that sends a message about its destination and moves there."""

    made = 0
    command = Action(verb="moveTo", arguments={"x": 1.0, "y": 2.0})
    message = Outgoing(kind="note", body={"text": "going"})

    async def reset(self, brief):
        self.brief = brief

    async def act(self, observation, inbox):
        await asyncio.sleep(0)
        return Decision(command=self.command, messages=(self.message,))


class CommandsForeignBody(FaultlessPolicy):
    command = Action(verb="moveTo", resource="uav[1]")


class UnknownVerb(FaultlessPolicy):
    command = Action(verb="dive")


class UnknownArgument(FaultlessPolicy):
    command = Action(verb="moveTo", arguments={"x": 1.0, "y": 2.0, "mood": "good"})


class UnknownMessage(FaultlessPolicy):
    message = Outgoing(kind="secret", body={})


class MissingField(FaultlessPolicy):
    message = Outgoing(kind="note", body={})


class UnknownRecipient(FaultlessPolicy):
    message = Outgoing(kind="note", body={"text": "?"}, to=("nobody",))


class NonFiniteArgument(FaultlessPolicy):
    command = Action(verb="moveTo", arguments={"x": math.nan, "y": 2.0})


class MissingArgument(FaultlessPolicy):
    command = Action(verb="moveTo", arguments={"x": 1.0})


class RaisesInReset(FaultlessPolicy):
    async def reset(self, brief):
        self.brief = brief.nothing


class NonFiniteField(FaultlessPolicy):
    message = Outgoing(kind="note", body={"text": math.inf})


class ReturnsDictionary(FaultlessPolicy):
    async def act(self, observation, inbox):
        return {"command": None}


class ChangesDecisions(FaultlessPolicy):
    async def act(self, observation, inbox):
        ChangesDecisions.made += 1
        return Decision(thought=str(ChangesDecisions.made))


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


def test_a_policy_without_faults_passes(brief):
    kit.check_policy(PolicyPlugin(name="calm", factory=FaultlessPolicy), brief)


@pytest.mark.parametrize(
    ("broken", "complaint"),
    [
        (CommandsForeignBody, "may not command"),
        (UnknownVerb, "no verb `dive`"),
        (UnknownArgument, "takes no mood"),
        (UnknownMessage, "a message `secret`"),
        (MissingField, "without text"),
        (UnknownRecipient, "unknown agent"),
        (ReturnsDictionary, "a value of type `dict` instead of a Decision"),
        (
            NonFiniteArgument,
            "policy `broken` breaks its contract: decisions: act: `moveTo`: `x` is nan, a finite number is due\nhint",
        ),
        (MissingArgument, "act: `moveTo` without y"),
        (NonFiniteField, "act: a `note`: `text` is inf, finite numbers are due"),
        (
            RaisesInReset,
            r"AttributeError: 'Brief' object has no attribute 'nothing' \(tests/plugins/test_conformance.py:\d+\)",
        ),
        (ChangesDecisions, "decide differently"),
    ],
)
def test_a_policy_that_breaks_its_contract_fails(brief, broken, complaint):
    with pytest.raises(kit.ConformanceError, match=complaint):
        kit.check_policy(PolicyPlugin(name="broken", factory=broken), brief)


def test_a_policy_over_a_model_need_not_be_deterministic(brief):
    kit.check_policy(PolicyPlugin(name="fickle", factory=ChangesDecisions), brief, deterministic=False)


def test_the_host_registers_the_built_in_plug_ins_like_any_other():
    host = PluginHost(entry_points=False, extra=(builtin,))
    named = {"multirotor", "plane", "quadruped", "road", "vessel", "satellite", "remote", "city", "camera"}
    assert set(host.engines) == named
    assert [name for name, plugin in host.engines.items() if plugin.sensor] == ["camera"]
    assert host.engine("camera").place == "camera"
    assert host.scene("bay").build(SceneSpec(kind="bay", datum_m=-3.5)).waters


def test_declaring_the_built_in_plug_ins_imports_no_heavy_library():
    import subprocess
    import sys

    code = "import sys, lingjing.builtin as b; b.lingjing_engines(); b.lingjing_scenes(); "
    code += "heavy = ('jsbsim', 'sgp4', 'mujoco', 'libsumo', 'cv2', 'moderngl', 'scipy', 'shapely'); "
    code += "print([m for m in heavy if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
