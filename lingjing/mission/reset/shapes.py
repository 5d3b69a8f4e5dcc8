"""The parts of a `resetScenario` document as pydantic models. Other fields are allowed and kept.

Two forms exist: an envelope (`commandType`, `taskId`, `scenario`) and the scenario alone. Coordinates are Unreal
centimetres (`X`, `Y`, `Z`) or WGS84 (`lon`, `lat`, `alt`); see `lingjing.mission.frames`.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from functools import cache, lru_cache
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.alias_generators import to_camel

from lingjing.mission.frames import compass_from_yaw
from lingjing.mission.vocabulary import CommunicationMode

Free = Annotated[Any, Field(description="kept as it is, nothing reads it")]
"""The type of a field that documents have and a mission does not need: every value is accepted."""

Code = Annotated[str | int, Field(union_mode="left_to_right")]
"""An identifier: a text, or a number."""

Degrees = Annotated[float, Field(ge=-360, le=360)]
"""An angle within one turn to either side."""

PLACES = (("X", "Y"), ("lon", "lat"))
"""The pairs of coordinates that define a place."""


class EntityList(NamedTuple):
    """One of the six lists of entities."""

    name: str
    """Its key in the document."""
    attribute: str
    """Its attribute of `EquipmentList`."""
    engine: str
    """The engine of its entities."""


LISTS: tuple[EntityList, ...] = (
    EntityList("droneEntityList", "drone_entity_list", "multirotor"),
    EntityList("unmannedDogEntityList", "unmanned_dog_entity_list", "quadruped"),
    EntityList("autoVehicleEntityList", "auto_vehicle_entity_list", "road"),
    EntityList("satelliteEntityList", "satellite_entity_list", "satellite"),
    EntityList("shipEntityList", "ship_entity_list", "vessel"),
    EntityList("planeEntityList", "plane_entity_list", "plane"),
)
"""The six lists."""


@lru_cache(maxsize=4096)  # the keys of a document are few, and each is compared many times
def fold_key(word: str) -> str:
    """The letters and digits of a spelling, case-folded, in compatibility form (NFKC): `Ｆｉｒｅ－１` gives `fire1`."""
    return "".join(letter for letter in unicodedata.normalize("NFKC", word) if letter.isalnum()).casefold()


def with_spellings(*others: str, alias: str | None = None, default: Any = None) -> Any:
    """A field with alternative spellings of its key. Case and separators are ignored."""
    return Field(default=default, alias=alias, json_schema_extra={"spellings": list(others)})


class DocumentPart(BaseModel):
    """Base of the document's parts: frozen, strict (a text is no number); unknown fields are allowed."""

    model_config = ConfigDict(
        extra="allow", frozen=True, strict=True, alias_generator=to_camel, populate_by_name=False, allow_inf_nan=False
    )


class ShapeKeys(NamedTuple):
    """The keys of a shape."""

    own: frozenset[str]
    spellings: Mapping[str, str]
    """Every spelling of a key, folded → the key."""
    free: frozenset[str]
    """The keys with values that are not read."""
    parts: Mapping[str, tuple[type[DocumentPart], bool]]
    """Key → (shape of its parts, True if they form a list)."""


@cache
def keys_of(shape: type[DocumentPart]) -> ShapeKeys:
    """The keys of a shape with their spellings and parts."""
    fields = {info.alias or name: info for name, info in shape.model_fields.items()}
    spellings: dict[str, str] = {}
    parts = {}
    for key, info in fields.items():
        extra: Any = info.json_schema_extra
        spellings |= dict.fromkeys(map(fold_key, (key, *(extra or {}).get("spellings", ()))), key)
        inner = _shape(info.annotation)
        if inner is not None and get_origin(info.annotation) is not dict:
            parts[key] = inner, "tuple[" in str(info.annotation)
    free = frozenset(key for key, info in fields.items() if info.annotation is Any)
    return ShapeKeys(frozenset(fields), spellings, free, parts)


def _shape(annotation: Any) -> type[DocumentPart] | None:
    if isinstance(annotation, type) and issubclass(annotation, DocumentPart):
        return annotation
    return next((inner for argument in get_args(annotation) if (inner := _shape(argument)) is not None), None)


