"""Live progress on a terminal: the line of an episode (tick, simulated time, real-time factor, last event), and bars
of counted work. Nothing is printed elsewhere.
"""

from __future__ import annotations

import sys
from types import TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from lingjing.kernel.episode import Progress


def describe(boundary: Progress) -> str:
    """Return the state of an episode as text: `t=120 s  ×3.4  rescued victim[1]`."""
    return f"t={boundary.time_s:.0f} s  {factor(boundary.time_s, boundary.wall_s)}  {boundary.last_event}"


def factor(time_s: float, wall_s: float) -> str:
    """Return the ratio of simulated to real time, such as `×3.4`."""
    return f"×{time_s / wall_s:.1f}" if wall_s > 0 else "×–"


class _ShownBar:
    """A context manager that shows a progress bar; silent if standard error is no terminal."""

    def __init__(self, title: str, text: str = "") -> None:
        self._title = title
        self._text = text
        self._bar: Bar | None = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            from lingjing.cli.console import spell_proxies

            self._bar = _bar()
            self._bar.start()
            spell_proxies()
            self._bar.add_task(self._title, total=None, text=self._text)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def _show(self, completed: int, total: int | None, text: str = "", title: str | None = None) -> None:
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=completed, total=total, text=text, description=title)


class LiveProgress(_ShownBar):
    """The progress bar of an episode, called after each boundary."""

    def __init__(self, title: str) -> None:
        super().__init__(title, "starting")

    def __call__(self, boundary: Progress) -> None:
        """Show this boundary."""
        self._show(boundary.tick, boundary.ticks, describe(boundary))


class CountProgress(_ShownBar):
    """The progress bar of counted work, called with the number of done items and of all items."""

    def __call__(self, done: int, whole: int) -> None:
        """Show these numbers."""
        self._show(done, whole)


class BranchProgress(_ShownBar):
    """The progress bar of a branch host, called with its current work and the numbers of done and due items (0:
    unknown).
    """

    def __call__(self, title: str, done: int, due: int) -> None:
        """Show this state."""
        self._show(done, due or None, title=title)


def _bar() -> Bar:
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
    from rich.progress import Progress as Bar

    from lingjing.cli.console import console

    return Bar(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TextColumn("{task.fields[text]}", markup=False),
        console=console(sys.stderr),
        transient=True,
    )
