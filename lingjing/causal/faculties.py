"""The six faculties of an agent: which record of a decision each one makes, and how it is replaced by the truth.

A decision is one command and some messages. Every part of it belongs to one faculty, told by what engines declare of
verbs and the mission of message kinds and cameras, never by a name of a mission, a policy or a verb. The truth is the
decision of a *reference*: a privileged policy that is asked at the same boundary, with the same inbox and pictures and
with the true states. `FACULTIES` is the table of docs/attribution.md. A part that agrees with the reference's within
the tolerances below is left as it is, so that a replacement is a departure and no noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, get_args

from msgspec.structs import replace

from lingjing.analysis.detection import iou, numbers
from lingjing.kernel.registry import Registry
from lingjing.mission.instance import AgentSpec, Entity, Instance
from lingjing.mission.tasks import reported
from lingjing.mission.vocabulary import VerbMotion
from lingjing.trace.records import Action, Decision, Faculty, Outgoing

PLACE_M = 15.0
"""Two destinations, or two places in messages, that lie no farther apart are the same: about what aircraft and vessels
miss a place by."""

STEP = 1.0
"""Two relative moves that differ by no more (metres or degrees) are the same."""

OVERLAP = 0.5
"""A box is right that overlaps (IoU) with the true one by so much: what the shipped missions adjudicate by."""

_RELATIVE: frozenset[VerbMotion] = frozenset(("step", "up", "down", "turn"))
"""Motions one of which may stand in the place of another: they differ in where they lead."""


class FacultyMeaning(NamedTuple):
    """A row of the table: what the faculty is, which record it makes, and what that record is replaced by."""

    name: Faculty
    meaning: str
    record: str
    truth: str


FACULTIES: tuple[FacultyMeaning, ...] = (
    FacultyMeaning(
        "perception",
        "seeing what a picture shows",
        "the reports (kinds that a rule matches with true boxes) of an agent with a camera",
        "reports on nothing, of another class or with less than half an overlap go; what the reference reports of the "
        "agent's own pictures comes",
    ),
    FacultyMeaning(
        "localisation",
        "placing what was seen",
        f"the `position` of those reports, and the same position in other messages, where it is over {PLACE_M:g} m off",
        "the true position, at the instant of the picture, of what the report's box lies on",
    ),
    FacultyMeaning(
        "waypoint",
        "choosing where to fly or sail",
        f"the arguments of a move of a body that goes straight to places, where over {PLACE_M:g} m (or {STEP:g} of a "
        "relative move) from the reference's",
        "the reference's move",
    ),
    FacultyMeaning(
        "routing",
        "choosing the way over ground",
        "the destination of a road vehicle, or the step or turn of a walker, likewise",
        "the reference's move",
    ),
    FacultyMeaning(
        "handoff",
        "telling the right agent the right thing",
        "all messages but the reports above: assignments, status, what is passed on",
        "what the reference says and the agent does not comes; an assignment to another assignee or another place goes",
    ),
    FacultyMeaning(
        "execution",
        "doing it: a command at all, and of the right kind",
        "a command that is missing, is not due, or has another verb or resource than the reference's",
        "the reference's command",
    ),
)
"""In the order in which a decision's parts are replaced."""


class TrueSituation(NamedTuple):
    """What the truth is read from at a boundary: the mission, the agent, and the kernel's registry."""

    instance: Instance
    agent: AgentSpec
    registry: Registry


def faculties_of(instance: Instance, agent: AgentSpec) -> tuple[Faculty, ...]:
    """The faculties that an agent has, by what it may command and say, in the order of the table."""
    entities = {entity.id: entity for entity in instance.entities}
    mobile = {_motion(entities[name]) for name in agent.commands} - {None}
    seen = _judged(instance, agent)
    places = any(field.name == "position" for one in instance.messages if one.kind in seen for field in one.fields)
    other = any(_may_send(agent, one.senders) and one.kind not in seen for one in instance.messages)
    has = {
        "perception": bool(seen),
        "localisation": bool(seen) and places,
        "waypoint": "waypoint" in mobile,
        "routing": "routing" in mobile,
        "handoff": other and len(instance.agents) > 1,
        "execution": bool(agent.commands),
    }
    return tuple(name for name in get_args(Faculty) if has[name])


