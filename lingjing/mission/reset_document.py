"""The shape of a `resetScenario` document: what is read of it. Whatever else it holds is allowed and kept as text.

Two spellings occur: an envelope (`commandType`, `taskId`, `scenario`) and the scenario alone; either may come in the
wire's own envelope (`{"type": "COMMAND", "data": …}`). Coordinates are Unreal centimetres (`X`, `Y`, `Z`, or in lower
case) or WGS84 (`lon`, `lat`, `alt`); see `lingjing.mission.frames`. A field that is null counts as absent, of equal
keys the last one counts; the latter is noted, and so are other spellings and fields that nothing here reads.

This module is the one door to pydantic in `lingjing.mission`; it is loaded for documents alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.alias_generators import to_camel

from lingjing.errors import Fault, MissionError
from lingjing.mission import jsontext
from lingjing.mission.reset_elements import lifted

Free = Annotated[Any, Field(description="kept as it is, nothing reads it")]
"""The type of a field that documents have and a mission does not need: whatever stands there is no fault."""

Code = Annotated[str | int, Field(union_mode="left_to_right")]
"""What names a thing: a text, or a number."""

PLACES = (("X", "Y"), ("lon", "lat"))
"""The pairs of coordinates that place something."""


class EntityList(NamedTuple):
    """One of the six lists: its key, the attribute of `EquipmentList`, and the engine that drives what is in it."""

    name: str
    attribute: str
    engine: str


LISTS: tuple[EntityList, ...] = (
    EntityList("droneEntityList", "drone_entity_list", "multirotor"),
    EntityList("unmannedDogEntityList", "unmanned_dog_entity_list", "quadruped"),
    EntityList("autoVehicleEntityList", "auto_vehicle_entity_list", "road"),
    EntityList("satelliteEntityList", "satellite_entity_list", "satellite"),
    EntityList("shipEntityList", "ship_entity_list", "vessel"),
    EntityList("planeEntityList", "plane_entity_list", "plane"),
)


def folded(word: str) -> str:
    """Letters and digits of a spelling, lower case."""
    return "".join(letter for letter in word if letter.isalnum()).casefold()


def spelt(*others: str, alias: str | None = None, default: Any = None) -> Any:
    """A field with other spellings of its key; case and separators do not count."""
    return Field(default=default, alias=alias, json_schema_extra={"spellings": list(others)})


class Part(BaseModel):
    """Base of the document's parts: frozen, strict (a text is no number); unknown fields are allowed."""

    model_config = ConfigDict(
        extra="allow", frozen=True, strict=True, alias_generator=to_camel, populate_by_name=False, allow_inf_nan=False
    )

    @classmethod
    def spellings(cls) -> Mapping[str, str]:
        """Every known key, folded, and the key it stands for."""
        known: dict[str, str] = {}
        for name, info in cls.model_fields.items():
            key = info.alias or name
            extra = info.json_schema_extra
            others = extra.get("spellings", []) if isinstance(extra, dict) else []
            known |= {folded(one): key for one in (key, *(others if isinstance(others, list) else []))}  # type: ignore[arg-type]
        return known

    @classmethod
    def parts(cls) -> Mapping[str, tuple[type[Part], bool]]:
        """The keys that hold parts of their own: of which shape, and whether as a list."""
        found = {}
        for name, info in cls.model_fields.items():
            shape = _shape(info.annotation)
            if shape is not None and get_origin(info.annotation) is not dict:
                found[info.alias or name] = shape, "tuple[" in str(info.annotation)
        return found


def _shape(annotation: Any) -> type[Part] | None:
    if isinstance(annotation, type) and issubclass(annotation, Part):
        return annotation
    return next((found for one in get_args(annotation) if (found := _shape(one)) is not None), None)


