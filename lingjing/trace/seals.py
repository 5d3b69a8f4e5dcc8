"""The hash chain over a trace's own bytes, and its signature (ADR 0017).

A seal is an MCAP metadata record named `lingjing/seal`. One follows the header, every boundary and the outcome. Its
`chain` is the SHA-256 over the chain before and every byte of the file between the end of the seal before (or the
beginning of the file) and its own end, its own `chain` and `hmac` read as zeros; the last one, with `end` = `1`, covers
the rest of the file too. So every byte of a whole trace is under the last chain, whatever it means.

`records` are the CRC-32 sums of what stands between two seals, in order: every message, schema and channel of a chunk,
then the chunk and the indexes behind it. They only say where a difference lies; that there is one the chain says.

`hmac` is the HMAC-SHA256 of `chain` under a key, if the trace is signed. Without a key whoever edits a trace can
compute the chain anew: it shows damage and careless edits, not the work of somebody who knows this page.
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
"""What an MCAP file begins and ends with."""

RECORD = struct.Struct("<BQ")
"""Opcode and length before every MCAP record."""

KEY_BYTES = 16
"""A key is at least so long: 128 bits, as RFC 2104 wants no shorter secret than is safe."""

KEY_MOST = 4096
"""Bytes of a key file: more is another file."""

BLANK = "0" * 64
"""What stands for a seal's chain and hmac in the bytes that are hashed."""

METADATA = 0x0C
"""The opcode of MCAP's metadata records."""

_HEAD = struct.pack("<I", len(SEAL)) + SEAL.encode()
_CHAIN = struct.pack("<I", 5) + b"chain" + struct.pack("<I", len(BLANK))
_HMAC = struct.pack("<I", 4) + b"hmac" + struct.pack("<I", len(BLANK))
_CHAIN_AT = RECORD.size + len(_HEAD) + 4 + len(_CHAIN)
_HMAC_AT = _CHAIN_AT + len(BLANK) + len(_HMAC)
"""Where a seal's two sums are in its bytes: its first fields, after the length of them all."""

_STAMP = struct.Struct("<IQ")

_LAST = struct.pack("<I", 3) + b"end"


def chain_hash(before: str = "", signed: str = "") -> hashlib._Hash:
    """What the bytes after a seal with the chain `before` and the hmac `signed` are fed to; its hex digest is the next
    chain."""
    return hashlib.sha256(f"{before}{signed}\n".encode())


def signature(chain: str, key: bytes) -> str:
    """The `hmac` of a chain."""
    return hmac.new(key, chain.encode(), hashlib.sha256).hexdigest()


def read_key(path: str | Path) -> bytes:
    """The key in a file: all its bytes but white space at the ends. Raises `UsageError` if it is too short or too
    long."""
    try:
        with Path(path).open("rb") as file:
            key = file.read(KEY_MOST + 1).strip()
    except OSError as error:
        raise UsageError(f"cannot read the key file {path}: {error.strerror}") from error
    if len(key) < KEY_BYTES:
        raise UsageError(
            f"the key in {path} has {len(key)} bytes: at least {KEY_BYTES} are due",
            hint="make one with `openssl rand -hex 32 > trace.key`",
        )
    if len(key) > KEY_MOST:
        raise UsageError(f"the key in {path} has more than {KEY_MOST} bytes", hint="is it a key file?")
    return key


