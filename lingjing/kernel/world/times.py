"""How long each engine has taken since a barrier began, so that the one that was slow is the one that is blamed."""

from __future__ import annotations

from lingjing.errors import InfrastructureError
from lingjing.processes.deadlines import own_now_s


class EngineTimes:
    """Own time by engine, from its first call to the next engine's; `enter` is an `Enter`."""

    def __init__(self) -> None:
        self._taken: dict[str, float] = {}
        self._engine = ""
        self.since_s = 0.0
        """When the present engine would have begun if its calls had followed one another."""

    def enter(self, engine: str, call: str) -> None:
        """A call begins."""
        now = self._settle()
        self._engine, self.since_s = engine, now - self._taken.get(engine, 0.0)

    def pause(self) -> None:
        """The present call has ended, and no other begins yet."""
        self._settle()
        self._engine = ""

    def clear(self) -> None:
        """A barrier ends, and another begins."""
        self._taken.clear()
        self._engine = ""

    def slowest(self) -> tuple[str, float]:
        """The engine that has taken most, and its seconds; of the present one those until its call began."""
        return max(self._taken.items(), key=lambda item: item[1], default=("", 0.0))

    def check(self, allowed_s: float) -> None:
        """`InfrastructureError` that names the slowest if all of them together took more than is allowed."""
        self.pause()
        taken = sum(self._taken.values())
        if taken > allowed_s:
            name, seconds = self.slowest()
            raise InfrastructureError(
                f"the engines took {taken:.1f} s of {allowed_s:g} s for one boundary; "
                f"the slowest was `{name}` with {seconds:.1f} s"
            )

    def _settle(self) -> float:
        now = own_now_s()
        if self._engine:
            self._taken[self._engine] = now - self.since_s
        return now
