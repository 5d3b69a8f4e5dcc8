"""The six faculties of an agent: the parts of a decision that belong to each, and their replacement by the reference.

A decision is one command and some messages. Every part belongs to one faculty, derived from the declarations of verbs,
message kinds and cameras, never from the name of a mission, a policy or a verb. The *reference* is the decision of a
privileged policy at the same boundary, with the same messages and pictures and with the true states. `FACULTIES` is
the table of docs/attribution.md. A part that agrees with the reference within the tolerances below is not replaced, so
that every replacement is a departure and not noise.
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
"""Distance up to which two destinations, or two positions in messages, are equal, metres. Chosen: about the error with
which aircraft and vessels reach a position.
"""

STEP = 1.0
"""Difference up to which two relative moves are equal, metres or degrees. Chosen."""

OVERLAP = 0.5
"""The least IoU of a box with the true one; the value by which the shipped missions adjudicate."""

_RELATIVE: frozenset[VerbMotion] = frozenset(("step", "up", "down", "turn"))
"""Motions that may replace each other, because they differ only in their direction."""


class _FacultyMeaning(NamedTuple):
    """A row of the table of faculties."""

    name: Faculty
    meaning: str
    """The faculty in words."""
    record: str
    """The parts of a decision that belong to the faculty."""
    truth: str
    """The replacement of these parts."""


FACULTIES: tuple[_FacultyMeaning, ...] = (
    _FacultyMeaning(
        "perception",
        "seeing what a picture shows",
        "the reports (kinds that a rule matches with true boxes) of an agent with a camera",
        "reports on nothing, of another class or with less than half an overlap go; what the reference reports of the "
        "agent's own pictures comes",
    ),
    _FacultyMeaning(
        "localisation",
        "placing what was seen",
        f"the `position` of those reports, and the same position in other messages, where it is over {PLACE_M:g} m off",
        "the true position, at the instant of the picture, of what the report's box lies on",
    ),
    _FacultyMeaning(
        "waypoint",
        "choosing where to fly or sail",
        f"the arguments of a move of a body that goes straight to places, where over {PLACE_M:g} m (or {STEP:g} of a "
        "relative move) from the reference's",
        "the reference's move",
    ),
    _FacultyMeaning(
        "routing",
        "choosing the way over ground",
        "the destination of a road vehicle, or the step or turn of a walker, likewise",
        "the reference's move",
    ),
    _FacultyMeaning(
        "handoff",
        "telling the right agent the right thing",
        "all messages but the reports above: assignments, status, what is passed on",
        "what the reference says and the agent does not comes; an assignment to another assignee or another place goes",
    ),
    _FacultyMeaning(
        "execution",
        "doing it: a command at all, and of the right kind",
        "a command that is missing, is not due, or has another verb or resource than the reference's",
        "the reference's command",
    ),
)
"""The faculties, in the order in which parts of a decision are replaced."""


class TrueSituation(NamedTuple):
    """The ground truth at a boundary, as far as replacements need it."""

    instance: Instance
    """The instance of the mission."""
    agent: AgentSpec
    """The agent of the decision."""
    registry: Registry
    """The kernel's registry of states, frames and events."""


def faculties_of(instance: Instance, agent: AgentSpec) -> tuple[Faculty, ...]:
    """Return the faculties of an agent, derived from its commands and messages, in the order of the table."""
    entities = {entity.id: entity for entity in instance.entities}
    mobile = {_motion(entities[name]) for name in agent.commands} - {None}
    report_kinds = _report_kinds(instance, agent)
    places = any(
        field.name == "position" for kind in instance.messages if kind.kind in report_kinds for field in kind.fields
    )
    other = any(_may_send(agent, kind.senders) and kind.kind not in report_kinds for kind in instance.messages)
    available = {
        "perception": bool(report_kinds),
        "localisation": bool(report_kinds) and places,
        "waypoint": "waypoint" in mobile,
        "routing": "routing" in mobile,
        "handoff": other and len(instance.agents) > 1,
        "execution": bool(agent.commands),
    }
    return tuple(name for name in get_args(Faculty) if available[name])


