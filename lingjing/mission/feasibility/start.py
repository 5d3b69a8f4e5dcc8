"""Missions that are won or lost at boundary 0, before any agent acts. Such a mission measures nothing.

Every result is certain: True and False hold for every seed, and unknown values are None. At the start, states and
properties of targets have their declared values; nothing was reported, assigned or performed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from lingjing.errors import LingjingError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.certain import Knowledge, known, truth
from lingjing.mission.conditions.outline import Body, Outline, Outlines, too_large
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.functions import operation
from lingjing.mission.intervals import Estimate, exactly
from lingjing.mission.kinds import scene_kind
from lingjing.mission.kinds_format import SceneKind
from lingjing.mission.values import Value

_NOW = "now"


class _Hint(NamedTuple):
    """A diagnostic code and the way out."""

    code: str
    hint: str


_WON = _Hint("LJ0510", "require a state that agents must bring about")
_LOST = _Hint("LJ0511", "use a condition that does not hold yet: `now > …`, or the result of an action")


def won_at_start(outlines: Outlines) -> tuple[Proof, ...]:
    """A hint at the success condition if it holds at the start in every seed, with the modes."""
    message = "success holds at the start, before any agent acts: the mission is won without an action"
    return _hints(outlines, lambda start: (("success", message),) if start.success() else (), _WON)


def lost_at_boundary_0(outline: Outline) -> list[Proof]:
    """Proofs at the failure condition and at each hard constraint that decide the episode at the start."""
    return [Proof(_LOST.code, at, message, _LOST.hint) for at, message in _StartKnowledge(outline).losses()]


def _hints(
    outlines: Outlines, messages_of: Callable[[_StartKnowledge], Iterable[tuple[str, str]]], of: _Hint
) -> tuple[Proof, ...]:
    mission = outlines.mission
    modes_of_message: dict[tuple[str, str], list[str]] = {}
    for mode in mission.modes.allowed:
        try:
            if not too_large(mission, mode):
                for at_message in messages_of(_StartKnowledge(outlines.of(mode))):
                    modes_of_message.setdefault(at_message, []).append(mode)
        except LingjingError:
            continue
    everywhere = len(mission.modes.allowed)
    return tuple(
        Proof(of.code, at, text if len(modes) == everywhere else f"in {' and '.join(modes)} mode, {text}", of.hint)
        for (at, text), modes in modes_of_message.items()
    )


class _StartKnowledge(Knowledge):
    """The facts at boundary 0 of an outline."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self._rules = {rule.name: rule for rule in outline.instance.rules}
        self._open: list[str] = []

    def success(self) -> bool:
        """True if success certainly holds, and no hard constraint can decide the episode before it."""
        return truth(self._outline.instance.success, {}, self) is True and not any(
            constraint.kind == "hard" for constraint in self._outline.instance.constraints
        )

    def losses(self) -> Iterator[tuple[str, str]]:
        """(path, message) of each failure condition or hard constraint that certainly loses the episode at the
        start."""
        instance = self._outline.instance
        for constraint in instance.constraints:
            if constraint.kind == "hard" and any(
                truth(constraint.condition, names, self) is False for names in self._subjects(constraint)
            ):
                yield (
                    f"constraint/{constraint.name}",
                    f"`{constraint.name}` does not hold at the start: the mission ends there, lost",
                )
        fails = instance.failure is not None and truth(instance.failure, {}, self) is True
        if fails and truth(instance.success, {}, self) is False:
            yield "failure", "failure holds at the start, before any agent acts: the mission ends there"

    def _subjects(self, constraint: model.Constraint) -> Iterator[Mapping[str, Value]]:
        if constraint.variable is None or constraint.domain is None:
            yield {}
            return
        for body in self._outline.groups.get(constraint.domain, ()):
            yield {constraint.variable: body}

    def name(self, ref: ex.Ref) -> Value:
        """The time is 0; an entity is its body."""
        if ref.kind == "clock" and ref.name == _NOW:
            return exactly(0.0)
        if ref.kind in ("group", "entity"):
            members = self._outline.groups.get(ref.name, ())
            return members[0] if len(members) == 1 else members or ref.name
        if ref.kind == "param" and ref.name in self._outline.wide:
            return self._outline.wide[ref.name]
        try:
            return known(self._outline.scope.refer(ref))
        except LingjingError:
            return None

    def field(self, value: Value, name: str) -> Value:
        """A declared state, or a property of a target in the city. Other properties may be replaced by their engine, so
        that they are unknown."""
        if not isinstance(value, Body):
            return None
        if name == "position":
            return self.spot(value)
        entity = value.entity
        declared = entity.engine == "city" or (entity.state_of(name) is not None and name in entity.properties)
        return value.bounds(name) if declared and not entity.dormant else None

    def members(self, domain: str) -> Sequence[Value]:
        """The bodies of a group; a message kind has no messages yet."""
        return self._outline.groups.get(domain, ())

    def spot(self, value: Value) -> Estimate | None:
        """The declared position of a body, with the largest distance by which the scene may move it."""
        if not isinstance(value, Body):
            return value if isinstance(value, Estimate) else None
        points = [outline[0] for outline in value.where.outlines if len(outline) == 1]
        if len(value.where.outlines) != 1 or not points or value.entity.dormant:
            return None
        kind = scene_kind(self._outline.instance.scene.kind) or SceneKind(name="")
        off = value.where.loose_m or kind.aside_m
        return Estimate(*points[0], off)

    def answer(self, call: ex.Call, arguments: Sequence[Value]) -> Value:
        """The value of a function at the start. A rule about a message is false; another rule is evaluated."""
        if not call.rule:
            operation_entry = operation(call)
            return None if operation_entry is None or _differs_at_start(arguments) else operation_entry.at_start
        rule = self._rules.get(call.function)
        if rule is None or rule.name in self._open or len(rule.parameters) != len(arguments):
            return None
        if any(parameter.domain in self._outline.kinds for parameter in rule.parameters):
            return False
        if not all(isinstance(argument, Body) for argument in arguments):
            return None
        self._open.append(rule.name)
        names: Mapping[str, Value] = {
            parameter.name: argument for parameter, argument in zip(rule.parameters, arguments, strict=True)
        }
        value = truth(rule.condition, names, self)
        self._open.pop()
        return value


def _differs_at_start(arguments: Sequence[Value]) -> bool:
    """True if an argument is a body that is absent at the start, or takes pictures by then."""
    bodies = [argument.entity for argument in arguments if isinstance(argument, Body)]
    return any(body.dormant or any(camera.capture == "each_tick" for camera in body.cameras) for body in bodies)
