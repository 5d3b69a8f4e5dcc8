"""Fill the target groups of the template with the hidden places of a `resetScenario`. They stay hidden."""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet

import msgspec

from lingjing.mission import geometry2d, model
from lingjing.mission.requirements import is_decided
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import HiddenEntries
from lingjing.mission.reset.frame import DocumentFrame
from lingjing.mission.reset.groups import Spot, allows_none, exists_by_default, fill_group, is_hidden, to_world
from lingjing.mission.reset.shapes import HiddenPlace
from lingjing.mission.reset.template import signatures

PERSONS = "person_in_water"
"""The target type of the paper's sea rescue."""


def place_targets(
    mission: model.Mission,
    parsed: Parsed,
    hidden_entries: Sequence[HiddenEntries],
    frame: DocumentFrame,
    outline: geometry2d.Polygon | None,
) -> model.Mission:
    """The mission with its targets at the document's places. A group that the document does not mention is
    unchanged."""
    claimed: dict[str, str] = {}
    fields: dict[str, HiddenEntries] = {}
    for name, targets in (parsed.scenario.lingjing.targets if parsed.scenario.lingjing else {}).items():
        where = f"{parsed.path}.lingjing.targets.{name}"
        group = next((g for g in mission.groups if g.role == "target" and g.name == name), None)
        if group is None:
            parsed.report(
                where, f"mission '{mission.name}' has no target group '{name}'", "name one of its target groups"
            )
            continue
        paths = [f"{where}[{k}]" for k in range(len(targets))]
        _report_repeated_ids(parsed, targets, paths)
        mission = fill_group(mission, group, tuple(map(Spot, targets, paths)), frame, parsed, where)
        claimed[name] = where
    # Fields with entries claim first, so that an empty field of the same kind does not take their group.
    for field in sorted(hidden_entries, key=lambda field: not (field.targets or field.pending)):
        mission = _fill_from_field(mission, parsed, field, claimed, fields, frame, outline)
    played = (g for g in mission.groups if g.role == "target" and exists_by_default(mission, g))
    silent = [group.name for group in played if group.name not in claimed]
    parsed.notes.extend(f"{parsed.state_path}: does not place '{name}'; the template places it" for name in silent)
    return _without_decided(mission, claimed.keys(), parsed)


def _without_decided(mission: model.Mission, placed: AbstractSet[str], parsed: Parsed) -> model.Mission:
    """The mission without the requirements that restrict only draws which the document's places replace."""
    kept = []
    for requirement in mission.requirements:
        if is_decided(mission, requirement.condition, placed):
            words = f'the requirement of draws because "{requirement.reason}" is left out'
            parsed.notes.append(f"{parsed.state_path}: {words}: the document places its targets")
        else:
            kept.append(requirement)
    return msgspec.structs.replace(mission, requirements=tuple(kept))


def _fill_from_field(
    mission: model.Mission,
    parsed: Parsed,
    field: HiddenEntries,
    claimed: dict[str, str],
    fields: dict[str, HiddenEntries],
    frame: DocumentFrame,
    outline: geometry2d.Polygon | None,
) -> model.Mission:
    """The mission with one field's places in the target group that it claims."""
    groups = [
        g
        for type_ in (*field.field.types, *field.field.also)
        for g in mission.groups
        if g.role == "target" and type_ in (g.type, *g.bases)
    ]
    groups = [g for g in groups if exists_by_default(mission, g)]
    group = next((g for g in groups if g.name not in claimed), None)
    if group is None and not groups and field.field.general and field.targets:
        group = _only_hidden(mission, claimed)
        if group is not None:
            parsed.notes.append(
                f"{field.path}: assigned to '{group.name}', the only hidden target of mission '{mission.name}'"
            )
    if group is None:
        if field.targets:
            _report_unused(mission, parsed, field, groups, claimed, fields)
        return mission
    fields[group.name] = field
    claimed[group.name] = field.path
    if not field.targets and not (group.count is not None and allows_none(mission, group)):
        lacks = "has no place yet" if field.pending else "is empty"
        parsed.notes.append(f"{field.path}: {lacks}; the template places '{group.name}'")
        return mission
    paths = [field.at(k) for k in range(len(field.targets))]
    _report_repeated_ids(parsed, field.targets, paths)
    spots = tuple(map(Spot, field.targets, paths))
    if group.type == PERSONS and outline is not None:
        outside = (
            spot
            for spot in spots
            if not geometry2d.contains(outline, *to_world(spot.part.place, spot.path, frame, parsed)[:2])
        )
        parsed.notes.extend(
            f"{spot.path}: lies outside of rescueRange, and no report of it is accepted" for spot in outside
        )
    return fill_group(mission, group, spots, frame, parsed, field.path)


def _report_unused(
    mission: model.Mission,
    parsed: Parsed,
    field: HiddenEntries,
    groups: Sequence[model.Group],
    claimed: dict[str, str],
    fields: dict[str, HiddenEntries],
) -> None:
    """Report places without a target group in the mission: a document's goals are never ignored silently.

    They are only noted if they repeat those of another field, or if the document names its template.
    """
    extra = parsed.scenario.lingjing
    if not groups and not any(signature.holds(field) for signature in signatures()):
        hint = f"remove it, or name a template of your own that has a target of type {field.field.types[0]}"
        parsed.report(field.path, f"no template has a target for '{field.key}'", hint)
        return
    why = f"'{groups[0].name}' is given by {claimed[groups[0].name]}" if groups else _nothing(mission, field)
    repeated = any(group.name in fields and field.repeats(fields[group.name]) for group in groups)
    if repeated or (extra is not None and extra.mission is not None):
        parsed.notes.append(f"{field.path}: {why}; {len(field.targets)} kept, not played")
        return
    hint = f'remove it, or say that it is not played: "lingjing": {{"mission": "{mission.name}"}} in the scenario'
    parsed.report(field.path, f"{why}; its entries ({len(field.targets)}) would be ignored", hint)


def _report_repeated_ids(parsed: Parsed, targets: Sequence[HiddenPlace], paths: Sequence[str]) -> None:
    """Report two entries of a list with the same id: reports about them could not be distinguished."""
    first: dict[str, str] = {}
    for target, path in zip(targets, paths, strict=True):
        if target.key and first.setdefault(target.key, path) != path:
            parsed.report(path, f"has the id '{target.key}' of {first[target.key]}", "give it an id of its own")


def _nothing(mission: model.Mission, field: HiddenEntries) -> str:
    return f"mission '{mission.name}' has no {' or '.join(field.field.types)}"


def _only_hidden(mission: model.Mission, claimed: dict[str, str]) -> model.Group | None:
    hidden = [g for g in mission.groups if g.role == "target" and is_hidden(g) and exists_by_default(mission, g)]
    return hidden[0] if len(hidden) == 1 and hidden[0].name not in claimed else None
