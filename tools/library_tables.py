"""Write the checked standard library after a change of it or of the compiler: `python tools/library_tables.py [FILE]`.

A cold `lingjing validate` reads it instead of checking the libraries that a mission uses. A test compares the committed
file with the output, so that a change cannot be forgotten.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from lingjing.dsl.checking.kept_libraries import FILE, kept_library, tables
from lingjing.dsl.checking.library import shipped_folder
from lingjing.dsl.checking.scope import Library
from lingjing.dsl.checking.toplevel import Files, check_library
from lingjing.dsl.source.text import read_source

__all__ = ["FILE", "Files", "checked", "kept", "kept_library", "shipped_folder"]

_USE = re.compile(r"^use std\.(\w+)", re.MULTILINE)


def kept() -> bytes:
    """Return the present standard library in the format of its file."""
    files = Files()
    return tables(checked(file, files) for file in sorted(Path(shipped_folder("std")).glob("*.ljs")))


def checked(file: Path, files: Files) -> tuple[Library, tuple[str, ...]]:
    """Return a library and the names of the files that it uses, directly or through others."""
    for name in _USE.findall(file.read_text(encoding="utf-8")):
        checked(file.with_name(f"{name}.ljs"), files)
    path = str(file)
    if path not in files.libraries:  # checked here, because `load_library` would read the file that is written anew
        files.libraries[path] = check_library(read_source(path), (), files)
    library, faults = files.libraries[path]
    if faults:
        raise SystemExit(f"{file}: {faults[0].message}")
    return library, tuple(Path(used).name for used in library.uses)


def main() -> None:
    """Write the libraries to the file in the arguments, by default the one that the compiler reads."""
    (Path(sys.argv[1]) if len(sys.argv) > 1 else Path(FILE)).write_bytes(kept())


if __name__ == "__main__":
    main()
