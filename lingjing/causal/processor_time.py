"""`cpu_of`: what a process has cost, as its relatives see it."""

from __future__ import annotations

import time


def cpu_of(pid: int) -> float:
    """CPU seconds that a process has taken so far (clock_getcpuclockid(3)). Raises `OSError` if there is none."""
    return time.clock_gettime((~pid << 3) | 2)
