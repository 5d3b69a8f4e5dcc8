"""A small file that unpacks to gigabytes is read up to the harmful chunk, in little memory."""

import json
import struct
import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zstandard

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.testing import sea_rescue
from lingjing.trace.chunks import LIMIT
from lingjing.trace.container import MAGIC, scan

READ = """
import json, resource, sys
from pathlib import Path
from lingjing import read as read_trace
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
trace = read_trace(Path(sys.argv[1]))
grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(json.dumps({"boundaries": len(trace.boundaries), "complete": trace.complete, "grown": grown}))
"""

ROOM = 900_000
"""Largest allowed growth of a process that reads, in kilobytes: the longest chunk, packed and unpacked."""

CHUNK, MESSAGE, CHANNEL, METADATA = 0x06, 0x05, 0x04, 0x0C


def record(opcode: int, data: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(data)) + data


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def chunk(packed: bytes, size: int, *, crc: int = 0, compression: str = "zstd") -> bytes:
    """Return a chunk record that declares `size` bytes."""
    return record(
        CHUNK, struct.pack("<QQQI", 0, 0, size, crc) + text(compression) + struct.pack("<Q", len(packed)) + packed
    )


def pack(pieces: Iterator[bytes]) -> bytes:
    """Return one zstandard frame, compressed piece by piece."""
    packer = zstandard.ZstdCompressor(level=3).compressobj()
    return b"".join([*map(packer.compress, pieces), packer.flush()])


def channel(number: int, topic: str) -> bytes:
    return record(CHANNEL, struct.pack("<HH", number, 0) + text(topic) + text("json") + struct.pack("<I", 0))


def message(number: int, data: bytes = b"") -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", number, 0, 0, 0) + data)


SPACES = b" " * (32 * 1024 * 1024)
HUGE = 40
"""Pieces of `SPACES`: 1.3 GB."""


def one_huge_record() -> Iterator[bytes]:
    yield struct.pack("<BQ", METADATA, HUGE * len(SPACES))
    for _ in range(HUGE):
        yield SPACES


def many_messages(data: bytes, gigabytes: float) -> bytes:
    some = message(99, data) * (len(SPACES) // len(message(99, data)))
    return pack(some for _ in range(round(gigabytes * 2**30 / len(some))))


def bombs() -> dict[str, bytes]:
    huge = pack(one_huge_record())
    size = 9 + HUGE * len(SPACES)
    small = many_messages(b"", 0.2)
    words = np.zeros((6_000_000, 3), "<u4")  # the length of a key, the key and the length of its value
    words[:, 0], words[:, 1] = 4, np.arange(len(words))
    texts = words.tobytes()
    body = struct.pack("<HH", 7, 0) + text("/x") + text("json") + struct.pack("<I", len(texts)) + texts
    names = zstandard.compress(record(CHANNEL, body))
    deep = channel(1, "/lingjing/boundary") + message(1, b"[" * 1_000_000)
    many = zstandard.compress(SPACES)
    return {
        "a chunk of 1.3 GB": chunk(huge, size),
        "a chunk of 1.3 GB that declares 100 bytes": chunk(huge, 100),
        "a chunk of 1.3 GB that declares the limit": chunk(huge, LIMIT),
        "a chunk of millions of messages": chunk(
            small, len(zstandard.ZstdDecompressor().decompressobj().decompress(small))
        ),
        "hundreds of chunks": chunk(many, len(SPACES)) * 300,
        "deep JSON": chunk(zstandard.compress(deep), len(deep)),
        "a channel with millions of texts": chunk(names, len(zstandard.ZstdDecompressor().decompress(names))),
        "an unknown compression": chunk(huge, size, compression="lz4"),
        "a missing chunk of declared length": struct.pack("<BQ", CHUNK, 2**62),
        "a missing attachment of declared length": struct.pack("<BQ", 0x09, LIMIT - 1),
    }


BOMBS = (
    "a chunk of 1.3 GB",
    "a chunk of 1.3 GB that declares 100 bytes",
    "a chunk of 1.3 GB that declares the limit",
    "a chunk of millions of messages",
    "hundreds of chunks",
    "deep JSON",
    "a channel with millions of texts",
    "an unknown compression",
    "a missing chunk of declared length",
    "a missing attachment of declared length",
)


@pytest.fixture(scope="module")
def hostile() -> dict[str, bytes]:
    """Return the files by their names; packing them takes seconds."""
    made = bombs()
    assert tuple(made) == BOMBS
    return made


@pytest.mark.parametrize("name", BOMBS)
def test_a_decompression_bomb_ends_the_reading_and_earlier_boundaries_are_kept(
    name: str, hostile: dict[str, bytes], trace: Trace, tmp_path: Path
) -> None:
    """Without limits, each file takes gigabytes or minutes; the suite's time limit would end the test."""
    path = tmp_path / "t.mcap"
    path.write_bytes(_before_the_summary(trace) + hostile[name] + MAGIC)
    if name == "deep JSON":
        with pytest.raises(UsageError, match="cannot read"):
            read_trace(path)
        return
    done = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, check=True)
    result = json.loads(done.stdout)
    assert result["boundaries"] == len(trace.boundaries)
    assert result["grown"] < ROOM


