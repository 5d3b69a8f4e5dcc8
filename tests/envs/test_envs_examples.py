"""The examples in the docstrings of the environments run."""

from __future__ import annotations

import doctest

import pytest

import lingjing
import lingjing.envs


@pytest.mark.slow
@pytest.mark.parametrize("name", lingjing.envs.__all__)
def test_the_example_runs(name: str) -> None:
    (example_set,) = doctest.DocTestFinder(recurse=False).find(
        getattr(lingjing.envs, name), name, module=False, globs={"lingjing": lingjing}
    )
    assert example_set.examples
    printed: list[str] = []
    runner = doctest.DocTestRunner()
    runner.run(example_set, out=printed.append)
    assert runner.failures == 0, "".join(printed)
