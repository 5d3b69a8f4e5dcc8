"""`RemoteEngine`: an engine that a foreign session plays, under the five methods of `Engine`."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec

from lingjing.engines.remote.exact import ExactDriver
from lingjing.engines.remote.link import Link, Request
from lingjing.engines.remote.messages import (
    EXTENSION,
    EXTENSION_VERSION,
    PROFILES,
    READY,
    Document,
    Profile,
    ProfileName,
    failure_of,
)
from lingjing.engines.remote.offsets import OffsetsDriver
from lingjing.engines.remote.poses import Bodies, Names
from lingjing.engines.remote.script import ScriptDriver
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import Instance
from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt

_TOLERANCE_S = 1e-6
"""Tolerance of times, seconds (chosen: far below a macro-step)."""


class RemoteSettings(msgspec.Struct, frozen=True, kw_only=True):
    """The settings of a remote engine."""

    engine: str
    """The engine's name in the mission."""
    profile: ProfileName = "auto"
    every_sync: bool = False
    """True to send offsets and request poses at every macro-step; else at decision boundaries."""
    asks: bool = True
    """True if observations are requested from a session of the profile `script`; else its last pose is held."""
    reply_s: float = 5.0
    """Deadline of acknowledgements of resets and observations, wall-clock seconds: that of the paper's system."""
    act_s: float = 3.0
    """Deadline of acknowledgements of actions, wall-clock seconds: that of the paper's system."""
    ready_s: float = 30.0
    """Longest wait for `isReady` of the profile `script`, wall-clock seconds: that of the paper's system."""


class RemoteEngine:
    """See `lingjing.engines.remote`."""

    def __init__(self, settings: RemoteSettings, link: Link, scenario: Callable[[Instance], Document]) -> None:
        """`scenario` returns the `resetScenario` object of an instance."""
        self._settings, self._link, self._scenario = settings, link, scenario
        self._driver: ExactDriver | OffsetsDriver | ScriptDriver | None = None
        self._tick_s = 1.0

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Send the scenario, choose the driver by the acknowledgement, and return boundary 0."""
        self._tick_s = spec.instance.clock.tick_s
        profile, ack, events = self._acknowledged(self._scenario(spec.instance))
        if _offers_extension(ack, spec.engine):
            exact = ExactDriver(self._link, spec, self._settings.reply_s)
            self._driver = exact
            return exact.reset(city, seed)
        names = Names(spec.owned())
        if fault := names.learn(_names_in(ack)):
            raise InfrastructureError(fault, hint="give the session the bodies of its `equipmentList`")
        bodies = Bodies(spec.instance, spec.owned())
        if profile is None:
            self._link.wait(READY, self._settings.ready_s)
            script = ScriptDriver(
                self._link, spec.engine, bodies, names, reply_s=self._settings.reply_s, asks=self._settings.asks
            )
            self._driver = script
            return script.reset(events)
        offsets = OffsetsDriver(
            self._link, spec.engine, profile, bodies, names, reply_s=self._settings.reply_s, act_s=self._settings.act_s
        )
        self._driver = offsets
        return offsets.reset()

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit or reject commands."""
        return self._playing().submit(commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Advance the session to `until`."""
        driver = self._playing()
        if isinstance(driver, ExactDriver):
            return driver.advance(until, mirrors)
        ticks = until / self._tick_s
        observes = self._settings.every_sync or abs(ticks - round(ticks)) * self._tick_s < _TOLERANCE_S
        return driver.advance(until, mirrors, observes=observes)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return nothing: pictures belong to the camera."""
        return ()

    def close(self) -> None:
        """Forget the session; its connection belongs to the server."""
        self._driver = None

    def _playing(self) -> ExactDriver | OffsetsDriver | ScriptDriver:
        if self._driver is None:
            raise UsageError("no episode is running", hint="call reset first")
        return self._driver

    def _acknowledged(self, scenario: Document) -> tuple[Profile | None, Document, tuple[Document, ...]]:
        """Send the scenario until a profile acknowledges it. Returns the profile, None for `script`, the
        acknowledgement, and the events that came with it. Raises `InfrastructureError` if none does."""
        settings = self._settings
        fields: Document = {"scenario": scenario, EXTENSION: {"version": EXTENSION_VERSION}}
        if settings.profile == "script":
            request = Request(PROFILES["open_vocab"].reset, fields)
            exchange = self._link.exchange([request], settings.reply_s)
            (reply,) = exchange.replies
            if reply is None:  # as the paper's system does: retry without ids, then continue without an acknowledgement
                again = self._link.exchange([Request(request.command, fields, wants_reply=False)], 0.0)
                return None, {}, (*exchange.events, *again.events)
            self._check(reply)
            return None, reply, exchange.events
        names = tuple(PROFILES) if settings.profile == "auto" else (settings.profile,)
        for name in names:
            profile = PROFILES[name]
            (reply,) = self._link.exchange([Request(profile.reset, fields)], settings.reply_s).replies
            if reply is not None:
                self._check(reply)
                return profile, reply, ()
        sent = ", ".join(f"`{PROFILES[name].reset}`" for name in names)
        raise InfrastructureError(
            f"the session has not acknowledged {sent} within {settings.reply_s:g} s",
            hint="a simulator without acknowledgements is played with --profile script; --deadline waits longer",
        )

    def _check(self, ack: Document) -> None:
        if failure := failure_of(ack):
            raise InfrastructureError(f"the session refuses the scenario: {failure}")


def recorded_scenario(instance: Instance) -> Document:
    """Return an empty scenario: a replay does not send it."""
    return {}


def _offers_extension(ack: Document, engine: str) -> bool:
    """Return whether a session is a process of this project that hosts the engine. Raises `InfrastructureError` if it
    is one with another version or without the engine."""
    offer = ack.get(EXTENSION)
    if not isinstance(offer, dict):
        return False
    if offer.get("version") != EXTENSION_VERSION:
        raise InfrastructureError(
            f"the session speaks version {offer.get('version')!r} of the extension and this is {EXTENSION_VERSION}",
            hint="install the same version of lingjing-sim on both sides",
        )
    engines = offer.get("engines")
    if not isinstance(engines, list) or engine not in engines:
        raise InfrastructureError(f"the session does not host the engine `{engine}`")
    return True


def _names_in(ack: Document) -> list[str]:
    agents = ack.get("agents")
    return [str(name) for name in agents if isinstance(name, str | int)] if isinstance(agents, list) else []
