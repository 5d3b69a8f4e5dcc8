"""Leaks: hidden values that decide something which agents notice, and the declarations that allow it.

Agents notice the end of the episode, and receipts of commands and messages. A hidden value that decides one of these
can be inferred from it. Agents also notice what an event of the mission changes: the weather, the state of a target.
Adjudicated events, and the state that an interaction changes, are no leaks: the kernel shows them as their rule and
their type allow (`lingjing.kernel.event_visibility`). A soft constraint changes the score alone.

Two leaks have no condition. A load that a secret interaction changes shows in the motion and the battery of its bearer,
which the kernel cannot withhold. A requirement over a hidden value repeats the draws of public values if nothing hidden
is drawn for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from lingjing.mission import model
from lingjing.mission.conditions.quantities import Quantity
from lingjing.mission.conditions.survey import Condition, Survey, survey_mission
from lingjing.mission.conditions.taint import carried_fields, changed_fields, roots
from lingjing.mission.expression_text import spell
from lingjing.mission.requirements import repeated_draws

END = "end"
"""The name under which a mission declassifies its success and failure."""

AS_BEFORE = "as in ljs 1"
"""The reason of a declassification that version 1 of the language did not ask for."""


LOAD = "load_kg"
"""The state of an asset that its engine weighs (`lingjing.plugins.stock`)."""


class Leak(NamedTuple):
    """One thing that agents notice and that a hidden value decides."""

    what: str
    """The name to declassify: `end`, `dog.forward`, or a constraint, a stage, a limit, an event, an interaction, or an
    element with a drawn value."""
    at: str
    """The path of the declaration with the condition."""
    notice: str
    """The thing that agents notice, as a clause."""
    way: str
    """The hidden value and the rules through which the condition reads it, as the object of "depends on"."""

    @property
    def message(self) -> str:
        """The error in one sentence."""
        return f"agents notice a hidden value: {self.notice}, which depends on {self.way}"


def leaks(mission: model.Mission) -> tuple[Leak, ...]:
    """Every leak of a mission, declassified or not, once for each name, in the order of declaration."""
    leak_of: dict[str, Leak] = {}
    for leak in every_leak(mission, survey_mission(mission)):
        leak_of.setdefault(leak.what, leak)
    return tuple(leak_of.values())


def declared_as_before(mission: model.Mission, known: tuple[Leak, ...] | None = None) -> model.Mission:
    """The mission with all its leaks declassified: those without a declaration are as version 1 had them.

    `known` are its leaks, if the caller has them.
    """
    declared = {item.what for item in mission.declassified}
    missing = (leak.what for leak in (leaks(mission) if known is None else known) if leak.what not in declared)
    implied = tuple(model.Declassification(what=what, reason=AS_BEFORE) for what in missing)
    return msgspec.structs.replace(mission, declassified=(*mission.declassified, *implied)) if implied else mission


def every_leak(mission: model.Mission, survey: Survey) -> Iterator[Leak]:
    """Every leak of every condition of a surveyed mission; a name may occur more than once."""
    stages = {condition.name: condition for condition in survey.of_kind("stage")}
    for condition in survey.conditions:
        match condition.kind:
            case "success" | "failure" if condition.hidden:
                yield Leak(END, condition.at, f"the episode ends on {condition.kind}", _way(condition, survey))
            case "permit" if condition.hidden:
                notice = f"receipts show whether `{condition.name}` is permitted"
                yield Leak(condition.name, condition.at, notice, _way(condition, survey))
            case "constraint" if condition.hidden and any(gate.kind == "end" for gate in condition.gates):
                notice = f"the episode ends when `{condition.name}` is broken"
                yield Leak(condition.name, condition.at, notice, _way(condition, survey))
            case "event" if condition.hidden:
                notice = f"agents observe what the event `{condition.name}` changes"
                yield Leak(condition.name, condition.at, notice, _way(condition, survey))
            case "stage":
                yield from _stage_leaks(condition, stages, mission, survey)
    yield from _load_leaks(survey)
    yield from _draw_leaks(mission)


# -- private


def _load_leaks(survey: Survey) -> Iterator[Leak]:
    """Interactions that change the mass on board of an asset and are secret or move a secret amount.

    If all agents receive the events of an interaction, they reveal its time and no amount.
    """
    of, own = survey.declarations, roots(survey.declarations)
    shown: set[str] = set()
    for name, target in sorted(of.taint.interactions | of.taint.amounts, key=lambda pair: (pair not in own, pair)):
        spec = next(spec for spec in of.groups[target].interactions if spec.name == name)
        if spec.told == "all" and (name, target) not in of.taint.amounts:
            continue
        bearers = [group.name for group, field in carried_fields(of, spec) if field == LOAD]
        if not bearers or ((name, target) not in own and shown.issuperset(bearers)):
            continue  # another interaction has made the load of these secret
        shown |= set(bearers)
        notice = f"the speed and the battery of `{bearers[0]}` show when `{name}` changes its load"
        condition = next((c for c in survey.of_kind("unlock") if c.name == name and c.hidden), None)
        way = f"`{target}` or what is done with it" if condition is None else _way(condition, survey)
        yield Leak(name, f"unlock/{name}", notice, way)


def _draw_leaks(mission: model.Mission) -> Iterator[Leak]:
    """Public draws that a requirement over a hidden value repeats."""
    for number, requirement in enumerate(mission.requirements, 1):
        repeated = repeated_draws(mission, requirement.condition)
        if repeated.hidden and not repeated.hidden_only:
            for name in sorted(repeated.names):
                notice = f"`{name}` is drawn anew until `require {spell(requirement.condition)}` holds"
                yield Leak(name, f"require/{number}", notice, f"the hidden {repeated.hidden}")


def _stage_leaks(
    stage: Condition, stages: dict[str, Condition], mission: model.Mission, survey: Survey
) -> Iterator[Leak]:
    """The leaks of a stage with a deadline or with limits. Such a stage begins when the stages that it depends on have
    ended, so that a hidden value in one of them leaks as well."""
    deciding = next((earlier for earlier in _until(stage.name, stages, mission) if earlier.hidden), None)
    if deciding is None:
        return
    for gate in stage.gates:
        if gate.kind == "end":
            yield Leak(
                stage.name, stage.at, f"the episode ends when stage `{stage.name}` is late", _way(deciding, survey)
            )
        elif gate.kind == "count":
            notice = f"receipts show that `{gate.name}` counts while stage `{stage.name}` runs"
            yield Leak(gate.name, stage.at, notice, _way(deciding, survey))


def _until(name: str, stages: dict[str, Condition], mission: model.Mission) -> Iterator[Condition]:
    """A stage and every stage that must have ended before it begins."""
    reached, queue = {name}, [name]
    while queue:
        stage = queue.pop(0)
        if stage in stages:
            yield stages[stage]
        for relation in mission.relations:
            before = {relation.source} if relation.target == stage else set()
            before |= {relation.target} if relation.mutual and relation.source == stage else set()
            for source in sorted(before - reached) if relation.kind == "dependency" else ():
                reached.add(source)
                queue.append(source)


def _way(condition: Condition, survey: Survey) -> str:
    """The hidden value that the condition reads through the fewest rules, as the object of "depends on"."""
    pairs = [(leaf, quantity) for leaf in condition.leaves for quantity in leaf.quantities if quantity.hidden]
    leaf, quantity = min(pairs, key=lambda pair: len(pair[0].via))
    through = ", through " + " → ".join(f"`{rule}`" for rule in leaf.via) if leaf.via else ""
    group = survey.declarations.group(quantity.owner)
    if group is not None and group.hidden:
        hidden = " and ".join(f"`{name}`" for name in sorted(group.hidden))
        return f"`{group.name}`, which hides its {hidden}{through}"
    interaction = _deciding_interaction(quantity, survey)
    if interaction:
        return f"`{quantity.key}`, which the interaction `{interaction}` changes as hidden values decide{through}"
    return f"the hidden {quantity.kind} `{quantity.name or quantity.owner}`{through}"


def _deciding_interaction(quantity: Quantity, survey: Survey) -> str:
    """The secret interaction that changes a public quantity; "" for none."""
    of = survey.declarations
    for name, target in sorted(of.taint.interactions | of.taint.amounts):
        group = of.groups[target]
        spec = next(spec for spec in group.interactions if spec.name == name)
        changed = {(target, field) for field in changed_fields(group, spec)}
        changed |= {(actor.name, field) for actor, field in carried_fields(of, spec)}
        place = quantity.kind if quantity.kind == "status" else "position"
        field = quantity.name if quantity.kind == "state" else place
        if (quantity.kind == "event" and quantity.name == name) or (quantity.owner, field) in changed:
            return name
    return ""
