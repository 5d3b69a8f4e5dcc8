"""`--watch`: who may watch, and one watched episode after another."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from lingjing.cli.process import say
from lingjing.cli.progress import LiveProgress
from lingjing.errors import UsageError
from lingjing.mission.model import Mission
from lingjing.play.options import PlayOptions

if TYPE_CHECKING:
    from lingjing.cli.watch.screen import Screen
    from lingjing.kernel.episode import Progress
    from lingjing.mission.instance import Instance
    from lingjing.scene.city import City

SHARE = 0.04
"""Of an episode's time that drawing may take; what does not fit is not drawn, but for the first and last boundary."""

_INSTEAD = "leave --watch out: the run leaves overview.png, and `lingjing docs MISSION --trace TRACE` makes a page"


class EpisodeDisplays:
    """Opens a display for each episode, as `play_here` asks for it.

    Raises `UsageError` if standard error is no terminal. One that cannot be drawn on (`TERM=dumb`) gets the line of
    progress instead, and is told so.
    """

    def __init__(self, mission: Mission, options: PlayOptions, *, truth: bool) -> None:
        from lingjing.kernel.cities import CityBuilder
        from lingjing.plugins.host import PluginHost

        if not sys.stderr.isatty():
            raise UsageError("--watch draws on the terminal, and standard error is none here", hint=_INSTEAD)
        self._drawable = os.environ.get("TERM", "dumb") not in ("dumb", "unknown", "")
        if not self._drawable:
            say("note: this terminal cannot be drawn on (TERM=dumb): progress only")
        self._mission, self._options, self._truth = mission, options, truth
        self._cities = CityBuilder(PluginHost())
        self._seed = 0

    def follow(self, places: Iterable[tuple[int, Path | None]]) -> Iterator[tuple[int, Path | None]]:
        """The same places; each is remembered when it is taken, just before its display is asked for."""
        for seed, folder in places:
            self._seed = seed
            yield seed, folder

    def __call__(self, title: str) -> AbstractContextManager[Watching | LiveProgress]:
        """The display of the episode that begins now."""
        from lingjing.mission.instantiate import instantiate

        if not self._drawable:
            return LiveProgress(title)
        options = self._options
        instance, city = self._cities.place(
            instantiate(self._mission, seed=self._seed, mode=options.mode, settings=options.settings),
            imported=bool(self._mission.origin.places),
        )
        return Watching(instance, city, options.policy, truth=self._truth)


class Watching:
    """A context manager to be called after each boundary; the terminal is as it was afterwards.

    After an episode that ran to its end the last picture stays, above the result.
    """

    def __init__(self, instance: Instance, city: City, policy: str, *, truth: bool) -> None:
        from lingjing.analysis.played_city import credit
        from lingjing.cli.watch.chart import Chart
        from lingjing.cli.watch.screen import Screen
        from lingjing.cli.watch.terminal import AlternateScreen
        from lingjing.viewer.state import EpisodeState

        self._watched = EpisodeState(instance, truth=truth)
        title = f"{instance.mission} · seed {instance.seed} · {instance.mode} · {policy}"
        self._screen: Screen = Screen(self._watched, Chart(city), title, credit(city.attribution))
        self._terminal = AlternateScreen(self._draw)
        self._started = time.perf_counter()
        self._spent_s = 0.0

    def __enter__(self) -> Self:
        self._terminal.__enter__()
        self._draw()
        return self

    def __call__(self, boundary: Progress) -> None:
        """Take this boundary in, and draw it if there is time for that."""
        began = time.perf_counter()
        self._watched.take(boundary.record, boundary.wall_s)
        ends = boundary.record.done or boundary.tick >= boundary.ticks
        if boundary.tick == 0 or ends or self._spent_s <= SHARE * (began - self._started):
            self._draw()
        self._spent_s += time.perf_counter() - began

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._terminal.__exit__(kind, error, trace)
        if kind is None:
            self._terminal.leave(self._screen)

    def _draw(self) -> None:
        self._terminal.draw(self._screen)
