"""`deferring_signals`: what must be whole or not at all, as a boundary and its record, is not torn by Ctrl-C."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_INTERRUPTING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def deferring_signals() -> Iterator[None]:
    """Keep signals that a Python function handles until the end, then have them handled in order, until one raises.

    Elsewhere than in the main thread, where none is handled, nothing is done.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    handled = [(number, handler) for number in _INTERRUPTING if callable(handler := signal.getsignal(number))]
    for number, _ in handled:
        signal.signal(number, lambda number, frame: came.append((number, frame)))
    try:
        yield
    finally:
        for number, handler in handled:
            signal.signal(number, handler)
    for number, frame in came:
        dict(handled)[number](number, frame)
