"""Toy engines for the tests of the world: exact arithmetic, a visible coupling, and one fault on demand.

An entity's property `fault` names what goes wrong and `fault_at` the simulation time (s) at which it does.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import ClassVar

import msgspec
import numpy as np

from lingjing.mission.instance import (
    Budget,
    CameraSpec,
    Clock,
    Entity,
    SceneSpec,
)
from lingjing.plugins.engine import Boundary, CaptureRequest, EnginePlugin, Frame
from lingjing.plugins.hookspecs import hookimpl
from lingjing.scene.city import City, Prop
from lingjing.testing import bare_instance
from lingjing.trace.records import BodyState, Box, CameraPose, Command, FrameInfo, Receipt, Route, TaskEvent

CITY = City(id="toy", origin=(31.0, 121.5), bounds=(-100.0, -100.0, 100.0, 100.0))


BURNS_S = {"burn": 0.08, "burn_more": 0.2, "burn_much": 0.6}


def burn(seconds):
    """Compute for `seconds` of this thread's CPU time."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


class Misbehaviour:
    """The faults of a toy, looked up from its entities' properties."""

    def __init__(self, spec):
        self.plans = [
            (entity.properties["fault"], float(entity.properties.get("fault_at", 0.0)))
            for entity in spec.instance.entities
            if "fault" in entity.properties and entity.properties.get("fault_in", entity.engine) == spec.engine
        ]

    def due(self, kind, time_s):
        return any(fault == kind and time_s >= at for fault, at in self.plans)

    def act(self, time_s):
        if self.due("raise", time_s):
            raise ValueError("the toy is broken")
        if self.due("exit", time_s):
            sys.exit(3)
        if self.due("kill", time_s):
            print("last words of the toy", file=sys.stderr, flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
        if self.due("crash", time_s):
            os.kill(os.getpid(), signal.SIGSEGV)
        if self.due("hang", time_s):
            time.sleep(3600.0)
        for fault, seconds in BURNS_S.items():
            if self.due(fault, time_s):
                burn(seconds)
        if self.due("spin", time_s):
            burn(3600.0)
        if self.due("chatter", time_s):
            print("chatter " * 40_000, file=sys.stderr, flush=True)


class Toy:
    """An engine that moves each entity east and slightly towards the mean of the others, so that mirrors affect the
    last bits.
    """

    def __init__(self):
        self.faults = None

    def reset(self, spec, city, seed):
        self.spec, self.seed = spec, seed
        self.faults = Misbehaviour(spec)
        if self.faults.due("at_reset", 0.0):
            self.faults.act(0.0)
        self.time_s = 0.0
        self.goals = {}
        self.states = {e.id: BodyState(id=e.id, position=e.position, status="idle") for e in spec.owned()}
        self.random = np.random.default_rng(seed)
        if self.faults.due("threads", 0.0):
            threading.Thread(target=time.sleep, args=(3600.0,), daemon=True).start()
        return self.boundary(0.0)

    def submit(self, commands):
        if self.faults.due("bad_submit", self.time_s):
            raise RuntimeError("no commands please")
        return tuple(receipt for command in commands for receipt in self.admit(command))

    def admit(self, command: Command):
        status = "rejected" if command.verb == "refuse" else "accepted"
        receipt = Receipt(
            request=command.id,
            tick=command.tick,
            sender=command.sender,
            resource=command.resource,
            status=status,
            by=self.spec.engine,
            time_s=self.time_s,
        )
        if status == "accepted":
            self.goals[command.resource] = (command, receipt)
        answers = {"silent": (), "twice": (receipt, receipt)}
        if command.verb == "misaddressed":
            return (Receipt(request="c9-9", tick=0, sender="x", resource="y", status="accepted"),)
        return answers.get(command.verb, (receipt,))

    def advance(self, until, mirrors):
        self.faults.act(until)
        dt = until - self.time_s
        drift = sum(mirror.position[0] for mirror in mirrors) / max(len(mirrors), 1)
        events, receipts = [], []
        for name, state in self.states.items():
            x, y, z = state.position
            speed = 1.0 + 0.01 * drift + float(self.random.normal(0.0, 0.1))
            self.states[name] = BodyState(
                id=name,
                position=(x + speed * dt, y + 0.1 * dt, z),
                velocity=(speed, 0.1, 0.0),
                heading_deg=90.0,
                status="moving",
                resources={"battery": 1.0 - until / 1000.0},
            )
        for resource, (_, receipt) in sorted(self.goals.items()):
            done = Receipt(
                request=receipt.request,
                tick=receipt.tick,
                sender=receipt.sender,
                resource=resource,
                status="completed",
                by=self.spec.engine,
                time_s=until,
                progress=1.0,
            )
            receipts.append(done)
            events.append(TaskEvent(kind="arrived", entities=(resource,), time_s=until, values={"drift": drift}))
        self.goals.clear()
        self.time_s = until
        return self.boundary(until, tuple(receipts), tuple(events))

    def boundary(self, until, receipts=(), events=()):
        states = tuple(self.states.values())
        due = self.faults.due
        if due("nan", until):
            states = (BodyState(id=states[0].id, position=(float("nan"), 0.0, 0.0)), *states[1:])
        if due("inf_battery", until):
            states = (BodyState(id=states[0].id, position=(0.0, 0.0, 0.0), resources={"battery": float("inf")}),)
        if due("numpy", until):
            states = tuple(
                BodyState(id=s.id, position=np.asarray(s.position), heading_deg=np.float64(90), pitch_deg=0)
                for s in states
            )
        if due("malformed", until):
            states = (BodyState(id=states[0].id, position=("a", "b", "c")), *states[1:])
        if due("missing", until):
            states = states[1:]
        if due("foreign", until):
            states = (*states, BodyState(id="stranger", position=(0.0, 0.0, 0.0)))
        if due("doubled", until):
            states = (*states, states[0])
        if due("none", until):
            return None
        wrong = 1e-3 if due("late_clock", until) else 0.0
        if due("stale", until):
            return self.last
        signed = "somebody" if due("signature", until) else self.spec.engine
        self.last = Boundary(engine=signed, time_s=until + wrong, states=states, receipts=receipts, events=events)
        return self.last

    def capture(self, requests):
        return ()

    def close(self):
        if self.faults and self.faults.due("bad_close", self.time_s):
            raise RuntimeError("it does not close")


class Crowd(Toy):
    """A toy with background movers, routes and unreachable links.

    The setting `crowd` is the number of movers; above 0 the toy takes part without entities. A fault `ambient_…` of an
    entity corrupts the movers from `fault_at` on. By engine, `seen` holds the ids of the mirrors of such a toy.
    """

    seen: ClassVar[dict[str, list[str]]] = {}

    def boundary(self, until, receipts=(), events=()):
        settings = self.spec.instance.settings
        prefix = {"toy_crowd": "traffic", "toy_crowd_too": "other", "far_crowd": "distant"}[self.spec.engine]
        movers = [self.mover(f"{prefix}/{n}", float(n), until) for n in range(int(settings.get("crowd", 0)))]
        mine = super().boundary(until, receipts, events)
        owned = [state.id for state in mine.states]
        return msgspec.structs.replace(
            mine,
            ambient=tuple(self.spoilt(movers, until)),
            routes=tuple(self.route(name, until) for name in owned),
            unreachable_links=(("cat", "ant"),) if settings.get("silence") else (),
        )

    def mover(self, name, x, until):
        place = (x + until, 1.0, 0.0)
        return BodyState(id=name, position=place, velocity=(1.0, 0.0, 0.0), heading_deg=90.0, kind="car")

    def route(self, name, until):
        if self.faults.due("foreign_route", until):
            name = "ant"
        far = float("inf") if self.faults.due("inf_route", until) else 5.0
        way = ((0.0, 0.0, 0.0), (far, 0.0, 0.0))
        return Route(
            entity=name, number=1 + round(until * 10), waypoints=way, length_m=5.0, duration_s=1.0, time_s=until
        )

    def spoilt(self, movers, until):
        due = self.faults.due
        replace = msgspec.structs.replace
        if due("ambient_nan", until):
            return [*movers[:-1], replace(movers[-1], velocity=(0.0, float("nan"), 0.0))]
        if due("ambient_twice", until):
            return [*movers, movers[0]]
        if due("ambient_entity", until):
            return [*movers, replace(movers[0], id="ant")]
        if due("ambient_clash", until):
            return [replace(mover, id=f"traffic/{n}") for n, mover in enumerate(movers)]
        if due("ambient_text", until):
            return [*movers[:-1], replace(movers[-1], position=("a", "b", "c"))]
        if due("ambient_numpy", until):
            return [replace(mover, position=np.asarray(mover.position), heading_deg=90) for mover in movers]
        return movers

    def advance(self, until, mirrors):
        self.seen[self.spec.engine] = [mirror.id for mirror in mirrors]
        return super().advance(until, mirrors)


def wants_a_crowd(instance):
    return instance.settings.get("crowd", 0.0) > 0


class Painter:
    """A sensor that paints the sum of all positions and can be slow, held, empty, wrong or deadly.

    A held picture is drawn when the file exists that an entity's property `released` names.
    """

    def reset(self, spec, city, seed):
        self.faults = Misbehaviour(spec)
        if self.faults.due("slow_reset", 0.0):
            time.sleep(1.5)
        self.cameras = {(e.id, c.name): c for e in spec.instance.entities for c in e.cameras}
        self.released = Path(*(e.properties["released"] for e in spec.instance.entities if "released" in e.properties))
        self.drawn = 0
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands):
        return ()

    def advance(self, until, mirrors):
        self.faults.act(until)
        self.mirrors, self.time_s = tuple(mirrors), until
        return Boundary(engine="camera", time_s=until)

    def capture(self, requests):
        return tuple(self.draw(request) for request in requests if not self.faults.due("empty", request.time_s))

    def draw(self, request: CaptureRequest):
        self.drawn += 1
        if self.faults.due("slow_once", request.time_s) and self.drawn == 1:
            time.sleep(1.6)
        for number, fault in ((1, "held_first"), (2, "held_second")):
            while self.drawn == number and self.faults.due(fault, request.time_s) and not self.released.exists():
                time.sleep(0.02)
        camera = self.cameras[(request.entity, request.camera)]
        shape = (camera.height, camera.width)
        total = sum(sum(mirror.position) for mirror in self.mirrors)
        rows = np.arange(camera.height, dtype=np.uint32)[:, None, None]
        rgb = np.broadcast_to((rows + int(total * 10)) % 256, (*shape, 3)).astype(np.uint8)
        if self.faults.due("bad_array", request.time_s):
            rgb = rgb[:, :, :2]
        depth = np.full(shape, total, np.float32) if "depth" in camera.channels else None
        semantic = np.full(shape, 7, np.uint8) if "semantic" in camera.channels else None
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=CameraPose(position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=90.0),
            channels=camera.channels,
            boxes=(Box(entity=request.entity, cls="toy", box=(0.1, 0.2, 0.3, 0.4), pixels=5),),
        )
        return Frame(info, rgb, depth, semantic)

    def close(self):
        pass


