"""The MCAP file: channels, messages, flushes; and reading one that may have been cut anywhere.

The only module that imports `mcap`. Chunks are closed at every flush, so a file that was cut reads up to its last
flushed chunk with the plain `mcap` reader as well.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

import mcap.records
import mcap.stream_reader
import mcap.writer

from lingjing.errors import UsageError
from lingjing.trace.chunks import BROKEN, LIMIT, UnpackLimits, contents
from lingjing.trace.seals import MAGIC, SEAL, SealedFile, definition_sum, message_sum

CHUNK_BYTES = 4 * 1024 * 1024


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
        self._file = SealedFile(path.open("xb"), key)
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


def scan(path: Path, passed_over: str = "") -> Iterator[Stored]:
    """Every message up to the file's end or its first damaged place, in file order; a chunk that holds more than it may
    is a damaged place. A chunk all of whose messages are in topics that begin with `passed_over` is not unpacked: its
    messages come without data, in the order of its index.

    Raises `UsageError` if the file cannot be opened or does not begin as an MCAP file.
    """
    channels: dict[int, str] = {}
    with _opened(path) as file:
        bounds = UnpackLimits(path.stat().st_size)
        try:
            for chunk, at, index in _chunks(file):
                yield from _chunk((chunk, at), index, channels, bounds, passed_over)
        except BROKEN:
            return


def _chunks(file: IO[bytes]) -> Iterator[tuple[mcap.records.Chunk, int, list[mcap.records.MessageIndex]]]:
    """Every whole chunk with its place and the indexes behind it; without any where the file is cut among them."""
    waiting: tuple[mcap.records.Chunk, int] | None = None
    index: list[mcap.records.MessageIndex] = []
    try:
        for record in mcap.stream_reader.StreamReader(file, emit_chunks=True, record_size_limit=LIMIT).records:
            if isinstance(record, mcap.records.MessageIndex):
                index.append(record)
                continue
            if waiting is not None:
                yield (*waiting, index)
            at = file.tell()
            waiting = (record, at - _chunk_length(record)) if isinstance(record, mcap.records.Chunk) else None
            index = []
    except BROKEN:
        index = []
    if waiting is not None:
        yield (*waiting, index)


def _chunk(
    chunk: tuple[mcap.records.Chunk, int],
    index: Sequence[mcap.records.MessageIndex],
    channels: dict[int, str],
    bounds: UnpackLimits,
    passed_over: str,
) -> Iterator[Stored]:
    """The messages of a chunk; without their data where its index says that all of them are to be passed over."""
    topics = [channels.get(one.channel_id, "") for one in index]
    if not passed_over or not index or not all(topic.startswith(passed_over) for topic in topics):
        yield from _messages(chunk[0], channels, chunk[1], bounds)
        return
    for topic, one in zip(topics, index, strict=True):
        for time_ns, _ in one.records:
            bounds.message()
            yield Stored(topic, one.channel_id, 0, time_ns, b"", chunk[1])


def chunk_messages(path: Path, chunk_at: int) -> Iterator[Stored]:
    """Every message of the chunk that begins at byte `chunk_at`; topics of channels from earlier chunks are ""."""
    with _opened(path) as file:
        file.seek(chunk_at)
        reader = mcap.stream_reader.StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=LIMIT)
        chunk = next(iter(reader.records))
        if isinstance(chunk, mcap.records.Chunk):
            yield from _messages(chunk, {}, chunk_at, UnpackLimits(path.stat().st_size))


def ends_properly(path: Path) -> bool:
    """Whether the file ends as a finished MCAP file does."""
    with _opened(path) as file:
        file.seek(max(len(MAGIC), path.stat().st_size - len(MAGIC)))
        return file.read() == MAGIC


def _opened(path: Path) -> IO[bytes]:
    try:
        file = path.open("rb")
    except OSError as error:
        raise UsageError(f"cannot read the trace {path}: {error.strerror}") from error
    if file.read(len(MAGIC)) != MAGIC:
        file.close()
        raise UsageError(f"{path} is not a trace", hint="a trace is an MCAP file such as runs/…/trace.mcap")
    file.seek(0)
    return file


def _messages(
    chunk: mcap.records.Chunk, channels: dict[int, str], chunk_at: int, bounds: UnpackLimits
) -> Iterator[Stored]:
    for record in contents(chunk, bounds):
        if isinstance(record, mcap.records.Channel):
            channels[record.id] = record.topic
        else:
            topic = channels.get(record.channel, "")
            yield Stored(topic, record.channel, record.sequence, record.time_ns, record.data, chunk_at)


def _chunk_length(chunk: mcap.records.Chunk) -> int:
    """Bytes of a chunk record in the file: opcode, length, six fixed fields, compression, data (MCAP, op 0x06)."""
    return 1 + 8 + 8 + 8 + 8 + 4 + 4 + len(chunk.compression) + 8 + len(chunk.data)