class Coordinates(Part):
    """A place: centimetres in Unreal's left-handed frame, or degrees and metres."""

    x: float | None = spelt(alias="X")
    y: float | None = spelt(alias="Y")
    z: float | None = spelt(alias="Z")
    lon: Annotated[float, Field(ge=-180, le=180)] | None = spelt("lng", "long", "longitude", "经度")
    lat: Annotated[float, Field(ge=-90, le=90)] | None = spelt("latitude", "纬度")
    alt: float | None = spelt("altitude", "海拔")
    yaw: float | None = None


class Data(Coordinates):
    """The place of an entity, which it must have."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": list(pair)} for pair in PLACES]})

    @model_validator(mode="after")
    def _is_placed(self) -> Data:
        return _placed(self, self)


class Corner(Data):
    """One corner of the search area; the corners go around it in order."""

    range_id: Code = ""


class Target(Coordinates):
    """A hidden place: a person, a fire, a leak, a delivery point. `weight` or `demand` is what it wants, in kg;
    `range` and `scale` say how large a fire is, and are kept."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": list(keys)} for keys in (*PLACES, ("data",), ("position",))]}
    )

    person_id: Code = ""
    target_id: Code = ""
    fire_id: Code = ""
    point_id: Code = ""
    del_id: Code = ""
    con_id: Code = ""
    pipe_id: Code = ""
    warehouse_id: Code = ""
    id: Code = ""
    name: str = ""
    weight: Annotated[float, Field(ge=0)] | None = None
    demand: Annotated[float, Field(ge=0)] | None = None
    person_count: Annotated[float, Field(ge=0)] | None = spelt("people", "人数")
    spacing: Free = None
    heading: float | None = None
    status: Free = None
    range: Free = None
    scale: Free = None
    data: Coordinates | None = None
    position: Coordinates | None = None

    @property
    def place(self) -> Coordinates:
        """Where it lies."""
        return self.data or self.position or self

    @property
    def key(self) -> str:
        """The id that tells it from the others of its list; "" if it has none."""
        ids = (self.person_id, self.target_id, self.fire_id, self.point_id, self.del_id, self.con_id, self.pipe_id)
        return next((str(code) for code in (*ids, self.warehouse_id, self.id) if code != ""), "")

    @property
    def code(self) -> str:
        """The document's own name for it."""
        return self.key or self.name

    @model_validator(mode="after")
    def _is_placed(self) -> Target:
        return _placed(self, self.place)


P = TypeVar("P", bound=Part)
_PLACELESS = "has no place"


def _placed(part: P, place: Coordinates) -> P:
    if (place.x is None or place.y is None) and (place.lon is None or place.lat is None):
        raise ValueError(_PLACELESS)
    return part


class Equipment(Part):
    """One entity. `heading` and `raw` are compass degrees, `yaw` is Unreal's, here or in `data`."""

    equipment_code: Code = ""
    name: str = ""
    side: Free = ""
    data: Data
    heading: float | None = None
    raw: float | None = None
    yaw: float | None = None
    sensor_type: Free = ""


class Satellite(Equipment):
    """An entity in orbit: its two-line elements place it, coordinates may be missing. The lines stand under `tle1` and
    `tle2`, or both in `tle`, as a list or as one text."""

    data: Coordinates = Coordinates()  # type: ignore[assignment]
    tle1: Free = ""
    tle2: Free = ""
    tle: Free = ""

    @property
    def lines(self) -> tuple[str, ...]:
        """The element lines; a name line before them is left out. Empty if there are none."""
        given = self.tle.splitlines() if isinstance(self.tle, str) else self.tle if isinstance(self.tle, list) else []
        both = [self.tle1, self.tle2] if self.tle1 or self.tle2 else given
        return tuple(line.strip() for line in both if isinstance(line, str) and line.strip())[-2:]


class EquipmentList(Part):
    """The six lists; one that is not there is empty."""

    drone_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    unmanned_dog_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    auto_vehicle_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    satellite_entity_list: Annotated[tuple[Satellite, ...], Field(strict=False)] = ()
    ship_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    plane_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()


