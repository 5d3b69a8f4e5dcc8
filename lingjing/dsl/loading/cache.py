"""Compiled missions, kept by content in the user's cache folder (`$XDG_CACHE_HOME/lingjing/missions`).

Only what has no error is kept: the diagnostics that are no errors, and the mission. The key covers the text, its path
(it stands in the mission and in diagnostics), and the size and time of every file of this compiler; an entry also names
each library the mission uses, directly or through others, with the digest of its text, and counts only while all of
them are found at the same place with the same contents.

A cache may cost time, never truth: an entry whose checksum is wrong is none; entries are written beside and renamed,
so that two writers at once leave one whole entry; where nothing can be written nothing is kept.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

import msgspec

from lingjing.data import cache_folder, cache_is_off
from lingjing.dsl.source.text import SourceText, read_source
from lingjing.errors import PluginError, UsageError
from lingjing.mission.diagnostics import Diagnostic

if TYPE_CHECKING:
    from lingjing.dsl.compilation import Compilation
    from lingjing.mission.model import Mission

FORMAT = b"1"
MOST_ENTRIES = 200
LARGEST_ENTRY = 16 * 1024 * 1024
"""Bytes. A mission that takes more is compiled each time, so that the cache does not fill the disk."""

_USE = re.compile(r"\buse\b[ \t]*(?P<dot>\.?)[ \t]*(?P<path>[^\W\d]\w*(?:[ \t]*\.[ \t]*[^\W\d]\w*)*)")
_CHECKSUM = 32


class CacheEntry(msgspec.Struct, frozen=True, array_like=True):
    """`libraries`: file and SHA-256 of its text, in the order they are met; `mission` is msgpack, empty for types."""

    libraries: tuple[tuple[str, str], ...]
    diagnostics: tuple[Diagnostic, ...]
    mission: bytes


def known_good(source: SourceText) -> tuple[Diagnostic, ...] | None:
    """The diagnostics of a text that is known to have no error; None if it is not known."""
    entry = _entry(source)
    return None if entry is None else entry.diagnostics


def compile_cached(source: SourceText) -> Compilation:
    """As `compile_source`, from the cache where it is known, and kept there where it is good."""
    from lingjing.dsl.compilation import Compilation, compile_source

    entry = _entry(source)
    if entry is not None:
        from lingjing.mission.model import Mission

        mission = msgspec.msgpack.decode(entry.mission, type=Mission) if entry.mission else None
        return Compilation(mission, entry.diagnostics, source)
    compilation = compile_source(source)
    keep(compilation)
    return compilation


def keep(compilation: Compilation) -> None:
    """Keep a compilation if it has no error. Never fails: what cannot be kept is made again.

    One that needs a plug-in is not kept either: by the next time that may be installed, or gone.
    """
    source = compilation.source
    if cache_is_off() or any(item.severity == "error" for item in compilation.diagnostics):
        return
    if compilation.mission is not None and _needs_plugins(compilation.mission):
        return
    mission = b"" if compilation.mission is None else msgspec.msgpack.encode(compilation.mission)
    if len(mission) > LARGEST_ENTRY:
        return
    try:
        entry = CacheEntry(tuple(_libraries(source)), compilation.diagnostics, mission)
        payload = msgspec.msgpack.encode(entry)
        _write(_file(source), hashlib.sha256(payload).digest() + payload)
    except (OSError, UsageError, PluginError):
        return


# -- private


def _needs_plugins(mission: Mission) -> bool:
    from lingjing.dsl.feasibility.absent import strange

    return next(strange(mission), None) is not None


def _entry(source: SourceText) -> CacheEntry | None:
    if cache_is_off():
        return None
    try:
        with open(_file(source), "rb") as file:  # noqa: PTH123 - a cold start
            data = file.read()
        if hashlib.sha256(data[_CHECKSUM:]).digest() != data[:_CHECKSUM]:
            return None
        entry = msgspec.msgpack.decode(data[_CHECKSUM:], type=CacheEntry)
        return entry if tuple(_libraries(source)) == entry.libraries else None
    except (OSError, msgspec.DecodeError, UsageError, PluginError):
        return None


def _file(source: SourceText) -> str:
    digest = hashlib.sha256(FORMAT)
    for part in (_compiler(), source.path, source.text):
        data = part.encode("utf-8", "surrogatepass")
        digest.update(b"%d\0" % len(data) + data)
    return os.path.join(cache_folder(), "missions", digest.hexdigest()[:40])  # noqa: PTH118


def _compiler() -> str:
    """Size and time of every file that decides what a text compiles to: stricter than a version, and cheaper to get."""
    package = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))  # noqa: PTH100, PTH120
    waiting = [os.path.join(package, "dsl"), os.path.join(package, "mission")]  # noqa: PTH118
    found = []
    while waiting:
        for item in sorted(os.scandir(waiting.pop()), key=lambda item: item.name):
            if item.name.endswith((".py", ".tables")):
                stat = item.stat()
                found.append(f"{item.name} {stat.st_size} {stat.st_mtime_ns}")
            elif "." not in item.name and item.name != "__pycache__":
                waiting.append(item.path)
    kinds = os.stat(os.path.join(package, "engines", "kinds.json"))  # noqa: PTH116, PTH118
    return "\n".join((*found, f"kinds.json {kinds.st_size} {kinds.st_mtime_ns}"))


def _libraries(source: SourceText) -> Iterator[tuple[str, str]]:
    """Every library a text names in a `use`, and those that these name; a `use` in a comment does no harm."""
    from lingjing.dsl.checking import library

    seen: set[str] = set()
    waiting = [(source.text, source.path)]
    while waiting:
        text, path = waiting.pop()
        for match in _USE.finditer(text):
            words = tuple(word.strip() for word in match["path"].split("."))
            file = library.find_file(words, library.folder_of(path)) if match["dot"] else library.find_file(words)
            if file is None or file in seen:
                continue
            seen.add(file)
            read = read_source(file)
            yield file, hashlib.sha256(read.text.encode("utf-8", "surrogatepass")).hexdigest()
            waiting.append((read.text, file))


def _write(path: str, data: bytes) -> None:
    import tempfile

    folder = os.path.dirname(path)  # noqa: PTH120
    os.makedirs(folder, exist_ok=True)  # noqa: PTH103
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=".new-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.replace(temporary, path)  # noqa: PTH105
    except OSError:
        os.unlink(temporary)  # noqa: PTH108
        raise
    _prune(folder)


def _prune(folder: str) -> None:
    """Remove the oldest entries beyond `MOST_ENTRIES`; another process may be doing the same."""
    entries = [(item.stat().st_mtime_ns, item.path) for item in os.scandir(folder)]
    for _, path in sorted(entries)[: max(0, len(entries) - MOST_ENTRIES)]:
        if os.path.exists(path):  # noqa: PTH110
            os.unlink(path)  # noqa: PTH108
