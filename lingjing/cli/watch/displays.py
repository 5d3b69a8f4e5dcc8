"""`--watch`: the check of the terminal, and one display for each episode."""

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
"""The greatest share of an episode's time for drawing. The first and the last boundary are always drawn. Chosen."""

_INSTEAD = "remove --watch: the run writes overview.png, and `lingjing docs MISSION --trace TRACE` makes a page"


class EpisodeDisplays:
    """The factory of displays that `play_here` calls for each episode.

    Raises `UsageError` if standard error is no terminal. On a terminal without cursor control (`TERM=dumb`) it prints
    a note and shows the progress line.
    """

    def __init__(self, mission: Mission, options: PlayOptions, *, truth: bool) -> None:
        from lingjing.kernel.cities import CityBuilder
        from lingjing.plugins.host import PluginHost

        if not sys.stderr.isatty():
            raise UsageError("--watch draws on the terminal, and standard error is not a terminal", hint=_INSTEAD)
        self._drawable = os.environ.get("TERM", "dumb") not in ("dumb", "unknown", "")
        if not self._drawable:
            say("note: this terminal has no cursor control (TERM=dumb): only progress is shown")
        self._mission, self._options, self._truth = mission, options, truth
        self._cities = CityBuilder(PluginHost())
        self._seed = 0

    def follow(self, places: Iterable[tuple[int, Path | None]]) -> Iterator[tuple[int, Path | None]]:
        """Yield the same places; the seed of each is stored just before its display is requested."""
        for seed, folder in places:
            self._seed = seed
            yield seed, folder

    def __call__(self, title: str) -> AbstractContextManager[EpisodeDisplay | LiveProgress]:
        """Return the display of the episode that starts now."""
        from lingjing.mission.instantiate import instantiate
        from lingjing.play.siting import sited_mission
        from lingjing.plugins.host import PluginHost

        if not self._drawable:
            return LiveProgress(title)
        options = self._options
        instance, city = self._cities.place(
            instantiate(
                sited_mission(self._mission, options.scene, PluginHost()),
                seed=self._seed,
                mode=options.mode,
                settings=options.settings,
                tier=options.tier,
            ),
            imported=bool(self._mission.origin.places),
        )
        return EpisodeDisplay(instance, city, options.policy, truth=self._truth)


class EpisodeDisplay:
    """The display of one episode: a context manager that is called after each boundary.

    The terminal is restored at the end. After an episode that ended by itself the last picture stays above the result.
    """

    def __init__(self, instance: Instance, city: City, policy: str, *, truth: bool) -> None:
        from lingjing.analysis.played_city import attribution_of, credit
        from lingjing.cli.watch.chart import Chart
        from lingjing.cli.watch.screen import Screen
        from lingjing.cli.watch.terminal import AlternateScreen
        from lingjing.viewer.state import EpisodeState

        self._watched = EpisodeState(instance, truth=truth)
        title = f"{instance.mission} · seed {instance.seed} · {instance.mode} · {policy}"
        self._screen: Screen = Screen(self._watched, Chart(city), title, credit(attribution_of(city, instance)))
        self._terminal = AlternateScreen(self._draw)
        self._started = time.perf_counter()
        self._spent_s = 0.0

    def __enter__(self) -> Self:
        self._terminal.__enter__()
        self._draw()
        return self

    def __call__(self, boundary: Progress) -> None:
        """Update the state to this boundary, and draw it if the share of time allows."""
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
