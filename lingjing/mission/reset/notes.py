"""What a `resetScenario` holds beyond what is read: repeated keys, repeated codes, fields that nothing understands.

All of it stays in the document, which the mission keeps to the letter; a note says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from lingjing.mission import jsontext
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import Found, field_of
from lingjing.mission.reset.shapes import (
    LISTS,
    CommandEnvelope,
    Coordinates,
    Corner,
    DocumentPart,
    EquipmentList,
    HiddenPlace,
    InitialState,
    Satellite,
    Scenario,
    TaskRow,
    folded,
)


def leftovers(text: str, parsed: Parsed, found: Iterable[Found]) -> Iterator[str]:
    """The notes, for repeated keys, codes and unread fields in this order."""
    yield from (
        f"{where}: stands more than once in its object; the last one counts" for where in jsontext.repeated(text)
    )
    yield from _codes(parsed)
    if parsed.envelope:
        yield from _unread([(parsed.envelope, CommandEnvelope)], "$")
    (state, state_path), (task, task_path), (scenario, path) = parsed.holders()
    yield from _unread([(scenario, Scenario)], path)
    equipment = scenario.get("equipmentList")
    if isinstance(equipment, Mapping):
        yield from _unread([(equipment, EquipmentList)], parsed.lists_path)
        for one in LISTS:
            yield from _unread_rows(equipment.get(one.name), Satellite, parsed.list_path(one.name))
    yield from _unread([(task, TaskRow)], task_path)
    yield from _unread([(state, InitialState)], state_path)
    yield from _unread_rows(state.get("rescueRange"), Corner, parsed.in_state("rescueRange"))
    holders = {where: holder for holder, where in parsed.holders()}
    for field in found:
        value = holders[field.path.removesuffix(f".{field.key}")][field.key]
        yield from _unread_rows([value] if field.single else value, HiddenPlace, field.path)


def _codes(parsed: Parsed) -> Iterator[str]:
    """One note for the codes that several entities share, over all lists: a command names its entity by them."""
    lists = (getattr(parsed.scenario.equipment_list, one.attribute) for one in LISTS)
    times = Counter(item.equipment_code for items in lists for item in items if item.equipment_code)
    shared = [f"'{code}'" for code, count in times.items() if count > 1]
    if shared:
        yield f"{parsed.lists_path}: an equipmentCode stands more than once: {', '.join(shared)}"


_TWICE = ("tasktype",)
"""Keys that may stand in two spellings beside each other."""


def _unread_rows(rows: object, shape: type[DocumentPart], where: str) -> Iterator[str]:
    """One note for all rows of a list, and for their places one more."""
    given = [row for row in rows if isinstance(row, Mapping)] if isinstance(rows, list) else []
    yield from _unread([(row, shape) for row in given], f"{where}[]")
    inner = [
        (row[key], Coordinates) for row in given for key in ("data", "position") if isinstance(row.get(key), Mapping)
    ]
    yield from _unread(inner, f"{where}[].data")


def _unread(parts: Iterable[tuple[Mapping[str, object], type[DocumentPart]]], where: str) -> Iterator[str]:
    unknown: dict[str, None] = {}
    for given, shape in parts:
        known = {info.alias or name for name, info in shape.model_fields.items()}
        general = shape in (Scenario, TaskRow, InitialState)
        unknown |= dict.fromkeys(
            key for key in given if key not in known and folded(key) not in _TWICE and not (general and field_of(key))
        )
    if unknown:
        yield f"{where}: {', '.join(repr(key) for key in unknown)} not understood and kept"
