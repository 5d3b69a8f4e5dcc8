"""`ShareDecision`: whether enough episodes have an outcome, decided as soon as the rest cannot change it."""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.mission.model import PolicyExpectation


class ShareDecision(msgspec.Struct):
    """The episodes of one expectation that have ended, counted."""

    expectation: PolicyExpectation
    met: int = 0
    """Episodes with the expected outcome."""
    missed: int = 0
    """Episodes with another outcome."""

    def add(self, met: bool) -> None:
        """Count one episode."""
        self.met += met
        self.missed += not met

    @property
    def verdict(self) -> Literal["passed", "failed", "open"]:
        """The result; `open` while the other episodes decide."""
        whole = len(self.expectation.episodes.seeds)
        least, most = _bounds(self.expectation, whole)
        if self.met > most or whole - self.missed < least:
            return "failed"
        certain = self.met >= least and whole - self.missed <= most
        return "passed" if certain else "open"


def _bounds(expectation: PolicyExpectation, whole: int) -> tuple[int, int]:
    """The least and the greatest number of episodes that may have the outcome."""
    match expectation.share:
        case "all":
            return whole, whole
        case "some":
            return 1, whole
        case "none":
            return 0, 0
        case "at_least":
            return expectation.least, whole
