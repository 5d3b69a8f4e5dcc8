"""`total`, and the deciding sums of floats that use it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import lingjing
from lingjing.sums import total

HARD = [1e16, 1.0, -1e16, 0.1, 0.2]
"""Numbers with a compensated sum, as `sum` gives it from Python 3.12 on, that differs from the plain sum."""

SOURCES = Path(lingjing.__file__).parent
GEOMETRY = {"math.dist", "dist", "hypot", "math.hypot", "math.cos", "math.sin", "math.sqrt", "sqrt"}


def test_numbers_are_added_from_left_to_right() -> None:
    by_hand = 0.0
    for number in HARD:
        by_hand += number
    assert total(HARD) == by_hand != 1.3
    assert total(iter(())) == 0.0


@pytest.mark.parametrize("folder", ["engines", "kernel", "mission", "scene"])
def test_no_builtin_sum_adds_lengths_or_waves(folder: str) -> None:
    """A sum over a function with an irrational result is one of floats, and bodies or cities depend on it."""
    sums = [
        f"{path.relative_to(SOURCES)}:{node.lineno}"
        for path in sorted((SOURCES / folder).rglob("*.py"))
        if "feasibility" not in path.parts  # proofs use bounds with a margin
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sum" and node.args
        if any(isinstance(part, ast.Call) and ast.unparse(part.func) in GEOMETRY for part in ast.walk(node.args[0]))
        if not any(isinstance(part, ast.Compare) for part in ast.walk(node.args[0]))  # a sum of comparisons counts
    ]
    assert sums == []