class InitialState(Part):
    """What the task begins with; the hidden places are here. They are read by `lingjing.mission.reset_fields`, which
    knows their spellings."""

    weather: Annotated[str | dict[str, Any], Field(union_mode="left_to_right")] = ""
    uav_count: float | None = Field(default=None, alias="uav_count")
    takeoff_height_m: Annotated[float, Field(gt=0)] | None = Field(default=None, alias="takeoff_height_m")
    rescue_range: tuple[Corner, ...] = Field(
        default=(), strict=False, json_schema_extra={"spellings": ["searchRange", "searchArea", "搜索范围"]}
    )


class Task(Part):
    """One row of the task matrix."""

    task_level: Free = ""
    task_id: Free = Field(default="", alias="task_id")
    task_type: str = ""
    goal: str = ""
    initial_state: InitialState = Field(default=InitialState(), alias="initial_state")


class Lingjing(Part):
    """What this project adds to a document so that the way back is exact: the template, how it was set, the scene's
    origin (latitude and longitude), the height that counts as 0 (metres), and the places of target groups that no
    field of the document stands for. It is this project's own, so an unknown key is an error."""

    model_config = ConfigDict(extra="forbid")

    mission: str | None = None
    mode: Literal["star", "broadcast", "single"] | None = None
    settings: dict[str, float] = {}
    seed: int | None = None
    origin: Annotated[tuple[float, float], Field(strict=False)] | None = None
    datum_m: float | None = Field(default=None, alias="datum_m")
    targets: dict[str, Annotated[tuple[Target, ...], Field(strict=False)]] = {}


class Scenario(Part):
    """The scenario itself."""

    command_type: Literal["resetScenario"] = "resetScenario"
    scene_name: str = ""
    collaboration_type: str = ""
    scene_region: Free = ""
    task_type: str = ""
    lingjing: Lingjing | None = None
    equipment_list: EquipmentList
    task_matrix: tuple[Task, ...] = Field(strict=False, min_length=1)


class Envelope(Part):
    """The command that carries a scenario."""

    command_type: Literal["resetScenario"] = "resetScenario"
    task_id: Free = ""
    scenario: Scenario


def document_error(file: str, faults: Sequence[Fault]) -> MissionError:
    """The error of a document that is no mission, with every fault that was found."""
    each = tuple(dict.fromkeys(faults))
    said = "\n".join(f"{file}: {one.where}: {one.message}" for one in each)
    return MissionError(said, hint=each[0].hint, faults=each)


_SCHEMA = "schemas/reset-scenario.schema.json describes the document"


@dataclass(frozen=True, slots=True)
class Parsed:
    """A document that was read: the scenario, the JSON path of the scenario, its plain values without nulls under the
    keys of this module, notes on spellings that were read as others, and the faults found since."""

    scenario: Scenario
    path: str
    file: str
    raw: Mapping[str, Any]
    envelope: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    spelt: Spelt = field(default_factory=lambda: Spelt({}))
    faults: list[Fault] = field(default_factory=list)

    @property
    def task(self) -> Task:
        """The row of the task matrix that is played."""
        return self.scenario.task_matrix[0]

    @property
    def task_path(self) -> str:
        """JSON path of that row."""
        return f"{self.path}.taskMatrix[0]"

    @property
    def state_path(self) -> str:
        """JSON path of the initial state."""
        return f"{self.task_path}.initial_state"

    def holders(self) -> tuple[tuple[Mapping[str, Any], str], ...]:
        """The objects that may hold hidden places, and their JSON paths: initial state, task, scenario."""
        rows = self.raw.get("taskMatrix")
        task = rows[0] if isinstance(rows, list) and rows and isinstance(rows[0], dict) else {}
        state = task.get("initial_state")
        inner: Mapping[str, Any] = state if isinstance(state, dict) else {}
        return (inner, self.state_path), (task, self.task_path), (self.raw, self.path)

    def rows(self) -> Iterator[tuple[Part, Mapping[str, Any], str]]:
        """The scenario and its task: shape, values, JSON path."""
        _, (task, task_path), (scenario, path) = self.holders()
        yield self.scenario, scenario, path
        yield self.task, task, task_path

    def fault(self, where: str, message: str, hint: str) -> MissionError:
        """The error that ends the reading at a JSON path of this document, with all faults found before."""
        return document_error(self.file, [*self.faults, Fault(where, message, hint)])

    def report(self, where: str, message: str, hint: str) -> None:
        """Keep a fault and go on."""
        self.faults.append(Fault(where, message, hint))

    def converted(self, value: object, shape: type[P], where: str) -> P | None:
        """A part of the document in its shape; None if it is none, which is reported."""
        try:
            return shape.model_validate(value)
        except ValidationError as error:
            self.faults.extend(faults_of(error, value, where, self.spelt))
            return None


