"""Errors of foreign code in one line: the exception, its message, and the file and line of the plug-in's own code.

A message has no traceback. The environment variable `LINGJING_TRACEBACK=1` shows it (`lingjing.cli.main`).
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from sysconfig import get_path

from lingjing.errors import LingjingError

VARIABLE = "LINGJING_TRACEBACK"
"""The environment variable that shows tracebacks, unless it is empty or 0."""

_ALIEN = frozenset({"lingjing", "lingjing_agents", "pluggy", "pydantic", "pydantic_core"})
"""Packages that call plug-ins, or that stand between a plug-in and this project."""

_LIBRARY = get_path("stdlib")
"""The folder of Python's own modules."""


def one_line(error: BaseException, *, with_place: bool = True) -> str:
    """Return the message of an exception in one line, with its type and the place in the plug-in's code unless it is an
    error of this project. `with_place` is False where the message names the place already.
    """
    if isinstance(error, LingjingError):
        return _first_line(_text(error))
    place = place_of(error) if with_place else ""
    text = _text(error.msg if isinstance(error, SyntaxError) else error)
    name = type(error).__name__
    line = _first_line(f"{name}: {text}" if text else name)
    return f"{line} ({place})" if place else line


def place_of(error: BaseException) -> str:
    """Return `package/module.py:LINE` of the plug-in's code in which an exception arose; "" without code of a plug-in.

    It is the last frame of the package that this project called first, so that an exception of a library is reported
    at the call of the library. The path begins at the package, so that it is the same on each machine.
    """
    if isinstance(error, SyntaxError) and error.filename and error.lineno and not _is_library(error.filename):
        return f"{_short_path(error.filename, Path(error.filename).parent.name)}:{error.lineno}"
    frames = list(_foreign_frames(error))
    own = [(file, package, line) for file, package, line in frames if _top(package) == _top(frames[0][1])]
    if not own:
        return ""
    file, package, line = own[-1]
    return f"{_short_path(file, package)}:{line}"


def kind_of_value(value: object) -> str:
    """Return the kind of a value in words, for messages about wrong values of foreign code."""
    return "None" if value is None else f"a value of type `{type(value).__name__}`"


def wants_traceback() -> bool:
    """Return True if the user wants to see tracebacks."""
    return os.environ.get(VARIABLE, "") not in {"", "0"}


def wanted_traceback(error: BaseException) -> str:
    """Return the traceback of an exception with its causes and notes; "" if the user does not want to see it."""
    return "".join(traceback.format_exception(error)) if wants_traceback() else ""


def print_wanted_traceback(error: BaseException) -> None:
    """Print the traceback of an exception on standard error if the user wants to see it."""
    if text := wanted_traceback(error):
        with suppress(OSError, ValueError):  # the stream is closed
            sys.stderr.write(text)
            sys.stderr.flush()


def _foreign_frames(error: BaseException) -> Iterator[tuple[str, str, int]]:
    """Yield the file, the package and the line of each frame that is neither this project's nor Python's own."""
    for frame, line in traceback.walk_tb(error.__traceback__):
        file, names = frame.f_code.co_filename, frame.f_globals
        if not _is_library(file) and _top(str(names.get("__name__", ""))) not in _ALIEN:
            yield file, str(names.get("__package__") or ""), line


def _top(module: str) -> str:
    return module.partition(".")[0]


def _is_library(file: str) -> bool:
    """Return True for code of Python itself; packages may be installed in a folder within that of its modules."""
    within = file.startswith(_LIBRARY + os.sep)
    return file.startswith("<") or (within and "site-packages" not in file and "dist-packages" not in file)


def _short_path(file: str, package: str) -> str:
    """Return the path of a file from its package's folder on."""
    depth = 1 + len(package.split(".")) if package else 1
    return "/".join(Path(file).parts[-depth:])


def _text(error: object) -> str:
    """Return the text of an error; "" if its own `__str__` raises."""
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - foreign code
        return ""


def _first_line(text: str) -> str:
    lines = text.splitlines() or [""]
    return lines[0].rstrip(": ").encode("utf-8", "backslashreplace").decode()


__all__ = [
    "VARIABLE", "kind_of_value", "one_line", "place_of", "print_wanted_traceback", "wanted_traceback",
    "wants_traceback",
]  # fmt: skip
