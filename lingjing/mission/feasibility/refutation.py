"""Why a need can never be met: the leaves one by one, then what all ways have in common."""

from __future__ import annotations

from lingjing.mission.feasibility.counting import refute_counts, refute_ticks
from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.needs import (
    AtLeast,
    Handover,
    Impossible,
    Need,
    Performed,
    PictureNeed,
    ReportNeed,
    Supply,
    VisitNeed,
    mandatory,
)
from lingjing.mission.feasibility.outline import Outline
from lingjing.mission.feasibility.payload import refute_supplies
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.feasibility.seeing import refute_picture
from lingjing.mission.feasibility.speech import refute_handover, refute_report
from lingjing.mission.feasibility.tour import refute_tours
from lingjing.mission.feasibility.travel import refute_visit


def refute(need: Need, limit: TimeLimit, outline: Outline, at: str) -> list[Proof]:
    """Every reason found why the need cannot be met within the limit; nothing if none is."""
    alone = refute_each(need, limit, outline)
    if alone:
        return alone
    leaves = mandatory(need)
    ticks = refute_ticks(need, limit, outline, at)
    return [
        *([ticks] if ticks else []),
        *refute_tours(leaves, limit, outline),
        *refute_supplies(leaves, limit, outline),
        *refute_counts(leaves, limit, outline),
    ]


def refute_each(need: Need, limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Reasons that lie in single leaves. Of parts of which only some are due, so many must fail that too few are left;
    then the first that fails stands for all."""
    if not isinstance(need, AtLeast):
        found = _leaf(need, limit, outline)
        return [found] if found else []
    failed = [proofs for part in need.parts if (proofs := refute_each(part, limit, outline))]
    if len(need.parts) - len(failed) >= need.least:
        return []
    if need.least == len(need.parts):
        return [proof for proofs in failed for proof in proofs]
    return failed[0] if failed else []


def _leaf(leaf: Need, limit: TimeLimit, outline: Outline) -> Proof | None:
    match leaf:
        case VisitNeed():
            return refute_visit(leaf, limit, outline)
        case ReportNeed():
            return refute_report(leaf, outline)
        case PictureNeed():
            return refute_picture(leaf, outline)
        case Handover():
            return refute_handover(leaf, outline)
        case Impossible(message=message, at=at):
            return Proof("LJ0612", at, message, "declare what is asked for, or do not ask for it")
        case Supply() | Performed() | AtLeast():
            return None