# -- spellings ------------------------------------------------------------------------------------------------------


class Spelt:
    """How a document spells its keys: it renames them in place to those of the shapes, and remembers."""

    def __init__(self, original: MutableMapping[tuple[int, str], str]) -> None:
        self.notes: list[str] = []
        self._original = original
        self._kept: list[object] = []

    def unify(self, value: Any, shape: type[Part], where: str) -> Any:
        """The value with the keys of the shape, all the way down; one note for each list and spelling."""
        if not isinstance(value, dict):
            return value
        self._rename(value, shape, where)
        if issubclass(shape, Satellite):
            lifted(value)
        for key, (inner, many) in shape.parts().items():
            found = value.get(key)
            at = f"{where}.{self.key(value, key)}"
            if many and isinstance(found, dict):
                value[key] = [self.unify(found, inner, at)]
            elif many and isinstance(found, list):
                value[key] = [self.unify(one, inner, f"{at}[{k}]") for k, one in enumerate(found)]
            elif found is not None:
                value[key] = self.unify(found, inner, at)
        return value

    def key(self, holder: Mapping[str, Any], key: str) -> str:
        """How the document spells a key."""
        return self._original.get((id(holder), key), key)

    def _rename(self, value: dict[str, Any], shape: type[Part], where: str) -> None:
        known = shape.spellings()
        own = {info.alias or name for name, info in shape.model_fields.items()}
        renamed = {}
        for key in list(value):
            name = known.get(folded(key))
            if name is not None and key not in own and name not in value:
                value[name] = value.pop(key)
                self._original[id(value), name] = key
                renamed[key] = name
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


_ROW = re.compile(r"\[\d+\](?!\.initial_state)")


# -- reading --------------------------------------------------------------------------------------------------------


def parse(text: str, path: str) -> Parsed:
    """Read a document; `UsageError` if it is not JSON, `MissionError` if it is no scenario at all.

    With `faults` in what is returned, its `scenario` is not to be used; its `raw` values are.
    """
    notes: list[str] = []
    value, root = _unwrapped(_without_nulls(jsontext.load(text, path, notes)), notes)
    spelt = Spelt({})
    if isinstance(value, dict):
        Spelt._rename(spelt, value, _Either, root)
    if not isinstance(value, dict) or not ({"scenario", "equipmentList"} & value.keys()):
        raise MissionError(
            f"{path}: {root} is not a resetScenario: it holds neither 'scenario' nor 'equipmentList'",
            hint="give a resetScenario document, a mission.json or an .ljs file",
        )
    shape: type[Envelope | Scenario] = Envelope if "scenario" in value else Scenario
    if shape is Envelope and isinstance(value["scenario"], dict):
        spelt._rename(value["scenario"], Scenario, f"{root}.scenario")
    rows = value["scenario"] if shape is Envelope else value
    if isinstance(rows, dict) and isinstance(rows.get("taskMatrix"), dict):
        notes.append(
            f"{root}{'.scenario' if shape is Envelope else ''}.taskMatrix: is one object, read as its only row"
        )
    spelt.unify(value, shape, root)
    inner, where = (value["scenario"], f"{root}.scenario") if shape is Envelope else (value, root)
    whole, faults = Scenario.model_construct(), list[Fault]()
    try:
        read = shape.model_validate(value)
        whole = read.scenario if isinstance(read, Envelope) else read
    except ValidationError as error:
        faults.extend(faults_of(error, value, root, spelt))
    envelope = value if shape is Envelope else {}
    raw = inner if isinstance(inner, dict) else {}
    return Parsed(whole, where, path, raw, envelope, (*notes, *spelt.notes), spelt, faults)


