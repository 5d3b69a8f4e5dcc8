"""Missions read, and texts written, as every verb does it."""

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
"""Environment variable: the temporary folder that the user knows of."""

NO_OUTCOME = "it is still played, was killed, cut or damaged (`lingjing verify` tells)"
"""Why a trace ends before its episode."""

RECORDED = {b"\x89MCAP0\r\n": "a trace", b"PAR1": "a suite's results"}
"""How files of episodes begin (MCAP and Parquet specifications), and what they are."""


def read_mission(path: str) -> Mission:
    """The mission of a file, a shipped name or standard input (`-`); notes on a document go to standard error."""
    from lingjing.dsl.loading.load import load_with_notes

    mission, notes = load_with_notes(path)
    for note in notes:
        say(f"note: {note}")
    return mission


def check_cache() -> None:
    """Say once, for this process and those that it starts, that a temporary folder is used as the cache.

    Raises `UsageError` where that cannot be written either.
    """
    choice = choose_cache()
    if not choice.is_usable:
        hint = "make room, or set XDG_CACHE_HOME or TMPDIR to a folder that can be written"
        raise UsageError(f"no folder for the cache: {choice.refused}, and none for temporary files either", hint=hint)
    if choice.refused and os.environ.get(_CACHE_TOLD) != choice.folder:
        os.environ[_CACHE_TOLD] = choice.folder
        # Matplotlib, which draws overviews and plans, would say in its own words that its folder is not there.
        os.environ.setdefault("MPLCONFIGDIR", os.path.join(choice.folder, "matplotlib"))  # noqa: PTH118
        say(f"note: {choice.refused}: the cache is `{choice.folder}`; XDG_CACHE_HOME names another")


def say_if_cut(trace: Trace) -> None:
    """Say on standard error that a file holds a part of its episode only, for whatever is then made of it."""
    if trace.outcome is None:
        last = f"ends behind boundary {trace.boundaries[-1].tick}" if trace.boundaries else "holds no boundary"
        say(f"note: {trace.path} {last} without an outcome: {NO_OUTCOME}")


def write_output(content: str | bytes, output: str | None, reads: Iterable[str | Path] = ()) -> None:
    """Write to the file that is named, whole or not at all, or a text to standard output (None or `-`).

    Raises `UsageError` for one of the files that the command `reads`, and as `write_whole` does.
    """
    if output in (None, "-"):
        write_data(content if isinstance(content, str) else content.decode())
        return
    check_output(str(output), reads)
    write_whole(str(output), content)


def check_output(output: str, reads: Iterable[str | Path] = ()) -> None:
    """Raise `UsageError` where a file cannot or must not be written, before long work is done for it."""
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


def say_written(path: str | Path) -> None:
    """Say on standard error which file was written, and its size."""
    size = Path(path).stat().st_size
    say(f"wrote {path} ({size / 1e6:.1f} MB)" if size >= 1e5 else f"wrote {path} ({size / 1e3:.1f} kB)")


def print_columns(rows: Sequence[tuple[str, ...]]) -> None:
    """Print aligned columns; the last is as long as it is."""
    for line in aligned(rows):
        print(line)


def write_whole(path: str, content: str | bytes) -> None:
    """Write a file so that it is there whole or not at all; `UsageError` if it cannot be written.

    A device or a pipe gets the content itself. A link is followed. A trace is never replaced. Texts are UTF-8.
    """
    data = content.encode() if isinstance(content, str) else content
    target = Path(path).resolve()
    if target.is_dir():
        raise UsageError(f"cannot write `{path}`: it is a folder", hint="name a file")
    if target.exists() and not target.is_file():  # a device or a pipe is written to, never replaced
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
    """Whether two paths are one file, under whatever names."""
    try:
        return target.samefile(other)
    except OSError:  # one of them is not there
        return False


def _check_not_recorded(target: Path, output: str) -> None:
    """Raise `UsageError` for a file that holds what was played: it cannot be made again from what is written."""
    with contextlib.suppress(OSError), target.open("rb") as file:
        start = file.read(max(map(len, RECORDED)))
        for magic, name in RECORDED.items():
            if start.startswith(magic):
                hint = "choose another file with -o"
                raise UsageError(f"cannot write `{output}`: {name} is there, which is never replaced", hint=hint)
