"""Counted budgets: limits of messages and commands below the minimum of every successful episode, and too few ticks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lingjing.mission.conditions.episode import EpisodeKnowledge
from lingjing.mission.conditions.motion import IDLE_VERBS, roaming_verbs
from lingjing.mission.conditions.needs import AtLeast, Need, NeedLeaf, PictureNeed, ReportNeed, VisitNeed
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import PossiblePlaces, gap
from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.proof import Proof, exceeds, spelled
from lingjing.mission.feasibility.seeing import as_drawn, sight_m, takes_pictures_by_itself
from lingjing.mission.feasibility.tour import length
from lingjing.mission.instance import CameraSpec, LimitSpec, VerbSpec
from lingjing.mission.kinds import engine_kind
from lingjing.mission.vocabulary import PHOTO

_SWING_M = 2.0
"""Metres added to the displacement of a command for the vehicle's turn (chosen). The engine's overshoot comes
on top."""


def refute_ticks(need: Need, limit: TimeLimit, outline: Outline, at: str) -> Proof | None:
    """A proof that there are too few ticks to request a picture, receive it and report it; None if there are enough."""
    least = _ticks(need, 1 if takes_pictures_by_itself(outline) else 2)
    if not exceeds(least, limit.ticks):
        return None
    return Proof(
        "LJ0602",
        at,
        f"no schedule fits: to request a picture, to receive it and to report it takes at least {least} ticks, "
        f"{limit.words}",
        "raise the budget",
        ((limit.at, "the budget"),),
    )


def refute_counts(leaves: Sequence[NeedLeaf], limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Proofs that a counted budget of the episode, or its budget of messages, is below the needed number."""
    reports = _reports(leaves)
    proofs = [_messages(counted, reports) for counted in outline.instance.limits if not counted.stage]
    proofs += [
        _commands(counted, leaves, limit, outline) or _orders(counted, leaves, outline)
        for counted in outline.instance.limits
        if not counted.stage
    ]
    most, needed = outline.instance.budget.messages, sum(reports.values())
    if most is not None and needed > most:
        proofs.append(
            Proof(
                "LJ0610",
                "budget/messages",
                f"success takes at least {needed} messages ({_spelled(reports)}), and the budget is {most}",
                "raise the budget",
            )
        )
    return [proof for proof in proofs if proof]


def _ticks(need: Need, picture: int) -> int:
    match need:
        case PictureNeed():
            return picture
        case ReportNeed():
            return 1
        case AtLeast(least=least, parts=parts) if 0 < least <= len(parts):
            return sorted(_ticks(part, picture) for part in parts)[least - 1]
    return 0


def _reports(leaves: Sequence[NeedLeaf]) -> dict[str, int]:
    """The minimum number of messages of each kind: one for each entity if they are matched one to one, else one."""
    about: dict[str, set[str]] = {}
    for leaf in leaves:
        if isinstance(leaf, ReportNeed):
            about.setdefault(leaf.kind, set()).add(leaf.about if leaf.matching else "")
    return {kind: max(1, len(names - {""})) for kind, names in about.items()}


def _messages(counted: LimitSpec, reports: dict[str, int]) -> Proof | None:
    kinds = {item.name for item in counted.counts if item.kind == "message"}
    needed = {kind: count for kind, count in reports.items() if kind in kinds}
    if sum(needed.values()) <= counted.most:
        return None
    return Proof(
        "LJ0610",
        f"limit/{counted.name}",
        f"success takes at least {sum(needed.values())} messages ({_spelled(needed)}), and `{counted.name}` allows "
        f"{counted.most}",
        "raise the limit",
    )


def _spelled(reports: dict[str, int]) -> str:
    return ", ".join(f"{count} `{kind}`" for kind, count in reports.items())


def _commands(counted: LimitSpec, leaves: Sequence[NeedLeaf], limit: TimeLimit, outline: Outline) -> Proof | None:
    """A proof that a way takes more commands than the limit allows. It requires that every command that moves the
    vehicle is counted."""
    for body in outline.bodies.values():
        step = _longest_step(body, counted)
        visits = tuple(leaf for leaf in leaves if isinstance(leaf, VisitNeed) and leaf.movers == (body,))
        if math.isinf(step) or not visits or body.aboard:
            continue
        metres = length((body,), visits, limit, outline)
        needed = math.ceil(metres / step - 1e-9) if step > 0 else 1 if metres > _SWING_M else 0
        if needed > counted.most:
            return Proof(
                "LJ0610",
                f"limit/{counted.name}",
                f"`{body.id}` must cover at least {spelled(round(metres, 3))} m, which at {spelled(round(step, 3))} m "
                f"a command at most takes {needed} commands, and `{counted.name}` allows {counted.most}",
                "raise the limit, allow longer steps, or start nearer",
                ((body.path, "the vehicle"),),
            )
    return None


