"""`AppendOnlyMap`: an immutable mapping that shares its entries with the mappings extended from it.

Every boundary and every fork copies the kernel's state, and parts of it grow with each event. Extending the newest map
costs only the added entries; extending an older one (a fork) copies it first. Entries that were added later are
invisible in the older map.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import TypeVar

K = TypeVar("K")
V = TypeVar("V")


class AppendOnlyMap(Mapping[K, V]):
    """An immutable mapping in insertion order. A key is inserted once and keeps its value."""

    __slots__ = ("_entries", "_size")

    def __init__(self) -> None:
        self._entries: dict[K, tuple[int, V]] = {}
        self._size = 0

    def extended(self, fresh: Mapping[K, V]) -> AppendOnlyMap[K, V]:
        """Return a map with the entries of `fresh` after these. Known keys keep their value."""
        new = {key: value for key, value in fresh.items() if key not in self}
        if not new:
            return self
        whole = len(self._entries) == self._size
        entries = self._entries if whole else dict(islice(self._entries.items(), self._size))
        for place, (key, value) in enumerate(new.items(), self._size):
            entries[key] = (place, value)
        return self._of(entries)

    def newest(self) -> Iterator[V]:
        """Iterate over the values, latest first."""
        return (value for place, value in reversed(self._entries.values()) if place < self._size)

    def __getitem__(self, key: K) -> V:
        place, value = self._entries[key]
        if place >= self._size:
            raise KeyError(key)
        return value

    def __contains__(self, key: object) -> bool:
        entry = self._entries.get(key)  # type: ignore[arg-type]
        return entry is not None and entry[0] < self._size

    def __iter__(self) -> Iterator[K]:
        return islice(iter(self._entries), self._size)

    def __len__(self) -> int:
        return self._size

    def __repr__(self) -> str:
        return f"AppendOnlyMap({dict(self)!r})"

    @classmethod
    def _of(cls, entries: dict[K, tuple[int, V]]) -> AppendOnlyMap[K, V]:
        made: AppendOnlyMap[K, V] = cls()
        made._entries, made._size = entries, len(entries)
        return made
