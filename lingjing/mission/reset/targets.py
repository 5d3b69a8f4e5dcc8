"""Hidden places of a `resetScenario` go to the target groups of its template; there they stay hidden."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.mission import geometry2d, model
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import Found
from lingjing.mission.reset.frame import DocumentFrame
from lingjing.mission.reset.groups import Spot, allows_none, filled, is_hidden, plays, world
from lingjing.mission.reset.shapes import HiddenPlace
from lingjing.mission.reset.template import signatures

PERSONS = "person_in_water"


def targeted(
    mission: model.Mission,
    parsed: Parsed,
    found: Sequence[Found],
    frame: DocumentFrame,
    outline: geometry2d.Polygon | None,
) -> model.Mission:
    """The mission with its targets where the document says; a group the document is silent about stays as it was."""
    claimed: dict[str, str] = {}
    fields: dict[str, Found] = {}
    for name, targets in (parsed.scenario.lingjing.targets if parsed.scenario.lingjing else {}).items():
        where = f"{parsed.path}.lingjing.targets.{name}"
        group = next((g for g in mission.groups if g.role == "target" and g.name == name), None)
        if group is None:
            parsed.report(where, f"mission '{mission.name}' has no target group '{name}'", "name one it has")
            continue
        paths = [f"{where}[{k}]" for k in range(len(targets))]
        _told_apart(parsed, targets, paths)
        mission = filled(mission, group, tuple(map(Spot, targets, paths)), frame, parsed, where)
        claimed[name] = where
    # Fields with something in them claim first: an empty one says little beside a full one of the same kind.
    for one in sorted(found, key=lambda one: not (one.targets or one.pending)):
        mission = _claimed(mission, parsed, one, claimed, fields, frame, outline)
    played = (g for g in mission.groups if g.role == "target" and plays(mission, g))
    silent = [group.name for group in played if group.name not in claimed]
    parsed.notes.extend(f"{parsed.state_path}: says nothing of '{name}'; the template places it" for name in silent)
    return mission


def _claimed(
    mission: model.Mission,
    parsed: Parsed,
    one: Found,
    claimed: dict[str, str],
    fields: dict[str, Found],
    frame: DocumentFrame,
    outline: geometry2d.Polygon | None,
) -> model.Mission:
    groups = [
        g
        for type_ in (*one.field.types, *one.field.also)
        for g in mission.groups
        if g.role == "target" and type_ in (g.type, *g.bases)
    ]
    groups = [g for g in groups if plays(mission, g)]
    group = next((g for g in groups if g.name not in claimed), None)
    if group is None and not groups and one.field.general and one.targets:
        group = _only_hidden(mission, claimed)
        if group is not None:
            parsed.notes.append(
                f"{one.path}: taken for '{group.name}', the only hidden target of mission '{mission.name}'"
            )
    if group is None:
        if one.targets:
            _left_over(mission, parsed, one, groups, claimed, fields)
        return mission
    fields[group.name] = one
    claimed[group.name] = one.path
    if not one.targets and not (group.count is not None and allows_none(mission, group)):
        lacks = "has no place yet" if one.pending else "is empty"
        parsed.notes.append(f"{one.path}: {lacks}; the template places '{group.name}'")
        return mission
    paths = [one.at(k) for k in range(len(one.targets))]
    _told_apart(parsed, one.targets, paths)
    spots = tuple(map(Spot, one.targets, paths))
    if group.type == PERSONS and outline is not None:
        outside = (
            spot
            for spot in spots
            if not geometry2d.contains(outline, *world(spot.part.place, spot.path, frame, parsed)[:2])
        )
        parsed.notes.extend(
            f"{spot.path}: lies outside of rescueRange, where no report of it counts" for spot in outside
        )
    return filled(mission, group, spots, frame, parsed, one.path)


def _left_over(
    mission: model.Mission,
    parsed: Parsed,
    one: Found,
    groups: Sequence[model.Group],
    claimed: dict[str, str],
    fields: dict[str, Found],
) -> None:
    """Report the places that the mission has no target group for: no goal of a document is dropped.

    They are noted alone where they repeat those of another field, or where the document names its template.
    """
    given = parsed.scenario.lingjing
    if not groups and not any(signature.holds(one) for signature in signatures()):
        hint = f"take it out, or name a template of your own that has a target of type {one.field.types[0]}"
        parsed.report(one.path, f"no template has anything for '{one.key}'", hint)
        return
    why = f"'{groups[0].name}' is given by {claimed[groups[0].name]}" if groups else _nothing(mission, one)
    repeated = any(group.name in fields and one.repeats(fields[group.name]) for group in groups)
    if repeated or (given is not None and given.mission is not None):
        parsed.notes.append(f"{one.path}: {why}; {len(one.targets)} kept, not played")
        return
    hint = f'take it out, or say that it is not played: "lingjing": {{"mission": "{mission.name}"}} in the scenario'
    parsed.report(one.path, f"{why}; its {len(one.targets)} would be dropped", hint)


def _told_apart(parsed: Parsed, targets: Sequence[HiddenPlace], paths: Sequence[str]) -> None:
    """Report two entries of a list that have one id: a report of one could not be told from the other's."""
    first: dict[str, str] = {}
    for target, path in zip(targets, paths, strict=True):
        if target.key and first.setdefault(target.key, path) != path:
            parsed.report(path, f"has the id '{target.key}' of {first[target.key]}", "give it one of its own")


def _nothing(mission: model.Mission, one: Found) -> str:
    return f"mission '{mission.name}' has no {' or '.join(one.field.types)}"


def _only_hidden(mission: model.Mission, claimed: dict[str, str]) -> model.Group | None:
    hidden = [g for g in mission.groups if g.role == "target" and is_hidden(g) and plays(mission, g)]
    return hidden[0] if len(hidden) == 1 and hidden[0].name not in claimed else None
