"""Claims: messages that assert a find, and their limit.

Concepts. A *positive claim* is a message with a picture and a box in it, or a message that asks for another route
around a place. Without a limit a team could win by guesses: it reports every possible place until one matches. The
limit of a mission (`limit positives <= 10 counts claims`) is shared by all agents. A relayed claim is free: messages
with the same picture, box and other content that rules read are one claim, and so are route requests for one place. A
claim with the same box and another position, class or number is another claim, because otherwise one box could be
tried with every possible position. A box with a class that no rule asks for is no claim: it can match nothing. A
message beyond the limit is delivered like any other, with the same receipt, but
no rule sees it and it requests no route, so that agents cannot measure the effect of the limit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

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

CLASS = "class"
"""The field of a report that names what it shows."""

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
        self._classes = asked_classes(instance) if self._limits else {}

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
            asked = self._classes.get(report.kind)
            if asked is None or report.body.get(CLASS) in asked:
                rest = {name: value for name, value in report.body.items() if name in self._read}
                return "", str(frame), _text((box, sorted(rest.items())))
        place = point(report.body.get("position"))
        if report.kind in self._requests and place is not None:
            return report.kind, "", _text(place)
        return None


def fields_read(instance: Instance) -> frozenset[str]:
    """The names of all fields that a condition of the instance reads, of messages and of entities."""
    conditions = _conditions(instance)
    return frozenset(part.name for each in conditions for part in ex.parts(each) if isinstance(part, ex.Attr))


def asked_classes(instance: Instance) -> dict[str, frozenset[str]]:
    """Return, for each kind of message, the classes that conditions ask for (`r.class == fire`). A message of another
    class makes no condition true.

    A kind is left out if a condition reads it without its class, counts it, or asks something of all of its messages.
    """
    kinds = {spec.kind for spec in instance.messages}
    asked: dict[str, set[str]] = {}
    every: set[str] = set()
    known: dict[tuple[str, int], frozenset[str]] = {}

    def note(kind: str, variable: str, condition: ex.Expr) -> frozenset[str]:
        classes = frozenset(_classes_of(variable, condition, known))
        asked.setdefault(kind, set()).update(classes)
        if not classes:
            every.add(kind)
        return classes

    for rule in instance.rules:  # a rule calls only rules before it
        for place, parameter in enumerate(rule.parameters):
            if parameter.domain in kinds:
                known[rule.name, place] = note(parameter.domain, parameter.name, rule.condition)
    for condition in _conditions(instance):
        for part in ex.parts(condition):
            if isinstance(part, ex.Quantified) and part.domain in kinds and part.quantifier == "exists":
                note(part.domain, part.variable, part.body)
            elif isinstance(part, ex.Quantified | ex.Aggregate) and part.domain in kinds:
                every.add(part.domain)
    return {kind: frozenset(classes) for kind, classes in asked.items() if kind not in every}


def _classes_of(variable: str, condition: ex.Expr, known: Mapping[tuple[str, int], frozenset[str]]) -> Iterator[str]:
    """Yield the classes that a condition asks of a message; none if it asks for none."""
    for part in ex.conjuncts(condition):
        if isinstance(part, ex.Binary) and part.operator == "==" and isinstance(part.right, ex.Symbol):
            if isinstance(part.left, ex.Attr) and part.left.name == CLASS and _is_ref(part.left.base, variable):
                yield part.right.name
        elif isinstance(part, ex.Call) and part.rule:
            for place, argument in enumerate(part.arguments):
                if _is_ref(argument, variable):
                    yield from known.get((part.function, place), ())


def _is_ref(expr: ex.Expr, variable: str) -> bool:
    return isinstance(expr, ex.Ref) and expr.name == variable


def _conditions(instance: Instance) -> Iterator[ex.Expr]:
    """Yield every condition that a report can make true or false."""
    yield instance.success
    if instance.failure is not None:
        yield instance.failure
    yield from (rule.condition for rule in instance.rules)
    yield from (unlock.condition for unlock in instance.unlocks)
    yield from (stage.condition for stage in instance.stages)
    yield from (permit.condition for permit in instance.permits)
    yield from (constraint.condition for constraint in instance.constraints)
    for event in instance.events:
        yield from (condition for condition in (event.condition, event.until) if condition is not None)


def _text(value: object) -> str:
    return msgspec.json.encode(value).decode()
