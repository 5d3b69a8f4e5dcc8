"""Texts from the answers of models: the first JSON object, in prose or in a fence, and lines that fit a request."""

from __future__ import annotations

import json
from collections.abc import Mapping

_DECODER = json.JSONDecoder()


def first_object(text: str) -> Mapping[str, object]:
    """Return the first JSON object in a text; an empty one if there is none."""
    start = text.find("{")
    while start >= 0:
        try:
            value, _ = _DECODER.raw_decode(text, start)
        except (ValueError, RecursionError):
            start = text.find("{", start + 1)
            continue
        return value if isinstance(value, dict) else {}
    return {}


def plain(text: str, letters: int) -> str:
    """Return a text in one line, cut to `letters`. Lone surrogates, which UTF-8 cannot encode, become `?`."""
    return " ".join(text.split())[:letters].encode("utf-8", "replace").decode()


def lines(value: object, most: int, letters: int) -> tuple[str, ...]:
    """Return the texts of a list, at most `most`, each cut to `letters`; none if the value is no list."""
    texts = [plain(item, letters) for item in value if isinstance(item, str)] if isinstance(value, list) else []
    return tuple(text for text in texts if text)[:most]
