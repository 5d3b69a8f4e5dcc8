"""Comparison of the bytes of a file with its seals.

One pass hashes the file without unpacking it. Chunks are unpacked only after a seal has failed, to find the first
record that differs.
"""

from __future__ import annotations

import hmac
import mmap
from pathlib import Path
from typing import Literal, NamedTuple

from lingjing.errors import UsageError
from lingjing.trace.container import open_trace
from lingjing.trace.seal_difference import first_difference, seal_fields, sealed_part
from lingjing.trace.seals import (
    MAGIC,
    RECORD,
    chain_hash,
    find_seal,
    is_last,
    is_seal,
    signature,
    whole_records,
    with_blank_sums,
)

SignatureState = Literal["none", "good", "bad", "unchecked"]
"""The state of a signature: not signed; valid or invalid under the key; signed, but without a key to check it."""


class SealReport(NamedTuple):
    """The result of the comparison of a file with its seals."""

    seals: int = 0
    """Number of valid seals from the beginning of the file."""
    fault: str = ""
    """The first record that differs from its seal, in words; "" if none differs."""
    ended: bool = False
    """True if the last seal is present."""
    loose: int = 0
    """Number of bytes behind the last valid seal. 0 if there is a fault."""
    signature: SignatureState = "none"
    """The state of the signatures of all seals under the key."""


def check_seals(path: Path, key: bytes | None = None) -> SealReport:
    """Compare a file's bytes with its seals. Raises `UsageError` if it cannot be read."""
    try:
        with open_trace(path) as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _checked(data, key)
    except ValueError as error:  # mmap refuses an empty file
        raise UsageError(f"{path} is not a trace: it is empty") from error


def last_chain(path: Path) -> str:
    """Return the chain of the last seal, a hash over every byte of a whole trace; "" if the file has no last seal.

    The bytes are not compared with it: `check_seals` does. Raises `UsageError` if the file cannot be read.
    """
    try:
        with open_trace(path) as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            seals = (data[at:end] for at, end in whole_records(data) if is_seal(data[at : min(end, at + 64)]))
            return next((seal_fields(record).get("chain", "") for record in seals if is_last(record)), "")
    except ValueError as error:
        raise UsageError(f"{path} is not a trace: it is empty") from error


def _checked(data: mmap.mmap, key: bytes | None) -> SealReport:
    """Check one seal after the other, up to the first invalid one."""
    begin, running, states = 0, chain_hash(), list[SignatureState]()
    for at, end in whole_records(data):
        if not is_seal(data[at : min(end, at + 64)]):
            continue
        record = data[at:end]
        fields, last = seal_fields(record), is_last(record)
        running.update(memoryview(data)[begin:at])
        running.update(with_blank_sums(record))
        if last:
            running.update(memoryview(data)[end:])
        chain, number = running.hexdigest(), len(states) + 1
        if fields.get("number") != str(number) or fields.get("chain") != chain:
            fault = first_difference(data, (begin, at, end), number, fields)
            loose = 0 if fault else len(data) - begin
            return SealReport(len(states), fault, loose=loose, signature=_all(states))
        states.append(_signed(fields, key))
        if states[-1] == "bad":
            fault = f"{sealed_part(number, last=last)}: it is not signed with this key"
            return SealReport(len(states), fault, signature="bad")
        begin, running = end, chain_hash(chain, fields.get("hmac", ""))
        if last:
            return SealReport(len(states), ended=True, signature=_all(states))
    return _open_end(data, begin, len(states), _all(states))


def _open_end(data: mmap.mmap, begin: int, seals: int, signed: SignatureState) -> SealReport:
    """Return the report of a file without a last seal.

    The file was cut, unless there is another seal behind the last readable record: then that record is damaged.
    """
    further, finished = find_seal(data, begin), data[-len(MAGIC) :] == MAGIC
    if further < 0:
        fault = "the outcome: its seal is missing or damaged" if seals and finished else ""
        return SealReport(seals, fault, loose=len(data) - begin, signature=signed)
    end = further + RECORD.size + RECORD.unpack_from(data, further)[1]
    if end > len(data) and not finished and find_seal(data, further + 1) < 0:  # the write of that seal was interrupted
        return SealReport(seals, loose=len(data) - begin, signature=signed)
    end = min(end, len(data))
    fault = first_difference(data, (begin, further, end), seals + 1, seal_fields(data[further:end]))
    return SealReport(seals, fault, signature=signed)


def _signed(fields: dict[str, str], key: bytes | None) -> SignatureState:
    if "hmac" not in fields:
        return "none"
    if key is None:
        return "unchecked"
    expected = signature(fields["chain"], key).encode()
    return "good" if hmac.compare_digest(expected, fields["hmac"].encode()) else "bad"


def _all(states: list[SignatureState]) -> SignatureState:
    return states[-1] if states else "none"