class ToyPlugin:
    """A plug-in with movers `toy_a`, `toy_b`, `toy_c`, the remote `toy_remote`, and three engines with background
    movers.
    """

    __name__ = "toys"

    @hookimpl
    def lingjing_engines(self):
        toys = [EnginePlugin(name=f"toy_{letter}", factory=Toy) for letter in "abc"]
        remote = EnginePlugin(name="toy_remote", factory=Toy, place="remote")
        crowd = EnginePlugin(name="toy_crowd", factory=Crowd, wanted=wants_a_crowd)
        crowds = [crowd, EnginePlugin(name="toy_crowd_too", factory=Crowd)]
        return [*toys, remote, *crowds, EnginePlugin(name="far_crowd", factory=Crowd, place="remote")]


class PainterPlugin:
    """A plug-in with the painter alone, for hosts without another camera."""

    __name__ = "painter"

    @hookimpl
    def lingjing_engines(self):
        return [EnginePlugin(name="camera", factory=Painter, place="camera", sensor=True)]


plugin = ToyPlugin()
painter = PainterPlugin()


def camera(width=64, height=48, channels=("rgb", "depth", "semantic")):
    return CameraSpec(
        name="nadir", view="nadir", width=width, height=height, hfov_deg=84.0, channels=channels, capture="on_request"
    )


