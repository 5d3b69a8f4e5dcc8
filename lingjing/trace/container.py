"""The MCAP file: channels, messages, flushes; and reading one that may have been cut anywhere.

The only module that imports `mcap`. Chunks are closed at every flush, so a file that was cut reads up to its last
flushed chunk with the plain `mcap` reader as well.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NamedTuple, cast

import mcap.opcode
import mcap.records
import mcap.writer
from mcap.data_stream import ReadDataStream

from lingjing.errors import UsageError
from lingjing.trace.chunks import BROKEN, LIMIT, UnpackLimits, contents
from lingjing.trace.seals import MAGIC, RECORD, SEAL, SealedFile, definition_sum, message_sum

CHUNK_BYTES = 4 * 1024 * 1024

_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY = struct.Struct("<QQ")
"""A message index (MCAP, op 0x07): channel and length in bytes, then log time and place of each message."""


@dataclass(frozen=True, slots=True)
class ContainerSchema:
    """A schema as MCAP stores it: `encoding` is `jsonschema` or `protobuf`."""

    name: str
    encoding: str
    data: bytes

    @property
    def message_encoding(self) -> str:
        """How messages of this schema are encoded."""
        return "json" if self.encoding == "jsonschema" else self.encoding


@dataclass(frozen=True, slots=True)
class Stored:
    """One message found in a file: its topic and channel, `sequence`, simulation time, bytes, and its chunk's place."""

    topic: str
    channel: int
    sequence: int
    time_ns: int
    data: bytes
    chunk_at: int


class ContainerWriter:
    """Messages into one MCAP file, opened exclusively and sealed at every flush, with `key` signed as well. Raises
    `OSError` as the file system does."""

    def __init__(self, path: Path, key: bytes = b"") -> None:
        opened = path.open("xb")
        _lock(opened)
        self._file = SealedFile(opened, key)
        self._writer = mcap.writer.Writer(cast("IO[bytes]", self._file), chunk_size=CHUNK_BYTES)
        self._writer.start(library="lingjing")
        self.last_ns = 0
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def add(self, topic: str, schema: ContainerSchema, time_ns: int, data: bytes, sequence: int = 0) -> None:
        """One message; log time and publish time are both the simulation time."""
        self.last_ns = max(self.last_ns, time_ns)
        channel = self._channel(topic, schema)
        self._file.note(message_sum(topic, sequence, time_ns, data))
        self._writer.add_message(channel, time_ns, data, time_ns, sequence)

    def end_chunk(self) -> None:
        """Close the chunk: what comes next is unpacked without what came before."""
        self._writer.flush()

    def flush(self) -> None:
        """Close and seal the chunk, and hand all to the operating system (a killed process then loses nothing)."""
        self._writer.flush()
        self._writer.add_metadata(SEAL, self._file.fields())
        self._file.flush()

    def finish(self) -> None:
        """Write the last seal and the summary (indexes, statistics), and close the file."""
        self._writer.flush()
        self._writer.add_metadata(SEAL, self._file.fields(last=True))
        self._writer.finish()
        self._file.close()

    def close(self) -> None:
        """Close the file as it is, without a summary, when writing has failed; idempotent."""
        with contextlib.suppress(OSError):  # what cannot be flushed is why we are here
            self._file.abort()

    def _channel(self, topic: str, schema: ContainerSchema) -> int:
        if topic not in self._channels:
            if schema.name not in self._schemas:
                self._file.note(definition_sum(schema.name, schema.encoding, schema.data))
                self._schemas[schema.name] = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            number = self._schemas[schema.name]
            self._file.note(definition_sum(topic, schema.message_encoding, str(number)))
            self._channels[topic] = self._writer.register_channel(topic, schema.message_encoding, number)
        return self._channels[topic]


def is_being_written(path: Path) -> bool:
    """Whether a `ContainerWriter` in any process of this machine has the file open; True where that cannot be known."""
    if sys.platform == "win32":
        return True
    import fcntl

    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    return False


def _lock(file: IO[bytes]) -> None:
    """Hold the file as long as it is open here: the system lets it go however this process ends. A file system without
    locks is written all the same."""
    if sys.platform != "win32":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def scan(path: Path, passed_over: str = "", only: tuple[str, ...] = ("",)) -> Iterator[Stored]:
    """Every message up to the file's end or its first damaged place, in file order; a chunk that holds more than it may
    is a damaged place. A chunk all of whose messages are in topics that begin with `passed_over` is not unpacked: its
    messages come without data, in the order of its index. Of other chunks those messages come whose topics begin with
    one of `only`.

    Raises `UsageError` if the file cannot be opened or does not begin as an MCAP file.
    """
    for stored, _ in scan_from(path, 0, DeclaredChannels(only), passed_over):
        yield stored


def scan_from(path: Path, begin: int, channels: DeclaredChannels, passed_over: str) -> Iterator[tuple[Stored, int]]:
    """The messages of the chunks from byte `begin` on, as `scan`, each with the byte behind its chunk, where a later
    call may begin. `begin` is 0 or such a byte; `channels` are those declared before, to which new ones are added."""
    with _opened(path) as file:
        bounds = UnpackLimits(path.stat().st_size)
        try:
            for chunk, at, index in _chunks(file, max(begin, len(MAGIC))):
                behind = at + _chunk_length(chunk)
                for stored in _chunk((chunk, at), index, channels, bounds, passed_over):
                    yield stored, behind
        except BROKEN:
            return


