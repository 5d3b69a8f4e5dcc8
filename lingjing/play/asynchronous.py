"""One episode as a coroutine, for programs with an event loop: a server, a notebook, an evaluation framework."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Unpack

from lingjing.kernel.episode import Progress
from lingjing.mission.model import Mission
from lingjing.play.episode import run
from lingjing.play.options import Changes
from lingjing.play.report import EpisodeReport


async def arun(
    mission: Mission | str | PathLike[str],
    *,
    out: str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
    **changes: Unpack[Changes],
) -> EpisodeReport:
    """Play `mission` once without blocking the event loop, and return its report.

    Arguments, report and errors are those of `lingjing.run`. The episode runs in a thread, and `progress` is called in
    that thread. A cancelled call ends its episode at the next boundary: the partial trace is closed, the engines'
    processes end, and only then `CancelledError` is raised.

    >>> import asyncio
    >>> report = asyncio.run(lingjing.arun("first.ljs", seed=1, overview=False))
    >>> report.mission, report.seed
    ('first', 1)
    """
    cancelled = threading.Event()

    def interruptible(state: Progress) -> None:
        if cancelled.is_set():
            raise KeyboardInterrupt  # the interrupt of an episode: its trace is closed
        if progress is not None:
            progress(state)

    def play() -> EpisodeReport | None:
        # An interrupt that left the thread would end the caller's event loop, and not this call alone.
        try:
            return run(mission, out=out, progress=interruptible, **changes)
        except KeyboardInterrupt:
            return None

    playing = asyncio.ensure_future(asyncio.to_thread(play))
    try:
        report = await asyncio.shield(playing)
    except asyncio.CancelledError:
        cancelled.set()
        await _ended(playing)
        raise
    if report is None:
        raise asyncio.CancelledError
    return report


async def _ended(playing: asyncio.Future[EpisodeReport | None]) -> None:
    """Wait for the end of a cancelled episode, also if the waiting itself is cancelled again."""
    while not playing.done():
        try:
            await asyncio.shield(playing)
        except asyncio.CancelledError:
            continue
