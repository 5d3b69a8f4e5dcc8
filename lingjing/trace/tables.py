"""Tables of a trace: its records as rows of plain values, and as data frames of pandas or polars.

Each table has a structure for its rows. A field of the structure is a column: its name, its type and its meaning. A
value that is absent is None; in a data frame it is null. Both libraries are optional, and none is imported before a
data frame is requested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final, Literal, get_type_hints

import msgspec

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.suggest import nearest_or

if TYPE_CHECKING:
    from lingjing.trace.reader import Trace

TableName = Literal["ticks", "bodies", "decisions", "commands", "receipts", "messages", "events", "pictures"]
"""The tables of a trace."""

FrameLibrary = Literal["pandas", "polars"]
"""The libraries of data frames; each is an extra of this project under the same name."""


class TickRow(msgspec.Struct, frozen=True, kw_only=True):
    """One boundary, with the counts of its records."""

    tick: int
    """Number of the boundary, from 0."""
    time_s: float
    """Simulation time, seconds."""
    score: float
    """The mission's own score so far, 0 to 1."""
    scr: float
    """Subtask completion rate so far, 0 to 1."""
    done: bool
    """True at the last boundary of an episode that ended by itself."""
    commands: int
    """Number of commands that were issued."""
    messages: int
    """Number of messages that were sent; one for each recipient."""
    receipts: int
    """Number of receipts."""
    events: int
    """Number of events that the kernel adjudicated."""
    pictures: int
    """Number of pictures that were taken."""
    wall_s: float
    """Wall-clock duration of the tick, seconds."""


class BodyRow(msgspec.Struct, frozen=True, kw_only=True):
    """The state of one entity at one boundary."""

    tick: int
    time_s: float
    entity: str
    """Id of the entity."""
    x_m: float
    """Position east of the origin, metres."""
    y_m: float
    """Position north of the origin, metres."""
    z_m: float
    """Height over the origin, metres."""
    vx_mps: float
    """Velocity to the east, metres per second."""
    vy_mps: float
    """Velocity to the north, metres per second."""
    vz_mps: float
    """Velocity upwards, metres per second."""
    heading_deg: float
    """Heading, degrees clockwise from north."""
    pitch_deg: float
    """Pitch, degrees."""
    roll_deg: float
    """Roll, degrees."""
    status: str
    """Status; "" for a body without one."""


class DecisionRow(msgspec.Struct, frozen=True, kw_only=True):
    """The decision of one agent in one tick."""

    tick: int
    time_s: float
    agent: str
    """Id of the agent."""
    verb: str | None
    """Verb of its command; None without a command."""
    resource: str | None
    """Entity that it commands; None if the decision names none."""
    arguments: str | None
    """Arguments of the command as JSON; None without a command."""
    messages: int
    """Number of messages of the decision."""
    thought: str
    """The policy's own note."""
    substituted: str
    """Reason for which the answer was replaced by "do nothing"; "" if it was not."""
    policy_wall_s: float
    """Wall-clock duration of the decision, seconds."""


class CommandRow(msgspec.Struct, frozen=True, kw_only=True):
    """One command that the kernel issued."""

    tick: int
    time_s: float
    id: str
    """Id of the command; `receipts.request` refers to it."""
    sender: str
    """Id of the agent."""
    resource: str
    """Id of the commanded entity."""
    verb: str
    arguments: str
    """Arguments as JSON, SI units."""
    origin: str
    """`agent`, or `kernel` for a command that the kernel adds."""


class ReceiptRow(msgspec.Struct, frozen=True, kw_only=True):
    """One receipt of a command or message."""

    tick: int
    """Boundary at which the receipt was recorded."""
    time_s: float
    request: str
    """Id of the command or message."""
    sender: str
    resource: str
    status: str
    """accepted, running, completed, rejected, timed_out or substituted."""
    reason: str
    """Cause of a rejection as a word; "" without one."""
    detail: str
    """Cause in words; "" without one."""
    progress: float | None
    """Share of the command that is done, 0 to 1; None if the engine reports none."""


