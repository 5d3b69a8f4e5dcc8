"""Reasons why a need can never be met: first each leaf alone, then all mandatory leaves together."""

from __future__ import annotations

from lingjing.mission.conditions.needs import (
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
from lingjing.mission.conditions.outline import Outline
from lingjing.mission.feasibility.counting import refute_counts, refute_ticks
from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.payload import refute_supplies
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.feasibility.seeing import refute_picture
from lingjing.mission.feasibility.tour import refute_tours
from lingjing.mission.feasibility.travel import refute_visit
from lingjing.mission.instance import MessageSpec


def refute(need: Need, limit: TimeLimit, outline: Outline, at: str) -> list[Proof]:
    """Every proof that the need cannot be met within the limit; empty if there is none."""
    alone = _refute_each(need, limit, outline)
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


def _refute_each(need: Need, limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Proofs about single leaves. Of parts of which only some are required, so many must fail that too few remain; then
    the first failed part stands for all."""
    if not isinstance(need, AtLeast):
        leaf_proof = _leaf(need, limit, outline)
        return [leaf_proof] if leaf_proof else []
    failed = [proofs for part in need.parts if (proofs := _refute_each(part, limit, outline))]
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
            return _refute_report(leaf, outline)
        case PictureNeed():
            return refute_picture(leaf, outline)
        case Handover():
            return _refute_handover(leaf, outline)
        case Impossible(message=message, at=at):
            return Proof("LJ0612", at, message, "correct the condition, or declare the element that it needs")
        case Supply() | Performed() | AtLeast():
            return None


# -- messages and assignments: an agent must be able to send them to a recipient


def _refute_report(report: ReportNeed, outline: Outline) -> Proof | None:
    """A proof that no message of the kind can be sent, or None."""
    spec = next((message for message in outline.instance.messages if message.kind == report.kind), None)
    if spec is not None and _senders(spec, outline):
        return None
    return Proof(
        "LJ0605",
        report.at,
        f"no agent can send a `{report.kind}`: no agent has a role that may send it to a role that may receive it",
        f"let a role with an agent send `{report.kind}`, or allow it in this mode",
        ((f"message/{report.kind}", "the required message"),),
        report.kind,
    )


def _refute_handover(handover: Handover, outline: Outline) -> Proof | None:
    """A proof that the asset cannot be assigned, neither by command nor by message, or None."""
    asset = handover.asset
    commanded = asset.driven and any(
        {"x", "y"} <= {argument.name for argument in verb.arguments} for verb in asset.entity.verbs
    )
    if commanded or any(_assigns(message, outline) for message in outline.instance.messages):
        return None
    return Proof(
        "LJ0607",
        handover.at,
        f"no agent can assign `{asset.id}` to `{handover.target.id}`: no agent may command it to a place, "
        "and no assignment with a position can be sent",
        f"give a role authority over `{asset.entity.group}`, or a message of the category assignment",
        ((asset.path, "the asset to be assigned"),),
        handover.target.id,
    )


def _assigns(message: MessageSpec, outline: Outline) -> bool:
    """True if a message of the kind can be an assignment with a recipient."""
    fields = {field.name for field in message.fields}
    return message.category == "assignment" and "position" in fields and bool(_senders(message, outline))


def _senders(message: MessageSpec, outline: Outline) -> list[str]:
    return [agent.id for agent in outline.instance.agents if message.is_sent_by(agent.role)]
