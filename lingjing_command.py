"""The command `lingjing`: start the command line, or name the package that stands in its place.

This module is outside of the package `lingjing`, because public indexes have another party's package of that name.
Installed beside this project, that package hides the whole of it or overwrites its `__init__.py`.
"""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from types import ModuleType

_OWN = os.path.join(os.path.dirname(os.path.realpath(__file__)), "lingjing")  # noqa: PTH118, PTH120 - a cold start
_USAGE = 2
_INTERRUPTED = 130


def main() -> int:
    """Run the command line and return its exit code. An interrupt while the package is imported prints one word."""
    try:
        return _start()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return _INTERRUPTED


def _start() -> int:
    """Run the command line; 2 if the package `lingjing` is another party's, or is not whole."""
    stranger = _stranger()
    if stranger:
        print(f"error: {stranger}\nhint: {_advice(is_hidden='hides' in stranger)}", file=sys.stderr)
        return _USAGE
    from lingjing.cli.main import main as command

    return command()


def _stranger() -> str:
    """The fault of the package that `import lingjing` finds; "" for this project's own."""
    spec = find_spec("lingjing")
    if spec is None or spec.origin is None:
        return f"the package `lingjing` has lost its `__init__.py`: {_OWN}"
    if os.path.realpath(spec.origin) != os.path.join(_OWN, "__init__.py"):  # noqa: PTH118 - a cold start
        return f"another package `lingjing` hides this project's: {spec.origin}"
    import lingjing

    if "EpisodeReport" not in getattr(lingjing, "__all__", ()):
        return f"another package `lingjing` was installed over this project's: {spec.origin}"
    return ""


def _advice(is_hidden: bool) -> str:
    """The lines that mend it. A package without an `__init__.py`, of this project's folder, stands in for the other."""
    own = ModuleType("lingjing")
    own.__path__ = [_OWN]
    sys.modules["lingjing"] = own
    from lingjing.installation import repair_advice

    return repair_advice(is_hidden)


if __name__ == "__main__":
    sys.exit(main())
