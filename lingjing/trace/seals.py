"""Seals: a hash chain over the bytes of a trace, and its signature (ADR 0017).

A seal is an MCAP metadata record named `lingjing/seal`. One follows the header, every boundary and the outcome. Its
fields are:

- `chain`: the SHA-256 over the previous chain and all bytes from the end of the previous seal (or the beginning of the
  file) to the end of this seal, in which `chain` and `hmac` count as zeros. The last seal, with `end` = `1`, also
  covers the rest of the file. The last chain therefore covers every byte of a whole trace.
- `hmac`: the HMAC-SHA256 of `chain` under a key, if the trace is signed.
- `number`: the number of the seal, from 1.
- `records`: the CRC-32 sums of the records between two seals, in order: every message, schema and channel of a chunk,
  then the chunk and the indexes behind it. The chain detects a difference; the sums only locate it.

Without a key an editor of the file can recompute the chain. An unsigned seal detects damage and careless edits, but no
deliberate forgery.
"""

from __future__ import annotations

import hashlib
import hmac
import mmap
import struct
import zlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import IO

from lingjing.errors import UsageError

SEAL = "lingjing/seal"
"""Name of the metadata record."""

MAGIC = b"\x89MCAP0\r\n"
"""The first and last bytes of an MCAP file."""

RECORD = struct.Struct("<BQ")
"""Head of every MCAP record: opcode and length."""

KEY_BYTES = 16
"""Shortest key, bytes. Chosen: 128 random bits cannot be guessed. RFC 2104 warns that shorter keys weaken the HMAC."""

KEY_MOST = 4096
"""Longest key, bytes. Chosen: a longer file is probably no key file."""

BLANK = "0" * 64
"""Placeholder of a seal's chain and hmac in the bytes that are hashed."""

METADATA = 0x0C
"""The opcode of MCAP's metadata records."""

_HEAD = struct.pack("<I", len(SEAL)) + SEAL.encode()
_CHAIN = struct.pack("<I", 5) + b"chain" + struct.pack("<I", len(BLANK))
_HMAC = struct.pack("<I", 4) + b"hmac" + struct.pack("<I", len(BLANK))
_CHAIN_AT = RECORD.size + len(_HEAD) + 4 + len(_CHAIN)
_HMAC_AT = _CHAIN_AT + len(BLANK) + len(_HMAC)
"""Offsets of the chain and the hmac in a seal. They are its first fields, after the length of all fields."""

_STAMP = struct.Struct("<IQ")
"""Sequence and log time of a message, as they enter its sum."""

_LAST = struct.pack("<I", 3) + b"end"


def chain_hash(before: str = "", signed: str = "") -> hashlib._Hash:
    """Return a running hash for the bytes after a seal with the chain `before` and the hmac `signed`.

    Its hex digest is the next chain.
    """
    return hashlib.sha256(f"{before}{signed}\n".encode())


def signature(chain: str, key: bytes) -> str:
    """Return the HMAC-SHA256 (hex) of a chain."""
    return hmac.new(key, chain.encode(), hashlib.sha256).hexdigest()


def read_key(path: str | Path) -> bytes:
    """Return the content of a key file, without white space at its ends.

    Raises `UsageError` if the file cannot be read, or if the key is too short or too long.
    """
    try:
        with Path(path).open("rb") as file:
            key = file.read(KEY_MOST + 1).strip()
    except OSError as error:
        raise UsageError(f"cannot read the key file {path}: {error.strerror}") from error
    if len(key) < KEY_BYTES:
        raise UsageError(
            f"the key in {path} has {len(key)} bytes: at least {KEY_BYTES} are required",
            hint="make one with `openssl rand -hex 32 > trace.key`",
        )
    if len(key) > KEY_MOST:
        raise UsageError(f"the key in {path} has more than {KEY_MOST} bytes", hint="check that it is a key file")
    return key