class MessageRow(msgspec.Struct, frozen=True, kw_only=True):
    """One message to one recipient."""

    tick: int
    time_s: float
    id: str
    sender: str
    recipient: str
    kind: str
    """Kind as declared by the mission."""
    category: str
    """Category of the kind, such as `assignment`."""
    body: str
    """Fields as JSON."""
    bytes: int
    """Size of the payload."""
    deliver_at: int
    """Tick of the delivery."""


class EventRow(msgspec.Struct, frozen=True, kw_only=True):
    """One adjudicated event."""

    tick: int
    time_s: float
    """Simulation time of the event, seconds."""
    id: str
    kind: str
    """The interaction, rule or engine event."""
    bindings: str
    """Ids of the entities as a JSON list."""
    evidence: str
    """Values that decided it, as JSON."""


class PictureRow(msgspec.Struct, frozen=True, kw_only=True):
    """One stored picture. `Trace.picture(id)` returns its pixels."""

    tick: int
    time_s: float
    id: str
    entity: str
    """Id of the entity that carries the camera."""
    camera: str
    """Name of the camera."""
    width: int
    """Width, pixels."""
    height: int
    """Height, pixels."""
    channels: str
    """Channels with a comma between them, such as `rgb,depth`."""
    boxes: int
    """Number of entities with visible pixels."""


TraceRow = TickRow | BodyRow | DecisionRow | CommandRow | ReceiptRow | MessageRow | EventRow | PictureRow
"""A row of any table."""

ROWS: Final[dict[str, type[TraceRow]]] = {
    "ticks": TickRow,
    "bodies": BodyRow,
    "decisions": DecisionRow,
    "commands": CommandRow,
    "receipts": ReceiptRow,
    "messages": MessageRow,
    "events": EventRow,
    "pictures": PictureRow,
}
"""The structure of the rows of each table."""


def table_rows(trace: Trace, table: TableName = "ticks") -> list[TraceRow]:
    """Return the rows of a table in the order of the records. Raises `UsageError` for an unknown table."""
    if table not in ROWS:
        hint = nearest_or(table, ROWS, f"there are: {', '.join(ROWS)}")
        raise UsageError(f"a trace has no table `{table}`", hint=hint)
    return [*_ROWS_OF[table](trace)]


def data_frame(trace: Trace, table: TableName, library: FrameLibrary) -> Any:
    """Return a table as a data frame of a library.

    Raises `UsageError` for an unknown table or library, and for a library that is not installed.
    """
    rows = table_rows(trace, table)
    return frame_of_columns(ROWS[table], rows, library)


def frame_library(library: FrameLibrary) -> Any:
    """Import a library of data frames. Raises `UsageError` if the name is unknown or the package is not installed."""
    if library not in ("pandas", "polars"):
        raise UsageError(f"no library of data frames is called `{library}`", hint="use `pandas` or `polars`")
    try:
        return import_module(library)
    except ImportError as error:
        hint = f"{install_line(library)} (the extra `{library}`), or use `rows`"
        raise UsageError(f"a data frame needs the package `{library}`", hint=hint) from error


def frame_of_columns(kind: type[msgspec.Struct], rows: list[Any], library: FrameLibrary) -> Any:
    """Return rows of one structure as a data frame. An empty list has the same columns with the same types."""
    frames = frame_library(library)
    types = {name: _plain(hint) for name, hint in get_type_hints(kind).items()}
    columns = {name: [getattr(row, name) for row in rows] for name in types}
    if library == "polars":
        kinds = {int: frames.Int64, float: frames.Float64, bool: frames.Boolean, str: frames.String}
        return frames.DataFrame(columns, schema={name: kinds[of] for name, of in types.items()})
    kinds = {int: "int64", float: "float64", bool: "bool", str: "string"}  # a `float64` has NaN for null
    return frames.DataFrame(
        {name: frames.Series(values, dtype=kinds[types[name]], name=name) for name, values in columns.items()}
    )


# -- rows