def replaced(faculty: Faculty, decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    """The decision with one faculty's part replaced by the truth; the same object where nothing departs from it."""
    return _REPLACERS[faculty](decision, reference, scene)


def right_parts(decision: Decision, reference: Decision, scene: TrueSituation) -> frozenset[Faculty]:
    """The faculties of which a decision has a part that is right. What is missing, and what the reference has no
    counterpart of, is neither right nor wrong."""
    kinds = _judged(scene.instance, scene.agent)
    reports = [one for one in decision.messages if one.kind in kinds]
    said, due = decision.command, reference.command
    move = _kind_of_move(said, due, scene) if said and due else None
    has = {
        "perception": bool(reports),
        "localisation": any(
            numbers(one.body.get("position"), 2) is not None and _true_place(one, scene) is not None for one in reports
        ),
        "handoff": any(
            one.kind not in kinds and _same_message(one, other)
            for one in decision.messages
            for other in reference.messages
        ),
        "execution": said is not None and due is not None,
    }
    return frozenset(
        name
        for name in get_args(Faculty)
        if has.get(name, name == move) and replaced(name, decision, reference, scene) is decision
    )


# -- messages


def _perceived(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    kinds = _judged(scene.instance, scene.agent)
    right = {id(one): _shown(one, scene) for one in decision.messages if one.kind in kinds}
    told = {entity for entity in right.values() if entity}
    kept = tuple(one for one in decision.messages if right.get(id(one), "other"))
    missing = tuple(one for one in reference.messages if one.kind in kinds and _shown(one, scene) not in told)
    if not missing and len(kept) == len(decision.messages):
        return decision
    return replace(decision, messages=kept + missing)


def _shown(report: Outgoing, scene: TrueSituation) -> str:
    """The entity of the report's class whose true box it is right about; "" if there is none."""
    info, box = scene.registry.frames.get(str(report.body.get("frame"))), numbers(report.body.get("box"), 4)
    if info is None or box is None:
        return ""
    found = [
        (overlap, truth.entity)
        for truth in info.boxes
        if truth.cls == report.body.get("class") and (overlap := iou(_four(box), truth.box)) >= OVERLAP
    ]
    return max(found, default=(0.0, ""))[1]


def _placed(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    kinds = _judged(scene.instance, scene.agent)
    wrong: list[tuple[tuple[float, ...], tuple[float, ...]]] = []
    for one in decision.messages:
        said = numbers(one.body.get("position"), 2)
        true = _true_place(one, scene) if one.kind in kinds else None
        if said is not None and true is not None and math.dist(said, true[:2]) > PLACE_M:
            wrong.append((said, true))
    if not wrong:
        return decision
    return replace(decision, messages=tuple(_corrected(one, wrong) for one in decision.messages))


def _corrected(message: Outgoing, wrong: Sequence[tuple[tuple[float, ...], tuple[float, ...]]]) -> Outgoing:
    """The message with a wrong position, wherever it repeats one, put right."""
    given = message.body.get("position")
    said = numbers(given, 2)
    for false, true in wrong:
        if said is not None and isinstance(given, tuple) and math.dist(said, false) <= STEP:
            return replace(message, body={**message.body, "position": true[: len(given)]})
    return message


def _true_place(report: Outgoing, scene: TrueSituation) -> tuple[float, float, float] | None:
    """Where what the report's box lies on most was when the picture was taken."""
    frame = str(report.body.get("frame"))
    info, box = scene.registry.frames.get(frame), numbers(report.body.get("box"), 4)
    if info is None or box is None:
        return None
    overlap, entity = max(((iou(_four(box), truth.box), truth.entity) for truth in info.boxes), default=(0.0, ""))
    state = scene.registry.frame_states[frame].get(entity)
    return state.position if state is not None and overlap > 0.0 else None


def _handed(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    kinds = _judged(scene.instance, scene.agent)
    due = [one for one in reference.messages if one.kind not in kinds]
    missing = [one for one in due if not any(_same_message(one, said) for said in decision.messages)]
    categories = {one.kind: one.category for one in scene.instance.messages}
    kept = tuple(
        one
        for one in decision.messages
        if one.kind in kinds or categories.get(one.kind) != "assignment" or not _contradicts(one, due, missing, scene)
    )
    if not missing and len(kept) == len(decision.messages):
        return decision
    return replace(decision, messages=kept + tuple(missing))


def _contradicts(said: Outgoing, due: Sequence[Outgoing], missing: Sequence[Outgoing], scene: TrueSituation) -> bool:
    """Whether an assignment stands in the place of one that is missing, or sends somebody where nothing is."""
    if any(_same_message(said, one) for one in due):
        return False
    for one in missing:
        if one.kind == said.kind and (
            one.body.get("assignee") == said.body.get("assignee") or _near(one.body, said.body) is True
        ):
            return True
    place = numbers(said.body.get("position"), 2)
    targets = (state for entity in scene.instance.entities if (state := scene.registry.states.get(entity.id)))
    return place is not None and all(math.dist(place, state.position[:2]) > 4 * PLACE_M for state in targets)


def _same_message(one: Outgoing, other: Outgoing) -> bool:
    """Whether two messages say the same to the same: kind, recipients, position within `PLACE_M`, all other fields."""
    if (one.kind, one.to) != (other.kind, other.to) or _near(one.body, other.body) is False:
        return False
    names = (one.body.keys() | other.body.keys()) - {"position", "confidence"}
    return all(one.body.get(name) == other.body.get(name) for name in names)


def _near(one: Mapping[str, object], other: Mapping[str, object]) -> bool | None:
    """Whether two bodies name the same place; None if neither or one alone names one."""
    here, there = numbers(one.get("position"), 2), numbers(other.get("position"), 2)
    return None if here is None or there is None else math.dist(here, there) <= PLACE_M


# -- commands


def _directed(faculty: Faculty) -> Callable[[Decision, Decision, TrueSituation], Decision]:
    def directed(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
        said, due = decision.command, reference.command
        if said is None or due is None or _kind_of_move(said, due, scene) != faculty or _same_move(said, due):
            return decision
        return replace(decision, command=due)

    return directed


def _executed(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    said, due = decision.command, reference.command
    if said is None and due is None:
        return decision
    if said is not None and due is not None:
        alike = said.verb == due.verb and _resource(said, scene) == _resource(due, scene)
        if _kind_of_move(said, due, scene) is not None or (alike and said.arguments == due.arguments):
            return decision
    return replace(decision, command=due)


def _kind_of_move(said: Action, due: Action, scene: TrueSituation) -> Faculty | None:
    """The faculty that two moves of one body differ in; None if they are not both moves of one body."""
    resource = _resource(said, scene)
    entity = next((one for one in scene.instance.entities if one.id == resource), None)
    if entity is None or resource != _resource(due, scene):
        return None
    motions = {verb.name: verb.motion for verb in entity.verbs}
    here, there = motions.get(said.verb, ""), motions.get(due.verb, "")
    if not here or not there or (said.verb != due.verb and not {here, there} <= _RELATIVE):
        return None
    return _motion(entity)


def _same_move(said: Action, due: Action) -> bool:
    if said.verb != due.verb:
        return False
    here, there = _coordinates(said), _coordinates(due)
    if here is not None and there is not None:
        return math.dist(here, there) <= PLACE_M
    names = said.arguments.keys() | due.arguments.keys()
    pairs = [(said.arguments.get(name), due.arguments.get(name)) for name in names]
    return all(
        abs(one - other) <= STEP if isinstance(one, int | float) and isinstance(other, int | float) else one == other
        for one, other in pairs
    )


def _coordinates(action: Action) -> tuple[float, float] | None:
    """The place in the plane that a move goes to; how high above it is the flier's own choice."""
    return numbers((action.arguments.get("x"), action.arguments.get("y")), 2)  # type: ignore[return-value]


def _motion(entity: Entity) -> Faculty | None:
    """The faculty that moves of an entity belong to: `waypoint` if it goes straight to places, through the air or over
    water, `routing` if it follows roads or walks; None if it does not move by commands."""
    motions = {verb.motion for verb in entity.verbs} - {""}
    return "waypoint" if "straight" in motions else "routing" if motions else None


def _resource(action: Action, scene: TrueSituation) -> str:
    commands = scene.agent.commands
    return action.resource if action.resource is not None else commands[0] if commands else ""


# -- what the mission declares


def _judged(instance: Instance, agent: AgentSpec) -> frozenset[str]:
    """The kinds with which an agent reports what its own pictures show: those that a rule matches with true boxes."""
    mounted = ((entity.id, camera.name) for entity in instance.entities for camera in entity.cameras)
    if not any(agent.receives_pictures(entity, camera) for entity, camera in mounted):
        return frozenset()
    kinds = frozenset(reported(instance).values())
    return frozenset(one.kind for one in instance.messages if one.kind in kinds and _may_send(agent, one.senders))


def _may_send(agent: AgentSpec, senders: Sequence[str]) -> bool:
    return "all" in senders or agent.role in senders


def _four(box: tuple[float, ...]) -> tuple[float, float, float, float]:
    return box[0], box[1], box[2], box[3]


_REPLACERS: Mapping[Faculty, Callable[[Decision, Decision, TrueSituation], Decision]] = {
    "perception": _perceived,
    "localisation": _placed,
    "waypoint": _directed("waypoint"),
    "routing": _directed("routing"),
    "handoff": _handed,
    "execution": _executed,
}
