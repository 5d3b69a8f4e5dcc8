"""Tables of a notebook: names and values as HTML, with optional pictures. Everything from outside is escaped."""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from pkgutil import resolve_name

from lingjing.errors import LingjingError

THUMBNAIL_PX = 240
"""Width of the small pictures below a table, pixels (chosen: three fit into a notebook's column)."""

_STYLE = "text-align:left;vertical-align:top"


def html_table(
    title: str, values: Mapping[str, object], picture: bytes | None = None, thumbnails: Sequence[bytes] = ()
) -> str:
    """Return a table with one row for each value, under a title; below it a PNG, and small pictures as JPEG."""
    rows = "".join(
        f'<tr><th style="{_STYLE}">{escape(name)}</th><td style="{_STYLE}">{escape(str(value))}</td></tr>'
        for name, value in values.items()
    )
    shown = [f"<table><caption>{escape(title)}</caption>{rows}</table>"]
    if picture is not None:
        data = b64encode(picture).decode()
        shown.append(f'<img alt="" style="max-width:100%;max-height:560px" src="data:image/png;base64,{data}">')
    if thumbnails:
        texts = (b64encode(jpeg).decode() for jpeg in thumbnails)
        row = "".join(f'<img alt="" style="margin:2px" src="data:image/jpeg;base64,{text}">' for text in texts)
        shown.append(f"<div>{row}</div>")
    return "".join(shown)


def drawn_by(reference: str, subject: object) -> tuple[bytes | None, str]:
    """Return the PNG that a function draws of a subject, or None and the reason in words.

    `reference` is `package.module:function`. It is a text because a mission and a trace are shown by packages that lie
    above theirs and are loaded for a notebook alone.
    """
    try:
        picture: bytes = resolve_name(reference)(subject)
    except LingjingError as error:
        return None, str(error)
    return picture, ""


def thumbnail(jpeg: bytes) -> bytes:
    """Return a picture as a JPEG of `THUMBNAIL_PX` width; a smaller one keeps its size."""
    from PIL import Image

    with Image.open(io.BytesIO(jpeg)) as picture:
        picture.thumbnail((THUMBNAIL_PX, THUMBNAIL_PX))
        small = io.BytesIO()
        picture.convert("RGB").save(small, "JPEG", quality=85)
    return small.getvalue()


def bytes_of(path: Path) -> bytes | None:
    """Return the bytes of a file; None if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return None
