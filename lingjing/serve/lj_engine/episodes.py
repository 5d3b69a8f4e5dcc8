"""One episode with bodies that foreign sessions own."""

from __future__ import annotations

import dataclasses
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec
from msgspec.structs import replace

from lingjing.engines.remote.engine import RemoteEngine, RemoteSettings
from lingjing.engines.remote.messages import Document, ProfileName, command_data
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.episode import OutsideControl, Session
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import load_policy
from lingjing.play.report import EpisodeReport
from lingjing.plugins.engine import Engine, EnginePlugin
from lingjing.plugins.host import PluginHost
from lingjing.serve.lj_engine.hub import Hub
from lingjing.serve.lj_engine.photos import RemoteCamera
from lingjing.serve.lj_engine.scenario import scenario_maker
from lingjing.serve.lj_engine.server import EngineServer
from lingjing.trace.records import RemoteBinding

ADDRESSES = {
    "multirotor": "airsim", "road": "carla", "quadruped": "go2", "satellite": "afsim", "vessel": "afsim",
    "plane": "afsim", "remote": "airsim",
}  # fmt: skip
"""The address of the session that plays an engine, as the paper's engines use them."""
IMAGE = "image"
"""The address of the session that takes pictures."""
_START_S = 60.0
"""Time for handshakes and the start of engines that is added to the budget of a boundary, wall-clock seconds."""
_LOOK_S = 0.5
"""Longest wait before the sessions are looked at again, seconds."""


@dataclass(frozen=True, slots=True)
class Serving:
    """The mission and the settings of a served episode."""

    mission: Mission
    options: PlayOptions
    folder: Path | None = None
    """The folder of the trace; None for a new one under `runs/`."""
    sessions: Mapping[str, str] | None = None
    """Engine → address of its session; None: the engines of the addresses that dial in."""
    profile: ProfileName = "auto"
    every_sync: bool = False
    asks: bool = True
    paced: bool = False
    """True if mission time passes as the wall clock."""
    pictures: bool = False
    """True if the session `image` takes the pictures."""
    deadline_s: float = 5.0
    act_s: float = 3.0
    ready_s: float = 30.0
    gather_s: float = 2.0
    """Time for further sessions after the first, without `sessions`."""
    patience_s: float | None = None
    """Longest wait for sessions; None waits without end."""

    def check(self) -> None:
        """Raise `UsageError` for a wrong policy, wrong options or wrong sessions."""
        load_policy(self.options.policy, PluginHost())
        self.instance()

    def instance(self) -> Instance:
        """Return the instance before it is placed. Raises `UsageError` for wrong options or sessions."""
        options = self.options
        instance = instantiate(
            self.mission, seed=options.seed, mode=options.mode, settings=dict(options.settings)
        )  # fmt: skip
        movable = _movable(instance)
        if not movable:
            raise UsageError(f"mission `{instance.mission}` has no body that a session could own", hint="try ssr")
        for engine in self.sessions or ():
            if engine not in movable:
                hint = f"engines of its assets: {', '.join(movable)}"
                raise UsageError(f"engine `{engine}` owns no asset of mission `{instance.mission}`", hint=hint)
        return instance


def serve_episode(serving: Serving, server: EngineServer, say: Callable[[str], None]) -> EpisodeReport:
    """Wait for the sessions, play one episode with them, and return its report. Raises the errors of `lingjing.run`."""
    hub = server.hub
    bound = _gathered(serving, hub)
    say(f"the episode begins: {', '.join(f'{engine} is {key}' for engine, key in bound.items())}")
    hub.hold(frozenset((*bound.values(), *((_image_key(),) if serving.pictures else ()))))
    make_scenario = scenario_maker(serving.mission, serving.options.settings, hub.task_id)
    host = PluginHost()
    engines = {engine: _plugin(host, serving, hub, engine, key, make_scenario) for engine, key in bound.items()}
    if serving.pictures:
        engines["camera"] = _camera_plugin(host.engines["camera"], serving, server)
    options = replace(serving.options, world="inline") if serving.pictures else serving.options
    observes: Literal["tick", "sync"] = "sync" if serving.every_sync else "tick"
    bindings = tuple(
        RemoteBinding(
            engine=engine,
            session=key,
            profile=serving.profile,
            task_id=hub.task_id,
            observes=observes,
            asks=serving.asks,
        )
        for engine, key in bound.items()
    )

    def change(instance: Instance) -> Instance:
        if serving.pictures:
            _reset_image(hub, make_scenario(instance))
        return _patient(instance, serving)

    outside = OutsideControl(change, remote_engines=bindings, frames=hub.take_frames)
    with Session(host.with_engines(engines)) as session:
        loaded = {options.policy: load_policy(options.policy, session.host)}
        report = session.play(options, serving.mission, out=serving.folder, loaded=loaded, outside=outside)
    _complete(hub, report)
    return report