class DeclaredChannels:
    """The topics of the channels that were declared so far, by number; `unwanted` are those that are left out."""

    def __init__(self, only: tuple[str, ...] = ("",)) -> None:
        self._only = only
        self.topics: dict[int, str] = {}
        self.unwanted: set[int] = set()

    def declare(self, number: int, topic: str) -> None:
        """One more channel, or another topic for one."""
        self.topics[number] = topic
        self.unwanted.discard(number)
        if not topic.startswith(self._only):
            self.unwanted.add(number)


class _ChunkIndex(NamedTuple):
    """The index that stands behind a chunk for one channel: `entries` are pairs of log time and place."""

    channel: int
    entries: bytes

    @property
    def times(self) -> Iterator[int]:
        """Log times of the channel's messages. Raises `struct.error` for entries that were cut."""
        return (time_ns for time_ns, _ in _INDEX_ENTRY.iter_unpack(self.entries))


def _chunks(file: IO[bytes], begin: int = len(MAGIC)) -> Iterator[tuple[mcap.records.Chunk, int, list[_ChunkIndex]]]:
    """Every whole chunk from byte `begin` on, with its place and the indexes behind it; without any of these where the
    file is cut among them."""
    waiting: tuple[mcap.records.Chunk, int] | None = None
    index: list[_ChunkIndex] = []
    file.seek(begin)
    behind = begin
    while len(head := file.read(RECORD.size)) == RECORD.size:
        at, (opcode, length) = behind, RECORD.unpack(head)
        behind = at + RECORD.size + length
        packed = opcode in (mcap.opcode.Opcode.CHUNK, mcap.opcode.Opcode.MESSAGE_INDEX)
        body = file.read(length) if packed and length <= LIMIT else b""
        if length > LIMIT or (packed and len(body) < length):
            index = []
            break
        if opcode == mcap.opcode.Opcode.MESSAGE_INDEX:
            index.append(_ChunkIndex(_INDEX_HEAD.unpack_from(body)[0], body[_INDEX_HEAD.size :]))
            continue
        if waiting is not None:
            yield (*waiting, index)
        waiting = (mcap.records.Chunk.read(ReadDataStream(io.BytesIO(body))), at) if packed else None
        index = []
        if not packed:
            file.seek(length, os.SEEK_CUR)
    if waiting is not None:
        yield (*waiting, index)


def _chunk(
    chunk: tuple[mcap.records.Chunk, int],
    index: Sequence[_ChunkIndex],
    channels: DeclaredChannels,
    bounds: UnpackLimits,
    passed_over: str,
) -> Iterator[Stored]:
    """The messages of a chunk; without their data where its index says that all of them are to be passed over."""
    topics = [channels.topics.get(one.channel, "") for one in index]
    if not passed_over or not index or not all(topic.startswith(passed_over) for topic in topics):
        yield from _messages(chunk[0], channels, chunk[1], bounds)
        return
    for topic, one in zip(topics, index, strict=True):
        for time_ns in one.times:
            bounds.message()
            yield Stored(topic, one.channel, 0, time_ns, b"", chunk[1])


def chunk_messages(path: Path, chunk_at: int) -> Iterator[Stored]:
    """Every message of the chunk that begins at byte `chunk_at`; topics of channels from earlier chunks are ""."""
    with _opened(path) as file:
        chunk, at, _ = next(_chunks(file, chunk_at), (None, chunk_at, []))
        if chunk is not None and at == chunk_at:
            yield from _messages(chunk, DeclaredChannels(), chunk_at, UnpackLimits(path.stat().st_size))


def ends_properly(path: Path) -> bool:
    """Whether the file ends as a finished MCAP file does."""
    with _opened(path) as file:
        file.seek(max(len(MAGIC), path.stat().st_size - len(MAGIC)))
        return file.read() == MAGIC


@contextlib.contextmanager
def reading(path: Path) -> Iterator[IO[bytes]]:
    """The file of a trace, open. Raises `UsageError` where there is none, and where it can be read no further."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise UsageError(
            f"cannot read the trace {path}: it is a pipe or a device",
            hint="a trace is read at several places at once: write it into a file first",
        )
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise UsageError(f"cannot read the trace {path}: {error.strerror}", hint=_other_place(path)) from error


def _other_place(path: Path) -> str:
    """Where the trace may be that was looked for at `path`."""
    if str(path) == "-":
        return "a trace is read from a file, not from standard input"
    inside = path / "trace.mcap"
    return f"name the file in it: {inside}" if inside.is_file() else ""


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    with reading(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise UsageError(f"{path} is not a trace", hint="a trace is an MCAP file such as runs/…/trace.mcap")
        file.seek(0)
        yield file


def _messages(
    chunk: mcap.records.Chunk, channels: DeclaredChannels, chunk_at: int, bounds: UnpackLimits
) -> Iterator[Stored]:
    for record in contents(chunk, bounds, channels.unwanted):
        if isinstance(record, mcap.records.Channel):
            channels.declare(record.id, record.topic)
        else:
            topic = channels.topics.get(record.channel, "")
            yield Stored(topic, record.channel, record.sequence, record.time_ns, record.data, chunk_at)


def _chunk_length(chunk: mcap.records.Chunk) -> int:
    """Bytes of a chunk record in the file: opcode, length, six fixed fields, compression, data (MCAP, op 0x06)."""
    return 1 + 8 + 8 + 8 + 8 + 4 + 4 + len(chunk.compression) + 8 + len(chunk.data)