def records_of(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and bytes (opcode and length included) of each MCAP record in `data`. Raises `struct.error`."""
    at = 0
    while at < len(data):
        opcode, length = RECORD.unpack_from(data, at)
        end = at + RECORD.size + length
        yield opcode, data[at:end]
        at = end


def message_sum(topic: str, sequence: int, time_ns: int, data: bytes) -> int:
    """The sum of one message."""
    return zlib.crc32(data, zlib.crc32(_STAMP.pack(sequence, time_ns), _topic_sum(topic)))


@lru_cache(maxsize=1024)
def _topic_sum(topic: str) -> int:
    return zlib.crc32(topic.encode())


def definition_sum(*parts: str | bytes) -> int:
    """The sum of a schema (name, encoding, data) or of a channel (topic, encoding, its schema's number)."""
    total = 0
    for part in parts:
        total = zlib.crc32(part.encode() if isinstance(part, str) else part, total)
    return total


def is_seal(record: bytes) -> bool:
    """Whether a record's bytes are those of a seal."""
    return record[:1] == bytes([METADATA]) and record.startswith(_HEAD, RECORD.size)


def is_last(record: bytes) -> bool:
    """Whether a seal covers what comes after it too."""
    return _LAST in record


def find_seal(data: mmap.mmap, begin: int) -> int:
    """Where the first seal from `begin` on stands, whatever the records before it say; -1 if nowhere."""
    at = data.find(_HEAD, begin + RECORD.size)
    while at >= 0 and data[at - RECORD.size] != METADATA:
        at = data.find(_HEAD, at + 1)
    return at - RECORD.size if at >= 0 else -1


def whole_records(data: mmap.mmap) -> Iterator[tuple[int, int]]:
    """Begin and end of each whole record of a file, up to the first that is none."""
    at = len(MAGIC)
    while at + RECORD.size <= len(data):
        end = at + RECORD.size + RECORD.unpack_from(data, at)[1]
        if end > len(data):
            return
        yield at, end
        at = end


def blanked(record: bytes) -> bytes:
    """A seal's bytes as they are hashed."""
    return _filled(record, BLANK, BLANK)


def _filled(record: bytes, chain: str, signed: str) -> bytes:
    record = record[:_CHAIN_AT] + chain.encode() + record[_CHAIN_AT + len(BLANK) :]
    if record[_HMAC_AT - len(_HMAC) : _HMAC_AT] != _HMAC:
        return record
    return record[:_HMAC_AT] + signed.encode() + record[_HMAC_AT + len(BLANK) :]


class SealedFile:
    """The file that a container is written through: it hashes what passes, sums each record, and fills in the seals.

    `fields` are those of the seal that is to be written next, `note` adds the sums of what passes packed.
    """

    def __init__(self, file: IO[bytes], key: bytes = b"") -> None:
        self._file = file
        self._key = key
        self._number = 0
        self._hash = chain_hash()
        self._sums: list[int] = []
        self._last: tuple[int, bytes] | None = None

    def write(self, data: bytes) -> int:
        """Write whole records, or the magic bytes."""
        self._hash.update(data)
        if is_seal(data):
            return self._write_seal(data)
        if data != MAGIC and self._last is None:
            self._sums.extend(zlib.crc32(record) for _, record in records_of(data))
        return self._file.write(data)

    def tell(self) -> int:
        """Where the next byte goes."""
        return self._file.tell()

    def flush(self) -> None:
        """Hand everything to the operating system."""
        self._file.flush()

    def note(self, total: int) -> None:
        """The sum of something inside the chunk that comes next."""
        self._sums.append(total)

    def fields(self, *, last: bool = False) -> dict[str, str]:
        """The next seal's fields in their order, its chain and hmac still blank."""
        sums, self._sums = "".join(f"{total:08x}" for total in self._sums), []
        signed = {"hmac": BLANK} if self._key else {}
        ends = {"end": "1"} if last else {}
        self._number += 1
        return {"chain": BLANK, **signed, "number": str(self._number), **ends, "records": sums}

    def close(self) -> None:
        """Fill in the last seal, which covers what came after it, and close the file."""
        if self._last is not None:
            at, record = self._last
            self._file.seek(at)
            self._file.write(self._fill(record))
        self._file.close()

    def abort(self) -> None:
        """Close the file as it is."""
        self._file.close()

    def _write_seal(self, record: bytes) -> int:
        if is_last(record):
            self._last = self.tell(), record
            return self._file.write(record)
        return self._file.write(self._fill(record))

    def _fill(self, record: bytes) -> bytes:
        """The seal with its chain, from which the next one goes on."""
        chain = self._hash.hexdigest()
        signed = signature(chain, self._key) if self._key else ""
        self._hash = chain_hash(chain, signed)
        return _filled(record, chain, signed)