class Coordinates(DocumentPart):
    """A place: centimetres in Unreal's left-handed frame, or degrees and metres."""

    x: float | None = with_spellings(alias="X")
    y: float | None = with_spellings(alias="Y")
    z: float | None = with_spellings(alias="Z")
    lon: Annotated[float, Field(ge=-180, le=180)] | None = with_spellings("lng", "long", "longitude", "经度")
    lat: Annotated[float, Field(ge=-90, le=90)] | None = with_spellings("latitude", "纬度")
    alt: float | None = with_spellings("altitude", "海拔")
    yaw: Degrees | None = None

    @property
    def spot(self) -> tuple[float | None, ...]:
        """All coordinates, None for absent ones."""
        return *self.pairs, self.z, self.alt

    @property
    def pairs(self) -> tuple[float | None, ...]:
        """The coordinates without heights, None for absent ones."""
        return self.x, self.y, self.lon, self.lat

    @property
    def is_place(self) -> bool:
        """True if a pair of coordinates is present."""
        return None not in self.pairs[:2] or None not in self.pairs[2:]


class Data(Coordinates):
    """The place of an entity, which is required."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": list(pair)} for pair in PLACES]})

    @model_validator(mode="after")
    def _check_place(self) -> Data:
        return _require_place(self, self)


class Corner(Data):
    """One corner of the search area; the corners are in order around it."""

    range_id: Code = ""


class HiddenPlace(Coordinates):
    """A hidden place: a person, a fire, a leak, a delivery point. `weight` or `demand` is what it wants, in kg;
    `spacing` is that of a queue and `range` that of a fire, in centimetres."""

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
    person_count: Annotated[float, Field(ge=1, multiple_of=1)] | None = with_spellings("people", "人数")
    spacing: Free = None
    heading: Degrees | None = None
    status: Free = None
    range: Free = None
    scale: Free = None
    data: Coordinates | None = None
    position: Coordinates | None = None

    @property
    def place(self) -> Coordinates:
        """Its position: the first of `data`, `position` and its own coordinates that is a place."""
        nested = [place for place in (self.data, self.position) if place is not None]
        return next((place for place in (*nested, self) if place.is_place), self)

    @property
    def headings(self) -> Mapping[str, float]:
        """Compass degrees by key, from its `heading` and from its `yaw` or that of its place. The first one is used."""
        return _headings({"heading": self.heading}, self.yaw, self.place)

    @property
    def measures(self) -> Mapping[str, object]:
        """Its measures by field."""
        weight = self.demand if self.weight is None else self.weight
        counted = {"weight": weight, "personCount": self.person_count, "spacing": self.spacing}
        return counted | {"range": self.range, "scale": self.scale}

    @property
    def key(self) -> str:
        """Its id within its list; "" if it has none."""
        ids = (self.person_id, self.target_id, self.fire_id, self.point_id, self.del_id, self.con_id, self.pipe_id)
        return next((str(code) for code in (*ids, self.warehouse_id, self.id) if code != ""), "")

    @property
    def code(self) -> str:
        """The document's name for it."""
        return self.key or self.name

    @model_validator(mode="after")
    def _check_place(self) -> HiddenPlace:
        places = [place for place in (self.data, self.position, self) if place is not None and place.is_place]
        if len({place.spot for place in places}) > 1:
            raise ValueError(f"{len(places)} places that differ")
        if self.weight is not None and self.demand is not None and self.weight != self.demand:
            raise ValueError(
                f"'weight' {self.weight:g} and 'demand' {self.demand:g}, which are the same measure and differ"
            )
        return _require_place(self, self.place)


P = TypeVar("P", bound=DocumentPart)
PLACELESS = "no place"
"""The error of a part without coordinates."""


def _require_place(part: P, place: Coordinates) -> P:
    if not place.is_place:
        raise ValueError(PLACELESS)
    return part


def _headings(compass: Mapping[str, float | None], yaw: float | None, place: Coordinates) -> Mapping[str, float]:
    turned = place.yaw if yaw is None else yaw
    every = {**compass, "yaw": None if turned is None else compass_from_yaw(turned)}
    return {name: value for name, value in every.items() if value is not None}


class Equipment(DocumentPart):
    """One entity of `equipmentList`. `heading` and `raw` are compass degrees, `yaw` is Unreal's, here or in `data`."""

    equipment_code: Code = ""
    name: str = ""
    side: Free = ""
    data: Data = with_spellings("position", "location", "pose", default=...)
    heading: Degrees | None = None
    raw: Degrees | None = None
    yaw: Degrees | None = None
    sensor_type: Free = ""

    @property
    def place(self) -> Coordinates:
        """Its `data`."""
        return self.data

    @property
    def code(self) -> str:
        """Its `equipmentCode`."""
        return str(self.equipment_code)

    @property
    def headings(self) -> Mapping[str, float]:
        """Compass degrees by key, like those of a hidden place, with `raw` after `heading`. A `raw` of 0 is a
        placeholder and follows `yaw`."""
        headings = _headings({"heading": self.heading, "raw": self.raw}, self.yaw, self.data)
        if headings.get("raw"):
            return headings
        return {**{key: value for key, value in headings.items() if key != "raw"}, **headings}


