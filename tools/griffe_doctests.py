"""An extension of griffe, which reads docstrings for the site: examples with `>>>` become blocks of code.

mkdocs loads it by its path (`extensions` in `mkdocs.yml`). Without it Markdown reads an example as quotations, and its
brackets as links.
"""

from __future__ import annotations

import ast
import re
from typing import Any

import griffe

EXAMPLE = re.compile(r"(?:^|(?<=\n))(?P<indent> *)>>> .*(?:\n(?! *\n).+)*")
"""Lines from the first `>>>` to an empty line or the end."""


class DoctestFences(griffe.Extension):
    """Put each example of a docstring between fences."""

    def on_instance(self, *, node: ast.AST | griffe.ObjectNode, obj: griffe.Object, **_: Any) -> None:
        """Change the docstring of an object as soon as it is read."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)


def fenced(text: str) -> str:
    """The text of a docstring with its examples between fences."""
    return EXAMPLE.sub(lambda match: f"{match['indent']}```pycon\n{match[0]}\n{match['indent']}```", text)
