"""Hidden fields of a `resetScenario`: their names, the target types that they may hold, and their entries.

Documents spell these fields in many ways (`goalFirePosition`, `fire_spots`, `leak`, `task_points`, …) and put them into
the initial state, the task or the scenario, as a list or as a single object. Spellings are compared by their letters
and digits alone. A value that is neither a list nor an object is a fault. Under a word that may also be a remark
(`congestion: "heavy"`), it is kept and noted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from lingjing.mission.faults import kind_of
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.shapes import HiddenPlace, fold_key


@dataclass(frozen=True, slots=True)
class HiddenField:
    """One kind of hidden field."""

    name: str
    """The name under which it is written."""
    types: tuple[str, ...]
    """Target types that it may hold, the likeliest first. Subtypes are included."""
    spellings: frozenset[str]
    """Its other spellings, folded."""
    general: bool = False
    """True if its name does not imply the type of the target."""
    also: tuple[str, ...] = ()
    """Further types that it may hold, which do not select a template."""


def _field(name: str, types: str, spellings: str, *, general: bool = False, also: str = "") -> HiddenField:
    stems = (fold_key(name), *spellings.split())
    plural = (stem + "s" for stem in stems if not stem.endswith("s"))
    return HiddenField(name, tuple(types.split()), frozenset((*stems, *plural)), general, tuple(also.split()))


FIELDS: tuple[HiddenField, ...] = (
    _field("rescuePersonPosition", "person_in_water", "personposition victimposition 落水人员位置"),
    _field("goalFirePosition", "building_fire fire_source", "fireposition firespot firepoint 火点 火源位置"),
    _field(
        "leakPosition",
        "pipeline_leak",
        "leak leakpoint leakspot pipelineleak pipelineleakposition leakpos 泄漏点 泄漏位置",
    ),
    _field(
        "fracturePosition", "bridge_fracture", "fracture fracturepoint bridgefracture bridgefractureposition 断裂点"
    ),
    _field(
        "congestionPosition",
        "congestion",
        "congestion congestionpoint congestionspot congestionpos trafficjam trafficjamposition 拥堵点",
    ),
    _field("warehousePosition", "warehouse", "warehouse warehousepoint depot depotposition 仓库"),
    _field(
        "queuingList", "queue_of_people", "queuinglist queuelist queueinglist queueposition queuingposition 排队 队列"
    ),
    _field("pollutionPosition", "pollution_source", "pollution pollutionpoint pollutionsource 污染点 污染源"),
    _field(
        "targetHouse",
        "delivery_door reference_building",
        "house targethouseposition houseposition 目标房屋",
        also="delivery_point",
    ),
    _field(
        "deliveryPoints",
        "delivery_point delivery_door",
        "deliverypoint deliveryposition delivery deliverylocation goaldelposition delposition 配送点",
        also="destination",
    ),
    _field("destinationPosition", "destination", "destination destinationpoint endposition endpoint 目的地 终点"),
    _field(
        "goalPosition",
        "reference_building delivery_door destination bridge_fracture pipeline_leak",
        "goalpoint targetposition 目标位置",
        general=True,
        also="delivery_point air_goal",
    ),
    _field(
        "taskPoints",
        "delivery_point bridge_fracture pipeline_leak delivery_door reference_building",
        "taskposition 任务点",
        general=True,
    ),
)
"""The kinds in the order in which they claim target groups: the most specific one first."""


_REMARKS = frozenset({
    "congestion", "delivery", "depot", "destination", "fracture", "bridgefracture", "house", "leak", "pipelineleak",
    "pollution", "trafficjam", "warehouse", "仓库", "排队", "队列", "污染源", "目的地", "终点",
})  # fmt: skip
"""Folded spellings that name the target and not its place: a text or a number under them may be a remark."""


_PENDING = (
    "pending",
    "tbd",
    "tobe",
    "unknown",
    "later",
    "notset",
    "notready",
    "unset",
    "undefined",
    "none",
    "待",
    "未",
)
"""Folded words by which a value without coordinates states that its place is not known yet."""

_STATUS_KEYS = frozenset({"status", "state", "状态"})
_REMARK_KEYS = _STATUS_KEYS | {"note", "remark", "comment", "description", "备注", "说明"}

_COORDINATES = frozenset({
    "x", "y", "z", "lon", "lng", "long", "longitude", "lat", "latitude", "alt", "altitude", "经度", "纬度", "海拔",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class HiddenEntries:
    """A hidden field of a document with its entries."""

    field: HiddenField
    key: str
    """The key in the document."""
    path: str
    """JSON path of the field."""
    targets: tuple[HiddenPlace, ...]
    paths: tuple[str, ...]
    """JSON paths of the entries."""
    pending: bool = False
    """True if it has entries, and all of their places are given later."""

    def at(self, index: int) -> str:
        """JSON path of one entry."""
        return self.paths[index]

    def extended(self, other: HiddenEntries) -> HiddenEntries:
        """The field with the entries of another one, except those that repeat one of its own."""
        new = [k for k, entry in enumerate(other.targets) if not any(_is_same(entry, own) for own in self.targets)]
        targets = (*self.targets, *(other.targets[k] for k in new))
        return replace(self, targets=targets, paths=(*self.paths, *(other.paths[k] for k in new)))

    def repeats(self, other: HiddenEntries) -> bool:
        """True if every entry of this field is one of the other field's."""
        return all(any(_is_same(entry, other_entry) for other_entry in other.targets) for entry in self.targets)