def replace_faculty(faculty: Faculty, decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    """Return the decision with one faculty's part replaced by the reference; the same object if nothing departs from
    it.
    """
    return _REPLACERS[faculty](decision, reference, scene)


def right_parts(decision: Decision, reference: Decision, scene: TrueSituation) -> frozenset[Faculty]:
    """Return the faculties of which a decision has a part that agrees with the reference.

    Missing parts, and parts without a counterpart in the reference, are neither right nor wrong.
    """
    kinds = _report_kinds(scene.instance, scene.agent)
    reports = [message for message in decision.messages if message.kind in kinds]
    command, reference_command = decision.command, reference.command
    move = _kind_of_move(command, reference_command, scene) if command and reference_command else None
    right = {
        "perception": bool(reports),
        "localisation": any(
            numbers(message.body.get("position"), 2) is not None and _true_position(message, scene) is not None
            for message in reports
        ),
        "handoff": any(
            message.kind not in kinds and _same_message(message, other)
            for message in decision.messages
            for other in reference.messages
        ),
        "execution": command is not None and reference_command is not None,
    }
    return frozenset(
        name
        for name in get_args(Faculty)
        if right.get(name, name == move) and replace_faculty(name, decision, reference, scene) is decision
    )


# -- messages


def _replace_perception(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    kinds = _report_kinds(scene.instance, scene.agent)
    shown = {id(message): _matched_entity(message, scene) for message in decision.messages if message.kind in kinds}
    reported = {entity for entity in shown.values() if entity}
    kept = tuple(message for message in decision.messages if shown.get(id(message), "other"))
    missing = tuple(
        message
        for message in reference.messages
        if message.kind in kinds and _matched_entity(message, scene) not in reported
    )
    if not missing and len(kept) == len(decision.messages):
        return decision
    return replace(decision, messages=kept + missing)


def _matched_entity(report: Outgoing, scene: TrueSituation) -> str:
    """Return the entity of the report's class with a true box that the report matches, or ""."""
    info, box = scene.registry.frames.get(str(report.body.get("frame"))), numbers(report.body.get("box"), 4)
    if info is None or box is None:
        return ""
    matches = [
        (overlap, truth.entity)
        for truth in info.boxes
        if truth.cls == report.body.get("class") and (overlap := iou(_four(box), truth.box)) >= OVERLAP
    ]
    return max(matches, default=(0.0, ""))[1]


def _replace_localisation(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    kinds = _report_kinds(scene.instance, scene.agent)
    wrong: list[tuple[tuple[float, ...], tuple[float, ...]]] = []
    for message in decision.messages:
        position = numbers(message.body.get("position"), 2)
        true_position = _true_position(message, scene) if message.kind in kinds else None
        if position is not None and true_position is not None and math.dist(position, true_position[:2]) > PLACE_M:
            wrong.append((position, true_position))
    if not wrong:
        return decision
    return replace(decision, messages=tuple(_corrected(message, wrong) for message in decision.messages))


def _corrected(message: Outgoing, wrong: Sequence[tuple[tuple[float, ...], tuple[float, ...]]]) -> Outgoing:
    """Return the message with the true position in place of a wrong one that it repeats."""
    value = message.body.get("position")
    position = numbers(value, 2)
    for false, true in wrong:
        if position is not None and isinstance(value, tuple) and math.dist(position, false) <= STEP:
            return replace(message, body={**message.body, "position": true[: len(value)]})
    return message


def _true_position(report: Outgoing, scene: TrueSituation) -> tuple[float, float, float] | None:
    """Return the position, at the time of the picture, of the entity with the greatest overlap with the report's
    box.
    """
    frame = str(report.body.get("frame"))
    info, box = scene.registry.frames.get(frame), numbers(report.body.get("box"), 4)
    if info is None or box is None:
        return None
    overlap, entity = max(((iou(_four(box), truth.box), truth.entity) for truth in info.boxes), default=(0.0, ""))
    state = scene.registry.frame_states[frame].get(entity)
    return state.position if state is not None and overlap > 0.0 else None


def _replace_handoff(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    kinds = _report_kinds(scene.instance, scene.agent)
    expected = [message for message in reference.messages if message.kind not in kinds]
    missing = [message for message in expected if not any(_same_message(message, sent) for sent in decision.messages)]
    categories = {message.kind: message.category for message in scene.instance.messages}
    kept = tuple(
        message
        for message in decision.messages
        if message.kind in kinds
        or categories.get(message.kind) != "assignment"
        or not _contradicts(message, expected, missing, scene)
    )
    if not missing and len(kept) == len(decision.messages):
        return decision
    return replace(decision, messages=kept + tuple(missing))


def _contradicts(
    assignment: Outgoing, expected: Sequence[Outgoing], missing: Sequence[Outgoing], scene: TrueSituation
) -> bool:
    """Return whether an assignment takes the place of a missing one, or refers to a position without a target."""
    if any(_same_message(assignment, message) for message in expected):
        return False
    for message in missing:
        if message.kind == assignment.kind and (
            message.body.get("assignee") == assignment.body.get("assignee")
            or _near(message.body, assignment.body) is True
        ):
            return True
    place = numbers(assignment.body.get("position"), 2)
    targets = (state for entity in scene.instance.entities if (state := scene.registry.states.get(entity.id)))
    return place is not None and all(math.dist(place, state.position[:2]) > 4 * PLACE_M for state in targets)


def _same_message(first: Outgoing, second: Outgoing) -> bool:
    """Return whether two messages agree: kind, recipients, position within `PLACE_M`, and all other fields."""
    if (first.kind, first.to) != (second.kind, second.to) or _near(first.body, second.body) is False:
        return False
    names = (first.body.keys() | second.body.keys()) - {"position", "confidence"}
    return all(first.body.get(name) == second.body.get(name) for name in names)


def _near(first: Mapping[str, object], second: Mapping[str, object]) -> bool | None:
    """Return whether two bodies hold the same position; None unless both hold one."""
    here, there = numbers(first.get("position"), 2), numbers(second.get("position"), 2)
    return None if here is None or there is None else math.dist(here, there) <= PLACE_M


# -- commands


def _move_replacer(faculty: Faculty) -> Callable[[Decision, Decision, TrueSituation], Decision]:
    def replace_move(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
        command, reference_command = decision.command, reference.command
        if (
            command is None
            or reference_command is None
            or _kind_of_move(command, reference_command, scene) != faculty
            or _same_move(command, reference_command)
        ):
            return decision
        return replace(decision, command=reference_command)

    return replace_move


def _replace_execution(decision: Decision, reference: Decision, scene: TrueSituation) -> Decision:
    command, reference_command = decision.command, reference.command
    if command is None and reference_command is None:
        return decision
    if command is not None and reference_command is not None:
        alike = command.verb == reference_command.verb and _resource(command, scene) == _resource(
            reference_command, scene
        )
        if _kind_of_move(command, reference_command, scene) is not None or (
            alike and command.arguments == reference_command.arguments
        ):
            return decision
    return replace(decision, command=reference_command)


def _kind_of_move(command: Action, reference: Action, scene: TrueSituation) -> Faculty | None:
    """Return the faculty of two moves of one body; None if they are not both moves of one body."""
    resource = _resource(command, scene)
    entity = next((candidate for candidate in scene.instance.entities if candidate.id == resource), None)
    if entity is None or resource != _resource(reference, scene):
        return None
    motions = {verb.name: verb.motion for verb in entity.verbs}
    here, there = motions.get(command.verb, ""), motions.get(reference.verb, "")
    if not here or not there or (command.verb != reference.verb and not {here, there} <= _RELATIVE):
        return None
    return _motion(entity)


def _same_move(command: Action, reference: Action) -> bool:
    if command.verb != reference.verb:
        return False
    here, there = _coordinates(command), _coordinates(reference)
    if here is not None and there is not None:
        return math.dist(here, there) <= PLACE_M
    names = command.arguments.keys() | reference.arguments.keys()
    pairs = [(command.arguments.get(name), reference.arguments.get(name)) for name in names]
    return all(
        abs(value - reference_value) <= STEP
        if isinstance(value, int | float) and isinstance(reference_value, int | float)
        else value == reference_value
        for value, reference_value in pairs
    )


def _coordinates(action: Action) -> tuple[float, float] | None:
    """Return the horizontal destination of a move; the altitude is the aircraft's own choice."""
    return numbers((action.arguments.get("x"), action.arguments.get("y")), 2)  # type: ignore[return-value]


def _motion(entity: Entity) -> Faculty | None:
    """Return the faculty of an entity's moves: `waypoint` for straight moves in air or water, `routing` for roads and
    walking, None if it cannot be moved.
    """
    motions = {verb.motion for verb in entity.verbs} - {""}
    return "waypoint" if "straight" in motions else "routing" if motions else None


def _resource(action: Action, scene: TrueSituation) -> str:
    commands = scene.agent.commands
    return action.resource if action.resource is not None else commands[0] if commands else ""


# -- what the mission declares


def _report_kinds(instance: Instance, agent: AgentSpec) -> frozenset[str]:
    """Return the message kinds with which an agent reports on its own pictures: those that a rule matches with true
    boxes.
    """
    mounted = ((entity.id, camera.name) for entity in instance.entities for camera in entity.cameras)
    if not any(agent.receives_pictures(entity, camera) for entity, camera in mounted):
        return frozenset()
    kinds = frozenset(reported(instance).values())
    return frozenset(kind.kind for kind in instance.messages if kind.kind in kinds and _may_send(agent, kind.senders))


def _may_send(agent: AgentSpec, senders: Sequence[str]) -> bool:
    return "all" in senders or agent.role in senders


def _four(box: tuple[float, ...]) -> tuple[float, float, float, float]:
    return box[0], box[1], box[2], box[3]


_REPLACERS: Mapping[Faculty, Callable[[Decision, Decision, TrueSituation], Decision]] = {
    "perception": _replace_perception,
    "localisation": _replace_localisation,
    "waypoint": _move_replacer("waypoint"),
    "routing": _move_replacer("routing"),
    "handoff": _replace_handoff,
    "execution": _replace_execution,
}
