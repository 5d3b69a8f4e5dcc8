"""The HTML page, with its script and style. It loads nothing from the network and has no inline event handlers.

The content security policy allows the script and the style by their hashes. No other script runs, whatever texts an
episode contains. A page from a server may request data from that server. A page from a file may send no requests.
"""

from __future__ import annotations

import base64
import hashlib
import html
from functools import lru_cache
from importlib.resources import files
from typing import NamedTuple


class PageAssets(NamedTuple):
    """The files of one kind of page."""

    document: str
    style: str
    scripts: tuple[str, ...]


PLAYER = PageAssets("player.html", "player.css", ("city.js", "episode.js", "marks.js", "player.js"))
"""The player of an episode."""

CALLS = PageAssets("calls.html", "calls.css", ("calls.js",))
"""The model calls of an episode."""


def page(title: str, data: str, *, meta_policy: bool, assets: PageAssets = PLAYER) -> str:
    """Return the page as HTML. `data` contains its data elements, which the caller has escaped.

    With `meta_policy`, the page contains the content security policy for a file. A server sends `policy()` as a header.
    """
    script, style = _assets(assets)
    meta = ""
    if meta_policy:
        meta = f'<meta http-equiv="Content-Security-Policy" content="{policy(served=False, assets=assets)}">'
    parts = {"meta": meta, "title": html.escape(title), "style": style, "data": data, "script": script}
    text = _asset(assets.document)
    for name, value in parts.items():
        before, _, after = text.partition(f"{{{{{name}}}}}")
        text = before + value + after
    return text


def element(name: str, text: str) -> str:
    """Return a data element of a page. `text` is base64 or from `page_json`. Raises `ValueError` if it has a `<`."""
    if "<" in text:
        raise ValueError("data of a page must hold no <")
    return f'<script type="text/plain" id="d-{html.escape(name)}">{text}</script>'


def policy(*, served: bool, assets: PageAssets = PLAYER) -> str:
    """Return the content security policy of a page from a server (`served`) or from a file."""
    script, style = (f"'sha256-{_sha256(text)}'" for text in _assets(assets))
    rules = {
        "default-src": "'none'",
        "script-src": script,
        "style-src": style,
        "img-src": "'self' data:" if served else "data:",
        "connect-src": "'self'" if served else "'none'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    if served:
        rules["frame-ancestors"] = "'none'"
    return "; ".join(f"{name} {value}" for name, value in rules.items())


@lru_cache(maxsize=2)
def _assets(assets: PageAssets) -> tuple[str, str]:
    """Return the script and the style."""
    script = "\n".join(_asset(name) for name in assets.scripts)
    return f'"use strict";\n{{\n{script}\n}}\n', _asset(assets.style)


def _asset(name: str) -> str:
    return files("lingjing.viewer").joinpath("assets", name).read_text(encoding="utf-8")


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
