"""The list of all figures in the order of a report, and the look-up of a figure by its name."""

from __future__ import annotations

from lingjing.errors import UsageError
from lingjing.report.figure import FigureKind
from lingjing.report.figures import (
    ablations,
    appearance,
    communication,
    conversations,
    cost,
    drift,
    failures,
    frames,
    last_mile,
    main_table,
    maps,
    perception,
    prompts,
    provenance,
    signatures,
    sweeps,
)
from lingjing.suggest import did_you_mean

FIGURES: tuple[FigureKind, ...] = (
    main_table.KIND, communication.KIND, conversations.KIND, provenance.KIND, perception.KIND, sweeps.SCALING,
    sweeps.ROBUSTNESS, failures.KIND, drift.KIND, signatures.KIND, ablations.KIND, cost.KIND, prompts.KIND,
    appearance.KIND, last_mile.KIND, maps.KIND, frames.KIND,
)  # fmt: skip


def figure_named(name: str) -> FigureKind:
    """Return the figure of that name. Raises `UsageError` if no figure has it."""
    for kind in FIGURES:
        if kind.name == name:
            return kind
    hint = did_you_mean(name, [kind.name for kind in FIGURES], "figures") or "`lingjing report --list` lists them"
    raise UsageError(f"there is no figure `{name[:80]}`", hint=hint)


__all__ = ["FIGURES", "figure_named"]
