"""The page with an episode in it as one file, which needs no network and no server.

Data is compressed. Pictures are scaled down until all of them together keep to a budget; where even the smallest size
is too much, some are left out, evenly, and the page says so.
"""

from __future__ import annotations

import base64
import io
import zlib
from collections.abc import Iterator, Sequence

from PIL import Image

from lingjing.errors import LingjingError
from lingjing.trace.reader import Trace
from lingjing.viewer.narrated import CHUNK, Narration, packed
from lingjing.viewer.page import element, page

BUDGET_BYTES = 12_000_000
"""What all pictures of a file take at most, as JPEG."""

WIDTHS = (960, 800, 640, 480, 360, 240)
"""Widths that are tried, pixels; a picture is never made wider than it is."""

QUALITY = 80
_TRIED = 12
"""So many pictures tell how much a width takes."""


def single_file(trace: Trace, *, truth: bool, budget_bytes: int = BUDGET_BYTES) -> str:
    """The page of a trace as HTML."""
    told = Narration(trace, truth)
    pictures, notes = _pictures(trace, budget_bytes)
    names = {name: number for number, (name, _) in enumerate(pictures)}
    elements = [
        element("source", packed({"kind": "file", "chunk": CHUNK, "pictures": names}).decode()),
        element("page-start", _deflated(told.page_start(notes=notes))),
        element("ground", _deflated(told.ground())),
    ]
    for number, begin in enumerate(range(0, len(told.details), CHUNK)):
        elements.append(element(f"details-{number}", _deflated(told.details[begin : begin + CHUNK])))
    for name, jpeg in pictures:
        elements.append(element(f"picture-{names[name]}", base64.b64encode(jpeg).decode()))
    return page(f"{trace.header.instance.mission} · Lingjing", "\n".join(elements), meta_policy=True)


def _deflated(value: object) -> str:
    return base64.b64encode(zlib.compress(packed(value), 9)).decode()


def _pictures(trace: Trace, budget_bytes: int) -> tuple[list[tuple[str, bytes]], list[str]]:
    """The pictures at the largest width that fits, and what a reader must know of them."""
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
    found: list[tuple[str, bytes]] = []
    left = budget_bytes
    for name, jpeg in _scaled(trace, kept, width):
        left -= len(jpeg)
        if left < 0:
            break
        found.append((name, jpeg))
    notes = [f"Pictures are at most {width} pixels wide in this file."]
    if len(found) < len(names):
        notes.append(f"It holds {len(found)} of {len(names)} pictures, to stay small; `lingjing view` shows all.")
    return found, notes


def _scaled(trace: Trace, names: Sequence[str], width: int) -> Iterator[tuple[str, bytes]]:
    """The pictures that can be read, no wider than `width`."""
    for name in names:
        try:
            image = Image.open(io.BytesIO(trace.jpeg(name)), formats=("JPEG",)).convert("RGB")
        except (LingjingError, OSError, ValueError, SyntaxError):
            continue  # lost or broken: the page says so where it would be
        if image.width > width:
            image = image.resize((width, max(1, round(image.height * width / image.width))), Image.Resampling.LANCZOS)
        out = io.BytesIO()
        image.save(out, "JPEG", quality=QUALITY, optimize=True)
        yield name, out.getvalue()
