"""How a `resetScenario` document spells its keys."""

from __future__ import annotations

import re
from collections.abc import Mapping, MutableMapping
from typing import Any

from lingjing.errors import Fault
from lingjing.mission.reset.elements import lifted
from lingjing.mission.reset.shapes import DocumentPart, Satellite, folded, keys_of


class Spelt:
    """How a document spells its keys: it renames them in place to those of the shapes, and remembers."""

    def __init__(self, original: MutableMapping[tuple[int, str], str]) -> None:
        self.notes: list[str] = []
        self.faults: list[Fault] = []
        self._original = original
        self._kept: list[object] = []

    def unify(self, value: Any, shape: type[DocumentPart], where: str) -> Any:
        """The value with the keys of the shape, all the way down; one note for each list and spelling."""
        if not isinstance(value, dict):
            return value
        self.rename(value, shape, where)
        if issubclass(shape, Satellite):
            lifted(value)
        for key, (inner, many) in keys_of(shape).parts.items():
            found = value.get(key)
            at = f"{where}.{self.key(value, key)}"
            if many and isinstance(found, dict):
                self.notes.append(f"{at}: is one object, read as its only row")
                value[key] = [self.unify(found, inner, at)]
            elif many and isinstance(found, list):
                value[key] = [self.unify(one, inner, f"{at}[{k}]") for k, one in enumerate(found)]
            elif found is not None:
                value[key] = self.unify(found, inner, at)
        return value

    def key(self, holder: Mapping[str, Any], key: str) -> str:
        """How the document spells a key."""
        return self._original.get((id(holder), key), key)

    def rename(self, value: dict[str, Any], shape: type[DocumentPart], where: str) -> None:
        """Put one object's keys under the names of the shape, in place.

        Of two spellings of one field the one that is not empty counts; two that are not and differ are a fault.
        """
        known = keys_of(shape)
        renamed = {}
        for key in [key for key in value if key not in known.own]:
            name = known.spellings.get(folded(key))
            if name is None:
                continue
            if name not in value or (value[name] in _EMPTY and value[key] not in _EMPTY):
                value[name] = value.pop(key)
                self._original[id(value), name] = key
                renamed[key] = name
            elif value[key] not in _EMPTY and value[key] != value[name] and name not in known.free:
                said = f"'{self.key(value, name)}' and '{key}' spell one field and differ"
                self.faults.append(Fault(where, said, "leave one of them"))
        self._kept.append(value)  # its identity must stay its own
        self._note(renamed, where)

    def _note(self, renamed: Mapping[str, str], where: str) -> None:
        """Other words and lower-case coordinates are noted; case and separators say nothing."""
        told = {key: name for key, name in renamed.items() if folded(key) != folded(name) or len(name) == 1}
        if told:
            said, read = ", ".join(f"'{key}'" for key in told), ", ".join(told.values())
            unit = ", Unreal's centimetres" if set(told.values()) <= set("XYZ") else ""
            note = f"{_rowless(where)}: {said} read as {read}{unit}"
            if note not in self.notes:
                self.notes.append(note)


def _rowless(where: str) -> str:
    """A JSON path without the indices of lists; the task matrix keeps its own, for its first row is played."""
    return _ROW.sub("[]", where)


_EMPTY: tuple[object, ...] = ([], {}, "")

_ROW = re.compile(r"\[\d+\](?!\.initial_state)")
