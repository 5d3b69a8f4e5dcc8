"""CPU time of other processes."""

from __future__ import annotations

import time


def cpu_of(pid: int) -> float:
    """Return the CPU time of a process so far, seconds (clock_getcpuclockid(3)). Raises `OSError` if it does not
    exist.
    """
    return time.clock_gettime((~pid << 3) | 2)