def entity(name, engine, x=0.0, cameras=(), **properties):
    return Entity(
        id=name,
        group=name,
        index=0,
        role="asset",
        type="toy",
        engine=engine,
        position=(x, 0.0, 0.0),
        properties=properties,
        cameras=cameras,
    )


def instance(*entities, seed=7, tick_s=1.0, sync_s=0.1, engine_s=20.0, capture_s=20.0, **settings):
    return bare_instance(
        entities,
        mission="toy",
        title="Toy",
        seed=seed,
        settings=settings,
        scene=SceneSpec(kind="toy"),
        clock=Clock(tick_s=tick_s, sync_s=sync_s),
        budget=Budget(ticks=10, policy_s=1.0, engine_s=engine_s, capture_s=capture_s),
    )


def trio(**changes):
    """Return an instance with three engines and four entities, declared out of engine order, one with a camera."""
    return instance(
        entity("cat", "toy_c", 5.0),
        entity("ant", "toy_a", 1.0, cameras=(camera(),)),
        entity("bee", "toy_b", 2.0),
        entity("ape", "toy_a", 3.0),
        **changes,
    )


def command(name, resource, verb="go", sender="agent"):
    return Command(id=name, tick=1, sender=sender, resource=resource, verb=verb)


def request(tick, frame="f", entity_id="ant"):
    return CaptureRequest(frame=frame, entity=entity_id, camera="nadir", tick=tick, time_s=float(tick))


def big_city():
    """Return a city of a few megabytes: more than a socket buffer holds."""
    props = tuple(Prop(id=f"prop{n}", cls="tree", model="tree", position=(float(n), 0.5, 0.25)) for n in range(40_000))
    return City(id="big", origin=(31.0, 121.5), bounds=(-1.0, -1.0, 1.0, 1.0), props=props)
