"""What tests of several packages need."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture
def descendants() -> Callable[[int], set[int]]:
    """Tells the ids of the processes below one, whoever started them, from /proc."""

    def below(pid: int) -> set[int]:
        children: dict[int, list[int]] = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                except (OSError, ValueError):
                    continue
                children.setdefault(parent, []).append(int(entry.name))
        found: set[int] = set()
        frontier = [pid]
        while frontier:
            frontier = [child for parent in frontier for child in children.get(parent, []) if child not in found]
            found.update(frontier)
        return found

    return below
