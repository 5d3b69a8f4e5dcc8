"""Which episodes stand for a mission where one can be shown: two modes of one seed, best with two endings."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.bench.played import columns_of
from lingjing.report.evidence import ReportEvidence, TracedEpisode

MODES = ("star", "broadcast")


def chosen_episodes(evidence: ReportEvidence) -> dict[str, tuple[TracedEpisode, ...]]:
    """One episode of each mission, or two of one seed in star and broadcast.

    Those of entrants that were not shown the truth come first, then pairs that ended differently, then pairs; among
    equals it is the first by entrant, condition and seed.
    """
    missions = dict.fromkeys(mission for mission, _ in columns_of(one.row for one in evidence.traced))
    return {name: _best([one for one in evidence.traced if one.row.mission == name]) for name in missions}


def _best(traced: Sequence[TracedEpisode]) -> tuple[TracedEpisode, ...]:
    groups: dict[tuple[str, str, str, int], dict[str, TracedEpisode]] = {}
    for one in traced:
        row = one.row
        groups.setdefault((row.suite, row.entrant, row.condition, row.seed), {}).setdefault(row.mode, one)
    ranked = min(enumerate(groups.values()), key=lambda each: (*_rank(each[1]), each[0]))[1]
    pair = tuple(ranked[mode] for mode in MODES if mode in ranked)
    return pair or tuple(ranked.values())[:1]


def _rank(modes: dict[str, TracedEpisode]) -> tuple[bool, bool, bool, bool]:
    rows = [one.row for one in modes.values()]
    pair = all(mode in modes for mode in MODES)
    differ = pair and len({row.report.success for row in rows}) > 1
    silent = not any(row.report.metrics is not None and row.report.metrics.messages for row in rows)
    return rows[0].privileged, silent, not differ, not pair


__all__ = ["chosen_episodes"]
