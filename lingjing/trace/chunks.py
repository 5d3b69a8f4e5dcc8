"""The messages of one MCAP chunk, whoever wrote it: unpacked and walked through within bounds.

A few bytes can unpack to gigabytes and hold millions of messages. What a chunk declares is looked at before anything is
unpacked, and what comes out must be what it declared; what a whole file may hold grows with its size (`UnpackLimits`).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Container, Iterator
from dataclasses import dataclass

import mcap.data_stream
import mcap.exceptions
import mcap.opcode
import mcap.records
import mcap.stream_reader
import zstandard

LIMIT = 2**28
"""Bytes. No record of ours is longer, packed or not; a damaged length must not make a reader ask for gigabytes."""

RATIO = 5000
"""How often a file's own size it may unpack to, beyond `LIMIT`. Every boundary ends a chunk, whose frame, index and
pictures are incompressible: what runs leave reaches 20, black pictures with empty depth some hundreds."""

INDEX_BYTES = 16
"""Of the index entry that MCAP keeps in the file for each message, outside of the chunk and unpacked."""

UNINDEXED = 200_000
"""Messages that a chunk may hold whose index was cut off: as many of the shortest ones as fill a chunk of ours."""

CHANNEL_BYTES = 2**16
"""What a channel's record may hold: its topic and a map, of which a hundred megabytes become gigabytes of texts."""

_RECORD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
"""What stands before the data of an MCAP message: channel, sequence, log time, publish time."""


class ChunkError(ValueError):
    """A chunk is no chunk of ours: it holds more than it may, or something else than it says."""


BROKEN = (
    ChunkError,
    mcap.exceptions.McapError,
    mcap.stream_reader.CRCValidationError,
    zstandard.ZstdError,
    struct.error,
    zlib.error,
    EOFError,
    ValueError,
    MemoryError,
    OverflowError,
)
"""What reading past a cut or a damaged place raises."""


class UnpackLimits:
    """What a file of a given size may still unpack to."""

    def __init__(self, file_bytes: int) -> None:
        self._bytes = LIMIT + RATIO * file_bytes
        self._messages = UNINDEXED + file_bytes // INDEX_BYTES

    def take(self, chunk: mcap.records.Chunk) -> None:
        """Count a chunk's bytes. Raises `ChunkError` if the file would hold too many."""
        self._bytes -= chunk.uncompressed_size
        if self._bytes < 0:
            raise ChunkError("the file unpacks to more than a trace of its size")

    def message(self) -> None:
        """Count a message. Raises `ChunkError` if the file holds too many."""
        self._messages -= 1
        if self._messages < 0:
            raise ChunkError("the file holds more messages than a trace of its size")


@dataclass(frozen=True, slots=True)
class ChunkMessage:
    """A message as the chunk has it; times in nanoseconds."""

    channel: int
    sequence: int
    time_ns: int
    data: bytes


def contents(
    chunk: mcap.records.Chunk, bounds: UnpackLimits, unwanted: Container[int] = ()
) -> Iterator[mcap.records.Channel | ChunkMessage]:
    """The channels and messages of a chunk, in order, but for messages of channels that are `unwanted` by then. Raises
    `ChunkError`, or what parsing a damaged place raises."""
    bounds.take(chunk)
    data = unpacked(chunk)
    at = 0
    while at < len(data):
        opcode, length = _RECORD.unpack_from(data, at)
        begin, at = at + _RECORD.size, at + _RECORD.size + length
        if at > len(data):
            raise ChunkError("a record is longer than its chunk")
        if opcode == mcap.opcode.Opcode.MESSAGE:
            bounds.message()
            channel, sequence, time_ns, _ = MESSAGE.unpack_from(data, begin)
            if channel not in unwanted:
                yield ChunkMessage(channel, sequence, time_ns, data[begin + MESSAGE.size : at])
        elif opcode == mcap.opcode.Opcode.CHANNEL:
            bounds.message()
            yield channel_of(data[begin:at])


def channel_of(body: bytes) -> mcap.records.Channel:
    """The channel of a record's bytes. Raises `ChunkError` if they are more than `CHANNEL_BYTES`."""
    if len(body) > CHANNEL_BYTES:
        raise ChunkError(f"a channel of {len(body)} bytes")
    return mcap.records.Channel.read(mcap.data_stream.ReadDataStream(io.BytesIO(body)))


def unpacked(chunk: mcap.records.Chunk, *, checked: bool = True) -> bytes:
    """A chunk's bytes. Raises `ChunkError` if there are more than `LIMIT`, more or fewer than it declares, or, if
    `checked`, others than its sum says."""
    size = chunk.uncompressed_size
    if size > LIMIT:
        raise ChunkError(f"a chunk of {size} bytes")
    data = _taken(chunk, size + 1)  # one byte more shows that there is more
    if len(data) != size:
        raise ChunkError(f"a chunk of other than the {size} bytes that it declares")
    if checked and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ChunkError("a chunk is damaged")
    return data


def _taken(chunk: mcap.records.Chunk, most: int) -> bytes:
    if not chunk.compression:
        return bytes(chunk.data[:most])
    if chunk.compression != "zstd":
        raise ChunkError(f"a chunk packed as {chunk.compression[:20]}")
    with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
        return bytes(reader.read(most))