def _is_same(first: HiddenPlace, second: HiddenPlace) -> bool:
    """True if two entries have the same place and no different ids."""
    return first.place.spot == second.place.spot and (not first.key or not second.key or first.key == second.key)


def field_of(key: str) -> HiddenField | None:
    """The kind of hidden field that a key spells, or None."""
    word = fold_key(key)
    return next((field for field in FIELDS if word in field.spellings), None)


def hidden_fields(parsed: Parsed) -> tuple[HiddenEntries, ...]:
    """Every hidden field of the document, also empty ones, in the order of `FIELDS`. Fields of later rows are merged
    into the same kind of field of the first row; repeated places count once.

    Reports a fault for an entry that is no place.
    """
    fields = [field for holder, path in parsed.holders() for field in _read_fields(holder, path, parsed)]
    for holder, path in parsed.later_holders():
        for later in _read_fields(holder, path, parsed):
            same = next((k for k, field in enumerate(fields) if field.field is later.field and field.targets), None)
            if same is None:
                fields.append(later)
            else:
                fields[same] = fields[same].extended(later)
    return tuple(sorted(fields, key=lambda field: FIELDS.index(field.field)))


def _read_fields(holder: Mapping[str, Any], path: str, parsed: Parsed) -> Iterator[HiddenEntries]:
    for key, value in holder.items():
        field = field_of(key)
        if field is None:
            continue
        where = f"{path}.{key}"
        items = [value] if isinstance(value, dict) else value
        if not isinstance(items, list):
            if fold_key(key) in _REMARKS:
                parsed.notes.append(f"{where}: is no list of places; not understood and kept")
            else:
                hint = "give X and Y in centimetres, or lon and lat in degrees"
                parsed.report(where, f"a place or a list of places is due, this is {kind_of(value)}", hint)
            continue
        paths = [where] if isinstance(value, dict) else [f"{where}[{k}]" for k in range(len(items))]
        count = len(items)
        paths, items = _present(paths, items, parsed)
        spelling_before = len(parsed.spelling.faults)
        unified = [parsed.spelling.unify(item, HiddenPlace, at) for item, at in zip(items, paths, strict=True)]
        parsed.faults.extend(parsed.spelling.faults[spelling_before:])
        read = [parsed.convert(item, HiddenPlace, at) for item, at in zip(unified, paths, strict=True)]
        parsed.notes.extend(note for note in parsed.spelling.notes if note not in parsed.notes)
        yield HiddenEntries(field, key, where, tuple(read), tuple(paths), pending=bool(count) and not items)


def _present(paths: Sequence[str], items: Sequence[Any], parsed: Parsed) -> tuple[list[str], list[Any]]:
    """The entries that have a place. Empty ones, and those that state that their place is given later, are noted."""
    absent = [item == {} or (isinstance(item, dict) and is_pending(item)) for item in items]
    parsed.notes.extend(
        f"{path}: has no place yet ({_words(item) or 'it is empty'}); treated as absent"
        for path, item, is_absent in zip(paths, items, absent, strict=True)
        if is_absent
    )
    kept = [k for k, is_absent in enumerate(absent) if not is_absent]
    return [paths[k] for k in kept], [items[k] for k in kept]


def is_pending(item: Mapping[str, Any]) -> bool:
    """True if an entry has no coordinates and states that they come later, or if its `status` states that and all its
    coordinates are 0."""
    inner = [part for part in item.values() if isinstance(part, Mapping)]
    pairs = [(fold_key(key), value) for holder in (item, *inner) for key, value in holder.items()]
    coordinates = [value for key, value in pairs if key in _COORDINATES]
    if not coordinates:
        return _comes_later(_texts(item))
    stand_in = all(isinstance(value, int | float) and value == 0 for value in coordinates)
    return stand_in and _comes_later(v for key, v in pairs if key in _STATUS_KEYS and isinstance(v, str))


def _comes_later(texts: Iterable[str]) -> bool:
    return any(word in fold_key(text) for text in texts for word in _PENDING)


def _texts(item: Mapping[str, Any]) -> Iterator[str]:
    for key, value in item.items():
        if isinstance(value, Mapping):
            yield from _texts(value)
        elif isinstance(value, str) and fold_key(key) in _REMARK_KEYS:
            yield value


def _words(item: Mapping[str, Any]) -> str:
    return ", ".join(f"'{text[:40]}'" for text in _texts(item))
