"""Compiled missions, cached by content in the user's cache folder (`$XDG_CACHE_HOME/lingjing/missions`).

Only compilations without errors are stored: their mission and their warnings. The key covers the text, its path (which
is in the mission and in diagnostics), and the size and time of every file of the compiler. An entry also lists each
library that the mission uses, directly or through others, with the hash of its text. It is valid only while all of them
are unchanged.

The cache affects time only, never results: entries are files of `lingjing.kept_files`, and a cache folder without write
permission means no cache.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import msgspec

from lingjing.data import cache_folder, cache_is_off
from lingjing.decoding import from_msgpack
from lingjing.digests import sha256
from lingjing.dsl.source.text import SourceText, read_source
from lingjing.errors import PluginError, UsageError
from lingjing.kept_files import prune, read_kept, write_kept
from lingjing.mission.diagnostics import Diagnostic
from lingjing.patterns import pattern

if TYPE_CHECKING:
    from lingjing.dsl.compilation import Compilation
    from lingjing.mission.model import Mission

FORMAT = b"1"
"""Version of the entries' format."""
MOST_ENTRIES = 200
"""Most entries (chosen)."""
MOST_BYTES = 1 << 28
"""Most bytes of all entries (chosen)."""
LARGEST_ENTRY = 16 * 1024 * 1024
"""Most bytes of one entry (chosen). A larger mission is compiled each time."""

_GAP = r"(?:[ \t]|\r?\n|#[^\n]*)*"
"""The blanks, line ends and comments that a path may have after a dot."""
_USE = pattern(rf"\buse\b[ \t]*(?P<dot>\.?)(?P<path>{_GAP}[^\W\d]\w*(?:[ \t]*\.{_GAP}[^\W\d]\w*)*)")
"""A `use` in a text. It also matches in comments, which only adds a dependency."""
_COMMENT = pattern(r"#[^\n]*")


class CacheEntry(msgspec.Struct, frozen=True, array_like=True):
    """One cached compilation."""

    libraries: tuple[tuple[str, str], ...]
    """File and SHA-256 of each library's text, in the order of their first use."""
    diagnostics: tuple[Diagnostic, ...]
    """Warnings."""
    mission: bytes
    """The mission as msgpack; empty for a file of types."""


def cached_warnings(source: SourceText) -> tuple[Diagnostic, ...] | None:
    """Return the cached warnings of a text without errors; None if the cache does not have it."""
    entry = _entry(source)
    return None if entry is None else entry.diagnostics


def compile_cached(source: SourceText) -> Compilation:
    """Compile a source as `compile_source` does, from the cache if possible. A result without errors is stored."""
    from lingjing.dsl.compilation import Compilation, compile_source

    entry = _entry(source)
    if entry is not None:
        from lingjing.mission.model import Mission

        mission = from_msgpack(entry.mission, Mission) if entry.mission else None
        return Compilation(mission, entry.diagnostics, source)
    compilation = compile_source(source)
    keep(compilation)
    return compilation


def keep(compilation: Compilation) -> None:
    """Store a compilation if it has no error. It never fails.

    A mission that needs a plug-in, a map or a look of its own is not stored, because these may appear or disappear.
    """
    source = compilation.source
    if cache_is_off() or any(item.severity == "error" for item in compilation.diagnostics):
        return
    if compilation.mission is not None and _needs_others(compilation.mission):
        return
    mission = b"" if compilation.mission is None else msgspec.msgpack.encode(compilation.mission)
    if len(mission) > LARGEST_ENTRY:
        return
    try:
        entry = CacheEntry(tuple(libraries_of(source)), compilation.diagnostics, mission)
        file = _file(source)
        write_kept(file, msgspec.msgpack.encode(entry))
        prune(os.path.dirname(file), most_bytes=MOST_BYTES, most_files=MOST_ENTRIES)  # noqa: PTH120
    except (OSError, UsageError, PluginError):
        return


def libraries_of(source: SourceText) -> Iterator[tuple[str, str]]:
    """Yield the file and the SHA-256 of each library that a text names in a `use`, and of those that these name, in the
    order of their first use.
    """
    from lingjing.dsl.checking import library

    seen: set[str] = set()
    waiting = [(source.text, source.path)]
    while waiting:
        text, path = waiting.pop()
        for match in _USE.finditer(text):
            words = tuple(word.strip() for word in _COMMENT.sub("", match["path"]).split("."))
            file = library.find_file(words, library.folder_of(path)) if match["dot"] else library.find_file(words)
            if file is None or file in seen:
                continue
            seen.add(file)
            read = read_source(file)
            yield file, sha256(read.text.encode("utf-8", "surrogatepass")).hexdigest()
            waiting.append((read.text, file))


# -- private


def _needs_others(mission: Mission) -> bool:
    from lingjing.dsl.feasibility.providers import named_files, unknown_entities

    return any(True for _ in unknown_entities(mission)) or any(True for _ in named_files(mission))


def _entry(source: SourceText) -> CacheEntry | None:
    if cache_is_off():
        return None
    try:
        data = read_kept(_file(source))
        if data is None:
            return None
        entry = from_msgpack(data, CacheEntry)
        return entry if tuple(libraries_of(source)) == entry.libraries else None
    except (OSError, msgspec.DecodeError, UsageError, PluginError):
        return None


def _file(source: SourceText) -> str:
    digest = sha256(FORMAT)
    for part in (_compiler(), source.path, source.text):
        data = part.encode("utf-8", "surrogatepass")
        digest.update(b"%d\0" % len(data) + data)
    return os.path.join(cache_folder(), "missions", digest.hexdigest()[:40])  # noqa: PTH118


def _compiler() -> str:
    """Size and time of every file that decides the result: stricter than a version, and cheaper to compute."""
    package = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))  # noqa: PTH100, PTH120
    waiting = [os.path.join(package, "dsl"), os.path.join(package, "mission")]  # noqa: PTH118
    stamps = []
    while waiting:
        for item in sorted(os.scandir(waiting.pop()), key=lambda item: item.name):
            if item.name.endswith((".py", ".tables")):
                stat = item.stat()
                stamps.append(f"{item.name} {stat.st_size} {stat.st_mtime_ns}")
            elif "." not in item.name and item.name != "__pycache__":
                waiting.append(item.path)
    kinds = os.stat(os.path.join(package, "kinds.json"))  # noqa: PTH116, PTH118
    return "\n".join((*stamps, f"kinds.json {kinds.st_size} {kinds.st_mtime_ns}"))