class _Either(Part):
    """What tells an envelope from a bare scenario."""

    scenario: Free = None
    equipment_list: Free = None


def _unwrapped(value: object, notes: list[str]) -> tuple[object, str]:
    """What the wire's envelope carries, and its JSON path."""
    if isinstance(value, dict) and "data" in value and not {"scenario", "equipmentList"} & value.keys():
        notes.append("$: the wire's envelope is taken off; $.data is read")
        return value["data"], "$.data"
    return value, "$"


def _without_nulls(root: object) -> object:
    """The same values, with every field that is null taken out (in place; a loop, for documents nest deeply)."""
    stack = [root]
    while stack:
        value = stack.pop()
        if isinstance(value, dict):
            for key in [key for key, item in value.items() if item is None]:
                del value[key]
            stack.extend(value.values())
        elif isinstance(value, list):
            stack.extend(value)
    return root


# -- faults in words ------------------------------------------------------------------------------------------------


def faults_of(error: ValidationError, value: object, root: str, spelt: Spelt) -> Iterator[Fault]:
    """Every fault that validation found, at the JSON paths of the document, one for each place."""
    seen: set[str] = set()
    for one in error.errors(include_url=False):
        where, missing = _path(one["loc"], value, root, spelt)
        if one["type"] in ("missing", "extra_forbidden"):
            where, missing = where.rpartition(".")[0] if not missing else where, missing or where.rpartition(".")[2]
        if f"{where}.{missing}" not in seen:
            seen.add(f"{where}.{missing}")
            yield Fault(where, *_worded(one, missing))


def _path(loc: tuple[int | str, ...], value: object, root: str, spelt: Spelt) -> tuple[str, str]:
    """The JSON path of a location, and the key that is not there, if it is about one."""
    where = root
    for part in loc:
        if isinstance(value, Mapping) and isinstance(part, str):
            if part not in value:
                return where, part
            where, value = f"{where}.{spelt.key(value, part)}", value[part]
        elif isinstance(value, list | tuple) and isinstance(part, int) and part < len(value):
            where, value = f"{where}[{part}]", value[part]
    return where, ""


_DUE = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "a text",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "model_attributes_type": "an object",
    "bool_type": "true or false",
}


def _worded(one: Mapping[str, Any], key: str) -> tuple[str, str]:
    """What is wrong, and the way out."""
    kind, given, limits = one["type"], one["input"], one.get("ctx", {})
    if kind == "missing":
        return f"'{key}' is missing", "add the field; " + _SCHEMA
    if kind == "extra_forbidden":
        return (
            f"unknown field '{key}'",
            "the object 'lingjing' knows mission, mode, settings, seed, origin, datum_m and targets",
        )
    if kind == "value_error":
        return _PLACELESS, "give X and Y in centimetres, or lon and lat in degrees"
    if kind in _DUE:
        hint = "write the number without quotes" if isinstance(given, str) and kind == "float_type" else _SCHEMA
        return f"{_DUE[kind]} is due, this is {_kind_of(given)}", hint
    if kind == "literal_error":
        return f"'{given}' is not known, {limits.get('expected', '')} is", _SCHEMA
    if kind in ("too_short", "missing_argument"):
        return "is empty", "give at least one entry"
    for bound, word in (("ge", "at least"), ("gt", "more than"), ("le", "at most")):
        if bound in limits:
            return f"is {given:g}, {word} {limits[bound]:g} is due", _SCHEMA
    return one["msg"][:1].lower() + one["msg"][1:], _SCHEMA


def _kind_of(value: object) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return f"the text '{value[:40]}'"
        case int() | float():
            return f"the number {value:g}" if abs(value) < 1e300 else "a number out of range"
        case Mapping():
            return "an object"
        case list() | tuple():
            return "a list"
    return "null"
