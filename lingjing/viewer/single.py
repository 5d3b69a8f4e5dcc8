"""The page with an episode as one file, which needs no network and no server.

The data is compressed. Pictures are scaled down until all of them together fit a budget. If even the smallest size is
too large, some pictures are left out at even intervals, and the page has a note.
"""

from __future__ import annotations

import base64
import io
import zlib
from collections.abc import Iterator, Sequence

from PIL import Image

from lingjing.errors import LingjingError
from lingjing.trace.reader import Trace
from lingjing.viewer.page import element, page
from lingjing.viewer.page_content import CHUNK, PageContent, page_json

BUDGET_BYTES = 12_000_000
"""Largest total size of the JPEGs, bytes. Chosen, so that the file stays small."""

WIDTHS = (960, 800, 640, 480, 360, 240)
"""Widths, pixels, that are tried in this order. A picture is never enlarged. Chosen."""

QUALITY = 80
"""Pillow's JPEG quality. Chosen."""
_TRIED = 12
"""Number of pictures from which the total size at a width is estimated. Chosen."""


def single_file(trace: Trace, *, truth: bool, budget_bytes: int = BUDGET_BYTES) -> str:
    """Return the page of a trace as HTML. Without `truth`, it contains no hidden targets and no true boxes."""
    content = PageContent(trace, truth)
    pictures, notes = _pictures(trace, budget_bytes)
    names = {name: number for number, (name, _) in enumerate(pictures)}
    elements = [
        element("source", page_json({"kind": "file", "chunk": CHUNK, "pictures": names}).decode()),
        element("page-start", _deflated(content.page_start(notes=notes))),
        element("ground", _deflated(content.ground())),
    ]
    for number, begin in enumerate(range(0, len(content.details), CHUNK)):
        elements.append(element(f"details-{number}", _deflated(content.details[begin : begin + CHUNK])))
    for name, jpeg in pictures:
        elements.append(element(f"picture-{names[name]}", base64.b64encode(jpeg).decode()))
    return page(f"{trace.header.instance.mission} · Lingjing", "\n".join(elements), meta_policy=True)


def _deflated(value: object) -> str:
    return base64.b64encode(zlib.compress(page_json(value), 9)).decode()


def _pictures(trace: Trace, budget_bytes: int) -> tuple[list[tuple[str, bytes]], list[str]]:
    """Return id and JPEG of the pictures at the largest width that fits, and notes for the reader."""
    names = list(trace.frames)
    if not names or budget_bytes <= 0:
        return [], (["The pictures are not in this file."] if names else [])
    sample = names[:: max(1, len(names) // _TRIED)]
    for width in WIDTHS:
        sizes = [len(jpeg) for _, jpeg in _scaled(trace, sample, width)]
        mean = sum(sizes) / len(sizes) if sizes else 0.0
        if mean * len(names) <= budget_bytes * 0.95 or width == WIDTHS[-1]:
            break
    kept = names
    if mean * len(names) > budget_bytes * 0.95:
        most = max(1, int(budget_bytes * 0.95 / mean))
        kept = [names[number * len(names) // most] for number in range(most)]
    pictures: list[tuple[str, bytes]] = []
    left = budget_bytes
    for name, jpeg in _scaled(trace, kept, width):
        left -= len(jpeg)
        if left < 0:
            break
        pictures.append((name, jpeg))
    notes = [f"Pictures are at most {width} pixels wide in this file."]
    if len(pictures) < len(names):
        notes.append(f"It holds {len(pictures)} of {len(names)} pictures, to stay small; `lingjing view` shows all.")
    return pictures, notes


def _scaled(trace: Trace, names: Sequence[str], width: int) -> Iterator[tuple[str, bytes]]:
    """Yield the pictures that can be decoded, scaled to at most `width` pixels."""
    for name in names:
        try:
            image = Image.open(io.BytesIO(trace.jpeg(name)), formats=("JPEG",)).convert("RGB")
        except (LingjingError, OSError, ValueError, SyntaxError):
            continue  # the page shows a note in the place of a missing or broken picture
        if image.width > width:
            image = image.resize((width, max(1, round(image.height * width / image.width))), Image.Resampling.LANCZOS)
        out = io.BytesIO()
        image.save(out, "JPEG", quality=QUALITY, optimize=True)
        yield name, out.getvalue()
