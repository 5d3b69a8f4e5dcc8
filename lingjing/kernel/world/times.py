"""The time that each engine has taken since a barrier began, so that an overrun is attributed to the right engine."""

from __future__ import annotations

from lingjing.errors import InfrastructureError
from lingjing.processes.deadlines import own_now_s


class EngineTimes:
    """Own time by engine, from its first call to the next engine's. `enter` is an `Enter`."""

    def __init__(self) -> None:
        self._spent_s: dict[str, float] = {}
        self._engine = ""
        self.since_s = 0.0
        """Start of the current engine's calls on the process's clock, in seconds, without other engines' calls."""

    def enter(self, engine: str, call: str) -> None:
        """Record the start of a call."""
        now = self._book_time()
        self._engine, self.since_s = engine, now - self._spent_s.get(engine, 0.0)

    def pause(self) -> None:
        """Record the end of the current call without a new one."""
        self._book_time()
        self._engine = ""

    def clear(self) -> None:
        """Start a new barrier."""
        self._spent_s.clear()
        self._engine = ""

    def slowest(self) -> tuple[str, float]:
        """Return the engine that has taken most time, and its seconds; the current engine counts until its call
        began.
        """
        return max(self._spent_s.items(), key=lambda item: item[1], default=("", 0.0))

    def check(self, allowed_s: float) -> None:
        """Raise `InfrastructureError` with the slowest engine if all together took more than `allowed_s` seconds."""
        self.pause()
        total_s = sum(self._spent_s.values())
        if total_s > allowed_s:
            name, seconds = self.slowest()
            raise InfrastructureError(
                f"the engines took {total_s:.1f} s of {allowed_s:g} s for one boundary; "
                f"the slowest was engine `{name}` with {seconds:.1f} s",
                engine=name,
            )

    def _book_time(self) -> float:
        now = own_now_s()
        if self._engine:
            self._spent_s[self._engine] = now - self.since_s
        return now
