"""Whether a mission is won or lost at boundary 0, before anybody acts: a hint, for one that ends itself says nothing.

Every answer is certain: `True` and `False` hold for every seed, what is not known is None. Declared states and the
properties of targets have their declared values then; nothing was reported, assigned or performed yet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from lingjing.errors import LingjingError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.certain import Knowledge, known, truth
from lingjing.mission.feasibility.outline import Body, Outline, of_mission, too_large
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.functions import operation
from lingjing.mission.intervals import Estimate, exactly
from lingjing.mission.kinds import scene_kind
from lingjing.mission.kinds_format import SceneKind
from lingjing.mission.values import Value

_NOW = "now"


class Hint(NamedTuple):
    """A code, and the way out."""

    code: str
    hint: str


_WON = Hint("LJ0510", "ask for what has to be brought about")
_LOST = Hint("LJ0511", "ask for what does not hold yet: `now > …`, or what somebody has done")


def won_at_start(mission: model.Mission) -> tuple[Proof, ...]:
    """A hint at the success condition if it holds at the start in every seed, with the modes."""
    said = "success holds at the start, before anybody acts: the mission wins itself"
    return _hints(mission, lambda beginning: (("success", said),) if beginning.success() else (), _WON)


def lost_at_start(mission: model.Mission) -> tuple[Proof, ...]:
    """A hint at the failure condition, and at each hard constraint, that decide the episode at the start in every
    seed, with the modes."""
    return _hints(mission, lambda beginning: tuple(beginning.losses()), _LOST)


def _hints(
    mission: model.Mission, told: Callable[[StartKnowledge], Iterable[tuple[str, str]]], of: Hint
) -> tuple[Proof, ...]:
    found: dict[tuple[str, str], list[str]] = {}
    for mode in mission.modes.allowed:
        try:
            if not too_large(mission, mode):
                for one in told(StartKnowledge(of_mission(mission, mode))):
                    found.setdefault(one, []).append(mode)
        except LingjingError:
            continue
    everywhere = len(mission.modes.allowed)
    return tuple(
        Proof(of.code, at, said if len(modes) == everywhere else f"in {' and '.join(modes)} mode, {said}", of.hint)
        for (at, said), modes in found.items()
    )


class StartKnowledge(Knowledge):
    """What is known at boundary 0 of an outline."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self._rules = {rule.name: rule for rule in outline.instance.rules}
        self._open: list[str] = []

    def success(self) -> bool:
        """Whether success certainly holds, and no hard constraint and no failure can come before it."""
        return truth(self._outline.instance.success, {}, self) is True and not any(
            one.kind == "hard" for one in self._outline.instance.constraints
        )

    def losses(self) -> Iterator[tuple[str, str]]:
        """Paths of what certainly decides the episode against its policies, and what to say of it."""
        instance = self._outline.instance
        for one in instance.constraints:
            if one.kind == "hard" and any(truth(one.condition, names, self) is False for names in self._subjects(one)):
                yield f"constraint/{one.name}", f"`{one.name}` does not hold at the start: the mission ends there, lost"
        fails = instance.failure is not None and truth(instance.failure, {}, self) is True
        if fails and truth(instance.success, {}, self) is False:
            yield "failure", "failure holds at the start, before anybody acts: the mission ends there"

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
        try:
            return known(self._outline.scope.refer(ref))
        except LingjingError:
            return None

    def field(self, value: Value, name: str) -> Value:
        """A declared state, or what a target of the city is; another property may be shadowed by its engine's word."""
        if not isinstance(value, Body):
            return None
        if name == "position":
            return self.spot(value)
        entity = value.entity
        told = entity.engine == "city" or (entity.state_of(name) is not None and name in entity.properties)
        return value.bounds(name) if told and not entity.dormant else None

    def members(self, domain: str) -> Sequence[Value]:
        """The bodies of a group; no message was sent yet."""
        return self._outline.groups.get(domain, ())

    def spot(self, value: Value) -> Estimate | None:
        """Where a body is declared to be, less and more what the scene may move it."""
        if not isinstance(value, Body):
            return value if isinstance(value, Estimate) else None
        points = [outline[0] for outline in value.where.outlines if len(outline) == 1]
        if len(value.where.outlines) != 1 or not points or value.entity.dormant:
            return None
        kind = scene_kind(self._outline.instance.scene.kind) or SceneKind(name="")
        off = value.where.loose_m or kind.aside_m
        return Estimate(*points[0], off)

    def answer(self, call: ex.Call, arguments: Sequence[Value]) -> Value:
        """What a function answers at the start; a rule about a message is false, another is looked through."""
        if not call.rule:
            done = operation(call)
            return None if done is None else done.at_start
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
        found = truth(rule.condition, names, self)
        self._open.pop()
        return found
