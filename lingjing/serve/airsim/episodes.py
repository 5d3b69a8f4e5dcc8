"""Served episodes, one after another: each `reset` of a client ends one and begins the next."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lingjing.kernel.barrier import Barrier
from lingjing.kernel.step import Kernel
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.episode import EpisodeInterrupted, OutsideControl, Session
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import load_policy
from lingjing.play.report import EpisodeReport
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, PolicyPlugin
from lingjing.scene.city import City
from lingjing.serve.airsim.missions import served
from lingjing.serve.airsim.server import Call, CallServer
from lingjing.serve.airsim.session import ClientSource, Ending, Pace, vehicle_agents

CLIENT_POLICY = "airsim-client"
"""Name in traces of the policy of the agents that clients play."""


@dataclass(frozen=True, slots=True)
class Serving:
    """The mission and the settings of served episodes."""

    mission: Mission
    options: PlayOptions
    """The options of each episode; `policy` plays the agents without a vehicle."""
    tick_s: float
    """Length of a tick, seconds."""
    pace: Pace
    once: bool
    """True to end when the last client has left."""
    moves_cameras: bool = False
    """True if clients may move cameras and change their lenses: in a free flight, where nothing is judged."""
    folder: Path | None = None
    """The folder of the first episode's trace; None for new ones under `runs/`. Later episodes get `-2`, `-3`, …"""

    def instance(self) -> Instance:
        """Return the instance before its changes. Raises `UsageError` for wrong options or without a vehicle."""
        options = self.options
        instance = instantiate(
            self.mission, seed=options.seed, mode=options.mode, settings=dict(options.settings)
        )  # fmt: skip
        vehicle_agents(instance)
        return instance


class ClientPolicy:
    """The policy of an agent that clients play: it is never called, and stands for them in the trace."""

    async def reset(self, brief: Brief) -> None:
        """Receive the brief."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Do nothing."""
        return Decision()


def serve_episodes(serving: Serving, server: CallServer) -> list[EpisodeReport]:
    """Serve episodes until a mission ends, the last client leaves, or an interrupt. Returns their reports.

    Raises the errors of `lingjing.run`.
    """
    options, instance = serving.options, serving.instance()
    agents = vehicle_agents(instance)
    ending = Ending()
    reports: list[EpisodeReport] = []
    with Session() as session:
        loaded = {CLIENT_POLICY: PolicyPlugin(CLIENT_POLICY, ClientPolicy)}
        if len(agents) < len(instance.agents):
            loaded[options.policy] = load_policy(options.policy, session.host)
        else:
            options = _with(options, policy=CLIENT_POLICY)
        options = _with(options, policies_for=dict.fromkeys(agents, CLIENT_POLICY))
        while True:
            greeting, ending.call = ending.call, None
            reports.append(_episode(session, serving, options, loaded, server, ending, greeting, len(reports)))
            if ending.call is None:
                return reports


def _episode(
    session: Session,
    serving: Serving,
    options: PlayOptions,
    loaded: dict[str, PolicyPlugin],
    server: CallServer,
    ending: Ending,
    greeting: Call | None,
    before: int,
) -> EpisodeReport:
    def change(instance: Instance) -> Instance:
        return served(instance, serving.tick_s, moves_cameras=serving.moves_cameras)

    def source(kernel: Kernel, barrier: Barrier, city: City) -> ClientSource:
        return ClientSource(kernel, barrier, city, server, serving.pace, ending, once=serving.once, greeting=greeting)

    folder = serving.folder
    if folder is not None and before:
        folder = folder.with_name(f"{folder.name}-{before + 1}")
    try:
        return session.play(options, serving.mission, out=folder, loaded=loaded, outside=OutsideControl(change, source))
    except EpisodeInterrupted as interrupted:
        if ending.asked:
            return interrupted.report
        raise


def _with(options: PlayOptions, **changes: object) -> PlayOptions:
    from msgspec.structs import replace

    return replace(options, **changes)
