"""Made-up reports of episodes."""

from __future__ import annotations

import types
import typing

from lingjing import EpisodeReport, Metrics
from lingjing.play.report import ABORTED, INTERRUPTED, POLICY_FAILED

__all__ = ["ABORTED", "INTERRUPTED", "POLICY_FAILED", "blank_metrics", "made_report"]


def blank_metrics(**changes: object) -> Metrics:
    """Nothing happened, but for the changes."""
    hints = typing.get_type_hints(Metrics)
    empty = {
        name: None if isinstance(hint, types.UnionType) else hint() for name, hint in hints.items() if name != "stages"
    }
    return Metrics(**{**empty, **changes})


def made_report(**changes: object) -> EpisodeReport:
    """A report of a won episode, but for the changes."""
    plain = {
        "mission": "ssr", "seed": 1, "mode": "star", "policy": "p", "success": True, "reason": "success", "scr": 1.0,
        "ticks": 3, "digest": "d", "trace": "t", "metrics": blank_metrics(),
    }  # fmt: skip
    return EpisodeReport(**{**plain, **changes})
