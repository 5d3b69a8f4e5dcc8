"""JSON text as plain values, with messages that name the line and column or the JSON path of an error."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

from lingjing.errors import Fault, MissionError, UsageError

_PLAIN = "write finite numbers and valid Unicode"

_COMMENT = re.compile(r'"(?:[^"\\]|\\.)*"|//[^\n]*|/\*.*?\*/', re.DOTALL)
"""A string, or a comment."""
_COMMA = re.compile(r'"(?:[^"\\]|\\.)*"|,(?=\s*[]}])')
"""A string, or a comma before a closing bracket."""


def without_comments(text: str) -> str:
    """The text with blanks in place of `// …` and `/* … */` outside of strings, so that lines and columns stay."""
    if "//" not in text and "/*" not in text:
        return text
    return _COMMENT.sub(_blanked, text)


def without_extras(text: str) -> str:
    """The text with blanks in place of comments and of commas before a closing bracket."""
    return _COMMA.sub(_blanked, without_comments(text))


def _blanked(match: re.Match[str]) -> str:
    return match[0] if match[0][0] == '"' else re.sub(r"[^\n]", " ", match[0])


def load(text: str, path: str, notes: list[str] | None = None, faults: list[Fault] | None = None) -> object:
    """The parsed document.

    Raises `UsageError` if it is not JSON, `MissionError` for a number that JSON does not have: NaN, Infinity and
    numbers beyond a double, which Python's parser accepts, are reported with their path. With `notes`, comments and
    commas before a bracket are accepted, and a note is added. With `faults`, errors of values are added there and
    replaced by 0 or "".
    """
    plain = text.removeprefix("\ufeff")
    if notes is not None:
        for what, without in (("comments", without_comments), ("commas before a bracket", without_extras)):
            if (cleaned := without(plain)) != plain:
                notes.append(f"$: {what} are not valid JSON; they are ignored and kept")
                plain = cleaned
    try:
        value: object = json.loads(plain)
    except json.JSONDecodeError as error:
        raise UsageError(
            f"{path}:{error.lineno}:{error.colno}: not JSON: {error.msg}",
            hint=_way_out(text, error.msg, strict=notes is None),
        ) from None
    except RecursionError:
        raise UsageError(f"{path}: nested too deeply to be a mission", hint="flatten the document") from None
    except ValueError:
        # Python refuses to convert whole numbers of thousands of digits.
        raise UsageError(f"{path}: holds a number of thousands of digits", hint="write numbers as doubles") from None
    for where, holder, key, fault in _faults(value):
        if faults is None:
            raise MissionError(f"{path}: {where}: {fault}", hint=_PLAIN)
        faults.append(Fault(where, fault, _PLAIN))
        holder[key] = "" if isinstance(holder[key], str) else 0.0
    return value


def repeated(text: str) -> Iterator[str]:
    """JSON paths of keys that are repeated in their object, in a text that `load` accepts. The last one counts."""
    root = json.loads(without_extras(text.removeprefix("\ufeff")), object_pairs_hook=_Pairs)
    stack: list[tuple[str, object]] = [("$", root)]
    while stack:
        where, value = stack.pop()
        if isinstance(value, _Pairs):
            yield from (f"{where}.{key}" for key, times in Counter(key for key, _ in value).items() if times > 1)
            stack.extend((f"{where}.{key}", item) for key, item in reversed(value))
        elif isinstance(value, list):
            stack.extend((f"{where}[{k}]", value[k]) for k in reversed(range(len(value))))


class _Pairs(list[tuple[str, object]]):
    """An object as it is written: a list of keys and values."""


def _way_out(text: str, message: str, *, strict: bool) -> str:
    if not text.strip():
        return "the file is empty: was it written to its end?"
    if message.startswith("Extra data"):
        return "one document a file: remove what follows the first"
    extras = ", no comments and no comma before a closing bracket" if strict else " around keys and texts"
    return f"JSON takes double quotes{extras}"


def _faults(root: object) -> Iterator[tuple[str, Any, Any, str]]:
    """(path, container, key, message) of every value that JSON does not have."""
    stack: list[tuple[str, Any, Any]] = [("$", [root], 0)]
    while stack:
        where, holder, key = stack.pop()
        value = holder[key]
        match value:
            case dict():
                stack.extend((f"{where}.{inner}", value, inner) for inner in reversed(value))
            case list():
                stack.extend((f"{where}[{k}]", value, k) for k in reversed(range(len(value))))
            case float() if not math.isfinite(value):
                yield where, holder, key, f"is {'NaN' if math.isnan(value) else 'infinite'}, not a finite number"
            case str() if not _is_unicode(value):
                yield where, holder, key, "holds half of a surrogate pair"


def _is_unicode(text: str) -> bool:
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True
