"""The record of an episode's calls to chat models: one SQLite file beside the trace.

Each message, parameter set and picture is stored once, under its SHA-256. A prompt that grows turn by turn therefore
adds only its last turn. A call is committed before its request is sent and again with its result, so a killed process
leaves whole records. During writing there is a write-ahead log beside the file. A clean end leaves one file.
"""

from __future__ import annotations

import lzma
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError, UsageError
from lingjing.trace.calls import CalledEpisode, CallRequest, CallResult, RecordedCall, sha256

CALLS_NAME = "calls.sqlite"
"""The file of the recorded model calls, which a replay answers by their place (ADR 0018)."""

PACKED_NAME = "calls.sqlite.xz"
"""A record that is compressed for shipping, such as a reference transcript. It is read in memory and never written."""

MOST_UNPACKED_BYTES = 256 * 2**20
"""Limit of a packed record once it is unpacked, bytes. Chosen: a transcript with small pictures has 1 to 3 MB."""

MOST_BYTES = 16 * 2**30
"""Limit of the stored contents, bytes. Chosen: an episode of 420 calls with two pictures of 100 kB each has 0.1 GB."""

_APPLICATION = 0x4C4A4343
"""SQLite's `application_id` of our files: "LJCC" in ASCII."""
_FORMAT = 1
"""Version of the tables, stored as SQLite's `user_version`."""
_HASH = 32
"""Bytes of a SHA-256."""
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
    """A record that is being written to `path`, a new file. All methods are thread-safe.

    Raises `InfrastructureError` if writing fails: the disk is full, the record is too large, or the file exists.
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
        """Store a request that is about to be sent, or a request together with its result."""
        contents = (request.head, *request.messages, *request.pictures)
        hashes = [sha256(content) for content in contents]
        messages = b"".join(hashes[1 : 1 + len(request.messages)])
        row = (agent, request.tick, request.number, hashes[0], messages, result and msgspec.json.encode(result))
        with self._transaction() as file:
            fresh = {name: content for name, content in zip(hashes, contents, strict=True) if name not in self._known}
            self._bytes += sum(map(len, fresh.values()))
            if self._bytes > MOST_BYTES:
                raise InfrastructureError(
                    f"the record of model calls `{self._path}` would hold more than {MOST_BYTES >> 30} GiB",
                    hint="shorten what the policy sends, or play with --calls live",
                    cause="call-record",
                )
            file.executemany("INSERT OR IGNORE INTO content VALUES (?, ?)", fresh.items())
            file.execute("INSERT INTO call VALUES (?, ?, ?, ?, ?, ?)", row)
            self._known |= fresh.keys()

    def end(self, agent: str, request: CallRequest, result: CallResult) -> None:
        """Store the result of a request. Does nothing after `close`, when the episode is over."""
        with self._transaction() as file:
            if self._open:
                file.execute(
                    "UPDATE call SET result = ? WHERE agent = ? AND tick = ? AND number = ?",
                    (msgspec.json.encode(result), agent, request.tick, request.number),
                )

    def close(self) -> None:
        """Merge the write-ahead log into the file and close it. Calls without a result are marked as abandoned."""
        with self._lock, suppress(sqlite3.Error):  # committed rows stay readable
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
                cause="call-record",
            ) from error


class CallReader:
    """A record that is read. `episode` identifies its episode. Raises `UsageError` for a file of another kind."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.Lock()
        with self._reading():
            self._file = _unpacked(path) if path.name.endswith(".xz") else _opened(path)
            (application,) = self._file.execute("PRAGMA application_id").fetchone()
            (version,) = self._file.execute("PRAGMA user_version").fetchone()
            if application != _APPLICATION:
                raise UsageError(f"`{path}` is no record of model calls")
            if version != _FORMAT:
                raise UsageError(
                    f"`{path}` is a record of model calls in format {version}; this version reads {_FORMAT}"
                )
            (about,) = self._file.execute("SELECT about FROM episode").fetchone()
            self.episode = from_json(about, CalledEpisode)

    def find(self, agent: str, tick: int, number: int) -> RecordedCall | None:
        """Return the call number `number` of an agent at a tick, or None."""
        where = "WHERE agent = ? AND tick = ? AND number = ?"
        return next(self._select(where, (agent, tick, number)), None)

    def calls(self, agent: str | None = None, tick: int | None = None) -> Iterator[RecordedCall]:
        """Yield all calls, or those of one agent or one tick, ordered by tick, agent and number."""
        where = "WHERE (?1 IS NULL OR agent = ?1) AND (?2 IS NULL OR tick = ?2) ORDER BY tick, agent, number"
        yield from self._select(where, (agent, tick))

    def served(self) -> tuple[str, ...]:
        """Return the models that services named in their answers, each once, in order of the calls."""
        with self._lock, self._reading():
            rows = self._file.execute(
                "SELECT result FROM call WHERE result IS NOT NULL ORDER BY tick, number"
            ).fetchall()
            results = [from_json(result, CallResult) for (result,) in rows]
        return tuple(dict.fromkeys(result.served for result in results if result.served))

    def content(self, name: bytes) -> bytes:
        """Return the content with the SHA-256 `name`. Raises `UsageError` if it is missing or has another hash."""
        with self._lock, self._reading():
            row = self._file.execute("SELECT data FROM content WHERE hash = ?", (name,)).fetchone()
        if row is None or sha256(row[0]) != name:
            raise UsageError(f"`{self.path}` does not hold the content {name.hex()}: it was changed or cut short")
        return bytes(row[0])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _select(self, where: str, values: tuple[object, ...]) -> Iterator[RecordedCall]:
        query = f"SELECT agent, tick, number, head, messages, result FROM call {where}"  # noqa: S608 - ours
        with self._lock, self._reading():
            rows = self._file.execute(query, values).fetchall()
        for agent, tick, number, head, messages, result in rows:
            names = [messages[at : at + _HASH] for at in range(0, len(messages), _HASH)]
            with self._reading():
                read = from_json(result, CallResult) if result is not None else None
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
    """Return the path of the record that belongs to a trace or to an episode's folder, or None if there is none."""
    if place.name in (CALLS_NAME, PACKED_NAME) and place.is_file():
        return place
    names = (CALLS_NAME, PACKED_NAME)
    candidates = (place / name if place.is_dir() else place.with_name(name) for name in names)
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def pack(record: Path, packed: Path) -> None:
    """Write a closed record compressed to a new file. The record stays as it is."""
    with closing(sqlite3.connect(":memory:")) as copy:
        with closing(_opened(record)) as source:
            source.backup(copy)
        copy.execute("PRAGMA journal_mode = DELETE")  # a record with a write-ahead log cannot be read from memory
        copy.execute("VACUUM")
        packed.write_bytes(lzma.compress(copy.serialize(), preset=9 | lzma.PRESET_EXTREME))


def _opened(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True, check_same_thread=False)


def _unpacked(path: Path) -> sqlite3.Connection:
    """Return a packed record in memory. Raises `UsageError` for a file that is none or is too large."""
    unpacker = lzma.LZMADecompressor()
    try:
        data = unpacker.decompress(path.read_bytes(), MOST_UNPACKED_BYTES)
    except (lzma.LZMAError, EOFError) as error:
        raise UsageError(f"`{path}` cannot be unpacked as a record of model calls: {error}") from error
    if not unpacker.eof:
        raise UsageError(f"`{path}` is cut short, or larger than {MOST_UNPACKED_BYTES // 2**20} MB once it is unpacked")
    file = sqlite3.connect(":memory:", check_same_thread=False)
    file.deserialize(data)
    return file


__all__ = ["CALLS_NAME", "PACKED_NAME", "CallReader", "CallStore", "calls_of", "pack"]