class Satellite(Equipment):
    """An entity in orbit: its two-line elements place it, and coordinates may be absent. The lines are under `tle1` and
    `tle2`, or both in `tle`, as a list or as one text."""

    data: Coordinates = Coordinates()  # type: ignore[assignment]
    tle1: Free = with_spellings("tleLine1", "line1", default="")
    tle2: Free = with_spellings("tleLine2", "line2", default="")
    tle: Free = with_spellings("tleLines", default="")

    @property
    def lines(self) -> tuple[str, ...]:
        """The element lines, without a preceding name line; empty if there are none."""
        lines = self.tle.splitlines() if isinstance(self.tle, str) else self.tle if isinstance(self.tle, list) else []
        both = [self.tle1, self.tle2] if self.tle1 or self.tle2 else lines
        return tuple(line.strip() for line in both if isinstance(line, str) and line.strip())[-2:]


Angle = Annotated[float, Field(ge=0, lt=360)]


class OrbitalElements(DocumentPart):
    """The elements of a satellite as numbers: degrees, revolutions a day, an ISO 8601 epoch. Names of CCSDS Orbit
    Mean-Elements Messages (OMM) are accepted too."""

    inclination: Annotated[float, Field(ge=0, lt=180)] = with_spellings("inclinationDeg", "incl", default=...)
    raan: Angle = with_spellings("raanDeg", "rightAscension", "rightAscensionOfAscendingNode", default=...)
    eccentricity: Annotated[float, Field(ge=0, lt=1)] = with_spellings("ecc", default=...)
    arg_perigee: Angle = with_spellings("argumentOfPerigee", "argumentOfPericenter", "argp", default=...)
    mean_anomaly: Angle = with_spellings("meanAnomalyDeg", default=...)
    mean_motion: Annotated[float, Field(ge=0, lt=20)] = with_spellings("meanMotionRevPerDay", default=...)
    epoch: Code


class EquipmentList(DocumentPart):
    """The six lists; an absent one is empty."""

    drone_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    unmanned_dog_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    auto_vehicle_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    satellite_entity_list: Annotated[tuple[Satellite, ...], Field(strict=False)] = ()
    ship_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()
    plane_entity_list: Annotated[tuple[Equipment, ...], Field(strict=False)] = ()


class InitialState(DocumentPart):
    """The initial state of the task, with the hidden places. `lingjing.mission.reset.fields` reads these, because their
    keys have many spellings."""

    weather: Annotated[str | dict[str, Any], Field(union_mode="left_to_right")] = ""
    uav_count: float | None = Field(default=None, alias="uav_count")
    takeoff_height_m: Annotated[float, Field(gt=0)] | None = Field(default=None, alias="takeoff_height_m")
    rescue_range: tuple[Corner, ...] = Field(
        default=(), strict=False, json_schema_extra={"spellings": ["searchRange", "searchArea", "搜索范围"]}
    )


class TaskRow(DocumentPart):
    """One row of the task matrix."""

    task_level: Free = ""
    task_id: Free = Field(default="", alias="task_id")
    task_type: str = ""
    goal: str = ""
    initial_state: InitialState = Field(default=InitialState(), alias="initial_state")


class Lingjing(DocumentPart):
    """The addition of this project to a document, which makes the export reversible. Unknown keys are errors.

    It holds the template, its mode, settings and seed, the scene's origin (latitude and longitude), the height that
    counts as 0 (metres), the unit of X, Y and Z, the places of target groups without a field of their own, and the goal
    in other languages, by their codes.
    """

    model_config = ConfigDict(extra="forbid")

    mission: str | None = None
    mode: CommunicationMode | None = None
    settings: dict[str, float] = {}
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] | None = None
    origin: Annotated[tuple[float, float], Field(strict=False)] | None = None
    datum_m: float | None = Field(default=None, alias="datum_m")
    unit: Literal["cm", "m"] | None = None
    targets: dict[str, Annotated[tuple[HiddenPlace, ...], Field(strict=False)]] = {}
    goals: dict[Annotated[str, Field(pattern="^[a-z]{2,3}$")], str] = {}


class Scenario(DocumentPart):
    """The object `scenario` of a document."""

    command_type: Literal["resetScenario"] = "resetScenario"
    scene_name: str = ""
    collaboration_type: str = ""
    scene_region: Free = ""
    task_type: str = ""
    lingjing: Lingjing | None = None
    equipment_list: EquipmentList
    task_matrix: tuple[TaskRow, ...] = Field(strict=False, min_length=1)


class CommandEnvelope(DocumentPart):
    """The command that carries a scenario."""

    command_type: Literal["resetScenario"] = "resetScenario"
    task_id: Free = ""
    scenario: Scenario
