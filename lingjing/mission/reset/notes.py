"""What a `resetScenario` holds beyond what is read: repeated keys, repeated codes, fields that nothing understands.

All of it stays in the document, which the mission keeps to the letter; a note says so.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from lingjing.mission import jsontext
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import Found, field_of
from lingjing.mission.reset.shapes import LISTS, DocumentPart, InitialState, Scenario, TaskRow, folded


def leftovers(text: str, parsed: Parsed, found: Iterable[Found]) -> Iterator[str]:
    """The notes, for repeated keys, codes and unread fields in this order."""
    yield from (
        f"{where}: stands more than once in its object; the last one counts" for where in jsontext.repeated(text)
    )
    yield from _codes(parsed)
    known = frozenset({"tasktype", *parsed.understood})
    equipment, state = parsed.scenario.equipment_list, parsed.task.initial_state
    if parsed.envelope is not None:
        yield from _unread([parsed.envelope], "$", known)
    yield from _unread([parsed.scenario], parsed.path, known)
    yield from _unread([equipment], parsed.lists_path, known)
    for one in LISTS:
        rows = getattr(equipment, one.attribute)
        yield from _unread(rows, f"{parsed.list_path(one.name)}[]", known)
        yield from _unread([row.data for row in rows], f"{parsed.list_path(one.name)}[].data", known)
    yield from _unread([parsed.task], parsed.task_path, known)
    yield from _unread([state], parsed.state_path, known)
    yield from _unread(state.rescue_range, f"{parsed.in_state('rescueRange')}[]", known)
    for field in found:
        yield from _unread(field.targets, f"{field.path}[]", known)
        inner = [part for target in field.targets for part in (target.data, target.position) if part is not None]
        yield from _unread(inner, f"{field.path}[].data", known)


def _codes(parsed: Parsed) -> Iterator[str]:
    """One note for the codes that several entities share, over all lists: a command names its entity by them."""
    lists = (getattr(parsed.scenario.equipment_list, one.attribute) for one in LISTS)
    times = Counter(item.equipment_code for items in lists for item in items if item.equipment_code)
    shared = [f"'{code}'" for code, count in times.items() if count > 1]
    if shared:
        yield f"{parsed.lists_path}: an equipmentCode stands more than once: {', '.join(shared)}"


def _unread(parts: Iterable[DocumentPart], where: str, known: frozenset[str]) -> Iterator[str]:
    """One note for all keys of these parts that nothing reads: not those that are known, folded, nor hidden places
    where these may stand."""
    unknown = dict.fromkeys(
        key
        for part in parts
        for key in part.model_extra or ()
        if folded(key) not in known and not (isinstance(part, Scenario | TaskRow | InitialState) and field_of(key))
    )
    if unknown:
        yield f"{where}: {', '.join(repr(key) for key in unknown)} not understood and kept"
