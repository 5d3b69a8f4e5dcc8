"""Bounded unpacking of one MCAP chunk from an untrusted file.

A few bytes can unpack to gigabytes and hold millions of messages. The declared size of a chunk is therefore checked
before unpacking, and the unpacked data must match the declaration. The limits of a whole file grow with its size
(`UnpackLimits`).
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
"""Longest record, packed or unpacked, bytes. Chosen above every record that `TraceWriter` writes. Without it a damaged
length would make the reader allocate gigabytes."""

RATIO = 5000
"""Highest ratio of unpacked bytes, beyond `LIMIT`, to the file's size. Chosen well above measured ratios: up to 20 in
recorded episodes, some hundreds with black pictures and empty depth. Every boundary ends a chunk, and its frame, index
and pictures are incompressible."""

INDEX_BYTES = 16
"""Size of an MCAP index entry (MCAP, op 0x07). The file has one per message, outside of the chunk and uncompressed, so
the file's size bounds the number of messages."""

UNINDEXED = 200_000
"""Messages allowed beyond those in the index, because the index of the last chunk may be cut off. The number is about
that of the shortest messages that fill a chunk of `container.CHUNK_BYTES`."""

CHANNEL_BYTES = 2**16
"""Longest channel record, bytes. Chosen: it holds a topic and a map, and decoding a map of a hundred megabytes would
make gigabytes of strings."""

_RECORD = struct.Struct("<BQ")
MESSAGE = struct.Struct("<HIQQ")
"""Header of an MCAP message: channel, sequence, log time, publish time."""


class ChunkError(ValueError):
    """A chunk exceeds a limit, or its content differs from its declaration."""


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
"""The exceptions that reading a cut or damaged file raises."""


class UnpackLimits:
    """The remaining budget of unpacked bytes and messages for a file of a given size."""

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
    """A message in a chunk."""

    channel: int
    sequence: int
    time_ns: int
    """Log time: simulation time in nanoseconds."""
    data: bytes


def contents(
    chunk: mcap.records.Chunk, bounds: UnpackLimits, unwanted: Container[int] = ()
) -> Iterator[mcap.records.Channel | ChunkMessage]:
    """Yield the channels and messages of a chunk, in order, without the messages of channels in `unwanted`.

    The caller may add to `unwanted` during the iteration. Raises one of `BROKEN` for a damaged chunk.
    """
    bounds.take(chunk)
    data = unpack(chunk)
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
    """Parse a channel record. Raises `ChunkError` if it is longer than `CHANNEL_BYTES`."""
    if len(body) > CHANNEL_BYTES:
        raise ChunkError(f"a channel record has {len(body)} bytes, more than {CHANNEL_BYTES}")
    return mcap.records.Channel.read(mcap.data_stream.ReadDataStream(io.BytesIO(body)))


def unpack(chunk: mcap.records.Chunk, *, checked: bool = True) -> bytes:
    """Return the unpacked bytes of a chunk.

    Raises `ChunkError` if they are more than `LIMIT`, or not as many as declared, or, if `checked`, if their CRC-32
    differs from the declared one.
    """
    size = chunk.uncompressed_size
    if size > LIMIT:
        raise ChunkError(f"a chunk has {size} bytes, more than {LIMIT}")
    data = _decompressed(chunk, size + 1)  # one byte more than declared reveals a longer content
    if len(data) != size:
        raise ChunkError(f"a chunk does not have the {size} bytes that it declares")
    if checked and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ChunkError("a chunk is damaged")
    return data


def _decompressed(chunk: mcap.records.Chunk, most: int) -> bytes:
    """Return the first `most` unpacked bytes."""
    if not chunk.compression:
        return bytes(chunk.data[:most])
    if chunk.compression != "zstd":
        raise ChunkError(f"a chunk has the unknown compression {chunk.compression[:20]}")
    with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
        return bytes(reader.read(most))
