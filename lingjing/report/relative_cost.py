"""What a condition costs beside the baseline: "relative cost divides this total by the designated full agent or prompt
baseline" (the paper's table of diagnostic metrics)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import fmean

from lingjing.bench.rows import SuiteRow
from lingjing.report.estimates import metrics_of


def mean_tokens(rows: Iterable[SuiteRow]) -> float:
    """Prompt and completion tokens of an episode; nan over none."""
    known = [one.tokens for one in metrics_of(rows)]
    return fmean(known) if known else math.nan


def cost_factor(rows: Sequence[SuiteRow], among: Iterable[SuiteRow]) -> float:
    """Tokens of an episode over those of the same entrant's baseline `among` some rows; nan where that took none."""
    base = mean_tokens(row for row in among if row.baseline and row.entrant == rows[0].entrant)
    return mean_tokens(rows) / base if base > 0 else math.nan


__all__ = ["cost_factor", "mean_tokens"]
