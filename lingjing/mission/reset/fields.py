"""The places a `resetScenario` hides: under which fields they stand, what may lie there, and what each entry says.

Documents spell these fields in many ways (`goalFirePosition`, `fire_spots`, `leak`, `task_points`, …) and put them into
the initial state, the task or the scenario, as a list or as a single object. Spellings are compared by their letters
and digits alone. What is neither a list nor an object is a fault, except under a word that may as well be a remark
(`congestion: "heavy"`): there it is kept and noted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from lingjing.mission.faults import kind_of
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.shapes import HiddenPlace, folded


@dataclass(frozen=True, slots=True)
class HiddenField:
    """One kind of hidden field: the name it is written under, the target types it may hold (the likeliest first; what
    extends one is one), and its other spellings, folded. A `general` one says nothing of what lies there. It may stand
    for a target of the types in `also`, but does not tell a mission by them."""

    name: str
    types: tuple[str, ...]
    spellings: frozenset[str]
    general: bool = False
    also: tuple[str, ...] = ()


def _field(name: str, types: str, spellings: str, *, general: bool = False, also: str = "") -> HiddenField:
    stems = (folded(name), *spellings.split())
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
"""In the order in which they claim target groups: what says most comes first."""


REMARKS = frozenset({
    "congestion", "delivery", "depot", "destination", "fracture", "bridgefracture", "house", "leak", "pipelineleak",
    "pollution", "trafficjam", "warehouse", "仓库", "排队", "队列", "污染源", "目的地", "终点",
})  # fmt: skip
"""Spellings that name the thing and not its place: a text or a number under them may be a remark on it."""


PENDING = ("pending", "tbd", "tobe", "unknown", "later", "notset", "notready", "unset", "undefined", "none", "待", "未")
"""Words, folded, by which a value without coordinates says that its place is not known yet."""

_STATUS_KEYS = frozenset({"status", "state", "状态"})
_REMARK_KEYS = _STATUS_KEYS | {"note", "remark", "comment", "description", "备注", "说明"}

_COORDINATES = frozenset({
    "x", "y", "z", "lon", "lng", "long", "longitude", "lat", "latitude", "alt", "altitude", "经度", "纬度", "海拔",
})  # fmt: skip


@dataclass(frozen=True, slots=True)
class Found:
    """A hidden field of a document: what it is, the key and JSON path it stands at, its entries and their paths.

    `pending`: it has entries, and all of them say that their place comes later.
    """

    field: HiddenField
    key: str
    path: str
    targets: tuple[HiddenPlace, ...]
    paths: tuple[str, ...]
    pending: bool = False

    def at(self, index: int) -> str:
        """JSON path of one entry."""
        return self.paths[index]

    def extended(self, other: Found) -> Found:
        """The field with the entries of another one, without those that repeat one of its own."""
        new = [k for k, entry in enumerate(other.targets) if not any(_is_same(entry, one) for one in self.targets)]
        targets = (*self.targets, *(other.targets[k] for k in new))
        return replace(self, targets=targets, paths=(*self.paths, *(other.paths[k] for k in new)))

    def repeats(self, other: Found) -> bool:
        """True if every entry of this field is one of the other field's."""
        return all(any(_is_same(entry, one) for one in other.targets) for entry in self.targets)


def _is_same(one: HiddenPlace, other: HiddenPlace) -> bool:
    """True if two entries lie at one place and no id tells them apart."""
    return one.place.spot == other.place.spot and (not one.key or not other.key or one.key == other.key)


def field_of(key: str) -> HiddenField | None:
    """The kind of hidden field a key spells, or None."""
    word = folded(key)
    return next((field for field in FIELDS if word in field.spellings), None)


def hidden_fields(parsed: Parsed) -> tuple[Found, ...]:
    """Every hidden field of the document, empty ones too, in the order of `FIELDS`. Those of the rows after the first
    are added to the same kind of field of the first; what repeats a place counts once.

    `MissionError` for an entry that is no place by its types.
    """
    found = [one for holder, path in parsed.holders() for one in _found(holder, path, parsed)]
    for holder, path in parsed.later_holders():
        for later in _found(holder, path, parsed):
            same = next((k for k, one in enumerate(found) if one.field is later.field and one.targets), None)
            if same is None:
                found.append(later)
            else:
                found[same] = found[same].extended(later)
    return tuple(sorted(found, key=lambda one: FIELDS.index(one.field)))


def _found(holder: Mapping[str, Any], path: str, parsed: Parsed) -> Iterator[Found]:
    for key, value in holder.items():
        field = field_of(key)
        if field is None:
            continue
        where = f"{path}.{key}"
        items = [value] if isinstance(value, dict) else value
        if not isinstance(items, list):
            if folded(key) in REMARKS:
                parsed.notes.append(f"{where}: is no list of places; not understood and kept")
            else:
                hint = "give X and Y in centimetres, or lon and lat in degrees"
                parsed.report(where, f"a place or a list of places is due, this is {kind_of(value)}", hint)
            continue
        paths = [where] if isinstance(value, dict) else [f"{where}[{k}]" for k in range(len(items))]
        given = len(items)
        paths, items = _present(paths, items, parsed)
        spelt_before = len(parsed.spelt.faults)
        unified = [parsed.spelt.unify(item, HiddenPlace, at) for item, at in zip(items, paths, strict=True)]
        parsed.faults.extend(parsed.spelt.faults[spelt_before:])
        read = [parsed.converted(item, HiddenPlace, at) for item, at in zip(unified, paths, strict=True)]
        parsed.notes.extend(note for note in parsed.spelt.notes if note not in parsed.notes)
        yield Found(field, key, where, tuple(read), tuple(paths), pending=bool(given) and not items)


def _present(paths: Sequence[str], items: Sequence[Any], parsed: Parsed) -> tuple[list[str], list[Any]]:
    """The entries without those that hold nothing or say that their place comes later, which are noted."""
    absent = [item == {} or (isinstance(item, dict) and is_pending(item)) for item in items]
    parsed.notes.extend(
        f"{path}: has no place yet ({_words(item) or 'it holds nothing'}); taken as absent"
        for path, item, is_absent in zip(paths, items, absent, strict=True)
        if is_absent
    )
    kept = [k for k, is_absent in enumerate(absent) if not is_absent]
    return [paths[k] for k in kept], [items[k] for k in kept]


def is_pending(item: Mapping[str, Any]) -> bool:
    """True if an entry has no coordinates and says that it will have some, or has a `status` of that kind beside
    coordinates that are all 0, which stand in for none."""
    inner = [one for one in item.values() if isinstance(one, Mapping)]
    pairs = [(folded(key), value) for holder in (item, *inner) for key, value in holder.items()]
    coordinates = [value for key, value in pairs if key in _COORDINATES]
    if not coordinates:
        return _comes_later(_texts(item))
    stand_in = all(isinstance(value, int | float) and value == 0 for value in coordinates)
    return stand_in and _comes_later(v for key, v in pairs if key in _STATUS_KEYS and isinstance(v, str))


def _comes_later(texts: Iterable[str]) -> bool:
    return any(word in folded(text) for text in texts for word in PENDING)


def _texts(item: Mapping[str, Any]) -> Iterator[str]:
    for key, value in item.items():
        if isinstance(value, Mapping):
            yield from _texts(value)
        elif isinstance(value, str) and folded(key) in _REMARK_KEYS:
            yield value


def _words(item: Mapping[str, Any]) -> str:
    return ", ".join(f"'{said[:40]}'" for said in _texts(item))
