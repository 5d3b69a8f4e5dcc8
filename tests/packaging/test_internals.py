"""Imports of internal modules in tests do not become more, and the count is right."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "internals.py"
_spec = importlib.util.spec_from_file_location("internals", TOOL)
assert _spec is not None and _spec.loader is not None
internals = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(internals)

SAMPLE = """
import lingjing
import lingjing.kernel.step
import lingjing.testing, lingjing.scene.terrain
from lingjing import builtin, compile
from lingjing import compile, run
from lingjing.errors import UsageError
from lingjing.plugins.conformance.policies import PolicyCase
from lingjing.plugins.host import PluginHost
from lingjing.testing.rescue import instance
from lingjing.trace.records import Action

def late():
    from lingjing.kernel.step import (
        Kernel,
        Published,
    )
"""


def test_the_imports_are_counted() -> None:
    assert sorted(internals.internals(SAMPLE)) == [
        (3, "lingjing.kernel.step"),
        (4, "lingjing.scene.terrain"),
        (5, "lingjing.builtin"),
        (9, "lingjing.plugins.host"),
        (14, "lingjing.kernel.step"),
    ]


def test_limits_are_lowered_and_never_raised() -> None:
    limits = {"tests/dsl": 3, "tests/kernel": 2}
    assert internals.above({"tests/dsl": 3}, limits) == []
    (message,) = internals.above({"tests/dsl": 4, "tests/kernel": 2}, limits)
    assert message.startswith("internals: tests/dsl imports internal modules 4 times, and at most 3 are accepted")
    (message,) = internals.above({"tests/new": 1}, limits)
    assert "tests/new" in message
    assert internals.lowered({"tests/dsl": 1, "tests/kernel": 9, "tests/new": 1}, limits) == {
        "tests/dsl": 1,
        "tests/kernel": 2,
    }


def test_the_tests_are_below_their_limits(capsys: pytest.CaptureFixture[str]) -> None:
    assert internals.main([]) == 0, capsys.readouterr().out
