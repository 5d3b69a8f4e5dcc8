"""An episode that plays inline in a notebook: the page of `lingjing view`, in a frame of its own.

The frame needs no server and no network. It is sandboxed: the page runs its own script and reaches nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from os import PathLike, fspath
from typing import Protocol

from lingjing.errors import UsageError
from lingjing.trace.reader import Trace, read_trace
from lingjing.viewer.single import single_file

HEIGHT_PX = 640
"""Default height of the frame, pixels (chosen)."""

BUDGET_BYTES = 6_000_000
"""Largest total size of the pictures, bytes (chosen: a notebook with three episodes can still be opened)."""


class PlayedReport(Protocol):
    """The part of an `EpisodeReport` that names its trace."""

    @property
    def trace(self) -> str:
        """The path of the trace; empty without one."""
        ...


@dataclass(frozen=True, slots=True, repr=False)
class InlineEpisode:
    """An episode that a notebook shows as a player: what `lingjing.show` returns.

    >>> lingjing.show("runs/first")
    <InlineEpisode of runs/first/trace.mcap: 9 boundaries, 2 pictures>
    """

    trace: Trace
    """The trace."""
    truth: bool = False
    """True if hidden targets and true boxes are shown."""
    height_px: int = HEIGHT_PX
    """Height of the frame, pixels."""

    def __repr__(self) -> str:
        """One line."""
        held = f"{len(self.trace.boundaries)} boundaries, {len(self.trace.frames)} pictures"
        return f"<InlineEpisode of {self.trace.path}: {held}>"

    def page(self) -> str:
        """Return the player as a complete HTML page."""
        return single_file(self.trace, truth=self.truth, budget_bytes=BUDGET_BYTES)

    def _repr_html_(self) -> str:
        """Return the player in a frame, for notebooks."""
        return (
            f'<iframe sandbox="allow-scripts" style="width:100%;height:{self.height_px}px;border:0" '
            f'srcdoc="{escape(self.page())}"></iframe>'
        )


def show(
    episode: Trace | PlayedReport | str | PathLike[str], *, truth: bool = False, height_px: int = HEIGHT_PX
) -> InlineEpisode:
    """Return an episode as a player for a notebook. `episode` is a trace, a report, or the path of either's folder.

    With `truth` the player shows hidden targets and true boxes too.

    >>> player = lingjing.show(lingjing.run("first.ljs", overview=False))
    >>> player.page().startswith("<!doctype html>")
    True

    Raises `UsageError` for a report without a trace, a height of 0 or less, and a path that holds no trace.
    """
    if height_px <= 0:
        raise UsageError(
            f"height_px={height_px} is not a height", hint=f"the height of the player in pixels, such as {HEIGHT_PX}"
        )
    if isinstance(episode, Trace):
        return InlineEpisode(episode, truth, height_px)
    path = fspath(episode) if isinstance(episode, str | PathLike) else episode.trace
    if not path:
        raise UsageError("the episode has no trace: it did not begin", hint="its report holds the reason")
    return InlineEpisode(read_trace(path), truth, height_px)


__all__ = ["InlineEpisode", "show"]
