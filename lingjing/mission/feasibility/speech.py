"""Messages: who must be able to say what, and whether the bus takes it anywhere."""

from __future__ import annotations

from lingjing.mission.feasibility.needs import Handover, ReportNeed
from lingjing.mission.feasibility.outline import Outline
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.instance import MessageSpec


def refute_report(report: ReportNeed, outline: Outline) -> Proof | None:
    """Why no message of the kind can be sent, if that is so."""
    spec = next((message for message in outline.instance.messages if message.kind == report.kind), None)
    if spec is not None and _senders(spec, outline):
        return None
    return Proof(
        "LJ0605",
        report.at,
        f"nobody can send a `{report.kind}`: no agent has a role that may send it to one that may receive it",
        f"let a role that is played send `{report.kind}`, or open it in this mode",
        ((f"message/{report.kind}", "the message that is needed"),),
        report.kind,
    )


def refute_handover(handover: Handover, outline: Outline) -> Proof | None:
    """Why no destination can be given to the asset, if that is so: neither by command nor by message."""
    asset = handover.asset
    commanded = asset.driven and any(
        {"x", "y"} <= {argument.name for argument in verb.arguments} for verb in asset.entity.verbs
    )
    if commanded or any(_assigns(message, outline) for message in outline.instance.messages):
        return None
    return Proof(
        "LJ0607",
        handover.at,
        f"nobody can assign `{asset.id}` to `{handover.target.id}`: no agent may command it to a place, "
        "and no assignment with a position can be sent",
        f"give a role authority over `{asset.entity.group}`, or a message of the category assignment",
        ((asset.path, "what must be assigned"),),
        handover.target.id,
    )


def _assigns(message: MessageSpec, outline: Outline) -> bool:
    """Whether a message of the kind can be an assignment that somebody reads."""
    fields = {field.name for field in message.fields}
    return message.category == "assignment" and "position" in fields and bool(_senders(message, outline))


def _senders(message: MessageSpec, outline: Outline) -> list[str]:
    return [agent.id for agent in outline.instance.agents if message.is_sent_by(agent.role)]
