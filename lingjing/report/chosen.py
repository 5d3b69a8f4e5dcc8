"""The episodes that represent a mission in figures of single episodes: best two modes of one seed."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.bench.played import columns_of
from lingjing.report.evidence import ReportEvidence, TracedEpisode

MODES = ("star", "broadcast")
"""Modes of a pair, in the order in which they are shown."""


def chosen_episodes(evidence: ReportEvidence) -> dict[str, tuple[TracedEpisode, ...]]:
    """Return one episode of each mission, or two episodes of one seed in star and broadcast.

    Episodes of entrants without access to the truth come first, then those with messages, then pairs that ended
    differently, then other pairs. Among equals the first one in the order of the evidence is taken.
    """
    missions = dict.fromkeys(mission for mission, _ in columns_of(episode.row for episode in evidence.traced))
    return {name: _best([episode for episode in evidence.traced if episode.row.mission == name]) for name in missions}


def _best(traced: Sequence[TracedEpisode]) -> tuple[TracedEpisode, ...]:
    groups: dict[tuple[str, str, str, int], dict[str, TracedEpisode]] = {}
    for episode in traced:
        row = episode.row
        groups.setdefault((row.suite, row.entrant, row.condition, row.seed), {}).setdefault(row.mode, episode)
    modes = min(enumerate(groups.values()), key=lambda group: (*_rank(group[1]), group[0]))[1]
    pair = tuple(modes[mode] for mode in MODES if mode in modes)
    return pair or tuple(modes.values())[:1]


def _rank(modes: dict[str, TracedEpisode]) -> tuple[bool, bool, bool, bool]:
    """Return a key that sorts the episodes of one seed: lower is better."""
    rows = [episode.row for episode in modes.values()]
    pair = all(mode in modes for mode in MODES)
    differ = pair and len({row.report.success for row in rows}) > 1
    silent = not any(row.report.metrics is not None and row.report.metrics.messages for row in rows)
    return rows[0].privileged, silent, not differ, not pair


__all__ = ["chosen_episodes"]
