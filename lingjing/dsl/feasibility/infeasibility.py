"""`report_infeasibility`: the proofs of `lingjing.mission.feasibility` as diagnostics at the declarations concerned.

It runs over a mission without errors. Hints (`feasibility.wide`, `feasibility.start`), and proofs that hold only in
some modes, become warnings. A declaration in a base mission is reported at the base's name.
"""

from __future__ import annotations

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission.diagnostics import Related, Severity
from lingjing.mission.feasibility import Proof, prove
from lingjing.mission.feasibility.start import lost_at_start, won_at_start
from lingjing.mission.feasibility.wide import too_wide
from lingjing.mission.model import Mission

_Place = tuple[int, int]


def report_infeasibility(mission: Mission, tree: s.File, report: Reporter) -> None:
    """Report every proof that the mission cannot be won, and every hint."""
    proofs, hints = prove(mission), (*too_wide(mission), *won_at_start(mission), *lost_at_start(mission))
    node = next((item for item in tree.items if isinstance(item, s.MissionBlock)), None)
    if not (proofs or hints) or node is None:
        return
    places = _places(node)
    head = node.base or node.name
    for proof in (*proofs, *hints):
        start, end = places.get(proof.at, (head.start, head.end))
        related = _related(proof, places, report)
        severity: Severity = "warning" if proof in hints or proof.partly else "error"
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


def _named(item: s.Statement) -> list[tuple[str, _Place]]:
    match item:
        case s.EntityBlock():
            return [(f"{item.keyword}/{item.name.text}", _at(item.name))]
        case s.RuleBlock():
            return [(f"rule/{item.name.text}", _at(item.name))]
        case s.UnlockLine():
            return [(f"unlock/{item.name.text}", _at(item.name))]
        case s.MessageLine():
            return [(f"message/{item.name.text}", _at(item.name))]
        case s.LimitLine():
            return [(f"limit/{item.name.text}", _at(item.name))]
        case s.StageBlock():
            inner = [pair for part in item.block.items for pair in _named(part)]
            return [(f"stage/{item.name.text}", _at(item.name)), *inner]
        case s.ConstraintBlock():
            return [(f"constraint/{item.name.text}", _at(item.name))]
        case s.RelationLine():
            return [(f"{item.kind.text}/{item.source.text}/{item.target.text}", (item.source.start, item.target.end))]
        case s.OutcomeLine():
            return [(item.keyword, (item.start, item.start + len(item.keyword)))]
        case s.SettingsBlock(keyword="budget"):
            return [
                (f"budget/{p.name.text}", (p.start, p.end)) for p in item.block.items if isinstance(p, s.PropertyLine)
            ]
    return []


def _at(name: s.Name) -> _Place:
    return name.start, name.end
