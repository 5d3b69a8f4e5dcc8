"""What is wrong with the aftermath of a case."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from lingjing.errors import UsageError
from lingjing.trace.reader import read_trace
from tests.faults.cases import Aftermath, Injection

CODES = {0, 1, 2, 3, 130}
HALF_WRITTEN = (".partial", ".new-", ".tmp")
ANOTHER_RESULT = ("wall", "steady", "service", "record")
"""Kinds of faults that may change what a policy does: an answer is late, or is another one."""


def faults_of(case: Injection, after: Aftermath, folder: Path, digest: str) -> list[str]:
    """Each fault in one line; `digest` is that of the same command without a planted fault, "" if it has none."""
    return [
        *_exit_faults(after),
        *(f"left running: {line}" for line in after.orphans),
        *_file_faults(case, after, folder),
        *_result_faults(case, after, digest),
    ]


def _exit_faults(after: Aftermath) -> Iterator[str]:
    if after.code == -1000:
        yield "it hung"
    elif after.code not in CODES:
        yield f"exit code {after.code}"
    if "Traceback" in after.errors or "Traceback" in after.output:
        yield "a traceback"
    if after.code in (1, 2, 3):
        if "error: " not in after.errors:
            yield "no message"
        elif "hint: " not in after.errors and "see `lingjing " not in after.errors:
            yield "a message without a way out"


def _file_faults(case: Injection, after: Aftermath, folder: Path) -> Iterator[str]:
    cleans_up = not case.lasting and case.kind not in ("name", "look")  # what removes files may be what fails
    for name in after.left:
        if name.endswith((".mcap", ".mcap.part")):
            yield from _trace_faults(folder / name)
        if cleans_up and (any(part in Path(name).name for part in HALF_WRITTEN) or name.startswith("tmp/lingjing")):
            yield f"left behind: {name}"


def _trace_faults(path: Path) -> Iterator[str]:
    try:
        trace = read_trace(path)
    except UsageError as error:
        if path.suffix != ".part" or path.stat().st_size > 100_000:  # a header that could not be written
            yield f"{path.name} cannot be read: {error}"
        return
    if path.suffix == ".mcap" and not trace.complete:
        yield f"{path.name} is not whole"


def _result_faults(case: Injection, after: Aftermath, digest: str) -> Iterator[str]:
    if after.code != 0 or not digest:
        return
    try:
        found = json.loads(after.output)["digest"]
    except (ValueError, KeyError, TypeError):
        yield f"no result with exit code 0: {after.output[:200]!r}"
        return
    if case.kind not in ANOTHER_RESULT and found != digest:
        yield "another digest with exit code 0"
