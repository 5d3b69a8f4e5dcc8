"""Where a suite's rows are kept while it is played: a folder that one command at a time may use.

A row is written as soon as its episode ends, whole or not at all, as a file of its own in `parts`; many parts are made
one `results.parquet` now and then and at the end. Whatever moment the command is killed at, the folder reads back.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import msgspec

from lingjing.bench.parquet import encode_rows, read_rows
from lingjing.bench.rows import SuiteRow
from lingjing.errors import UsageError
from lingjing.mission.seeding import integer
from lingjing.whole_files import PARTIAL, written_whole

RESULTS = "results.parquet"
PARTS = "parts"
MOST_PARTS = 256
"""So many parts are made one file."""

_SUFFIX = ".parquet"


@contextmanager
def open_results(folder: Path) -> Iterator[ResultsFolder]:
    """Make the folder and keep other commands out of it as long as this one runs, however it ends.

    Raises `UsageError` where another one uses it, or where it cannot be written or read.
    """
    with alone_in(folder, "suite") as lock:
        try:
            (folder / PARTS).mkdir(exist_ok=True)
        except OSError as error:
            raise UsageError(f"cannot write to `{folder}`: {error.strerror}", hint="choose another with -o") from error
        yield ResultsFolder(folder, lock)


@contextmanager
def alone_in(folder: Path, what: str) -> Iterator[IO[str]]:
    """Make a folder and hold the lock of the one command, a `what`, that may write to it. Raises `UsageError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("a")
    except OSError as error:
        raise UsageError(f"cannot write to `{folder}`: {error.strerror}", hint="choose another with -o") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(f"another {what} is writing to `{folder}`", hint="wait, or name another with -o") from None
        yield lock


def read_results(place: Path) -> list[SuiteRow]:
    """The rows of a suite's folder, finished or not, or of one Parquet file. Raises `UsageError`."""
    if place.is_dir():
        files = _files(place)
        if not files:
            raise UsageError(f"`{place}` holds no results of a suite", hint="name its folder, or a .parquet file")
        try:
            return with_attention(_merged(files), place)
        except UsageError:
            if _files(place) == files:
                raise
            return read_results(place)  # its suite has put its parts together meanwhile
    return with_attention(read_rows(place), place.parent)


def with_attention(rows: Iterable[SuiteRow], folder: Path) -> list[SuiteRow]:
    """The rows, each with the attention IoU of the maps that lie beside its trace in the suite's folder."""
    return [_attended(row, folder / row.report.trace) if row.report.trace else row for row in rows]


def write_whole(file: Path, content: bytes) -> None:
    """Write a file so that it is there whole or not at all, also after a power failure. Raises `OSError`."""
    with written_whole(file) as partial, partial.open("wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


class ResultsFolder:
    """The rows of one suite; `rows` are those that are there."""

    def __init__(self, folder: Path, lock: IO[str]) -> None:
        self.folder = folder
        self._lock = lock
        self._salt = ""
        for left in (*folder.glob(f"*{PARTIAL}"), *(folder / PARTS).glob(f"*{PARTIAL}")):
            left.unlink(missing_ok=True)
        self.rows = _merged(_files(folder))
        self._parts = sorted((folder / PARTS).glob(f"*{_SUFFIX}"))
        self._next = 1 + max((int(path.stem) for path in self._parts if path.stem.isdigit()), default=0)

    def add(self, row: SuiteRow) -> None:
        """Keep a row. Raises `UsageError` where it cannot be written; what was there before stays as it was."""
        part = self.folder / PARTS / f"{self._next:08d}{_SUFFIX}"
        self._write(part, encode_rows([row]))
        self._next += 1
        self._parts.append(part)
        self.rows.append(row)
        if len(self._parts) >= MOST_PARTS:
            self.compact()

    def compact(self) -> Path:
        """Make one file of all parts; its path."""
        whole = self.folder / RESULTS
        if self._parts or not whole.is_file():
            self._write(whole, encode_rows(self.rows))
            while self._parts:  # a row that is in both is read once
                self._parts.pop().unlink(missing_ok=True)
        return whole

    def salt(self) -> str:
        """The text in the folder's `salt`, made by chance where there is none yet."""
        if not self._salt:
            file = self.folder / "salt"
            self._salt = file.read_text().strip() if file.is_file() else ""
            if not self._salt:
                self._salt = secrets.token_hex(16)
                self._write(file, f"{self._salt}\n".encode())
        return self._salt

    def take_salt(self, other: Path) -> None:
        """Draw as another suite's folder did. Raises `UsageError` where this one has a salt of its own already."""
        salt = (other / "salt").read_text().strip()
        own = self.folder / "salt"
        if own.is_file() and own.read_text().strip() != salt:
            raise UsageError(
                f"`{self.folder}` draws by another salt than `{other}`", hint="replay into a new folder, with -o"
            )
        self._salt = salt
        self._write(own, f"{salt}\n".encode())

    def write(self, name: str, text: str) -> Path:
        """Write a text beside the results; its path."""
        self._write(self.folder / name, text.encode())
        return self.folder / name

    def _write(self, file: Path, content: bytes) -> None:
        if not self._is_there():
            raise UsageError(
                f"`{self.folder}` was removed or replaced while its suite was played",
                hint="nothing more is written; start again, with a folder that stays",
            )
        try:
            write_whole(file, content)
        except OSError as error:
            kept = f"{len(self.rows)} rows are there" if self.rows else "there is nothing yet"
            raise UsageError(
                f"cannot write to `{self.folder}`: {error.strerror}; {kept}",
                hint="make room or choose another folder with -o; the same command goes on from here",
            ) from error

    def _is_there(self) -> bool:
        """Whether the folder is still the one that was locked."""
        try:
            return os.path.samestat(os.fstat(self._lock.fileno()), (self.folder / "lock").stat())
        except OSError:
            return False


def policy_seed(salt: str, cell: tuple[str, str, str, str], seed: int) -> int:
    """What the policies of one row draw from. The suite's own salt decides it, so that it tells a policy that has the
    code nothing about the instance; a row that is played again has the same one."""
    return integer(0, "/".join((salt, *cell, str(seed))))


def fingerprint(salt: str) -> str:
    """What tells a salt from another one without telling it."""
    return hashlib.sha256(f"lingjing salt {salt}".encode()).hexdigest()[:16]


def _attended(row: SuiteRow, trace: Path) -> SuiteRow:
    from lingjing.analysis.attention import attention_beside

    looked = attention_beside(trace)
    return row if looked is None else msgspec.structs.replace(row, attention_iou=looked)


def _files(folder: Path) -> list[Path]:
    whole = folder / RESULTS
    return [*([whole] if whole.is_file() else []), *sorted((folder / PARTS).glob(f"*{_SUFFIX}"))]


def _merged(files: list[Path]) -> list[SuiteRow]:
    """The rows of all files, each once."""
    return list({row.key: row for file in files for row in read_rows(file)}.values())


__all__ = [
    "RESULTS", "ResultsFolder", "alone_in", "fingerprint", "open_results", "policy_seed", "read_results",
    "with_attention", "write_whole",
]  # fmt: skip