def _ticks(trace: Trace) -> Iterator[TickRow]:
    for record in trace.boundaries:
        yield TickRow(
            tick=record.tick,
            time_s=record.time_s,
            score=record.reward,
            scr=record.scr,
            done=record.done,
            commands=len(record.commands),
            messages=len(record.messages),
            receipts=len(record.receipts),
            events=len(record.events),
            pictures=len(record.frames),
            wall_s=record.wall_s,
        )


def _bodies(trace: Trace) -> Iterator[BodyRow]:
    for record in trace.boundaries:
        for body in record.snapshots[-1].states if record.snapshots else ():
            (x_m, y_m, z_m), (vx_mps, vy_mps, vz_mps) = body.position, body.velocity
            yield BodyRow(
                tick=record.tick,
                time_s=record.time_s,
                entity=body.id,
                x_m=x_m,
                y_m=y_m,
                z_m=z_m,
                vx_mps=vx_mps,
                vy_mps=vy_mps,
                vz_mps=vz_mps,
                heading_deg=body.heading_deg,
                pitch_deg=body.pitch_deg,
                roll_deg=body.roll_deg,
                status=body.status,
            )


def _decisions(trace: Trace) -> Iterator[DecisionRow]:
    for record in trace.boundaries:
        for made in record.decisions:
            command = made.decision.command
            yield DecisionRow(
                tick=record.tick,
                time_s=record.time_s,
                agent=made.agent,
                verb=None if command is None else command.verb,
                resource=None if command is None else command.resource,
                arguments=None if command is None else _json(command.arguments),
                messages=len(made.decision.messages),
                thought=made.decision.thought,
                substituted=made.substituted,
                policy_wall_s=made.policy_wall_s,
            )


def _commands(trace: Trace) -> Iterator[CommandRow]:
    for record in trace.boundaries:
        for command in record.commands:
            yield CommandRow(
                tick=record.tick,
                time_s=record.time_s,
                id=command.id,
                sender=command.sender,
                resource=command.resource,
                verb=command.verb,
                arguments=_json(command.arguments),
                origin=command.origin,
            )


def _receipts(trace: Trace) -> Iterator[ReceiptRow]:
    for record in trace.boundaries:
        for receipt in record.receipts:
            yield ReceiptRow(
                tick=record.tick,
                time_s=record.time_s,
                request=receipt.request,
                sender=receipt.sender,
                resource=receipt.resource,
                status=receipt.status,
                reason=receipt.reason,
                detail=receipt.detail,
                progress=receipt.progress,
            )


def _messages(trace: Trace) -> Iterator[MessageRow]:
    for record in trace.boundaries:
        for message in record.messages:
            yield MessageRow(
                tick=record.tick,
                time_s=record.time_s,
                id=message.id,
                sender=message.sender,
                recipient=message.recipient,
                kind=message.kind,
                category=message.category,
                body=_json(message.body),
                bytes=message.bytes,
                deliver_at=message.deliver_at,
            )


def _events(trace: Trace) -> Iterator[EventRow]:
    for record in trace.boundaries:
        for event in record.events:
            yield EventRow(
                tick=record.tick,
                time_s=event.time_s,
                id=event.id,
                kind=event.kind,
                bindings=_json(event.bindings),
                evidence=_json(event.evidence),
            )


def _pictures(trace: Trace) -> Iterator[PictureRow]:
    for info in trace.frames.values():
        yield PictureRow(
            tick=info.tick,
            time_s=info.time_s,
            id=info.id,
            entity=info.entity,
            camera=info.camera,
            width=info.pose.width,
            height=info.pose.height,
            channels=",".join(info.channels),
            boxes=len(info.boxes),
        )


_ROWS_OF: Final[dict[str, Callable[[Trace], Iterator[TraceRow]]]] = {
    "ticks": _ticks,
    "bodies": _bodies,
    "decisions": _decisions,
    "commands": _commands,
    "receipts": _receipts,
    "messages": _messages,
    "events": _events,
    "pictures": _pictures,
}


def _json(value: object) -> str:
    return msgspec.json.encode(value, order="deterministic").decode()


def _plain(hint: object) -> type:
    """Return the type of a column's values, without None."""
    return next(kind for kind in (bool, int, float, str) if hint in (kind, kind | None))
