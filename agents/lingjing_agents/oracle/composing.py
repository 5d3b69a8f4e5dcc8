"""`MessageComposer`: finds the message kinds that an agent may send by their fields, and composes messages."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.plugins.decisions import sendable
from lingjing.plugins.policy import Brief, Datum, FrameInfo, MessageSpec, Outgoing
from lingjing.plugins.tasks import Task
from lingjing_agents.capability import compose


class MessageComposer:
    """What one agent may say."""

    def __init__(self, brief: Brief) -> None:
        self._brief, self._open = brief, sendable(brief)
        self._progress: dict[str, str] = {}

    def kind(self, name: str) -> MessageSpec | None:
        """The message kind of that name, if this agent may send it."""
        return next((message for message in self._open if message.kind == name), None)

    def with_fields(self, *names: str) -> MessageSpec | None:
        """The first kind whose record has all of the fields."""
        wanted = set(names)
        return next((one for one in self._open if wanted <= {field.name for field in one.fields}), None)

    def order(self, assignee: str, task: str, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> list[Outgoing]:
        """An assignment of a task, if this agent may give one."""
        return self._said(self.with_fields("assignee", "task"), {"assignee": assignee, "task": task, **body}, to)

    def status(self, task: str, state: str, body: Mapping[str, Datum]) -> list[Outgoing]:
        """How a task is going, if this agent may say so."""
        return self._said(self.with_fields("task", "state"), {"task": task, "state": state, **body})

    def progress(self, body: str, task: Task | None, more: Mapping[str, Datum]) -> list[Outgoing]:
        """Which task a body goes to, None for none that is left, whenever that changes."""
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
        """A sighting in a picture, with whatever is `known` of the target that the record has a field for."""
        message = self.kind(kind)
        fields = {field.name for field in message.fields} if message is not None else set()
        more = {name: value for name, value in (known or {}).items() if name in fields}
        return self._said(
            message,
            {**more, "frame": frame.id, "class": cls, "box": box, "position": position, "confidence": 1.0},
        )

    def say(self, kind: str, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> list[Outgoing]:
        """A message of a kind by name."""
        return self._said(self.kind(kind), body, to)

    def _said(self, message: MessageSpec | None, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> list[Outgoing]:
        if message is None:
            return []
        return [compose(message, body, to if self._brief.hub == self._brief.agent else ())]
