"""Tests on the oldest supported interpreter: Debian 12's Python 3.11.2."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted([*(ROOT / "lingjing").rglob("*.py"), *(ROOT / "agents" / "lingjing_agents").rglob("*.py")])
POSSESSIVE = re.compile(r"\(\?>|[\w)\]}](?:\+\+|\*\+|\?\+)")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_pattern_is_possessive_or_atomic(path: Path) -> None:
    """Python 3.11.2 (Debian 12) matches `(?:\\.\\d+)?+` wrongly: it keeps a part of the failed match."""
    texts = [
        node.value
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]
    assert [text for text in texts if POSSESSIVE.search(text)] == []
