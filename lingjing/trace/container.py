"""Writing and reading of the MCAP file.

Only this module, `chunks` and `seal_difference` import `mcap`. Every flush ends a chunk. A file that was cut anywhere
can therefore be read up to its last flushed chunk, with the plain `mcap` reader as well.
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
"""Unpacked size at which the writer ends a chunk, bytes. Chosen; a flush usually ends it earlier."""

_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY = struct.Struct("<QQ")
"""A message index (MCAP, op 0x07): channel and length in bytes, then log time and offset of each message."""


@dataclass(frozen=True, slots=True)
class ContainerSchema:
    """A schema as MCAP stores it."""

    name: str
    encoding: str
    """`jsonschema` or `protobuf`."""
    data: bytes

    @property
    def message_encoding(self) -> str:
        """The MCAP name of the encoding of messages with this schema."""
        return "json" if self.encoding == "jsonschema" else self.encoding


@dataclass(frozen=True, slots=True)
class StoredMessage:
    """One message read from a file."""

    topic: str
    channel: int
    sequence: int
    time_ns: int
    """Simulation time in nanoseconds."""
    data: bytes
    chunk_at: int
    """Byte offset of its chunk in the file."""


class ContainerWriter:
    """Writer of one MCAP file. It creates the file, locks it, and seals it at every flush, signed if there is a `key`.

    Methods raise `OSError` for errors of the file system.
    """

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
        """Write one message. Its log time and publish time are both the simulation time."""
        self.last_ns = max(self.last_ns, time_ns)
        channel = self._channel(topic, schema)
        self._file.note(message_sum(topic, sequence, time_ns, data))
        self._writer.add_message(channel, time_ns, data, time_ns, sequence)

    def end_chunk(self) -> None:
        """End the chunk. Later messages can then be unpacked without the earlier ones."""
        self._writer.flush()

    def flush(self) -> None:
        """End and seal the chunk, and pass all bytes to the operating system. A killed process then loses nothing."""
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
        """Close the file without a summary after a failed write. Idempotent."""
        with contextlib.suppress(OSError):  # the bytes that cannot be flushed are the cause of this call
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
    """Return whether a `ContainerWriter` in any process of this machine has the file open. True if that is unknown."""
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
    """Lock the file while it is open here. The system releases the lock however this process ends.

    A file system without locks is no error: the file is then written unlocked.
    """
    if sys.platform != "win32":
        import fcntl

        with contextlib.suppress(OSError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def scan(path: Path, passed_over: str = "", only: tuple[str, ...] = ("",)) -> Iterator[StoredMessage]:
    """Yield the messages up to the end of the file or its first damaged place, in file order.

    A chunk that exceeds its limits is a damaged place. A chunk is not unpacked if the topics of all its messages begin
    with `passed_over`. Its messages are yielded without data, in the order of its index. From other chunks, only
    messages on topics that begin with one of `only` are yielded.

    Raises `UsageError` if the file cannot be opened or does not begin as an MCAP file.
    """
    for stored, _ in scan_from(path, 0, DeclaredChannels(only), passed_over):
        yield stored


def scan_from(
    path: Path, begin: int, channels: DeclaredChannels, passed_over: str
) -> Iterator[tuple[StoredMessage, int]]:
    """Yield the messages of the chunks from byte `begin` on, as `scan` does, each with the offset behind its chunk.

    A later call may begin at such an offset. `begin` is 0 or such an offset. `channels` are the channels declared
    before it; newly declared ones are added.
    """
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
    """The channels that were declared so far."""

    def __init__(self, only: tuple[str, ...] = ("",)) -> None:
        self._only = only
        self.topics: dict[int, str] = {}
        """Topic by channel number."""
        self.unwanted: set[int] = set()
        """Numbers of the channels with topics that begin with none of `only`."""

    def declare(self, number: int, topic: str) -> None:
        """Add a channel, or change the topic of a known one."""
        self.topics[number] = topic
        self.unwanted.discard(number)
        if not topic.startswith(self._only):
            self.unwanted.add(number)


class _ChunkIndex(NamedTuple):
    """The message index of one channel, which follows its chunk in the file."""

    channel: int
    entries: bytes
    """Encoded pairs of log time and offset."""

    @property
    def times(self) -> Iterator[int]:
        """The log times of the channel's messages in nanoseconds. Raises `struct.error` for cut entries."""
        return (time_ns for time_ns, _ in _INDEX_ENTRY.iter_unpack(self.entries))


def _chunks(file: IO[bytes], begin: int = len(MAGIC)) -> Iterator[tuple[mcap.records.Chunk, int, list[_ChunkIndex]]]:
    """Yield every whole chunk from byte `begin` on, with its offset and the indexes that follow it.

    If the file is cut within these indexes, the chunk is yielded with none of them.
    """
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
) -> Iterator[StoredMessage]:
    """Yield the messages of a chunk, without data if all topics of its index begin with `passed_over`."""
    topics = [channels.topics.get(entry.channel, "") for entry in index]
    if not passed_over or not index or not all(topic.startswith(passed_over) for topic in topics):
        yield from _messages(chunk[0], channels, chunk[1], bounds)
        return
    for topic, entry in zip(topics, index, strict=True):
        for time_ns in entry.times:
            bounds.message()
            yield StoredMessage(topic, entry.channel, 0, time_ns, b"", chunk[1])


def chunk_messages(path: Path, chunk_at: int) -> Iterator[StoredMessage]:
    """Yield the messages of the chunk that begins at byte `chunk_at`. The topic of an earlier chunk's channel is ""."""
    with _opened(path) as file:
        chunk, at, _ = next(_chunks(file, chunk_at), (None, chunk_at, []))
        if chunk is not None and at == chunk_at:
            yield from _messages(chunk, DeclaredChannels(), chunk_at, UnpackLimits(path.stat().st_size))


def ends_properly(path: Path) -> bool:
    """Return whether the file ends as a finished MCAP file does."""
    with _opened(path) as file:
        file.seek(max(len(MAGIC), path.stat().st_size - len(MAGIC)))
        return file.read() == MAGIC


@contextlib.contextmanager
def open_trace(path: Path) -> Iterator[IO[bytes]]:
    """Open the file of a trace for reading. Raises `UsageError` if it is missing or reading fails within the block."""
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
    """Return a hint at the likely place of a trace that was not found at `path`, or ""."""
    if str(path) == "-":
        return "a trace is read from a file, not from standard input"
    inside = path / "trace.mcap"
    return f"name the file in it: {inside}" if inside.is_file() else ""


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    with open_trace(path) as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise UsageError(f"{path} is not a trace", hint="a trace is an MCAP file such as runs/…/trace.mcap")
        file.seek(0)
        yield file


def _messages(
    chunk: mcap.records.Chunk, channels: DeclaredChannels, chunk_at: int, bounds: UnpackLimits
) -> Iterator[StoredMessage]:
    for record in contents(chunk, bounds, channels.unwanted):
        if isinstance(record, mcap.records.Channel):
            channels.declare(record.id, record.topic)
        else:
            topic = channels.topics.get(record.channel, "")
            yield StoredMessage(topic, record.channel, record.sequence, record.time_ns, record.data, chunk_at)


def _chunk_length(chunk: mcap.records.Chunk) -> int:
    """Return the bytes of a chunk record: opcode, length, six fixed fields, compression, data (MCAP, op 0x06)."""
    return 1 + 8 + 8 + 8 + 8 + 4 + 4 + len(chunk.compression) + 8 + len(chunk.data)
