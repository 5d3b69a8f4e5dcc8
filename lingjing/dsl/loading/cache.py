"""Compiled missions, kept by content in the user's cache folder (`$XDG_CACHE_HOME/lingjing/missions`).

Only what has no error is kept: the diagnostics that are no errors, and the mission. The key covers the text, its path
(it stands in the mission and in diagnostics), and the size and time of every file of this compiler; an entry also names
each library the mission uses, directly or through others, with the digest of its text, and counts only while all of
them are found at the same place with the same contents.

A cache may cost time, never truth: entries are files of `lingjing.kept_files`; where nothing can be written nothing is
kept.
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
from lingjing.kept_files import prune, read_kept, write_kept
from lingjing.mission.diagnostics import Diagnostic

if TYPE_CHECKING:
    from lingjing.dsl.compilation import Compilation
    from lingjing.mission.model import Mission

FORMAT = b"1"
MOST_ENTRIES = 200
MOST_BYTES = 1 << 28
LARGEST_ENTRY = 16 * 1024 * 1024
"""Bytes. A mission that takes more is compiled each time, so that the cache does not fill the disk."""

_USE = re.compile(r"\buse\b[ \t]*(?P<dot>\.?)[ \t]*(?P<path>[^\W\d]\w*(?:[ \t]*\.[ \t]*[^\W\d]\w*)*)")


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

    One that needs a plug-in or a map is not kept either: by the next time that may be there, or gone.
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
        entry = CacheEntry(tuple(_libraries(source)), compilation.diagnostics, mission)
        file = _file(source)
        write_kept(file, msgspec.msgpack.encode(entry))
        prune(os.path.dirname(file), most_bytes=MOST_BYTES, most_files=MOST_ENTRIES)  # noqa: PTH120
    except (OSError, UsageError, PluginError):
        return


# -- private


def _needs_others(mission: Mission) -> bool:
    from lingjing.dsl.feasibility.absent import strange
    from lingjing.mission.kinds import scene_kind

    if next(strange(mission), None) is not None:
        return True
    kind = scene_kind(mission.scene.kind)
    paths = {name for name, option in kind.options.items() if option.type == "path"} if kind else set()
    return any(option.name in paths for option in mission.scene.options)


def _entry(source: SourceText) -> CacheEntry | None:
    if cache_is_off():
        return None
    try:
        data = read_kept(_file(source))
        if data is None:
            return None
        entry = msgspec.msgpack.decode(data, type=CacheEntry)
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
