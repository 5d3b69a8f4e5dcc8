"""The services of a suite's entrants that are down, and the wait until they answer.

An episode that ends because its service is down shows that the next one would end likewise. So no further episode of
the entrant begins until the service gives a sign of life; episodes of other entrants go on. If nothing else is left to
play, the suite asks again after a pause that doubles, up to a limit of all pauses together.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from lingjing.bench.planning import SuiteCell
from lingjing.errors import InfrastructureError
from lingjing.play.outages import SERVICE_GONE, probe_failure
from lingjing.play.report import ABORTED, EpisodeReport
from lingjing.plugins.host import PluginHost

FIRST_PAUSE_S = 15.0
"""Seconds before the first question after an outage. Chosen."""

LONGEST_PAUSE_S = 600.0
"""Upper bound of the doubling pause, seconds. Chosen."""

LONGEST_WAIT_S = 3600.0
"""The default limit of all pauses of one outage together, seconds. Chosen."""


@dataclass(slots=True)
class EntrantServices:
    """The services that are down, by entrant. `probe` returns the reason for which the service of a cell's entrant does
    not answer, or "".
    """

    probe: Callable[[SuiteCell], str]
    longest_wait_s: float = LONGEST_WAIT_S
    """The limit of all pauses of one outage together, seconds; 0: no wait."""
    tell: Callable[[str], None] = lambda line: None
    """Receives a line about each pause."""
    sleep: Callable[[float], None] = time.sleep
    _down: dict[str, SuiteCell] = field(default_factory=dict)
    """Entrant with a service that is down → one of its cells."""
    _waited_s: float = 0.0

    def note(self, cell: SuiteCell, report: EpisodeReport) -> None:
        """Note the end of an episode."""
        if report.reason == ABORTED and report.detail.startswith(SERVICE_GONE):
            self._down[cell.player.name] = cell
        elif report.reason != ABORTED:
            self._waited_s = 0.0

    def is_down(self, cell: SuiteCell) -> bool:
        """Return whether no episode of the cell should begin now."""
        return self.longest_wait_s > 0.0 and cell.player.name in self._down

    def wait(self, left: int) -> None:
        """Return when a service that was down answers. `left` is the number of waiting episodes.

        Raises `InfrastructureError` if the limit passes first.
        """
        pause_s, failures = FIRST_PAUSE_S, dict.fromkeys(self._down, "")
        while self._down:
            if self._waited_s >= self.longest_wait_s:
                listed = "; ".join(f"{name}: {failure}" for name, failure in failures.items())
                raise InfrastructureError(
                    f"no service answered for {self._waited_s / 60.0:g} min, and {left} episodes are left ({listed})",
                    hint="the same command continues when the service is back; --wait MINUTES waits longer, and "
                    "--retry-lost plays lost episodes again",
                    cause="service",
                )
            pause_s = min(pause_s, self.longest_wait_s - self._waited_s)
            self.tell(f"waiting {pause_s:g} s for the service of {', '.join(self._down)}; {left} episodes are left")
            self.sleep(pause_s)
            self._waited_s += pause_s
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)
            failures = {name: self.probe(cell) for name, cell in self._down.items()}
            if not all(failures.values()):
                back = [name for name, failure in failures.items() if not failure]
                self.tell(f"the service of {', '.join(back)} answers again")
                self._down = {name: cell for name, cell in self._down.items() if name not in back}
                return


def probe_entrant(cell: SuiteCell) -> str:
    """Return the reason for which the service of the cell's entrant does not answer; "" if it does."""
    plugin = PluginHost().policy(cell.player.policy)
    return "" if plugin.probe is None else probe_failure(cell.player.name, plugin, plugin.probe, cell.args)


__all__ = ["LONGEST_WAIT_S", "EntrantServices", "probe_entrant"]
