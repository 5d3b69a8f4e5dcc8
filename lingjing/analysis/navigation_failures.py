"""Breakdowns of a navigation: a body must reach a hidden target, and no rule of the mission judges reports.

Without reports, the records of perception are the pictures that showed the target and the motion after them. `families`
has the definitions. Distances are planar, between the states at the ends of ticks.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from lingjing.analysis.behaviour import EvaluatedAction, actions
from lingjing.analysis.detection import judged_kinds, shots
from lingjing.analysis.failure_records import DELAY, Attribution, FailureFamily, RecordLink
from lingjing.analysis.memo import cache_by_trace
from lingjing.analysis.repetition import assignments_of
from lingjing.mission.instance import Vector
from lingjing.plugins.requests import STOP
from lingjing.trace.reader import Trace

NEARER_M = 5.0
"""Change of a distance from which on a body came nearer, metres. Chosen: a short step of a dog."""

AWAY_M = 30.0
"""Change of a distance from which on a body went away again, metres. Chosen: the paper's radius of navigation."""

Places = Sequence[Mapping[str, Vector]]
"""The positions of all entities at the end of each tick."""


@cache_by_trace
def body_places(trace: Trace) -> Places:
    """Return the positions of all entities at the boundaries of a trace."""
    return [
        {state.id: state.position for state in record.snapshots[-1].states} if record.snapshots else {}
        for record in trace.boundaries
    ]


def planar_distance(places: Places, body: str, target: str, tick: int) -> float | None:
    """Return the planar distance of two entities at a boundary, metres; None if either of them is missing."""
    there = places[tick] if 0 <= tick < len(places) else {}
    here, goal = there.get(body), there.get(target)
    return None if here is None or goal is None else math.dist(here[:2], goal[:2])


def navigation_breakdowns(trace: Trace, target: str) -> Iterator[Attribution]:
    """Yield the breakdowns of a navigation to one lost target; none in other missions."""
    serving = assignments_of(trace)
    group, hidden = (
        serving.groups.get(target),
        {entity.id for entity in trace.header.instance.entities if entity.hidden},
    )
    bodies = {served.executor: served.radius_m for served in serving.radii if served.group == group}
    if judged_kinds(trace) or target not in hidden or not bodies:
        return
    seen = [
        frame
        for frame in shots(trace)
        if frame.entity in bodies and any(box.entity == target and box.pixels for box in frame.boxes)
    ]
    first = seen[0].tick if seen else None
    stops = [action for action in actions(trace) if action.verb == STOP and action.resource in bodies]
    for rule in (_never_seen(trace, target, first), _stopped(trace, target, bodies, stops, first)):
        if rule is not None:
            yield rule
    if seen:
        yield from _after_sight(trace, target, seen[0].entity, seen[0].id, seen[0].tick)


def _never_seen(trace: Trace, target: str, first: int | None) -> Attribution | None:
    if first is not None:
        return None
    last = trace.boundaries[-1].tick
    link = RecordLink(kind="event", tick=last, record="", text=f"{target} is visible in no picture")
    return Attribution(family="perception_miss", target=target, tick=last, chain=(link,))


def _stopped(
    trace: Trace, target: str, radii: Mapping[str, float], stops: Sequence[EvaluatedAction], first: int | None
) -> Attribution | None:
    """Return the breakdown of the first stop outside of the target's region, by which a body claims its arrival."""
    for action in stops:
        off = planar_distance(body_places(trace), action.resource, target, action.tick)
        if off is not None and off > radii[action.resource]:
            known = first is not None and first < action.tick
            text = f"{action.resource} stops {off:.0f} m from {target}, {'after' if known else 'before'} it was visible"
            link = RecordLink(kind="action", tick=action.tick, record=f"{action.agent} {STOP}", text=text)
            family: FailureFamily = "localisation_error" if known else "object_confusion"
            return Attribution(family=family, target=target, tick=action.tick, chain=(link,))
    return None


def _after_sight(trace: Trace, target: str, body: str, frame: str, tick: int) -> Iterator[Attribution]:
    """Yield the miss of a body that came no nearer to a visible target, or the drift of one that went away again."""
    away = [planar_distance(body_places(trace), body, target, number) for number in range(len(trace.boundaries))]
    path = [(number, off) for number, off in enumerate(away) if number >= tick and off is not None]
    if not path:
        return
    picture = RecordLink(kind="picture", tick=tick, record=frame, text=f"{target} is visible")
    early = [off for number, off in path if number <= tick + DELAY]
    if path[-1][0] >= tick + DELAY and min(early) > path[0][1] - NEARER_M:
        link = RecordLink(kind="agent", tick=tick, record=body, text=f"{body} comes no nearer within {DELAY} ticks")
        yield Attribution(family="perception_miss", target=target, tick=tick, chain=(picture, link))
        return
    turned, nearest = min(path, key=lambda step: (step[1], step[0]))
    if path[-1][1] > nearest + AWAY_M:
        text = f"{body} came as near as {nearest:.0f} m and went away again, to {path[-1][1]:.0f} m"
        link = RecordLink(kind="agent", tick=turned, record=body, text=text)
        yield Attribution(family="context_drift", target=target, tick=turned, chain=(picture, link))
