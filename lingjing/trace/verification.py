"""Verification of a trace file.

Two checks are combined: the bytes must match their seals (`seal_check`), and the records must be consistent
(`lingjing.trace.digest.verify`: digests, outcome, pixels).
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission.salts import Salt, public_seed, salt_fault
from lingjing.trace.digest import verify
from lingjing.trace.reader import Trace, UnknownFormatError, read_trace
from lingjing.trace.seal_check import SealReport, SignatureState, check_seals

State = Literal["ok", "wrong", "cut", "unreadable"]


class Verification(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a verification."""

    path: str
    state: State
    """`ok`: every byte matches its seal, and the records are consistent. `wrong`: there is a difference or an
    inconsistency. `cut`: everything present is right, but the file ends before its last seal. `unreadable`: the file
    is no trace, or a trace of another version."""
    said: str
    """The result in words, with the first record that differs."""
    signature: SignatureState = "none"


def verify_file(path: str | Path, key: bytes | None = None) -> Verification:
    """Verify one file of any content. Raises `UsageError` if it cannot be opened.

    >>> lingjing.verify("runs/first/trace.mcap").state
    'ok'
    """
    path = Path(path)
    seals = check_seals(path, key)
    state, text = _verdict(path, seals, key)
    return Verification(path=str(path), state=state, said=text, signature=seals.signature)


def check_salt(result: Verification, salt: Salt) -> Verification:
    """Return the result of a verification, `wrong` if the salt has not drawn the instance of the trace."""
    if result.state in ("wrong", "unreadable"):
        return result
    header = read_trace(Path(result.path)).header
    fault = salt_fault(salt, header.fingerprint, header.instance.seed)
    if fault:
        return msgspec.structs.replace(result, state="wrong", said=f"{fault}; {result.said}")
    seed = public_seed(header.fingerprint, header.instance.seed)
    return msgspec.structs.replace(result, said=f"{result.said}; drawn by this salt for seed {seed}")


def _verdict(path: Path, seals: SealReport, key: bytes | None) -> tuple[State, str]:
    """Return the state and its description."""
    if seals.fault:
        return "wrong", seals.fault
    try:
        trace = read_trace(path)
        disagreement = verify(trace, pixels=True)
    except UnknownFormatError as error:
        return "unreadable", str(error)
    except LingjingError as error:
        # sealed records that cannot be read were written by another version
        return ("wrong" if seals.ended else "unreadable"), str(error)
    if disagreement:
        return "wrong", disagreement
    summary = _summary(trace)
    if not seals.seals:
        return "wrong", f"{summary}; its seals are missing"
    if key is not None and seals.signature == "none":
        return "wrong", f"{summary}; as it was sealed, but not signed"
    if not seals.ended:
        return "cut", f"{summary}{_cut_off(trace, seals.loose)}"
    return "ok", f"{summary}; {_SIGNATURES[seals.signature]}"


def _cut_off(trace: Trace, loose: int) -> str:
    """Return the description of the missing end of a cut file."""
    if trace.outcome is not None:
        return f", but no seal covers the outcome: the file was cut in its summary, {loose} bytes are not covered"
    behind = f", {loose} bytes behind the last seal are not covered" if loose else ""
    return f", as they were sealed; the file ends before the episode did{behind}"


_SIGNATURES: dict[SignatureState, str] = {
    "none": "sealed, not signed",
    "good": "sealed and signed with this key",
    "unchecked": "sealed; signed, which --key KEYFILE would check",
    "bad": "",
}


def _summary(trace: Trace) -> str:
    outcome = trace.outcome
    ending = "no outcome" if outcome is None else outcome.reason
    return f"{len(trace.boundaries)} boundaries, {len(trace.frames)} pictures, {ending}"
