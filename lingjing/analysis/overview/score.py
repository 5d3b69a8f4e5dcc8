"""The metrics of an episode as a small table beside the map."""

from __future__ import annotations

from matplotlib.axes import Axes

from lingjing.analysis.metrics import Metrics
from lingjing.analysis.overview import style

ENDINGS = {"budget": "out of time", "late": "stage late", "constraint": "constraint broken", "error": "cut short"}
"""Printed words for reasons of an episode's end; other reasons are printed unchanged."""


def draw_score(axes: Axes, numbers: Metrics, *, complete: bool, judging: bool = True) -> None:
    """Draw the verdict on top, two columns of metrics, and the stages at the bottom.

    `complete` is False for a cut trace. `judging` is True if the mission judges reports.
    """
    style.bare(axes)
    axes.set_facecolor(style.PANEL)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1)
    verdict, colour = _verdict(numbers, complete)
    axes.text(0.03, 0.895, verdict, fontsize=17, fontweight="bold", color=colour, va="center")
    axes.text(0.97, 0.895, f"SCR {_share(numbers.scr)}", fontsize=14, color=style.INK, va="center", ha="right")
    left, right = _columns(numbers, judging)
    for at, rows in ((0.03, left), (0.53, right)):
        for place, (name, value) in enumerate(rows):
            y = 0.775 - place * 0.077
            axes.text(at, y, name, fontsize=9, color=style.FAINT, va="center")
            axes.text(at + 0.44, y, value, fontsize=9, color=style.INK, va="center", ha="right", fontweight="bold")
    stages = "   ".join(f"{stage.name} {stage.done}/{stage.required}" for stage in numbers.stages)
    axes.text(0.03, 0.055, stages, fontsize=9, color=style.INK, va="center")


def _verdict(numbers: Metrics, complete: bool) -> tuple[str, str]:
    if numbers.success:
        return "SUCCESS", style.FATES["completed"]
    colour = style.FATES["missed"] if complete else style.FATES["found"]
    return ENDINGS.get(numbers.reason, numbers.reason or "cut short").replace("-", " ").upper(), colour


def _columns(numbers: Metrics, judging: bool) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    speed = f"{numbers.sim_s / numbers.wall_s:.1f} x real time" if numbers.wall_s else "–"
    left = [
        ("ticks", str(numbers.ticks)),
        ("simulated", f"{numbers.sim_s:g} s"),
        ("wall clock", "–" if numbers.wall_s is None else f"{numbers.wall_s:.1f} s"),
        ("speed", speed),
        ("cells visited", _share(numbers.coverage)),
        ("pictures", str(numbers.frames)),
        *(_discovered(numbers) if judging else []),
        ("refused", str(numbers.rejections)),
    ]
    right = [
        *(_judged(numbers) if judging else [("reports", f"{numbers.reports}, none judged")] if numbers.reports else []),
        ("messages", str(numbers.messages)),
        ("payload", f"{numbers.kilobytes:.1f} kB"),
        ("rounds", str(numbers.rounds)),
        ("repeated targets", _share(numbers.rep)),
        ("tokens", f"{numbers.tokens:,} · ${numbers.cost_usd:.2f}" if numbers.tokens else "–"),
    ]
    return left, right


def _discovered(numbers: Metrics) -> list[tuple[str, str]]:
    """Return the rows on discoveries, for a mission that compares reports with the truth."""
    return [
        ("first discovery", "–" if numbers.first_discovery_tick is None else f"tick {numbers.first_discovery_tick}"),
        ("targets found", str(numbers.targets_found)),
    ]


def _judged(numbers: Metrics) -> list[tuple[str, str]]:
    """Return the rows on the quality of reports, for a mission that compares them with the truth."""
    return [
        ("matched reports", f"{numbers.detections} of {numbers.reports}"),
        ("precision", _share(numbers.precision)),
        ("recall", _share(numbers.recall)),
        ("location error", "–" if numbers.localisation_error_m is None else f"{numbers.localisation_error_m:.1f} m"),
    ]


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.0f} %"
