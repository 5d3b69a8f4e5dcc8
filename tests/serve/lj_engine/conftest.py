"""Backends in processes of their own, as a user starts them, and clients and backends of the paper's protocol.

`ReferenceClient` and `ReferenceBackend` are written from the description of the protocol alone: they import nothing of
the project.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from lingjing import Trace
from lingjing import read as read_trace
from tools.python_forks import PipedFork

websockets: Any = pytest.importorskip("websockets.sync.client", reason="websockets is not installed")

WAIT_S = 120

MISSION = """\
ljs 2
use std.air {{ quadrotor }}
use std.weather {{ clear }}

mission ferry "Ferry flight" {{
  goal "Fly to the marked place."
  scene bay
  clock {{ tick = 2 s, sync = 500 ms }}
  budget {{ ticks <= {ticks}, policy <= 90 s, engine <= 30 s, capture <= 30 s }}
  weather clear
  mode broadcast
  asset uav[k in 1..{uavs}] : quadrotor {{
    position = (306.6 m, -620.2 m + 6 m * k, 1.875 m), heading = 0 deg, cruise = 15 m/s, band = 0 m..200 m
    camera nadir {{ view = nadir, size = 64 by 48, hfov = 80 deg, channels = [rgb], capture = on_request }}
    actions {{ takeoff, setDestination, forward, backward, up, stop, takePhoto }}
  }}
  agent pilot[i in 1..{uavs}] as pilot controls uav[i] {{ observes uav[i].*, events }}
  success when forall u in uav: distance_xy(u, (306.6 m, -500 m)) <= 20 m
}}
"""
"""A flight of 120 m to the north, which is towards a smaller Y in Unreal."""

POLICY = """
from lingjing.plugins.policy import Action, Decision

class Pilot:
    async def reset(self, brief):
        self.own = None

    async def act(self, observation, inbox):
        own = observation.entities[0]
        verb = VERBS.get(observation.tick)
        if verb is None:
            return Decision()
        name, arguments = verb
        return Decision(command=Action(verb=name, arguments=arguments, resource=own.id))

