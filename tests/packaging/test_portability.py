"""Tests on the oldest supported interpreter: Debian 12's Python 3.11.2."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted([*(ROOT / "lingjing").rglob("*.py"), *(ROOT / "agents" / "lingjing_agents").rglob("*.py")])
POSSESSIVE = re.compile(r"\(\?>|[\w)\]}](?:\+\+|\*\+|\?\+)")


def test_no_pattern_is_possessive_or_atomic() -> None:
    """Python 3.11.2 (Debian 12) matches `(?:\\.\\d+)?+` wrongly: it keeps a part of the failed match."""
    assert [str(path) for path in SOURCES if any(map(POSSESSIVE.search, strings_of(path)))] == []


def strings_of(path: Path) -> Iterator[str]:
    """Return all string constants of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
