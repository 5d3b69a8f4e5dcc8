"""Deferral of signals during a step that must not be interrupted, such as a boundary and its record."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_INTERRUPTING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def deferring_signals() -> Iterator[None]:
    """Defer signals with a Python handler to the end of the block. Handlers then run in order, until one raises.

    Does nothing outside of the main thread, because Python handles signals in the main thread only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    pending: list[tuple[int, FrameType | None]] = []
    handled = [(number, handler) for number in _INTERRUPTING if callable(handler := signal.getsignal(number))]
    for number, _ in handled:
        signal.signal(number, lambda number, frame: pending.append((number, frame)))
    try:
        yield
    finally:
        for number, handler in handled:
            signal.signal(number, handler)
    for number, frame in pending:
        dict(handled)[number](number, frame)
