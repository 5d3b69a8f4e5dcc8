"""Python files of users. An error in one is reported with its file and line, without a traceback of this project."""

from __future__ import annotations

import hashlib
import sys
import traceback
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from lingjing.errors import ForeignCodeError, UsageError
from lingjing.plugins.foreign_errors import one_line


def load_file(path: Path, what: str, start: str = "") -> ModuleType:
    """Return the module of a user's file. `what` names the file's kind in messages, `start` is the hint for a missing
    file.

    Raises `UsageError` if it cannot be read, `ForeignCodeError` if its code fails.
    """
    try:
        is_there, resolved = path.is_file(), path.resolve()
    except OSError as error:
        raise UsageError(f"cannot read the {what} file `{path}`: {error.strerror}") from error
    if not is_there:
        raise UsageError(f"there is no {what} file `{path}`", hint=start)
    unique = hashlib.sha256(str(resolved).encode()).hexdigest()[:12]
    spec = spec_from_file_location(f"lingjing_{what}_{path.stem}_{unique}", resolved)
    if spec is None or spec.loader is None:
        raise UsageError(f"`{path}` cannot be loaded as a Python module")
    module = module_from_spec(spec)
    if str(resolved.parent) not in sys.path:
        sys.path.append(str(resolved.parent))  # last, so that a sibling is found and nothing installed is shadowed
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        raise ForeignCodeError(
            f"{error.filename or path}:{error.lineno}: {error.msg}", hint=f"fix the {what} file"
        ) from error
    except (Exception, SystemExit) as error:
        where = f"{path}:{_line_in(error, resolved)}"
        raise ForeignCodeError(f"{where}: {one_line(error, with_place=False)}", hint=f"fix the {what} file") from error
    return module


def function_of(spec: str, what: str, start: str = "") -> Callable[..., Any]:
    """Return the function that `FILE.py:FUNCTION` names. Raises `UsageError`."""
    path, _, name = spec.partition(":")
    function: Callable[..., Any] | None = getattr(load_file(Path(path), what, start), name, None)
    if not callable(function):
        raise UsageError(f"`{path}` has no function `{name}`", hint=start)
    return function


def _line_in(error: BaseException, path: Path) -> int:
    """Return the last line of `path` in the exception's traceback; 1 if there is none."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    return lines[-1] or 1 if lines else 1
