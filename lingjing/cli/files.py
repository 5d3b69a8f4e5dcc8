"""Reading of missions and writing of files, as all verbs do it."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.process import say
from lingjing.data import choose_cache
from lingjing.errors import UsageError
from lingjing.terminal import aligned, write_data
from lingjing.whole_files import written_whole

if TYPE_CHECKING:
    from lingjing.mission.model import Mission
    from lingjing.trace.reader import Trace

_CACHE_TOLD = "LINGJING_CACHE_TOLD"
"""Environment variable with the temporary cache folder that a note has already named to the user."""

NO_OUTCOME = "the episode still runs, or the file was cut or damaged (see `lingjing verify`)"
"""Possible reasons why a trace ends before its episode."""

RECORDED = {b"\x89MCAP0\r\n": "a trace", b"PAR1": "a suite's results"}
"""The first bytes of recorded files (MCAP and Parquet specifications), and their names."""


def read_mission(path: str) -> Mission:
    """Return the mission of a file, a shipped name or standard input (`-`); print notes on standard error."""
    from lingjing.dsl.loading.load import load_with_notes

    mission, notes = load_with_notes(path)
    for note in notes:
        say(f"note: {note}")
    return mission


def check_cache() -> None:
    """Print a note, once for this process and its children, if a temporary folder is used as the cache.

    Raises `UsageError` if the temporary folder cannot be written either.
    """
    choice = choose_cache()
    if not choice.is_usable:
        hint = "make room, or set XDG_CACHE_HOME or TMPDIR to a folder that can be written"
        raise UsageError(f"no folder for the cache: {choice.refused}, and no folder for temporary files", hint=hint)
    if choice.refused and os.environ.get(_CACHE_TOLD) != choice.folder:
        os.environ[_CACHE_TOLD] = choice.folder
        # Matplotlib draws overviews and plans; without this it prints a warning of its own about its folder.
        os.environ.setdefault("MPLCONFIGDIR", os.path.join(choice.folder, "matplotlib"))  # noqa: PTH118
        say(f"note: {choice.refused}: the cache is `{choice.folder}`; XDG_CACHE_HOME sets another")


def say_if_cut(trace: Trace) -> None:
    """Print a note on standard error if a file holds only a part of its episode."""
    if trace.outcome is None:
        last = f"ends after boundary {trace.boundaries[-1].tick}" if trace.boundaries else "holds no boundary"
        say(f"note: {trace.path} {last} without an outcome: {NO_OUTCOME}")


def write_output(content: str | bytes, output: str | None, reads: Iterable[str | Path] = ()) -> None:
    """Write to the named file, or a text to standard output (None or `-`). The file is complete or absent.

    Raises `UsageError` if the file is one of those that the command `reads`, and as `write_whole` does.
    """
    if output in (None, "-"):
        write_data(content if isinstance(content, str) else content.decode())
        return
    check_output(str(output), reads)
    write_whole(str(output), content)


def check_output(output: str, reads: Iterable[str | Path] = ()) -> None:
    """Raise `UsageError` for a file that cannot or must not be written. Called before long work."""
    target = Path(output).resolve()
    if output == "-" or (target.exists() and not target.is_file() and not target.is_dir()):
        return
    if target.is_dir():
        raise UsageError(f"cannot write `{output}`: it is a folder", hint="name a file")
    if any(_same(target, Path(path)) for path in reads):
        raise UsageError(f"cannot write `{output}`: this command reads it", hint="choose another file with -o")
    _check_not_recorded(target, output)
    try:
        with tempfile.TemporaryFile(dir=target.parent):
            pass
    except OSError as error:
        raise UsageError(f"cannot write `{output}`: {error.strerror}", hint="choose another place with -o") from None


def tell_aside(files: Iterable[Path]) -> None:
    """Print on standard error where rows of an old version of a mission are now."""
    for file in files:
        say(
            f"`{file}` has the rows of an old version of a mission; no table shows them, and its episodes are due again"
        )


def say_written(path: str | Path) -> None:
    """Print the name and size of a written file on standard error."""
    size = Path(path).stat().st_size
    say(f"wrote {path} ({size / 1e6:.1f} MB)" if size >= 1e5 else f"wrote {path} ({size / 1e3:.1f} kB)")


def print_columns(rows: Sequence[tuple[str, ...]]) -> None:
    """Print rows as aligned columns; the last column is not padded or cut."""
    for line in aligned(rows):
        print(line)


def write_whole(path: str, content: str | bytes) -> None:
    """Write a file so that it is complete or absent. Raises `UsageError` if it cannot be written.

    Content goes directly to a device or a pipe. A link is followed. A trace is never replaced. Texts are UTF-8.
    """
    data = content.encode() if isinstance(content, str) else content
    target = Path(path).resolve()
    if target.is_dir():
        raise UsageError(f"cannot write `{path}`: it is a folder", hint="name a file")
    if target.exists() and not target.is_file():  # a device or a pipe must not be replaced
        with target.open("wb") as file:
            file.write(data)
        return
    _check_not_recorded(target, path)
    try:
        with written_whole(target) as partial:
            partial.write_bytes(data)
    except OSError as error:
        hint = "choose another place with -o, or make room"
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint=hint) from None


def _same(target: Path, other: Path) -> bool:
    """Return whether two paths are the same file, also under different names."""
    try:
        return target.samefile(other)
    except OSError:  # one of them does not exist
        return False


def _check_not_recorded(target: Path, output: str) -> None:
    """Raise `UsageError` for a file that holds a recorded episode or results, which cannot be made again."""
    with contextlib.suppress(OSError), target.open("rb") as file:
        start = file.read(max(map(len, RECORDED)))
        for magic, name in RECORDED.items():
            if start.startswith(magic):
                hint = "choose another file with -o"
                raise UsageError(f"cannot write `{output}`: it holds {name}, which is never replaced", hint=hint)
