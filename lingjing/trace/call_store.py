"""The record of an episode's calls to chat models: one SQLite file beside the trace, each content in it once.

A message, the parameters and a picture are each kept under their SHA-256, so that a prompt that grows turn by turn
costs its last turn only. A question is committed before it is asked and again when there is a result, so that a
process that is killed leaves whole records. While it is written the file has a write-ahead log beside it; a clean end
leaves one file.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from lingjing.errors import InfrastructureError, UsageError
from lingjing.trace.calls import CalledEpisode, CallRequest, CallResult, RecordedCall, sha256

CALLS_NAME = "calls.sqlite"

MOST_BYTES = 16 * 2**30
"""Contents of one record: an episode of 420 calls with two pictures of 100 kB each has 0.1 GB."""

_APPLICATION = 0x4C4A4343
_FORMAT = 1
_HASH = 32
_TABLES = """
CREATE TABLE episode (about BLOB NOT NULL);
CREATE TABLE content (hash BLOB PRIMARY KEY, data BLOB NOT NULL);
CREATE TABLE call (
  agent TEXT NOT NULL, tick INTEGER NOT NULL, number INTEGER NOT NULL,
  head BLOB NOT NULL REFERENCES content, messages BLOB NOT NULL, result BLOB,
  PRIMARY KEY (agent, tick, number)
);
"""
_ABANDONED = msgspec.json.encode(
    CallResult(failure="the policy was given up while it waited", fault="abandoned", attempts=0)
)


class CallStore:
    """A record that is being written. `path` is a new file. Any thread may call it.

    Raises `InfrastructureError` where it cannot write: a full disk, a record that is too large, a place that is taken.
    """

    def __init__(self, path: Path, episode: CalledEpisode) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._known: set[bytes] = set()
        self._bytes = 0
        with self._writing():
            path.touch(exist_ok=False)
            self._file = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
            self._file.executescript(
                f"PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL; PRAGMA application_id = {_APPLICATION};"
                f"PRAGMA user_version = {_FORMAT}; {_TABLES}"
            )
            self._file.execute("INSERT INTO episode VALUES (?)", (msgspec.json.encode(episode),))
        self._open = True

    def begin(self, agent: str, request: CallRequest, result: CallResult | None = None) -> None:
        """Keep a question that is about to be asked, or one with its result."""
        contents = (request.head, *request.messages, *request.pictures)
        hashes = [sha256(content) for content in contents]
        messages = b"".join(hashes[1 : 1 + len(request.messages)])
        row = (agent, request.tick, request.number, hashes[0], messages, result and msgspec.json.encode(result))
        with self._transaction() as file:
            fresh = {name: one for name, one in zip(hashes, contents, strict=True) if name not in self._known}
            self._bytes += sum(map(len, fresh.values()))
            if self._bytes > MOST_BYTES:
                raise InfrastructureError(
                    f"the record of model calls `{self._path}` would hold more than {MOST_BYTES >> 30} GiB",
                    hint="shorten what the policy sends, or play with --calls live",
                )
            file.executemany("INSERT OR IGNORE INTO content VALUES (?, ?)", fresh.items())
            file.execute("INSERT INTO call VALUES (?, ?, ?, ?, ?, ?)", row)
            self._known |= fresh.keys()

    def end(self, agent: str, request: CallRequest, result: CallResult) -> None:
        """Keep what came out of a question. After `close` nothing is: the episode is over."""
        with self._transaction() as file:
            if self._open:
                file.execute(
                    "UPDATE call SET result = ? WHERE agent = ? AND tick = ? AND number = ?",
                    (msgspec.json.encode(result), agent, request.tick, request.number),
                )

    def close(self) -> None:
        """Put all of it into one file. A question that is still open has been given up."""
        with self._lock, suppress(sqlite3.Error):  # what is committed stays readable
            if self._open:
                self._open = False
                self._file.execute("UPDATE call SET result = ? WHERE result IS NULL", (_ABANDONED,))
                self._file.execute("PRAGMA journal_mode = DELETE")
                self._file.close()

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock, self._writing():
            if not self._open:
                yield self._file
                return
            self._file.execute("BEGIN IMMEDIATE")
            try:
                yield self._file
            except BaseException:
                self._file.execute("ROLLBACK")
                raise
            self._file.execute("COMMIT")

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError) as error:
            raise InfrastructureError(
                f"cannot record a model call in `{self._path}`: {error}",
                hint="make room, or choose another folder with -o; --calls live records nothing",
            ) from error


class CallReader:
    """A record that is read: `episode` says whose it is. Raises `UsageError` for a file that is none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        with self._reading():
            self._file = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, check_same_thread=False)
            (application,) = self._file.execute("PRAGMA application_id").fetchone()
            (version,) = self._file.execute("PRAGMA user_version").fetchone()
            if application != _APPLICATION:
                raise UsageError(f"`{path}` is no record of model calls")
            if version != _FORMAT:
                raise UsageError(f"`{path}` is a record of model calls in format {version}; {_FORMAT} is due")
            (about,) = self._file.execute("SELECT about FROM episode").fetchone()
            self.episode = msgspec.json.decode(about, type=CalledEpisode)

    def find(self, agent: str, tick: int, number: int) -> RecordedCall | None:
        """The call at a place, if there is one."""
        where = "WHERE agent = ? AND tick = ? AND number = ?"
        return next(self._select(where, (agent, tick, number)), None)

    def calls(self, agent: str | None = None, tick: int | None = None) -> Iterator[RecordedCall]:
        """All calls, or those of an agent or a tick, in order of time, agents by name."""
        where = "WHERE (?1 IS NULL OR agent = ?1) AND (?2 IS NULL OR tick = ?2) ORDER BY tick, agent, number"
        yield from self._select(where, (agent, tick))

    def content(self, name: bytes) -> bytes:
        """The content of that hash. Raises `UsageError` if the file does not hold it, or another one under its name."""
        with self._lock, self._reading():
            found = self._file.execute("SELECT data FROM content WHERE hash = ?", (name,)).fetchone()
        if found is None or sha256(found[0]) != name:
            raise UsageError(f"`{self.path}` does not hold the content {name.hex()}: it was changed or cut short")
        return bytes(found[0])

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def _select(self, where: str, values: tuple[object, ...]) -> Iterator[RecordedCall]:
        query = f"SELECT agent, tick, number, head, messages, result FROM call {where}"  # noqa: S608 - ours
        with self._lock, self._reading():
            rows = self._file.execute(query, values).fetchall()
        for agent, tick, number, head, messages, result in rows:
            names = [messages[at : at + _HASH] for at in range(0, len(messages), _HASH)]
            with self._reading():
                read = msgspec.json.decode(result, type=CallResult) if result is not None else None
            yield RecordedCall(
                agent=agent,
                tick=tick,
                number=number,
                head=self.content(head),
                messages=tuple(map(self.content, names)),
                result=read,
            )

    @contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, OSError, msgspec.DecodeError, TypeError) as error:
            raise UsageError(f"`{self.path}` cannot be read as a record of model calls: {error}") from error


def calls_of(place: Path) -> Path | None:
    """The record of a trace, of an episode's folder, or the one that is named itself; None if there is none."""
    beside = place / CALLS_NAME if place.is_dir() else place.with_name(CALLS_NAME)
    return beside if beside.is_file() else None


__all__ = ["CALLS_NAME", "CallReader", "CallStore", "calls_of"]
