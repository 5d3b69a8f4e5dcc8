"""`MessageComposer`: selects message kinds by their fields and composes messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lingjing.plugins.decisions import sendable
from lingjing.plugins.policy import Brief, Datum, FrameInfo, MessageSpec, Outgoing
from lingjing.plugins.tasks import Task
from lingjing_agents.capability import compose


class MessageComposer:
    """The messages that one agent may send."""

    def __init__(self, brief: Brief) -> None:
        self._brief, self._open = brief, sendable(brief)
        self._progress: dict[str, str] = {}

    def kind(self, name: str) -> MessageSpec | None:
        """Return the message kind of that name if this agent may send it."""
        return next((message for message in self._open if message.kind == name), None)

    def with_fields(self, *names: str) -> MessageSpec | None:
        """Return the first sendable kind with all of these fields."""
        wanted = set(names)
        return next((kind for kind in self._open if wanted <= {field.name for field in kind.fields}), None)

    def order(self, assignee: str, task: str, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> list[Outgoing]:
        """Return an assignment of a task, or [] if this agent may not send one."""
        return self._composed(self.with_fields("assignee", "task"), {"assignee": assignee, "task": task, **body}, to)

    def status(self, task: str, state: str, body: Mapping[str, Datum]) -> list[Outgoing]:
        """Return a status message of a task, or [] if this agent may not send one."""
        return self._composed(self.with_fields("task", "state"), {"task": task, "state": state, **body})

    def progress(self, body: str, task: Task | None, more: Mapping[str, Datum]) -> list[Outgoing]:
        """Return a status message whenever the task of a body changes; None stands for no task."""
        name = f"{task.name} {task.target}" if task is not None else ""
        if name == self._progress.get(body, ""):
            return []
        self._progress[body] = name
        return self.status(name or "all done", "begun" if name else "done", more)

    def report(
        self,
        kind: str,
        frame: FrameInfo,
        cls: str,
        box: tuple[float, ...],
        position: tuple[float, ...],
        known: Mapping[str, float] | None = None,
    ) -> list[Outgoing]:
        """Return a report of a target in a picture, with those values of `known` that the record has fields for."""
        message = self.kind(kind)
        fields = {field.name for field in message.fields} if message is not None else set()
        more = {name: value for name, value in (known or {}).items() if name in fields}
        return self._composed(
            message,
            {**more, "frame": frame.id, "class": cls, "box": box, "position": position, "confidence": 1.0},
        )

    def way(self, start: tuple[float, ...], points: Sequence[tuple[float, ...]]) -> list[Outgoing]:
        """Return the messages that name a route: its ends, and its places in order; those that this agent may send."""
        ends: dict[str, Datum] = {"start": start, "target": points[-1], "confidence": 1.0}
        messages = self._composed(self.with_fields("start", "target"), ends)
        for number, point in enumerate(points, 1):
            messages += self._composed(self.with_fields("number", "position"), {"number": number, "position": point})
        return messages

    def say(self, kind: str, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> list[Outgoing]:
        """Return a message of a kind by name, or [] if this agent may not send it."""
        return self._composed(self.kind(kind), body, to)

    def _composed(
        self, message: MessageSpec | None, body: Mapping[str, Datum], to: tuple[str, ...] = ()
    ) -> list[Outgoing]:
        if message is None:
            return []
        return [compose(message, body, to if self._brief.hub == self._brief.agent else ())]
