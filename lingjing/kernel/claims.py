"""Claims: messages that assert a find, and their limit.

Concepts. A *positive claim* is a message with a picture and a box in it, or a message that asks for another route
around a place. Without a limit a team could win by guesses: it reports every possible place until one matches. The
limit of a mission (`limit positives <= 10 counts claims`) is shared by all agents. A relayed claim is free: messages
with the same picture, box and other content that rules read are one claim, and so are route requests for one place. A
claim with the same box and another position, class or number is another claim, because otherwise one box could be
tried with every possible position. A message beyond the limit is delivered like any other, with the same receipt, but
no rule sees it and it requests no route, so that agents cannot measure the effect of the limit.
"""

from __future__ import annotations

import msgspec

from lingjing.kernel.assignments import point
from lingjing.kernel.budgets import limit_key
from lingjing.kernel.progress import EpisodeProgress
from lingjing.kernel.registry import Report
from lingjing.mission import expression as ex
from lingjing.mission.instance import Instance

ClaimKey = tuple[str, str, str]
"""The identity of a claim: the message kind for a route request ("" for a box), the picture ("" for a place), and as
JSON the place, or the box with the other fields that rules read."""


_IDENTITY = frozenset(("frame", "box", "sender", "role"))
"""Fields that are in the key already, and those of the sender, which differ when a claim is passed on."""


class Claims:
    """The limit of claims of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._limits = tuple(
            limit for limit in instance.limits if any(counted.kind == "claims" for counted in limit.counts)
        )
        self._requests = frozenset(spec.replan for spec in instance.inspections if spec.replan)
        self._read = fields_read(instance) - _IDENTITY if self._limits else frozenset()

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
            rest = {name: value for name, value in report.body.items() if name in self._read}
            return "", str(frame), _text((box, sorted(rest.items())))
        place = point(report.body.get("position"))
        if report.kind in self._requests and place is not None:
            return report.kind, "", _text(place)
        return None


def fields_read(instance: Instance) -> frozenset[str]:
    """The names of all fields that a rule, an unlock or the success reads, of messages and of entities."""
    conditions = (
        instance.success,
        *(rule.condition for rule in instance.rules),
        *(unlock.condition for unlock in instance.unlocks),
    )
    return frozenset(part.name for each in conditions for part in ex.parts(each) if isinstance(part, ex.Attr))


def _text(value: object) -> str:
    return msgspec.json.encode(value).decode()
