"""Rows as evidence: the seal of a row's trace, contradictions within a row, and the marks of an audit.

ADR 0058 says what a row proves.

A row names the last seal of its trace, a hash over every byte of it. So a kept trace can be neither edited nor
exchanged without a difference to the row. The row itself is protected by nothing but its audit (`auditing`): the
evaluator keeps the hashes of the rows that were checked, and an edited row is not among them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.bench.rows import SuiteRow
from lingjing.decoding import from_json
from lingjing.errors import LingjingError, UsageError
from lingjing.play.report import ABORTED, INTERRUPTED

AuditMark = Literal["checked", "replayed"]
"""`checked`: the kept trace confirms the row. `replayed`: fresh engines confirm the trace too."""

AUDIT = "audit.json"
"""The file of an audit in a results folder. Beside `NAME.parquet` it is `NAME.audit.json`."""

_HINT = "`lingjing bench audit RESULTS` names every such row; play these episodes again"


class AuditRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The result of an audit, as it is stored beside the rows."""

    rows: dict[str, AuditMark]
    """The confirmed rows, by `row_sha256`."""
    faults: dict[str, str] = {}
    """The rows that are not what they claim, by `row_sha256`, with the reason."""
    unchecked: dict[str, int] = {}
    """The reasons for which rows could not be checked, with the number of rows."""
    share: float = 0.0
    """The share of the checked rows that were replayed."""
    code: str = ""
    """The SHA-256 of the code that audited."""


def row_sha256(row: SuiteRow) -> str:
    """Return the hash of a row. The attention IoU is read from files beside the trace and has no part in it."""
    plain = msgspec.json.encode(msgspec.structs.replace(row, attention_iou=None), order="deterministic")
    if row.foreign is None:  # the hash of a row from before a field does not change
        plain = plain.replace(b'"foreign":null,', b"", 1)
    if not row.mission_sha256:
        plain = plain.replace(b'"mission_sha256":"",', b"", 1)
    return hashlib.sha256(plain).hexdigest()


def seal_of(trace: Path) -> str:
    """Return the last seal of a trace; "" if there is no trace, or if it has no end."""
    from lingjing.trace.seal_check import last_chain

    try:
        return last_chain(trace) if trace.is_file() else ""
    except LingjingError:
        return ""


def row_faults(row: SuiteRow) -> Iterator[str]:
    """Yield the contradictions within a row."""
    report, is_by_mission = row.report, row.options.evaluators == ("mission",)
    if row.standing == "counted" and not 0.0 <= report.scr <= 1.0:  # nan is refused too
        yield f"its subtask completion rate is {report.scr:.2f}, which is no share"
    elif row.standing == "counted" and report.success and report.scr < 1.0 and is_by_mission:
        yield f"it counts as a success with a subtask completion rate of {report.scr:.2f}"
    if row.standing == "counted" and report.success and report.ticks == 0 and is_by_mission:
        yield "it counts as a success that held before any agent acted: its mission asks for nothing (LJ0510)"
    if report.success and report.reason != "success":
        yield f"it counts as a success, and its reason is `{report.reason}`"
    if (row.standing == "counted") == (report.reason in (ABORTED, INTERRUPTED)):
        yield f"it is {row.standing}, and its reason is `{report.reason}`"
    if row.standing == "counted" and report.success and not report.digest:
        yield "it counts as a success of an episode without a digest"
    if report.privileged and not row.privileged:
        yield "its report is of a player with the truth, and the row does not say so"
    if report.seed != row.seed:
        yield f"its seed is {row.seed}, and that of its report {report.seed}"


def check_rows(rows: Iterable[SuiteRow]) -> None:
    """Raise `UsageError` for the first row that contradicts itself."""
    for row in rows:
        fault = next(row_faults(row), "")
        if fault:
            raise UsageError(f"the row of {named(row)} is refused: {fault}", hint=_HINT)


def named(row: SuiteRow) -> str:
    """Return the name of a row's episode."""
    return f"{row.entrant}, {row.column}{row.condition and f', {row.condition}'}, seed {row.seed}"


def audit_file(place: Path) -> Path:
    """Return the file of the audit of a results folder or a .parquet file."""
    return place / AUDIT if place.is_dir() else place.with_suffix(f".{AUDIT}")


def read_audit(place: Path) -> AuditRecord | None:
    """Return the audit beside results; None if there is none. Raises `UsageError` for a damaged one."""
    file = audit_file(place)
    try:
        return from_json(file.read_bytes(), AuditRecord)
    except FileNotFoundError:
        return None
    except (OSError, msgspec.DecodeError) as error:
        raise UsageError(f"cannot read the audit `{file}`: {error}", hint="remove it and audit again") from error


def audit_marks(places: Iterable[Path]) -> dict[str, AuditMark]:
    """Return the marks of all rows that an audit beside their results has confirmed, by `row_sha256`."""
    audits = (audit for place in places if (audit := read_audit(place)) is not None)
    return {name: mark for audit in audits for name, mark in audit.rows.items()}


def audited_in_words(rows: Iterable[SuiteRow], marks: Mapping[str, AuditMark]) -> str:
    """Return the counts of audited rows in words: `audited: 38 of 40 rows, 3 of them replayed`."""
    states = [marks.get(row_sha256(row)) for row in rows if row.standing == "counted"]
    known = [state for state in states if state is not None]
    return f"audited: {len(known)} of {len(states)} rows, {known.count('replayed')} of them replayed"


__all__ = [
    "AuditMark", "AuditRecord", "audit_file", "audit_marks", "audited_in_words", "check_rows", "named", "read_audit",
    "row_faults", "row_sha256", "seal_of",
]  # fmt: skip
