"""`verify_file`: whether a trace is what was written, or the first record of it that is not.

Two things are compared: the bytes with their seals (`seal_check`) and the records with each other
(`lingjing.trace.digest.verify`: digests, outcome, pixels).
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from lingjing.errors import LingjingError
from lingjing.trace.digest import verify
from lingjing.trace.reader import Trace, UnknownFormatError, read_trace
from lingjing.trace.seal_check import SealReport, SignatureState, check_seals

State = Literal["ok", "wrong", "cut", "unreadable"]


class Verification(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of a file, in words in `said`.

    `ok`: every byte is as it was sealed and the records agree with each other; `wrong`: `said` names the first that is
    not or does not; `cut`: all that is there is right, but the file ends before its last seal;
    `unreadable`: no trace, or another version's.

    `signature` is `good` or `bad` under the key that was given, `unchecked` without one.
    """

    path: str
    state: State
    said: str
    signature: SignatureState = "none"


def verify_file(path: str | Path, key: bytes | None = None) -> Verification:
    """Verify one file, whatever is in it. Raises `UsageError` if it cannot be opened."""
    path = Path(path)
    seals = check_seals(path, key)
    state, said = _verdict(path, seals, key)
    return Verification(path=str(path), state=state, said=said, signature=seals.signature)


def _verdict(path: Path, seals: SealReport, key: bytes | None) -> tuple[State, str]:
    if seals.fault:
        return "wrong", seals.fault
    try:
        trace = read_trace(path)
        disagreement = verify(trace, pixels=True)
    except UnknownFormatError as error:
        return "unreadable", str(error)
    except LingjingError as error:
        # what is sealed and cannot be read was written so, by another version
        return ("wrong" if seals.ended else "unreadable"), str(error)
    if disagreement:
        return "wrong", disagreement
    held = _held(trace)
    if not seals.seals:
        return "wrong", f"{held}; its seals are missing"
    if key is not None and seals.signature == "none":
        return "wrong", f"{held}; as it was sealed, but not signed"
    if not seals.ended:
        return "cut", f"{held}{_cut_off(trace, seals.loose)}"
    return "ok", f"{held}; {_SIGNATURES[seals.signature]}"


def _cut_off(trace: Trace, loose: int) -> str:
    """What a file that was cut no longer shows."""
    if trace.outcome is not None:
        return f", whose outcome no seal covers any more: the file ends in its summary, {loose} bytes are not covered"
    behind = f", {loose} bytes behind its last seal are not covered" if loose else ""
    return f", as they were sealed; the file ends before the episode did{behind}"


_SIGNATURES: dict[SignatureState, str] = {
    "none": "sealed, not signed",
    "good": "sealed and signed with this key",
    "unchecked": "sealed; signed, which --key KEYFILE would check",
    "bad": "",
}


def _held(trace: Trace) -> str:
    outcome = trace.outcome
    ending = "no outcome" if outcome is None else outcome.reason
    return f"{len(trace.boundaries)} boundaries, {len(trace.frames)} pictures, {ending}"
