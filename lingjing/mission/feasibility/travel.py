"""Travel: a lower bound of time is a straight line at top speed, and a battery bounds the distance."""

from __future__ import annotations

import math

import msgspec

from lingjing.mission.conditions.needs import VisitNeed
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import PossiblePlaces, gap
from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.proof import Proof, both, exceeds, spelled


class VisitGeometry(msgspec.Struct, frozen=True):
    """A visit as plain geometry."""

    where: PossiblePlaces
    """Possible start places of the goal."""
    speed_mps: float
    """Upper bound of the goal's own speed, m/s."""
    radius_m: float
    """Distance from the goal that completes the visit, metres."""


def meeting(visit: VisitNeed, outline: Outline) -> VisitGeometry:
    """The geometry of a visit, including carriers that may move its goal.

    A goal that other entities than the visit's movers may take aboard moves as fast as they do. If only the movers may
    take it aboard, they first meet it where it drifts, at the distance of that interaction.
    """
    if isinstance(visit.goal, PossiblePlaces):
        return VisitGeometry(visit.goal, 0.0, visit.radius_m)
    goal, movers = visit.goal, {mover.id for mover in visit.movers}
    radius = max(visit.radius_m, goal.aboard_m)
    if goal.aboard <= movers:
        return VisitGeometry(goal.where, goal.speed_mps, radius)
    return VisitGeometry(goal.where, max(goal.speed_mps, _carried(goal, outline)), radius)


def _pace(mover: Body, outline: Outline) -> float:
    """The speed of a mover, m/s: its own, or that of its carrier if that is faster."""
    return max(mover.speed_mps, _carried(mover, outline))


def refute_visit(visit: VisitNeed, limit: TimeLimit, outline: Outline) -> Proof | None:
    """A proof that no mover can make the visit within the limit, or None."""
    if not visit.movers:
        return None
    goal = meeting(visit, outline)
    away = {mover.id: _away(mover, goal, outline) for mover in visit.movers}
    best = min(visit.movers, key=lambda mover: _seconds(away[mover.id], _pace(mover, outline) + goal.speed_mps))
    needed = _seconds(away[best.id], _pace(best, outline) + goal.speed_mps)
    if math.isinf(needed):
        return _immobile(visit, away[best.id], best)
    if exceeds(needed, limit.seconds):
        return _too_late(visit, goal, limit, best, away[best.id], _pace(best, outline) + goal.speed_mps)
    return _too_far(visit, goal, limit, away, outline)


def _name_of(goal: Body | PossiblePlaces) -> str:
    """The goal in words."""
    if isinstance(goal, Body):
        return f"`{goal.id}`"
    first = goal.outlines[0]
    return f"({spelled(first[0][0])}, {spelled(first[0][1])}) m" if len(first) == 1 else "the region"


def movers_of(movers: tuple[Body, ...]) -> str:
    """The movers in words."""
    if len(movers) == 1:
        return f"`{movers[0].id}`"
    groups = list(dict.fromkeys(mover.entity.group for mover in movers))
    return f"the {len(movers)} " + " and ".join(f"`{group}`" for group in groups)


def _carried(body: Body, outline: Outline) -> float:
    return max((outline.bodies[name].speed_mps for name in body.aboard), default=0.0)


def _away(mover: Body, goal: VisitGeometry, outline: Outline) -> float:
    """Lower bound of the distance to cover, metres. A mover that is taken aboard starts at its carrier."""
    return max(0.0, gap(mover.where, goal.where) - goal.radius_m - mover.aboard_m)


def _seconds(metres: float, speed: float) -> float:
    if metres <= 1e-6 or math.isinf(speed):
        return 0.0
    return metres / speed if speed > 0 else math.inf


def _immobile(visit: VisitNeed, metres: float, mover: Body) -> Proof:
    why = "no agent may command it to move" if not mover.driven else "it has no speed"
    movers = movers_of(visit.movers)
    return Proof(
        "LJ0607",
        visit.at,
        f"no agent can bring {movers} within {spelled(visit.radius_m)} m of {_name_of(visit.goal)}: "
        f"`{mover.id}` is at least {spelled(round(metres, 3))} m too far away, and {why}",
        f"let an agent control `{mover.entity.group}`, give it a verb that moves it, or place it nearer",
        ((mover.path, "the vehicle"), *_goal(visit)),
        _subject(visit),
    )


def _too_late(
    visit: VisitNeed, goal: VisitGeometry, limit: TimeLimit, mover: Body, metres: float, speed: float
) -> Proof:
    needed, _ = both(metres / speed, limit.seconds)
    closing = " (both moving)" if goal.speed_mps > 0 else ""
    return Proof(
        "LJ0601",
        visit.at,
        f"{movers_of(visit.movers)} cannot come within {spelled(visit.radius_m)} m of {_name_of(visit.goal)} in time: "
        f"{spelled(round(metres, 3))} m at {spelled(round(speed, 3))} m/s at most{closing}, margins included, "
        f"take at least {needed} s, {limit.words}",
        "raise the budget, start nearer, or choose a faster vehicle",
        ((limit.at, "the budget"), (mover.path, "the vehicle"), *_goal(visit)),
        _subject(visit),
    )


def _too_far(
    visit: VisitNeed, goal: VisitGeometry, limit: TimeLimit, away: dict[str, float], outline: Outline
) -> Proof | None:
    """A proof that no battery lasts for the visit, or None."""
    worst: Proof | None = None
    for mover in visit.movers:
        speed = _pace(mover, outline)
        metres = max(0.0, away[mover.id] - goal.speed_mps * limit.seconds)
        flight = _seconds(metres, speed)
        if not exceeds(flight, mover.flight_s):
            return None
        needed, lasts = both(flight, mover.flight_s)
        worst = worst or Proof(
            "LJ0603",
            visit.at,
            f"no battery takes {movers_of(visit.movers)} within {spelled(visit.radius_m)} m of {_name_of(visit.goal)}: "
            f"{spelled(round(metres, 3))} m at {spelled(round(speed, 3))} m/s at most are at least {needed} s of "
            f"flight, `{mover.id}` can fly for {lasts} s at most",
            "raise `endurance`, start nearer, or choose another vehicle",
            ((mover.path, "the vehicle"), *_goal(visit)),
            _subject(visit),
        )
    return worst


def _goal(visit: VisitNeed) -> tuple[tuple[str, str], ...]:
    return ((visit.goal.path, "the destination"),) if isinstance(visit.goal, Body) else ()


def _subject(visit: VisitNeed) -> str:
    return visit.goal.id if isinstance(visit.goal, Body) else visit.movers[0].id
