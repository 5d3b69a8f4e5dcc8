"""Blocking of signals that would end the process."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def blocked_signals() -> Iterator[None]:
    """Block SIGINT, SIGTERM and SIGHUP in this thread. A pending signal is delivered at the end of the block.

    Threads that are started within the block inherit its mask for good, so signals go to the main thread. A main thread
    that sleeps would otherwise sleep on when another thread takes the signal.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