def records_of(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the opcode and the bytes (with opcode and length) of each MCAP record in `data`.

    Raises `struct.error` for a cut record.
    """
    at = 0
    while at < len(data):
        opcode, length = RECORD.unpack_from(data, at)
        end = at + RECORD.size + length
        yield opcode, data[at:end]
        at = end


def message_sum(topic: str, sequence: int, time_ns: int, data: bytes) -> int:
    """Return the CRC-32 sum of one message."""
    return zlib.crc32(data, zlib.crc32(_STAMP.pack(sequence, time_ns), _topic_sum(topic)))


@lru_cache(maxsize=1024)
def _topic_sum(topic: str) -> int:
    return zlib.crc32(topic.encode())


def definition_sum(*parts: str | bytes) -> int:
    """Return the CRC-32 sum of a schema (name, encoding, data) or of a channel (topic, encoding, schema number)."""
    total = 0
    for part in parts:
        total = zlib.crc32(part.encode() if isinstance(part, str) else part, total)
    return total


def is_seal(record: bytes) -> bool:
    """Return whether a record is a seal."""
    return record[:1] == bytes([METADATA]) and record.startswith(_HEAD, RECORD.size)


def is_last(record: bytes) -> bool:
    """Return whether a seal is the last one, which also covers the bytes behind it."""
    return _LAST in record


def find_seal(data: mmap.mmap, begin: int) -> int:
    """Return the offset of the first seal at or behind `begin`, or -1. The lengths of other records are not used."""
    at = data.find(_HEAD, begin + RECORD.size)
    while at >= 0 and data[at - RECORD.size] != METADATA:
        at = data.find(_HEAD, at + 1)
    return at - RECORD.size if at >= 0 else -1


def whole_records(data: mmap.mmap) -> Iterator[tuple[int, int]]:
    """Yield begin and end of each whole record of a file, up to the first cut one."""
    at = len(MAGIC)
    while at + RECORD.size <= len(data):
        end = at + RECORD.size + RECORD.unpack_from(data, at)[1]
        if end > len(data):
            return
        yield at, end
        at = end


def with_blank_sums(record: bytes) -> bytes:
    """Return a seal's bytes with `BLANK` for chain and hmac, as they are hashed."""
    return _filled(record, BLANK, BLANK)


def _filled(record: bytes, chain: str, signed: str) -> bytes:
    record = record[:_CHAIN_AT] + chain.encode() + record[_CHAIN_AT + len(BLANK) :]
    if record[_HMAC_AT - len(_HMAC) : _HMAC_AT] != _HMAC:
        return record
    return record[:_HMAC_AT] + signed.encode() + record[_HMAC_AT + len(BLANK) :]


class SealedFile:
    """The output file of a container. It hashes all bytes, sums each record, and fills in the seals."""

    def __init__(self, file: IO[bytes], key: bytes = b"") -> None:
        self._file = file
        self._key = key
        self._number = 0
        self._hash = chain_hash()
        self._sums: list[int] = []
        self._last: tuple[int, bytes] | None = None

    def write(self, data: bytes) -> int:
        """Write whole records or the magic bytes, and return the number of bytes."""
        self._hash.update(data)
        if is_seal(data):
            return self._write_seal(data)
        if data != MAGIC and self._last is None:
            self._sums.extend(zlib.crc32(record) for _, record in records_of(data))
        return self._file.write(data)

    def tell(self) -> int:
        """Return the offset of the next byte."""
        return self._file.tell()

    def flush(self) -> None:
        """Pass all bytes to the operating system."""
        self._file.flush()

    def note(self, total: int) -> None:
        """Add the sum of a record inside the next chunk, which passes `write` in compressed form."""
        self._sums.append(total)

    def fields(self, *, last: bool = False) -> dict[str, str]:
        """Return the fields of the next seal in their order, with blank chain and hmac."""
        sums, self._sums = "".join(f"{total:08x}" for total in self._sums), []
        signed = {"hmac": BLANK} if self._key else {}
        ends = {"end": "1"} if last else {}
        self._number += 1
        return {"chain": BLANK, **signed, "number": str(self._number), **ends, "records": sums}

    def close(self) -> None:
        """Fill in the last seal, which covers the bytes behind it, and close the file."""
        if self._last is not None:
            at, record = self._last
            self._file.seek(at)
            self._file.write(self._fill(record))
        self._file.close()

    def abort(self) -> None:
        """Close the file without filling in the last seal."""
        self._file.close()

    def _write_seal(self, record: bytes) -> int:
        if is_last(record):
            self._last = self.tell(), record
            return self._file.write(record)
        return self._file.write(self._fill(record))

    def _fill(self, record: bytes) -> bytes:
        """Return the seal with its chain and hmac, and start the hash of the next seal."""
        chain = self._hash.hexdigest()
        signed = signature(chain, self._key) if self._key else ""
        self._hash = chain_hash(chain, signed)
        return _filled(record, chain, signed)
