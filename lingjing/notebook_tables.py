"""Tables of a notebook: names and values as HTML, with an optional picture. Everything from outside is escaped."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from html import escape
from pathlib import Path


def html_table(title: str, values: Mapping[str, object], picture: bytes | None = None) -> str:
    """Return a table with one row for each value, under a title, and below it a PNG."""
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>" for name, value in values.items())
    table = f"<table><caption>{escape(title)}</caption>{rows}</table>"
    if picture is None:
        return table
    return f'{table}<img alt="" style="max-width:100%" src="data:image/png;base64,{b64encode(picture).decode()}">'


def bytes_of(path: Path) -> bytes | None:
    """Return the bytes of a file; None if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return None
