"""The folder that stores a suite's rows while it is played; one command at a time may write to it.

A row is written as soon as its episode ends, atomically, as a file in `parts`. From time to time, and at the end, the
parts are joined into `results.parquet`. The folder stays readable if the command is killed at any moment.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import IO

import msgspec

from lingjing.bench.evidence import AuditRecord, audit_file, read_audit, row_sha256
from lingjing.bench.parquet import encode_rows, read_rows
from lingjing.bench.rows import SuiteRow
from lingjing.errors import UsageError
from lingjing.file_names import plain_name
from lingjing.mission.seeding import integer
from lingjing.whole_files import PARTIAL, written_whole

RESULTS = "results.parquet"
"""The file of joined rows."""

PARTS = "parts"
"""The subfolder of single rows."""

RUNS = "runs"
"""The subfolder of kept runs."""

MOST_PARTS = 256
"""The number of parts that triggers joining. Chosen."""

_SUFFIX = ".parquet"


@contextmanager
def open_results(folder: Path) -> Iterator[ResultsFolder]:
    """Create the folder and lock it against other commands until this one ends.

    Raises `UsageError` if another command uses the folder, or if it cannot be written or read.
    """
    with lock_folder(folder, "suite") as lock:
        try:
            (folder / PARTS).mkdir(exist_ok=True)
        except OSError as error:
            raise UsageError(
                f"cannot write to `{folder}`: {error.strerror}", hint="choose another folder with -o"
            ) from error
        yield ResultsFolder(folder, lock)


def check_folder(folder: Path | None) -> None:
    """Raise `UsageError` for a place that cannot be a results folder because a file is there."""
    if folder is not None and folder.is_file():
        raise UsageError(f"cannot write to `{folder}`: it is a file", hint="choose another folder with -o")


@contextmanager
def lock_folder(folder: Path, what: str) -> Iterator[IO[str]]:
    """Create a folder and hold the lock that allows one command (a `what`) to write to it. Raises `UsageError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("a")
    except OSError as error:
        raise UsageError(
            f"cannot write to `{folder}`: {error.strerror}", hint="choose another folder with -o"
        ) from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(
                f"another {what} is writing to `{folder}`", hint="wait, or name another folder with -o"
            ) from None
        yield lock


def read_results(place: Path) -> list[SuiteRow]:
    """Return the rows of a suite's folder, finished or not, or of one Parquet file. Raises `UsageError`."""
    if place.is_dir():
        files = _files(place)
        if not files:
            raise UsageError(
                f"`{place}` holds no results of a suite", hint="name the folder of a suite, or a .parquet file"
            )
        try:
            return with_attention(_merged(files), place)
        except UsageError:
            if _files(place) == files:
                raise
            return read_results(place)  # the running suite has joined its parts meanwhile
    return with_attention(read_rows(place), place.parent)


def with_attention(rows: Iterable[SuiteRow], folder: Path) -> list[SuiteRow]:
    """Return the rows, each with the attention IoU of the maps beside its trace in the suite's folder."""
    return [_with_iou(row, folder / row.report.trace) if row.report.trace else row for row in rows]


def write_whole(file: Path, content: bytes) -> None:
    """Write a file atomically, also with respect to power failures. Raises `OSError`."""
    with written_whole(file) as partial, partial.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


class ResultsFolder:
    """The rows of one suite. `rows` holds all rows of the folder."""

    def __init__(self, folder: Path, lock: IO[str]) -> None:
        self.folder = folder
        self._lock = lock
        self._salt = ""
        for left in (*folder.glob(f"*{PARTIAL}"), *(folder / PARTS).glob(f"*{PARTIAL}")):
            if not left.is_dir():
                left.unlink(missing_ok=True)
        self.rows = _merged(_files(folder))
        self._parts = sorted((folder / PARTS).glob(f"*{_SUFFIX}"))
        numbers = (int(path.stem) for path in self._parts if path.stem.isascii() and path.stem.isdigit())
        self._next = 1 + max(numbers, default=0)

    def add(self, row: SuiteRow) -> None:
        """Store a row. Raises `UsageError` if it cannot be written; existing rows are not changed."""
        part = self.folder / PARTS / f"{self._next:08d}{_SUFFIX}"
        self._restore_parts()
        self._write(part, encode_rows([row]))
        self._next += 1
        self._parts.append(part)
        self.rows.append(row)
        if len(self._parts) >= MOST_PARTS:
            self.compact()

    def replace(self, row: SuiteRow) -> None:
        """Store a row in place of the one with its key."""
        self.rows = [kept for kept in self.rows if kept.key != row.key]
        self.add(row)

    def put_aside(self, mission: str) -> Path:
        """Move the rows of a mission into a file of their own, and return its path. Kept runs move into a folder of the
        same name.

        The runs are moved first and the file is written next, so a kill loses nothing, and the same call continues.
        Rows that lie aside already are never replaced: other rows of the same episodes get another file.
        """
        own = [row for row in self.rows if row.mission == mission]
        stem = f"results-{plain_name(mission, 60)}-{own[0].mission_sha256[:12] or 'old'}"
        for name in (f"{stem}{'' if number == 1 else f'-{number}'}" for number in count(1)):
            aside = self.folder / f"{name}{_SUFFIX}"
            moved = [_with_run_in(row, name) for row in own]
            there = {row.key: row for row in read_rows(aside)} if aside.is_file() else {}
            if all(there.get(row.key, row) == row for row in moved):
                break
        for before, after in zip(own, moved, strict=True):
            self._move_run(before.report.trace, after.report.trace)
        self._move_marks(own, moved, aside)
        self._write(aside, encode_rows(list({**there, **{row.key: row for row in moved}}.values())))
        self.rows = [row for row in self.rows if row.mission != mission]
        self._write(self.folder / RESULTS, encode_rows(self.rows))
        while self._parts:
            self._parts.pop().unlink(missing_ok=True)
        return aside

    def compact(self) -> Path:
        """Join all parts into one file and return its path."""
        whole = self.folder / RESULTS
        if self._salt and not (self.folder / "salt").is_file():  # another process has removed it
            self._write(self.folder / "salt", f"{self._salt}\n".encode())
        if self._parts or not whole.is_file():
            self._write(whole, encode_rows(self.rows))
            while self._parts:  # after a kill here, a row that is in both files is read once
                self._parts.pop().unlink(missing_ok=True)
        return whole

    def salt(self) -> str:
        """Return the text of the folder's `salt` file, which is drawn at random if it does not exist."""
        if not self._salt:
            file = self.folder / "salt"
            self._salt = file.read_text().strip() if file.is_file() else ""
            if not self._salt:
                self._salt = secrets.token_hex(16)
                self._write(file, f"{self._salt}\n".encode())
        return self._salt

    def adopt_salt(self, other: Path) -> None:
        """Use the salt of another suite's folder. Raises `UsageError` if this folder has a different salt."""
        salt = (other / "salt").read_text().strip()
        own = self.folder / "salt"
        if own.is_file() and own.read_text().strip() != salt:
            raise UsageError(
                f"`{self.folder}` has another salt than `{other}`", hint="replay into a new folder with -o"
            )
        self._salt = salt
        self._write(own, f"{salt}\n".encode())

    def write(self, name: str, text: str) -> Path:
        """Write a text beside the results and return its path."""
        self._write(self.folder / name, text.encode())
        return self.folder / name

    def _restore_parts(self) -> None:
        """Make the folder of parts again if another process has removed it, and write all rows anew."""
        if not (self.folder / PARTS).is_dir() and self._is_same_folder():
            self._write(self.folder / RESULTS, encode_rows(self.rows))
            self._parts.clear()
            with suppress(OSError):  # the next write reports it
                (self.folder / PARTS).mkdir()

    def _move_marks(self, before: Sequence[SuiteRow], after: Sequence[SuiteRow], aside: Path) -> None:
        """Store the marks of an audit for the moved rows beside their file."""
        audit, there = read_audit(self.folder), read_audit(aside)
        known = {} if audit is None else audit.rows
        marks = {} if there is None else dict(there.rows)
        for old, new in zip(before, after, strict=True):
            if (name := row_sha256(old)) in known:
                marks[row_sha256(new)] = known[name]
        if audit is not None and marks:
            self._write(audit_file(aside), msgspec.json.encode(AuditRecord(rows=marks, code=audit.code)))

    def _move_run(self, before: str, after: str) -> None:
        """Move the folder of a kept trace to that of its new path; a run that is gone or was moved stays as it is."""
        source, target = (self.folder / Path(trace).parent for trace in (before, after))
        if before == after or not source.is_dir():
            return
        try:
            target.parent.mkdir(exist_ok=True)
            source.rename(target)
        except OSError as error:
            raise UsageError(f"cannot move `{source}` to `{target}`: {error.strerror}") from error

    def _write(self, file: Path, content: bytes) -> None:
        if not self._is_same_folder():
            raise UsageError(
                f"`{self.folder}` was removed or replaced while its suite was played",
                hint="no further rows are written; start again in another folder",
            )
        try:
            write_whole(file, content)
        except OSError as error:
            kept = f"{len(self.rows)} rows are stored" if self.rows else "no row is stored"
            raise UsageError(
                f"cannot write to `{self.folder}`: {error.strerror}; {kept}",
                hint="make room or choose another folder with -o; the same command continues from here",
            ) from error

    def _is_same_folder(self) -> bool:
        """Return whether the folder is still the locked one."""
        try:
            return os.path.samestat(os.fstat(self._lock.fileno()), (self.folder / "lock").stat())
        except OSError:
            return False


def policy_seed(salt: str, cell: tuple[str, str, str, str], seed: int) -> int:
    """Return the seed of a row's policies.

    It depends on the suite's salt, so that a policy with access to the code cannot derive the instance from it. A row
    that is played again has the same seed.
    """
    return integer(0, "/".join((salt, *cell, str(seed))))


def fingerprint(salt: str) -> str:
    """Return a hash that identifies a salt without revealing it."""
    return hashlib.sha256(f"lingjing salt {salt}".encode()).hexdigest()[:16]


def _with_run_in(row: SuiteRow, folder: str) -> SuiteRow:
    """Return the row with its run, if one was kept, in another folder beside `runs`."""
    match Path(row.report.trace).parts:
        case (top, name, file) if top == RUNS and ".." not in (name, file):
            moved = msgspec.structs.replace(row.report, trace=f"{folder}/{name}/{file}")
            return msgspec.structs.replace(row, report=moved)
    return row


def _with_iou(row: SuiteRow, trace: Path) -> SuiteRow:
    from lingjing.analysis.attention import attention_beside

    iou = attention_beside(trace)
    return row if iou is None else msgspec.structs.replace(row, attention_iou=iou)


def _files(folder: Path) -> list[Path]:
    whole = folder / RESULTS
    return [*([whole] if whole.is_file() else []), *sorted((folder / PARTS).glob(f"*{_SUFFIX}"))]


def _merged(files: list[Path]) -> list[SuiteRow]:
    """Return the rows of all files, each key once."""
    return list({row.key: row for file in files for row in read_rows(file)}.values())


__all__ = [
    "RESULTS",
    "RUNS",
    "ResultsFolder",
    "check_folder",
    "fingerprint",
    "lock_folder",
    "open_results",
    "policy_seed",
    "read_results",
    "with_attention",
    "write_whole",
]  # fmt: skip
