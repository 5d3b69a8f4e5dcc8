"""Claims: messages that assert a find, and their limit.

Concepts. A *positive claim* is a message with a picture and a box in it, or a message that asks for another route
around a place. Without a limit a team could win by guesses: it reports every possible place until one matches. The
limit of a mission (`limit positives <= 10 counts claims`) is shared by all agents. A relayed claim is free: every
distinct pair of picture and box counts once, and so does every distinct place of a route request. A message beyond the
limit is delivered like any other, with the same receipt, but no rule sees it and it requests no route, so that agents
cannot measure the effect of the limit.
"""

from __future__ import annotations

import msgspec

from lingjing.kernel.assignments import point
from lingjing.kernel.budgets import limit_key
from lingjing.kernel.progress import EpisodeProgress
from lingjing.kernel.registry import Report
from lingjing.mission.instance import Instance

ClaimKey = tuple[str, str, str]
"""The identity of a claim: the message kind for a route request ("" for a box), the picture ("" for a place), and the
box or place as JSON."""


class Claims:
    """The limit of claims of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._limits = tuple(
            limit for limit in instance.limits if any(counted.kind == "claims" for counted in limit.counts)
        )
        self._requests = frozenset(spec.replan for spec in instance.inspections if spec.replan)

    def admit(
        self, reports: tuple[Report, ...], progress: EpisodeProgress
    ) -> tuple[tuple[Report, ...], EpisodeProgress]:
        """Return the reports that rules may see, in order, and the progress with their claims.

        Without a limit all reports are returned, and nothing is counted.
        """
        if not self._limits:
            return reports, progress
        most = min(limit.most for limit in self._limits)
        known = dict(progress.claims)
        admitted = []
        for report in reports:
            key = self._key(report)
            if key is not None and key not in known:
                if len(known) >= most:
                    continue
                known[key] = report.id
            admitted.append(report)
        if len(known) == len(progress.claims):
            return tuple(admitted), progress
        used = {**progress.used, **{limit_key(limit): len(known) for limit in self._limits}}
        return tuple(admitted), msgspec.structs.replace(progress, claims=known, used=used)

    def _key(self, report: Report) -> ClaimKey | None:
        """The identity of the report's claim; None if it claims nothing."""
        frame, box = report.body.get("frame"), report.body.get("box")
        if frame is not None and box is not None:
            return "", str(frame), _text(box)
        place = point(report.body.get("position"))
        if report.kind in self._requests and place is not None:
            return report.kind, "", _text(place)
        return None


def _text(value: object) -> str:
    return msgspec.json.encode(value).decode()
