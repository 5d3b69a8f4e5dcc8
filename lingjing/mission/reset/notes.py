"""Notes on the unread parts of a `resetScenario`: repeated keys, repeated codes, unknown fields.

All of them stay in the document, which the mission keeps unchanged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from lingjing.mission import jsontext
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import HiddenEntries, field_of
from lingjing.mission.reset.shapes import LISTS, DocumentPart, InitialState, Scenario, TaskRow, fold_key


def unread_notes(text: str, parsed: Parsed, hidden_entries: Iterable[HiddenEntries]) -> Iterator[str]:
    """Notes on repeated keys, repeated codes and unread fields, in this order."""
    yield from (f"{where}: is repeated in its object; the last one is used" for where in jsontext.repeated(text))
    yield from _codes(parsed)
    known = frozenset({"tasktype", *parsed.understood})
    equipment, state = parsed.scenario.equipment_list, parsed.task.initial_state
    if parsed.envelope is not None:
        yield from _unread([parsed.envelope], "$", known)
    yield from _unread([parsed.scenario], parsed.path, known)
    yield from _unread([equipment], parsed.lists_path, known)
    for entity_list in LISTS:
        rows = getattr(equipment, entity_list.attribute)
        yield from _unread(rows, f"{parsed.list_path(entity_list.name)}[]", known)
        yield from _unread([row.data for row in rows], f"{parsed.list_path(entity_list.name)}[].data", known)
    yield from _unread([parsed.task], parsed.task_path, known)
    yield from _unread([state], parsed.state_path, known)
    yield from _unread(state.rescue_range, f"{parsed.in_state('rescueRange')}[]", known)
    for field in hidden_entries:
        yield from _unread(field.targets, f"{field.path}[]", known)
        inner = [part for target in field.targets for part in (target.data, target.position) if part is not None]
        yield from _unread(inner, f"{field.path}[].data", known)


def _codes(parsed: Parsed) -> Iterator[str]:
    """One note for the codes that several entities of all lists share: commands name entities by their codes."""
    lists = (getattr(parsed.scenario.equipment_list, entity_list.attribute) for entity_list in LISTS)
    times = Counter(item.equipment_code for items in lists for item in items if item.equipment_code)
    shared = [f"'{code}'" for code, count in times.items() if count > 1]
    if shared:
        yield f"{parsed.lists_path}: an equipmentCode is repeated: {', '.join(shared)}"


def _unread(parts: Iterable[DocumentPart], where: str, known: frozenset[str]) -> Iterator[str]:
    """One note for all unread keys of these parts, except the `known` ones (folded), and hidden fields in
    their places."""
    unknown = dict.fromkeys(
        key
        for part in parts
        for key in part.model_extra or ()
        if fold_key(key) not in known and not (isinstance(part, Scenario | TaskRow | InitialState) and field_of(key))
    )
    if unknown:
        yield f"{where}: {', '.join(repr(key) for key in unknown)} not understood and kept"
