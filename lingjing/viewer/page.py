"""The one page, with its script and style inside; nothing in it comes from the network or from an inline handler.

The content policy names the script and the style by their hashes: no other script runs, whatever texts an episode
holds. A page from a server may ask that server for data, a page from a file may ask nobody.
"""

from __future__ import annotations

import base64
import hashlib
import html
from functools import lru_cache
from importlib.resources import files

SCRIPTS = ("city.js", "episode.js", "marks.js", "player.js")


def page(title: str, data: str, *, meta_policy: bool) -> str:
    """The page as HTML. `data` are the elements that hold its data, escaped by the caller.

    `meta_policy` puts the content policy for a file into the page; a server sends `policy()` as a header.
    """
    script, style = _assets()
    meta = ""
    if meta_policy:
        meta = f'<meta http-equiv="Content-Security-Policy" content="{policy(served=False)}">'
    parts = {"meta": meta, "title": html.escape(title), "style": style, "data": data, "script": script}
    text = _asset("player.html")
    for name, value in parts.items():
        before, _, after = text.partition(f"{{{{{name}}}}}")
        text = before + value + after
    return text


def element(name: str, text: str) -> str:
    """A data element of a page; `text` must hold no `<` (base64, or JSON made by `packed`)."""
    if "<" in text:
        raise ValueError("data of a page must hold no <")
    return f'<script type="text/plain" id="d-{html.escape(name)}">{text}</script>'


def policy(*, served: bool) -> str:
    """The content security policy of the page."""
    script, style = (f"'sha256-{_sha256(text)}'" for text in _assets())
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


@lru_cache(maxsize=1)
def _assets() -> tuple[str, str]:
    """Script and style."""
    script = "\n".join(_asset(name) for name in SCRIPTS)
    return f'"use strict";\n{{\n{script}\n}}\n', _asset("player.css")


def _asset(name: str) -> str:
    return files("lingjing.viewer").joinpath("assets", name).read_text(encoding="utf-8")


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