def new_task_id(mission: str) -> str:
    """Return an id that no earlier episode had: engines ignore a reset with the id of a loaded one."""
    return f"{mission}-{uuid.uuid4().hex[:12]}"


def _movable(instance: Instance) -> tuple[str, ...]:
    """Return the engines of assets, in the order of the first asset of each."""
    return tuple(dict.fromkeys(e.engine for e in instance.entities if e.role == "asset" and e.engine != "city"))


def _gathered(serving: Serving, hub: Hub) -> dict[str, str]:
    """Wait for the sessions of the episode. Returns engine → session key."""
    instance = serving.instance()
    began = time.monotonic()
    latest = None if serving.patience_s is None else began + serving.patience_s
    first: float | None = None
    while True:
        keys = hub.open_keys()
        if serving.sessions is not None:
            bound = {engine: f"LJ-ENGINE_{address}" for engine, address in serving.sessions.items()}
            complete = all(key in keys for key in bound.values())
        else:
            bound = _by_address(instance, keys)
            first = time.monotonic() if bound and first is None else first
            everyone = len(bound) == len(_movable(instance))
            complete = bool(bound) and (everyone or time.monotonic() - (first or 0.0) >= serving.gather_s)
        if serving.pictures and _image_key() not in keys:
            complete = False
        if complete:
            return bound
        if latest is not None and time.monotonic() > latest:
            wanted = ", ".join(f"LJ-ENGINE_{a}" for a in (serving.sessions or {}).values()) or "any engine"
            raise InfrastructureError(
                f"no session has come within {serving.patience_s:g} s: {wanted} is awaited, "
                f"{', '.join(keys) or 'none'} is connected",
                hint="start the engine, or wait longer with --patience SECONDS",
            )
        with hub.news:
            hub.news.wait(_LOOK_S)


def _by_address(instance: Instance, keys: tuple[str, ...]) -> dict[str, str]:
    """Return engine → session for the connected addresses. An address that no engine uses plays the
    engine of the first asset."""
    movable = _movable(instance)
    bound = {engine: f"LJ-ENGINE_{ADDRESSES.get(engine, engine)}" for engine in movable}
    bound = {engine: key for engine, key in bound.items() if key in keys}
    known = {f"LJ-ENGINE_{address}" for address in (*ADDRESSES.values(), IMAGE)}
    strangers = [key for key in keys if key.startswith("LJ-ENGINE_") and key not in known]
    if not bound and strangers:
        bound = {movable[0]: strangers[0]}
    return bound


def _plugin(
    host: PluginHost, serving: Serving, hub: Hub, engine: str, key: str, scenario: Callable[[Instance], Document]
) -> EnginePlugin:
    """Return the declaration of an engine that a session plays."""
    settings = RemoteSettings(
        engine=engine, profile=serving.profile, every_sync=serving.every_sync, asks=serving.asks,
        reply_s=serving.deadline_s, act_s=serving.act_s, ready_s=serving.ready_s,
    )  # fmt: skip

    def make() -> Engine:
        return RemoteEngine(settings, hub.link(engine, key, paced=serving.paced), scenario)

    return dataclasses.replace(host.engine(engine), factory=make, place="remote")


def _camera_plugin(plugin: EnginePlugin, serving: Serving, server: EngineServer) -> EnginePlugin:
    def make() -> Engine:
        return RemoteCamera(plugin.factory(), server.hub, _image_key(), server.upload_url, serving.deadline_s)

    return dataclasses.replace(plugin, factory=make)


def _image_key() -> str:
    return f"LJ-ENGINE_{IMAGE}"


def _patient(instance: Instance, serving: Serving) -> Instance:
    """Return the instance with a budget of wall-clock time that the deadlines of sessions fit into."""
    tick_s = instance.clock.tick_s if serving.paced else 0.0
    resets = 4 * serving.deadline_s + serving.ready_s + _START_S
    budget = instance.budget
    engine_s = budget.engine_s + resets + tick_s
    capture_s = budget.capture_s + (serving.deadline_s * 8 if serving.pictures else 0.0)
    return replace(instance, budget=replace(budget, engine_s=engine_s, capture_s=capture_s))


def _reset_image(hub: Hub, scenario: Document) -> None:
    session = hub.sessions.get(_image_key())
    if session is not None:
        fields = {"scenario": scenario}
        hub.send(session, msgspec.json.encode(command_data("resetScenario", hub.task_id, fields, "")))


def _complete(hub: Hub, report: EpisodeReport) -> None:
    """Tell every session that the episode is over."""
    fields = {"success": report.success, "result": report.reason, "message": report.detail or report.reason}
    frame = msgspec.json.encode(command_data("complete", hub.task_id, fields, ""))
    with hub.news:
        for session in hub.sessions.values():
            session.send(frame)
