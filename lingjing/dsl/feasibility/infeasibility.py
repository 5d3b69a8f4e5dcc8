"""`report_infeasibility`: the proofs of `lingjing.mission.feasibility` as diagnostics at the declarations concerned.

It runs over a mission without errors. Hints (`feasibility.wide`, `feasibility.start`, `feasibility.order`), and proofs
that do not hold in the mission's own mode, become warnings. A declaration in a base mission is reported at the base's
name.
"""

from __future__ import annotations

import itertools

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission.conditions.outline import Outlines
from lingjing.mission.diagnostics import Related, Severity
from lingjing.mission.feasibility import Proof, prove, unproved
from lingjing.mission.feasibility.order import circular_stages
from lingjing.mission.feasibility.start import won_at_start
from lingjing.mission.feasibility.wide import too_wide
from lingjing.mission.model import Mission

_Place = tuple[int, int]


def report_infeasibility(mission: Mission, tree: s.File, report: Reporter) -> None:
    """Report every proof that the mission cannot be won, and every hint."""
    outlines = Outlines(mission)
    proofs = prove(mission, outlines)
    hints = (*too_wide(mission), *won_at_start(outlines), *circular_stages(mission))
    notes = unproved(mission)
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if not (proofs or hints or notes) or node is None:
        return
    places = _places(node)
    head = node.base or node.name
    for proof in (*proofs, *hints, *notes):
        start, end = places.get(proof.at, (head.start, head.end))
        related = _related(proof, places, report)
        severity: Severity = "note" if proof in notes else "warning" if proof in hints or proof.partly else "error"
        report(proof.code, start, end, proof.message, proof.hint, related=related, severity=severity)


def _related(proof: Proof, places: dict[str, _Place], report: Reporter) -> tuple[Related, ...]:
    known = {path: why for path, why in proof.related if path in places and path != proof.at}
    return tuple(Related(report.span(*places[path]), why) for path, why in known.items())


def _places(node: s.MissionBlock) -> dict[str, _Place]:
    """The place of each declaration of the mission itself, by its path in the graph."""
    places: dict[str, _Place] = {}
    for item in node.block.items:
        for path, place in _named(item.item if isinstance(item, s.Override) else item):
            places.setdefault(path, place)
    return places


_KINDS: tuple[tuple[type[s.Statement], str], ...] = (
    (s.RuleBlock, "rule"),
    (s.UnlockLine, "unlock"),
    (s.MessageLine, "message"),
    (s.LimitLine, "limit"),
    (s.ConstraintBlock, "constraint"),
    (s.EventBlock, "event"),
)
"""Declarations with a name, and the first part of their paths."""


def _named(item: s.Statement) -> list[tuple[str, _Place]]:
    match item:
        case s.EntityBlock():
            return [(f"{item.keyword}/{item.name.text}", _at(item.name))]
        case s.StageBlock():
            inner = [pair for part in item.block.items for pair in _named(part)]
            return [(f"stage/{item.name.text}", _at(item.name)), *inner]
        case s.RelationLine():
            return [(f"{item.kind.text}/{item.source.text}/{item.target.text}", (item.source.start, item.target.end))]
        case s.OrderLine(keyword="serial"):
            places = itertools.pairwise(item.stages)
            return [(f"dependency/{a.text}/{b.text}", (a.start, b.end)) for a, b in places]
        case s.PermitLine():
            return [(f"permit/{_permitted(item.resource)}", (item.resource.start, item.resource.end))]
        case s.OutcomeLine():
            return [(item.keyword, (item.start, item.start + len(item.keyword)))]
        case s.SettingsBlock(keyword="budget"):
            return [
                (f"budget/{p.name.text}", (p.start, p.end)) for p in item.block.items if isinstance(p, s.PropertyLine)
            ]
    kind = next((kind for node, kind in _KINDS if isinstance(item, node)), "")
    name = getattr(item, "name", None)
    return [(f"{kind}/{name.text}", _at(name))] if kind and isinstance(name, s.Name) else []


def _permitted(channel: s.ObservedChannel) -> str:
    """The group and the verb of a permit, `uav/takePhoto`; no verb after `uav.*`."""
    source = channel.source
    verb = source.name.text if isinstance(source, s.FieldExpr) and not channel.everything else ""
    owner = source.base if isinstance(source, s.FieldExpr) and verb else source
    owner = owner.base if isinstance(owner, s.Subscript) else owner
    return f"{owner.text if isinstance(owner, s.Name) else ''}/{verb}"


def _at(name: s.Name) -> _Place:
    return name.start, name.end
