"""Tests of processes start interpreters, as a command of a user does."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tools.python_forks import true_starts


@pytest.fixture(scope="module", autouse=True)
def processes_are_interpreters() -> Iterator[None]:
    with true_starts():
        yield
