"""Alternative spellings of keys in a `resetScenario` document."""

from __future__ import annotations

import re
from collections.abc import Mapping, MutableMapping
from typing import Any

from lingjing.errors import Fault
from lingjing.mission.reset.elements import lift_elements
from lingjing.mission.reset.shapes import DocumentPart, Satellite, fold_key, keys_of


class KeySpelling:
    """Renames a document's keys in place to those of the shapes, and keeps the original spellings."""

    def __init__(self, original: MutableMapping[tuple[int, str], str]) -> None:
        self.notes: list[str] = []
        self.faults: list[Fault] = []
        self._original = original
        self._kept: list[object] = []

    def unify(self, value: Any, shape: type[DocumentPart], where: str) -> Any:
        """The value with the keys of the shape at all levels. Adds one note for each list and spelling."""
        if not isinstance(value, dict):
            return value
        self.rename(value, shape, where)
        if issubclass(shape, Satellite):
            lift_elements(value)
        for key, (inner, many) in keys_of(shape).parts.items():
            item = value.get(key)
            at = f"{where}.{self.key(value, key)}"
            if many and isinstance(item, dict):
                self.notes.append(f"{at}: is one object, read as its only row")
                value[key] = [self.unify(item, inner, at)]
            elif many and isinstance(item, list):
                value[key] = [self.unify(row, inner, f"{at}[{k}]") for k, row in enumerate(item)]
            elif item is not None:
                value[key] = self.unify(item, inner, at)
        return value

    def key(self, holder: Mapping[str, Any], key: str) -> str:
        """A key in the document's spelling."""
        return self._original.get((id(holder), key), key)

    def rename(self, value: dict[str, Any], shape: type[DocumentPart], where: str) -> None:
        """Rename one object's keys to the names of the shape, in place.

        Of two spellings of one field, the non-empty one is used. Two non-empty values that differ are a fault.
        """
        known = keys_of(shape)
        renamed = {}
        for key in [key for key in value if key not in known.own]:
            name = known.spellings.get(fold_key(key))
            if name is None:
                continue
            if name not in value or (value[name] in _EMPTY and value[key] not in _EMPTY):
                value[name] = value.pop(key)
                self._original[id(value), name] = key
                renamed[key] = name
            elif value[key] not in _EMPTY and value[key] != value[name] and name not in known.free:
                message = f"'{self.key(value, name)}' and '{key}' are spellings of one field and differ"
                self.faults.append(Fault(where, message, "leave one of them"))
        self._kept.append(value)  # keeps the object alive, because its id() is a key
        self._note(renamed, where)

    def _note(self, renamed: Mapping[str, str], where: str) -> None:
        """Note other words and lower-case coordinates. Case and separators are not noted."""
        noted = {key: name for key, name in renamed.items() if fold_key(key) != fold_key(name) or len(name) == 1}
        if noted:
            spellings, read = ", ".join(f"'{key}'" for key in noted), ", ".join(noted.values())
            unit = ", Unreal's centimetres" if set(noted.values()) <= set("XYZ") else ""
            note = f"{_rowless(where)}: {spellings} read as {read}{unit}"
            if note not in self.notes:
                self.notes.append(note)


def _rowless(where: str) -> str:
    """A JSON path without the indices of lists, except that of the task matrix, because its first row is used."""
    return _ROW.sub("[]", where)


_EMPTY: tuple[object, ...] = ([], {}, "")

_ROW = re.compile(r"\[\d+\](?!\.initial_state)")
"""The index of a list, except that of the task matrix before its initial state."""