def _longest_step(body: Body, counted: LimitSpec) -> float:
    """The longest displacement of one counted command, metres; infinity if it has no bound or not all commands are
    counted."""
    names = _counted_verbs(counted, body)
    moving = [verb for verb in body.entity.verbs if verb.name not in IDLE_VERBS]
    overshoot = engine_kind(body.entity.engine).overshoot
    if overshoot is None or not names or not moving:
        return math.inf
    if "" not in names and any(verb.name not in names for verb in moving):
        return math.inf
    return max(_step(verb, overshoot) for verb in moving)


def _step(verb: VerbSpec, overshoot: float) -> float:
    """The longest displacement of a verb, from its one bounded length; the swing alone if it only turns."""
    if verb.motion == "turn":
        return _SWING_M
    length = verb.arguments[0] if len(verb.arguments) == 1 and verb.arguments[0].unit == "m" else None
    if verb.motion in ("straight", "route") or length is None or length.maximum is None:
        return math.inf
    return length.maximum * overshoot + _SWING_M


# -- one command at least


def _orders(counted: LimitSpec, leaves: Sequence[NeedLeaf], outline: Outline) -> Proof | None:
    """A proof that the limit allows fewer commands than bodies that must be moved and pictures that must be requested.

    Each body that must move takes one counted command at least, and a picture on request takes another one.
    """
    if not any(item.kind == "command" for item in counted.counts):
        return None
    knowledge = EpisodeKnowledge(outline)
    moved = {
        leaf.movers[0].id: leaf.movers[0]
        for leaf in leaves
        if isinstance(leaf, VisitNeed) and len(leaf.movers) == 1
        if _must_move(leaf.movers[0], leaf.goal, leaf.radius_m, knowledge, counted)
    }
    costs = [
        min((_shot(counted, moved, leaf.target, mount, knowledge) for mount in _mounts(outline)), default=(0, ""))
        for leaf in leaves
        if isinstance(leaf, PictureNeed)
    ]
    needed, shot = max([*costs, (0, "")])
    needed += len(moved)
    if needed <= counted.most:
        return None
    parts = [*(f"a motion of `{name}`" for name in moved), *([shot] if shot else [])]
    return Proof(
        "LJ0610",
        f"limit/{counted.name}",
        f"success takes at least {needed} commands ({', '.join(parts)}), and `{counted.name}` allows {counted.most}",
        "raise the limit",
    )


def _mounts(outline: Outline) -> list[tuple[Body, CameraSpec]]:
    return [(body, camera) for body in outline.bodies.values() for camera in body.entity.cameras]


def _shot(
    counted: LimitSpec,
    moved: Mapping[str, Body],
    target: Body,
    mount: tuple[Body, CameraSpec],
    knowledge: EpisodeKnowledge,
) -> tuple[int, str]:
    """The number of counted commands, besides those of `moved` bodies, that a picture with this camera takes at least,
    and their description."""
    carrier, camera = mount
    names = _counted_verbs(counted, carrier)
    on_request = camera.capture != "each_tick" and ("" in names or PHOTO in names)
    radius = sight_m(carrier, camera, target, knowledge)
    must_move = (
        carrier.id not in moved
        and math.isfinite(radius)
        and _must_move(carrier, as_drawn(target), radius, knowledge, counted)
    )
    parts = [f"a motion of `{carrier.id}`"] * must_move + [f"`{PHOTO}` of `{carrier.id}`"] * on_request
    return len(parts), ", ".join(parts)


def _must_move(
    body: Body, goal: Body | PossiblePlaces, radius: float, knowledge: EpisodeKnowledge, counted: LimitSpec
) -> bool:
    """True if the body comes within the radius of the goal only by a counted command."""
    outline, names = knowledge.outline, _counted_verbs(counted, body)
    verbs = roaming_verbs(body.entity)
    if body.aboard or not names or not ("" in names or all(verb in names for verb in verbs)):
        return False
    if any(inspection.asset == body.id for inspection in outline.instance.inspections):
        return False
    near = knowledge.drift_m(body)
    if isinstance(goal, Body):
        radius = max(radius, goal.aboard_m)
        near += knowledge.drift_m(goal) if goal.aboard <= {body.id} else knowledge.reach_m(goal)
        goal = goal.where
    return gap(body.where, goal) - radius - near > _SWING_M


def _counted_verbs(counted: LimitSpec, body: Body) -> set[str]:
    """The counted verbs of a body; "" stands for all of them."""
    return {item.name for item in counted.counts if item.kind == "command" and item.resource == body.id}
