"""Regular expressions that are compiled at their first use.

Python compiles a pattern in Python. The patterns of the language took a seventh of the processor time of a cold
`lingjing validate`, and a text without errors needs a third of them.
"""

from __future__ import annotations

import re
from typing import Any, cast

_METHODS = ("findall", "finditer", "flags", "fullmatch", "match", "pattern", "search", "split", "sub", "subn")


class _Late:
    """Stands for a pattern: its first attribute compiles it, and from then on all attributes are the pattern's own."""

    def __init__(self, text: str, flags: int) -> None:
        self._text, self._flags = text, flags

    def __getattr__(self, name: str) -> Any:
        if name not in _METHODS:
            raise AttributeError(name)
        compiled = re.compile(self._text, self._flags)
        vars(self).update({method: getattr(compiled, method) for method in _METHODS})
        return vars(self)[name]


def pattern(text: str, flags: int = 0) -> re.Pattern[str]:
    """Return the pattern of a text, compiled at its first use. Raises `re.error` there if the text is none."""
    return cast("re.Pattern[str]", _Late(text, flags))
