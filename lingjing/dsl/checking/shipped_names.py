"""The names that the standard library declares, for the hint at a forgotten `use`.

The files are searched by the beginnings of their lines, not parsed: an error needs only the name of the file.
"""

from __future__ import annotations

import os
import re
from functools import cache

from lingjing.dsl.checking.library import shipped_folder

_DECLARED = re.compile(r"^(?:asset|target|record|camera|weather) +(\w+)", re.MULTILINE)
_PERFORMED = re.compile(r"^ +interaction +(\w+)", re.MULTILINE)


@cache
def standard_names() -> dict[str, str]:
    """Type, record or preset of the standard library → its file as in `use`, such as `std.air`."""
    names: dict[str, str] = {}
    folder = shipped_folder("std")
    for file in sorted(os.listdir(folder)):  # noqa: PTH208 - pathlib is not imported cold
        library, extension = os.path.splitext(file)  # noqa: PTH122
        if extension == ".ljs":
            for name in _DECLARED.findall(_text(folder, file)):
                names.setdefault(name, f"std.{library}")
    return names


@cache
def performed_in(library: str) -> frozenset[str]:
    """The interactions that the types of a standard file have."""
    return frozenset(_PERFORMED.findall(_text(shipped_folder("std"), library.removeprefix("std.") + ".ljs")))


def _text(folder: str, file: str) -> str:
    with open(os.path.join(folder, file), encoding="utf-8") as source:  # noqa: PTH118, PTH123
        return source.read()
