"""Names of files and folders: those that are not UTF-8 are rejected, and texts become parts of names.

Linux allows any bytes in a name, and Python represents bytes that are not UTF-8 as lone surrogates (PEP 383). Traces,
reports and messages between processes are UTF-8 and cannot hold them. The command line and the reader of missions
therefore reject such names at once.
"""

from __future__ import annotations

import os
import re

from lingjing.errors import UsageError


def check_name(name: str, role: str) -> None:
    """Raise `UsageError` for a name that is not UTF-8. `role` describes its owner: `file`, `argument`."""
    if not name.isascii() and any("\ud800" <= letter <= "\udfff" for letter in name):
        shown = os.fsencode(name).decode("utf-8", "backslashreplace")
        raise UsageError(
            f"the {role} `{shown}` is not text in UTF-8",
            hint="rename the file or the folder: its name is recorded, and records are UTF-8",
        )


def plain_name(text: str, longest: int) -> str:
    """Return a text as a part of a file's name, at most `longest` characters: other characters become `_`."""
    return re.sub(r"[^\w.=-]+", "_", text)[:longest]


__all__ = ["check_name", "plain_name"]
