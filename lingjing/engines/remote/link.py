"""Requests, exchanges and links: the interface between a driver and the frames of a session."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import msgspec

from lingjing.decoding import from_json
from lingjing.engines.remote.messages import Document, command_data, result_of
from lingjing.errors import InfrastructureError
from lingjing.trace.records import EngineFrame

_UNCOMPARED = ("request_id", "requestId", "scenario")
"""Fields of a command that a replay does not compare: ids are drawn anew, and a scenario is not built again."""


class Request(msgspec.Struct, frozen=True):
    """A command to the session."""

    command: str
    """`commandType`."""
    fields: Document = {}
    """The further fields of `data`."""
    wants_reply: bool = True
    """True if the command carries a request id and its reply is awaited."""


class Exchange(msgspec.Struct, frozen=True):
    """The result of one exchange."""

    replies: tuple[Document | None, ...]
    """The result of each request, in their order; None for a request without a reply in time."""
    events: tuple[Document, ...] = ()
    """The messages that arrived unasked since the last exchange, in the order of arrival."""


class Link(Protocol):
    """The connection of one engine of ours to its session."""

    @property
    def task_id(self) -> str:
        """The id of the episode on the wire."""
        ...

    def exchange(self, requests: Sequence[Request], deadline_s: float) -> Exchange:
        """Send requests and wait for their replies, at most `deadline_s` wall-clock seconds.

        Raises `InfrastructureError` if the session is lost.
        """
        ...

    def wait(self, event: str, deadline_s: float) -> None:
        """Wait until an event of this `commandType` has arrived, or the deadline. The event stays for an exchange."""
        ...

    def pause(self, until_s: float) -> None:
        """Wait until this mission time has passed on the wall clock since the first call."""
        ...


class RecordedLink:
    """The link of a recorded episode: answers with the frames of the trace."""

    def __init__(self, engine: str, task_id: str, frames: Iterable[EngineFrame]) -> None:
        self._engine, self._task_id = engine, task_id
        self._exchanges: dict[int, list[EngineFrame]] = {}
        for frame in frames:
            if frame.engine == engine and frame.exchange >= 0:
                self._exchanges.setdefault(frame.exchange, []).append(frame)
        self._next = 0

    @property
    def task_id(self) -> str:
        """The recorded id."""
        return self._task_id

    def exchange(self, requests: Sequence[Request], deadline_s: float) -> Exchange:
        """Return the recorded exchange. Raises `InfrastructureError` if the requests differ from the recorded ones."""
        number, self._next = self._next, self._next + 1
        frames = self._exchanges.get(number, [])
        sent = [frame for frame in frames if frame.use in ("request", "notice") and frame.slot >= 0]
        if len(sent) != len(requests):
            raise self._differs(number, f"{len(requests)} commands are sent and {len(sent)} were recorded")
        for request, frame in zip(requests, sent, strict=True):
            if self._plain(frame.text) != self._plain(msgspec.json.encode(self._data(request))):
                raise self._differs(number, f"`{request.command}` is not what was recorded")
        replies: list[Document | None] = [None] * len(requests)
        for frame in frames:
            if frame.use == "reply":
                replies[frame.slot] = result_of(from_json(frame.text))
        events = tuple(from_json(frame.text) for frame in frames if frame.use == "event")
        return Exchange(tuple(replies), events)

    def wait(self, event: str, deadline_s: float) -> None:
        """Return at once."""

    def pause(self, until_s: float) -> None:
        """Return at once."""

    def _data(self, request: Request) -> Document:
        return command_data(request.command, self._task_id, request.fields, "")

    def _plain(self, text: str | bytes) -> Document:
        data: Mapping[str, object] = from_json(text)["data"]
        return {name: value for name, value in data.items() if name not in _UNCOMPARED}

    def _differs(self, number: int, problem: str) -> InfrastructureError:
        return InfrastructureError(
            f"the replay differs from the recorded frames of engine `{self._engine}` in exchange {number}: {problem}",
            hint="replay it with the version that recorded it",
        )
