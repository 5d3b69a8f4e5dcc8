"""The engine's side of the protocol: carries out the commands of a backend and answers them."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import msgspec

from lingjing.decoding import from_json
from lingjing.engines.remote.messages import (
    COLLISION,
    COMPLETED,
    EXTENSION,
    PROFILES,
    READY,
    SUBSCRIBE,
    TELEMETRY,
    Document,
    Profile,
    request_id_of,
)
from lingjing.engines.remote.poses import engine_of, position_of
from lingjing.errors import LingjingError
from lingjing.mission.frames import from_unreal
from lingjing.mission.instance import Entity
from lingjing.plugins.foreign_errors import one_line
from lingjing.plugins.host import PluginHost
from lingjing.serve.lj_engine.hosted_engines import HostedEngines
from lingjing.serve.lj_engine.hosted_world import HostedWorld
from lingjing.serve.lj_engine.orders import read_offsets, read_orders
from lingjing.serve.lj_engine.posting import post_picture

ClientProfile = Literal["any", "open_vocab", "delivery", "fire_rescue", "script"]
"""The commands that are answered; `any` answers all."""

_ACT_WALL_S = 2.5
"""Longest wall-clock time of an offset action, seconds: the backend waits for 3 s."""
_ACT_MOST_S = 300.0
"""Longest mission time of an offset action, seconds (chosen)."""
_VIEWS = {"topdown": "nadir", "front": "front", "global": "oblique"}
_NAMES = {"multirotor": "droneID", "plane": "planeId", "quadruped": "dogID", "road": "autocarId", "vessel": "shipId"}
"""The field of events that names a body, by its kind."""


@dataclass(frozen=True, slots=True)
class EngineSettings:
    """The settings of an engine that dials in."""

    address: str
    """The address of the session: `airsim`."""
    backend_host: str
    """The host of the backend. Pictures are uploaded to it alone."""
    profile: ClientProfile = "any"
    telemetry_s: float | None = None
    """Period of telemetry, wall-clock seconds; None for none."""
    seed: int = 0


class Answers:
    """The state of one session: the scenario, the engines of an own backend, the world of a foreign one."""

    def __init__(
        self, settings: EngineSettings, host: PluginHost, engines: HostedEngines, send: Callable[[object], None],
        say: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._settings, self._host, self._engines = settings, host, engines
        self._send, self._say = send, say
        self._scenario: Document = {}
        self._task = ""
        self._world: HostedWorld | None = None
        self._step = 0
        self._own_backend = False
        self._pushed = 0.0
        self.ended = False
        """True after `complete`."""

    @property
    def busy(self) -> bool:
        """True while a body carries out a command that ends with an event."""
        return self._world is not None and self._world.busy

    @property
    def playing(self) -> bool:
        """True from the first scenario that was accepted to the end of its episode."""
        return bool(self._scenario) and not self.ended

    def take(self, text: object) -> None:
        """Answer one frame of the backend. A frame that is no command is passed over."""
        try:
            frame = from_json(text) if isinstance(text, str) else None
        except (msgspec.DecodeError, RecursionError):
            frame = None
        if not isinstance(frame, dict) or frame.get("type") != "COMMAND":
            content = frame.get("data") if isinstance(frame, dict) else None
            self._say(f"the backend says: {str(content)[:300]}" if content is not None else "a frame is not JSON")
            return
        data = frame.get("data")
        data = data[0] if isinstance(data, list) and data else data
        if isinstance(data, dict):
            self._command(data)

    def advance(self) -> None:
        """Let the bodies go on for one macro-step."""
        if self._world is not None and self._world.busy:
            self._world.advance()
            self._push_telemetry()

    def idle(self) -> None:
        """Push telemetry if it is due."""
        self._push_telemetry()

    def close(self) -> None:
        """End all engines."""
        self._engines.close()
        if self._world is not None:
            self._world.close()
            self._world = None

    def _command(self, data: Document) -> None:
        kind = str(data.get("commandType"))
        method = self._methods().get(kind)
        if method is None:
            return  # a client answers the commands of its profile alone, and drops others without a reply
        ack, answer = method
        try:
            result = answer(data)
        except (LingjingError, msgspec.ValidationError, ValueError, KeyError) as error:
            self._say(f"`{kind}` failed: {one_line(error)}")
            result = {"status": "error", "error": one_line(error)}
        request = request_id_of(data)
        if request and result is not None:
            self._send({"commandType": ack, "request_id": request, "requestId": request, "data": result})
        if kind in [profile.reset for profile in PROFILES.values()] and result and result.get("status") == "reset":
            self._after_reset()

    def _methods(self) -> dict[str, tuple[str, Callable[[Document], Document | None]]]:
        """Return the answered commands with the names of their acknowledgements."""
        chosen = self._settings.profile
        methods: dict[str, tuple[str, Callable[[Document], Document | None]]] = {}
        for name, profile in PROFILES.items():
            if chosen in ("any", name) or (chosen == "script" and name == "open_vocab"):
                methods[profile.reset] = profile.reset_ack, self._reset
                methods[profile.observe] = profile.observe_ack, partial(self._observe, profile)
                methods[profile.act] = profile.act_ack, self._act
        if chosen in ("any", "script"):
            methods |= {
                "takePhoto": ("takePhotoAck", self._take_photos),
                "equipmentMoveTask2D": ("actionAck", self._move_ship),
                "getEngineLoc": ("engineLoc", self._locate),
            }
        methods["complete"] = "completeAck", self._complete
        return methods

    # -- the commands

    def _reset(self, data: Document) -> Document:
        scenario = data.get("scenario")
        if not isinstance(scenario, dict):
            raise LingjingError("a reset has no `scenario`")
        task = str(data.get("taskId") or scenario.get("taskId") or "")
        if task and task == self._task and not self.ended and not request_id_of(data):
            return {"status": "reset", "taskId": task}  # a backend sends it again if the first one took it too long
        self.close()
        self._scenario, self._step, self.ended = scenario, 0, False
        self._task = task
        self._own_backend = isinstance(data.get(EXTENSION), dict)
        result: dict[str, object] = {"status": "reset", "taskId": self._task}
        if self._own_backend:  # the world of a foreign backend is built when it is needed
            result[EXTENSION] = self._engines.offer()
            result["agents"] = _names(scenario)
        else:
            result["agents"] = [_name(entity) for entity in self._needed().assets]
        return result

    def _after_reset(self) -> None:
        if self._task:
            self._send({"commandType": SUBSCRIBE, "command": {"taskId": self._task}})
        if self._settings.profile in ("any", "script"):
            self._send({"commandType": READY, "engine": self._settings.address, READY: "ready"})

    def _observe(self, profile: Profile, data: Document) -> Document:
        query = data.get("query")
        query = query if isinstance(query, dict) else {}
        extra = query.get("extra")
        extension = extra.get(EXTENSION) if isinstance(extra, dict) else None
        if isinstance(extension, dict):
            return self._engines.observe(extension, str(query.get("phase")))
        observation = self._observation(profile, str(data.get("agent") or ""))
        schema = query.get("observation_schema")
        spaces = schema.get("spaces") if isinstance(schema, dict) else None
        if isinstance(spaces, dict) and spaces:
            observation = {name: value for name, value in observation.items() if name in spaces}
        return observation

    def _act(self, data: Document) -> Document | None:
        extension = data.get(EXTENSION)
        if isinstance(extension, dict):
            return self._engines.act(extension)
        world = self._needed()
        action = data.get("action")
        if isinstance(action, dict):
            return self._move_by_offsets(world, action, str(data.get("agent") or ""))
        for entity, verb, steps in read_orders(world, data):
            world.order(entity, steps, partial(self._completed, world, entity, verb))
        return {"status": "ok", "taskId": self._task}

    def _move_by_offsets(self, world: HostedWorld, action: Document, agent: str) -> Document:
        """Carry out offsets to their end, or until the backend would stop waiting."""
        ends: dict[str, str] = {}
        for entity, (dx, dy) in read_offsets(world, action, agent):
            east, north, _ = from_unreal(dx, dy, 0.0)
            position = world.state(entity.id).position
            steps = world.approach(entity, position[0] + east, position[1] + north)
            if steps and math.hypot(east, north) > 0.0:
                world.order(entity, steps, partial(_note_end, ends, entity.id))
        self._step += 1
        wall, latest = time.monotonic(), world.time_s + _ACT_MOST_S
        world.advance()
        while world.busy and time.monotonic() - wall < _ACT_WALL_S and world.time_s < latest:
            world.advance()
        failed = {name: reason for name, reason in ends.items() if reason}
        if failed:
            return {"status": "error", "error": "; ".join(f"{name}: {reason}" for name, reason in failed.items())}
        return {"status": "ok", "step": self._step, "moving": world.busy}

    def _take_photos(self, data: Document) -> Document:
        world, rows = self._needed(), data.get("modelIdList")
        wishes = [row for row in (rows if isinstance(rows, list) else []) if isinstance(row, dict)]
        sent = [self._take_photo(world, row) for row in wishes]
        return {"status": "ok" if all(sent) and sent else "failed", "photos": sent.count(True)}

    def _take_photo(self, world: HostedWorld, row: Document) -> bool:
        name = next((str(row[key]) for key in ("droneId", "carId", "dogId") if row.get(key)), "")
        entity = world.entity(name)
        if entity is None or not entity.cameras:
            self._say(f"no picture: `{name[:60]}` is no body with a camera")
            return False
        view = _VIEWS.get(str(row.get("viewType")), "nadir")
        camera = next((each for each in entity.cameras if each.view == view), entity.cameras[0])
        frame = world.photograph(entity, camera.name, f"f{world.tick}-{entity.id}-{camera.name}")
        spec = row.get("uploadSpec")
        if frame is None or not isinstance(spec, dict):
            self._say(f"no picture of `{entity.id}`")
            return False
        fields = spec.get("fields")
        form = {str(key): str(value) for key, value in fields.items()} if isinstance(fields, dict) else {}
        form.setdefault("photoid", str(row.get("photoid") or ""))
        if self._own_backend:
            form["boxes"] = json.dumps([{"id": box.entity, "box": list(box.box)} for box in frame.info.boxes])
        return post_picture(
            str(spec.get("url")), str(spec.get("fileField") or "file"), form, frame.jpeg,
            allowed_host=self._settings.backend_host, say=self._say,
        )  # fmt: skip

    def _move_ship(self, data: Document) -> Document:
        world, content = self._needed(), data.get("data")
        content = content if isinstance(content, dict) else data
        entity = world.entity(str(content.get("shipId")))
        places = content.get("targetPosition")
        place = places[0] if isinstance(places, list) and places else None
        if entity is None or not isinstance(place, dict):
            raise LingjingError("equipmentMoveTask2D needs a known shipId and a targetPosition")
        target = position_of(place, world.instance, world.state(entity.id).position)
        if target is None:
            raise LingjingError("targetPosition has no X and Y")
        world.order(
            entity, world.approach(entity, target[0], target[1]), partial(self._completed, world, entity, "moveTo")
        )
        return {"status": "ok"}

    def _locate(self, data: Document) -> Document:
        world = self._needed()
        return {"status": "ok", "agents": {_name(e): {"pose": world.pose(e.id)} for e in world.assets}}

    def _complete(self, data: Document) -> Document:
        self._say(f"the episode is over: {str(data.get('message') or data.get('result') or '')[:200]}")
        self.close()
        self.ended = True
        return {"status": "ok"}

    # -- what the backend receives

    def _completed(self, world: HostedWorld, entity: Entity, verb: str, success: bool, reason: str) -> None:
        """Send the event of a finished command."""
        name = {_NAMES.get(engine_of(entity), "droneID"): _name(entity)}
        if "collid" in reason or "collision" in reason:
            self._send({"commandType": COLLISION, "taskId": self._task, **name, "position": world.pose(entity.id)})
            return
        won = bool(world.targets) and len(world.reached) == len(world.targets)
        judgment = {"action": verb, "success": won, "reason": reason or ("task reached" if won else "action finished")}
        self._send(
            {"commandType": COMPLETED, "taskId": self._task, **name, "position": world.pose(entity.id),
             "judgment": judgment}
        )  # fmt: skip
        del success

    def _observation(self, profile: Profile, agent: str) -> dict[str, object]:
        world = self._needed()
        seen = world.reached
        if profile is PROFILES["delivery"]:
            drones = {
                _name(e): {
                    "pose": world.pose(e.id),
                    "delivered": _own_target(world, k) in seen,
                    "camera_rgb": "",
                }
                for k, e in enumerate(world.assets)
            }
            done = bool(world.targets) and all(target.id in seen for target in world.targets)
            return {"drones": drones, "step": self._step, "all_delivered": done}
        if profile is PROFILES["fire_rescue"]:
            agents = {_name(e): {"pose": world.pose(e.id), "camera_rgb": ""} for e in world.assets}
            fires = [_fire(world, target) for target in world.targets]
            done = bool(fires) and all(target.id in seen for target in world.targets)
            return {"agents": agents, "fires": fires, "step": self._step, "all_extinguished": done}
        entity = (world.entity(agent) if agent else None) or world.assets[0]
        observation: dict[str, object] = {"pose": world.pose(entity.id), "camera_rgb": "", "step": self._step}
        if world.targets:
            goal = world.pose(world.targets[0].id)
            here = world.pose(entity.id)
            distance = math.hypot(goal["x"] - here["x"], goal["y"] - here["y"], goal["z"] - here["z"])
            observation |= {"goal_position": {axis: goal[axis] for axis in "xyz"}, "distance": distance}
        if len(world.assets) > 1:
            observation["agents"] = {_name(e): {"pose": world.pose(e.id)} for e in world.assets}
        return observation

    def _push_telemetry(self) -> None:
        period, now = self._settings.telemetry_s, time.monotonic()
        if period is None or self._world is None or now - self._pushed < period:
            return
        self._pushed = now
        profile = PROFILES.get(self._settings.profile, PROFILES["open_vocab"])
        self._send(
            {"commandType": TELEMETRY, "taskId": self._task, "task_id": self._task,
             "data": self._observation(profile, "")}
        )  # fmt: skip

    def _needed(self) -> HostedWorld:
        """Return the world of the scenario, built at the first need."""
        if self._world is None:
            if not self._scenario:
                raise LingjingError("no scenario is loaded: send resetScenario first")
            self._world = HostedWorld(self._scenario, self._task, self._host, self._settings.seed)
        return self._world


def _note_end(ends: dict[str, str], entity: str, success: bool, reason: str) -> None:
    ends[entity] = "" if success else reason or "not carried out"


def _name(entity: Entity) -> str:
    """Return the name of a body on the wire: its code in the document."""
    return entity.label or entity.id


def _names(scenario: Document) -> list[str]:
    """Return the codes of the bodies in a scenario."""
    lists = scenario.get("equipmentList")
    rows = (
        [row for value in lists.values() if isinstance(value, list) for row in value] if isinstance(lists, dict) else []
    )
    return [str(row.get("equipmentCode") or row.get("name")) for row in rows if isinstance(row, dict)]


def _own_target(world: HostedWorld, number: int) -> str:
    """Return the target of the n-th body: the n-th one, or the last."""
    return world.targets[min(number, len(world.targets) - 1)].id if world.targets else ""


def _fire(world: HostedWorld, target: Entity) -> Document:
    place = world.pose(target.id)
    out = target.id in world.reached
    return {
        "id": target.label or target.id, "position": {axis: place[axis] for axis in "xyz"},
        "status": "extinguished" if out else "burning", "progress": 1.0 if out else 0.0,
    }  # fmt: skip
