"""`Redactor`: removes keys and passwords from texts of services, libraries and exceptions.

A secret is found in any letter case, as any substring of at least `RUN` characters, percent-encoded, with JSON or HTML
escapes, in hexadecimal and in base64 (alone or inside a longer text, as in `Basic` authorisation). A secret shorter
than `RUN` is found as a separate word. One shorter than `SHORTEST` is not searched for, because such texts occur in
every sentence. A secret in an encoding of the service's own cannot be found.
"""

from __future__ import annotations

import html
import json
import re
from base64 import b64encode, urlsafe_b64encode
from collections.abc import Iterable, Iterator
from urllib.parse import quote, quote_plus, unquote

import numpy as np
import numpy.typing as npt

MARK = "***"
"""The replacement of a secret."""
RUN = 8
"""Length of the substrings of a secret that are searched for. Chosen."""
SHORTEST = 4
"""Length of the shortest secret that is searched for. Chosen."""
_LONG = 1000
"""Length from which on a text is pre-filtered by rolling sums."""
_FACTOR = 1_000_003
"""Base of the polynomial sums of substrings: a prime above all character frequencies in practice. Chosen."""
_ROUNDS = 3
"""Number of nested escapes that are undone. Chosen."""

_USERINFO = re.compile(r"(?<=://)[^/\s@\"'<>]+@")
_JSON_ESCAPE = re.compile(r"(?<!\\)\\++(?:u([0-9a-fA-F]{4})|x([0-9a-fA-F]{2}))")
_ASCII_LOWER = {upper: upper + 32 for upper in range(ord("A"), ord("Z") + 1)}


class Redactor:
    """A function that replaces `secrets`, and the user and password of every URL, in a text."""

    def __init__(self, secrets: Iterable[str]) -> None:
        spellings = {_lower(form) for secret in secrets if len(secret) >= SHORTEST for form in _spellings(secret)}
        self._runs = frozenset(form[at : at + RUN] for form in spellings for at in range(len(form) - RUN + 1))
        self._sums = np.unique([_sums(run)[0] for run in self._runs] or [0])
        short = sorted(form for form in spellings if SHORTEST <= len(form) < RUN)
        self._alone = re.compile(rf"(?<!\w)(?:{'|'.join(map(re.escape, short))})(?!\w)") if short else None

    def __call__(self, text: str) -> str:
        """Return `text` with `***` for every secret. A text with a secret in escapes is returned without these
        escapes.
        """
        text = self._plain(text)
        view = text
        for _ in range(_ROUNDS):
            before = view
            for unescape in (unquote, html.unescape, _without_json_escapes):
                view = unescape(view)
            if view == before:
                break
            if self._secret_spans(view):
                text = view = self._plain(view)
        return text

    def _plain(self, text: str) -> str:
        parts, end = [], 0
        for first, last in self._secret_spans(text):
            parts += [text[end:first], MARK]
            end = last
        return _USERINFO.sub(f"{MARK}@", "".join([*parts, text[end:]]))

    def _secret_spans(self, text: str) -> list[tuple[int, int]]:
        """Return the spans of secrets, in order and disjoint."""
        lowered = _lower(text)
        spans = [match.span() for match in self._alone.finditer(lowered)] if self._alone else []
        spans += [(at, at + RUN) for at in self._candidates(lowered) if lowered[at : at + RUN] in self._runs]
        joined: list[tuple[int, int]] = []
        for first, last in sorted(spans):
            if joined and first <= joined[-1][1]:
                joined[-1] = (joined[-1][0], max(last, joined[-1][1]))
            else:
                joined.append((first, last))
        return joined

    def _candidates(self, lowered: str) -> list[int]:
        """Return possible starts of a secret: every index of a short text, indices with a matching sum in a long
        one.
        """
        if len(lowered) < _LONG or not self._runs:
            return list(range(max(0, len(lowered) - RUN + 1)))
        return [int(at) for at in np.flatnonzero(np.isin(_sums(lowered), self._sums))]


def _spellings(secret: str) -> Iterator[str]:
    yield from (secret, quote(secret, safe=""), quote_plus(secret), json.dumps(secret)[1:-1], html.escape(secret))
    data = secret.encode("utf-8", "surrogatepass")
    yield data.hex()
    for encode in (b64encode, urlsafe_b64encode):
        for before in range(3):  # inside a longer text it may start at any of three offsets of a base64 group
            letters = encode(b"\0" * before + data).decode().rstrip("=")
            yield letters[(0, 2, 3)[before] : len(letters) - bool((before + len(data)) % 3)]


def _sums(text: str) -> npt.NDArray[np.uint64]:
    """Return a number for each substring of `RUN` characters; equal substrings have equal numbers."""
    letters = np.frombuffer(text.encode("utf-32-le", "surrogatepass"), "<u4").astype(np.uint64)
    sums = np.zeros(len(letters) - RUN + 1, np.uint64)
    for at in range(RUN):
        sums = sums * np.uint64(_FACTOR) + letters[at : at + len(sums)]
    return sums


def _without_json_escapes(text: str) -> str:
    return _JSON_ESCAPE.sub(_character, text)


def _lower(text: str) -> str:
    """Return the text in lower case with the same length."""
    lowered = text.lower()
    return lowered if len(lowered) == len(text) else text.translate(_ASCII_LOWER)


def _character(escape: re.Match[str]) -> str:
    return chr(int(escape[1] or escape[2], 16))