def _before_the_summary(trace: Trace) -> bytes:
    """Return the file up to the end of its last chunk before the outcome."""
    data = trace.path.read_bytes()
    last = max(stored.chunk_at for stored in scan(trace.path))
    return data[:last]


def test_records_that_unpack_to_more_than_the_limit_of_a_trace_are_rejected(trace: Trace, tmp_path: Path) -> None:
    boundary = next(stored.data for stored in scan(trace.path) if stored.topic == "/lingjing/boundary")
    padded = boundary[:-1] + b" " * (30 * 2**20) + b"}"
    data = channel(9, "/lingjing/boundary") + message(9, padded) * 3
    path = tmp_path / "t.mcap"
    path.write_bytes(MAGIC + chunk(zstandard.compress(data), len(data)))
    with pytest.raises(UsageError, match="more records than a trace of its size"):
        read_trace(path)


def test_a_chunk_is_checked_against_its_checksum(tmp_path: Path) -> None:
    data = channel(1, "/x") + message(1, b"hi")
    for crc, expected in ((zlib.crc32(data), [b"hi"]), (1, [])):
        path = tmp_path / f"{crc}.mcap"
        path.write_bytes(MAGIC + chunk(zstandard.compress(data), len(data), crc=crc))
        assert [stored.data for stored in scan(path)] == expected


def test_an_uncompressed_chunk_is_read(tmp_path: Path) -> None:
    data = channel(1, "/x") + message(1, b"hi")
    path = tmp_path / "t.mcap"
    path.write_bytes(MAGIC + chunk(data, len(data), compression=""))
    assert [(stored.topic, stored.data) for stored in scan(path)] == [("/x", b"hi")]
    path.write_bytes(MAGIC + chunk(data, len(data) + 1, compression=""))
    assert not list(scan(path))


def test_the_most_compressible_trace_stays_within_the_bounds(tmp_path: Path) -> None:
    """The most compressible file that the writer produces has black pictures and no motion."""
    path = tmp_path / "t.mcap"
    sea_rescue.write_episode(path, ticks=40, depth=True)
    packed = path.stat().st_size
    plain = sum(len(stored.data) for stored in scan(path))
    assert plain / packed < 500
    assert sum(1 for _ in scan(path)) < packed / 16


def test_an_impossible_chunk_length_ends_the_reading_and_earlier_chunks_are_kept(trace: Trace, tmp_path: Path) -> None:
    """A length of 2**63 or more cannot be used as an index. The chunk before it is read all the same."""
    good = channel(1, "/x") + message(1, b"hi")
    whole = chunk(zstandard.compress(good), len(good))
    for length in (2**63, 2**64 - 1, 2**32):
        head = struct.pack("<QQQI", 0, 0, 10, 0) + text("zstd") + struct.pack("<Q", length)
        (tmp_path / "t.mcap").write_bytes(MAGIC + whole + record(CHUNK, head) + MAGIC)
        assert [stored.data for stored in scan(tmp_path / "t.mcap")] == [b"hi"]