VERBS = {verbs}
"""


@dataclass
class Backend:
    """A running `lingjing serve --lj-engine`."""

    process: PipedFork
    port: int
    folder: Path
    errors: list[str] = field(default_factory=list)

    def url(self, address: str = "airsim", kind: str = "LJ-ENGINE") -> str:
        return f"ws://127.0.0.1:{self.port}/ws/{kind}/{address}"

    def finish(self, code: int = 0) -> Trace:
        """Wait for the end and return the trace."""
        output, text = self.process.communicate(timeout=WAIT_S)
        self.errors += text.splitlines()
        assert self.process.returncode == code, f"{self.process.returncode}: {text}\n{output}"
        path = self.folder / ("trace.mcap" if code == 0 else "trace.mcap.part")
        return read_trace(path)


Serve = Callable[..., Backend]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    started: list[PipedFork] = []

    def start(*options: str, verbs: str = "{}", uavs: int = 1, ticks: int = 12, mission: str = "") -> Backend:
        folder = tmp_path / f"run{len(started)}"
        (tmp_path / "ferry.ljs").write_text(MISSION.format(uavs=uavs, ticks=ticks))
        (tmp_path / "pilot.py").write_text(POLICY.replace("{verbs}", verbs))
        command = [
            sys.executable, "-m", "lingjing.cli.main", "serve", "--lj-engine", mission or "ferry.ljs",
            "--port", "0", "--world", "inline", "--patience", "90", "-o", str(folder),
            *(() if mission else ("--policy", "pilot.py:Pilot")), *options,
        ]  # fmt: skip
        process = PipedFork(command, cwd=tmp_path)
        started.append(process)
        assert process.stdout is not None
        line = process.stdout.readline().strip()
        assert line.startswith("127.0.0.1:"), process.communicate(timeout=WAIT_S)
        return Backend(process, int(line.rpartition(":")[2]), folder)

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait(WAIT_S)


@dataclass
class ReferenceClient:
    """An environment client of one profile: it expects a greeting, then replies only to its three commands."""

    url: str
    profile: str = "open_vocab"
    swallow: int = 0
    """Number of observations that it does not answer, at the end of its life."""
    received: list[dict[str, Any]] = field(default_factory=list)
    poses: dict[str, list[float]] = field(default_factory=dict)
    task: str = ""
    step: int = 0
    ended: bool = False

    NAMES = {
        "open_vocab": ("resetScenario", "getObservation", "executeAction", "sceneResetAck", "observationResponse",
                       "actionAck"),
        "delivery": ("resetDeliveryScenario", "getFleetObservation", "dispatchFleetAction", "sceneResetAck",
                     "observationResponse", "actionAck"),
        "fire_rescue": ("resetFireRescueScenario", "getFireRescueObservation", "dispatchFireRescueAction",
                        "fireRescueResetAck", "fireRescueObservationResponse", "fireRescueActionAck"),
    }  # fmt: skip

    def __post_init__(self) -> None:
        self.socket = websockets.connect(self.url, open_timeout=30, max_size=2**26).__enter__()
        greeting = json.loads(self.socket.recv(timeout=30))
        address = self.url.rpartition("/")[2]
        assert greeting == {"type": "SYSTEM", "data": {"code": 0, "message": f"Hello,{address}"}}

    def start(self) -> threading.Thread:
        thread = threading.Thread(target=self.run, daemon=True)
        thread.start()
        return thread

    def run(self) -> None:
        try:
            for text in self.socket:
                self.take(json.loads(text))
        except Exception:
            pass
        self.ended = True

    def take(self, frame: dict[str, Any]) -> None:
        self.received.append(frame)
        data = frame.get("data")
        if frame.get("type") != "COMMAND" or not isinstance(data, dict):
            return
        reset, observe, act, reset_ack, observe_ack, act_ack = self.NAMES[self.profile]
        kind = data["commandType"]
        if kind == reset:
            self.reset(data["scenario"])
            self.reply(data, reset_ack, {"status": "reset", "taskId": self.task, "agents": list(self.poses)})
            self.send({"commandType": "subscribeScene", "command": {"taskId": self.task}})
        elif kind == observe:
            self.reply(data, observe_ack, self.observation())
        elif kind == act:
            self.move(data["action"])
            self.reply(data, act_ack, {"status": "ok"})

    def reset(self, scenario: dict[str, Any]) -> None:
        self.task = scenario["taskId"]
        drones = scenario["equipmentList"]["droneEntityList"]
        self.poses = {d["name"]: [d["data"][axis] for axis in "XYZ"] for d in drones}

    def observation(self) -> dict[str, Any]:
        self.step += 1
        poses = {name: dict(zip("xyz", place, strict=True)) for name, place in self.poses.items()}
        if self.profile == "delivery":
            drones = {name: {"pose": pose, "delivered": False, "camera_rgb": ""} for name, pose in poses.items()}
            return {"drones": drones, "step": self.step, "all_delivered": False}
        if self.profile == "fire_rescue":
            agents = {name: {"pose": pose, "camera_rgb": ""} for name, pose in poses.items()}
            return {"agents": agents, "fires": [], "step": self.step, "all_extinguished": False}
        return {"pose": next(iter(poses.values())), "goal_position": {}, "distance": 0.0, "camera_rgb": "",
                "step": self.step}  # fmt: skip

    def move(self, action: dict[str, Any]) -> None:
        assert action["task_id"] == self.task
        if "offset" in action:
            offsets = {next(iter(self.poses)): action["offset"]}
        else:
            group = {"delivery": "drones", "fire_rescue": "agents"}[self.profile]
            offsets = {name: body["offset"] for name, body in action[group].items()}
        for name, (dx, dy) in offsets.items():
            self.poses[name][0] += dx
            self.poses[name][1] += dy

    def reply(self, data: dict[str, Any], kind: str, result: dict[str, Any]) -> None:
        assert data["request_id"] == data["requestId"]
        identity = data["request_id"]
        self.send({"commandType": kind, "request_id": identity, "requestId": identity, "data": result})

    def send(self, message: dict[str, Any]) -> None:
        self.socket.send(json.dumps(message))

    def kinds(self) -> list[str]:
        return [frame["data"]["commandType"] for frame in self.received if frame.get("type") == "COMMAND"]
