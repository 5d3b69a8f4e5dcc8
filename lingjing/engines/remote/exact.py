"""The driver of a session that is a process of this project: boundaries and receipts travel unchanged.

The commands are those of the protocol. A field `lingjing` holds the arguments and the results of the five methods; JSON
keeps every bit of a number.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from lingjing.decoding import converted
from lingjing.engines.remote.link import Link, Request
from lingjing.engines.remote.messages import EXTENSION, PROFILES, Document, failure_of
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import Boundary, EngineSpec
from lingjing.scene.city import City, content_sha256
from lingjing.trace.records import BodyState, Command, Receipt

START_S = 120.0
"""Longest start of an engine in the other process, seconds (chosen): it builds the city and imports the engine."""

_NAMES = PROFILES["open_vocab"]


class ResetCall(msgspec.Struct, frozen=True):
    """The arguments of `reset`."""

    engine: str
    instance: Instance
    owns: tuple[str, ...]
    seed: int
    city_sha256: str
    """The content of the city. The other process builds it from the instance and compares."""


class SubmitCall(msgspec.Struct, frozen=True):
    """The arguments of `submit`."""

    engine: str
    commands: tuple[Command, ...]


class AdvanceCall(msgspec.Struct, frozen=True):
    """The arguments of `advance`."""

    engine: str
    until: float
    mirrors: tuple[BodyState, ...]
    occurrences: tuple[Occurrence, ...] = ()
    """All occurrences of events so far."""


class ExactDriver:
    """Calls the engine of the other process."""

    def __init__(self, link: Link, spec: EngineSpec, deadline_s: float) -> None:
        self._link, self._spec, self._deadline_s = link, spec, deadline_s
        self._schedule = spec.schedule

    def reset(self, city: City, seed: int) -> Boundary:
        """Reset the engine and return its boundary 0."""
        spec = self._spec
        call = ResetCall(spec.engine, spec.instance, spec.owns, seed, content_sha256(city))
        return self._observe("reset", call, START_S)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Return the engine's admission receipts."""
        call = SubmitCall(self._spec.engine, tuple(commands))
        fields: Document = {"action": {"task_id": self._link.task_id, "offset": [0.0, 0.0]}, EXTENSION: call}
        (reply,) = self._link.exchange([Request(_NAMES.act, fields)], self._deadline_s).replies
        return converted(self._content(reply, "submit").get("receipts"), tuple[Receipt, ...])

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Advance the engine and return its boundary."""
        call = AdvanceCall(self._spec.engine, until, tuple(mirrors), self._schedule.occurrences)
        return self._observe("step", call, self._deadline_s)

    def _observe(self, phase: str, call: msgspec.Struct, deadline_s: float) -> Boundary:
        query: Document = {
            "task_id": self._link.task_id, "phase": phase, "modalities": ["state"], "extra": {EXTENSION: call},
        }  # fmt: skip
        (reply,) = self._link.exchange([Request(_NAMES.observe, {"query": query})], deadline_s).replies
        return converted(self._content(reply, phase).get("boundary"), Boundary)

    def _content(self, reply: Document | None, call: str) -> Document:
        """Return the field `lingjing` of a reply. Raises `InfrastructureError` without one."""
        if reply is None:
            raise InfrastructureError(f"the session has not answered `{call}` in time")
        if failure := failure_of(reply):
            raise InfrastructureError(f"the session reports a failure of `{call}`: {failure}")
        content = reply.get(EXTENSION)
        if not isinstance(content, dict):
            raise InfrastructureError(f"the answer to `{call}` has no field `{EXTENSION}`")
        return content
