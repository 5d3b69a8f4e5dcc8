"""The shape of a `resetScenario` document: what is read of it. Whatever else it holds is allowed and kept as text.

Two spellings occur: an envelope (`commandType`, `taskId`, `scenario`) and the scenario alone. Coordinates are Unreal
centimetres (`X`, `Y`, `Z`) or WGS84 (`lon`, `lat`, `alt`); see `lingjing.mission.frames`. A field that is null counts
as absent, of equal keys the last one; the latter is noted, and so are fields that nothing here reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import jsontext, reset_elements, reset_places

PLACED = msgspec.Meta(extra_json_schema={"anyOf": [{"required": ["X", "Y"]}, {"required": ["lon", "lat"]}]})
"""What the schema says beyond the types: a place has a pair of coordinates (checked where it is used)."""

PLACED_DEEPER = msgspec.Meta(
    extra_json_schema={"anyOf": [{"required": keys} for keys in (["X", "Y"], ["lon", "lat"], ["data"], ["position"])]}
)
"""The same for an entry that may hold its place in an object of its own."""

Free = Annotated[Any, msgspec.Meta(description="kept as it is, nothing reads it")]
"""The type of a field that documents have and a mission does not need: whatever stands there is no fault."""

P = TypeVar("P")


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


class Part(msgspec.Struct, frozen=True, kw_only=True, rename="camel"):
    """Base of the document's parts: frozen; unknown fields are allowed."""


class Coordinates(Part, frozen=True, kw_only=True):
    """A place: centimetres in Unreal's left-handed frame, or degrees and metres."""

    x: float | None = msgspec.field(default=None, name="X")
    y: float | None = msgspec.field(default=None, name="Y")
    z: float | None = msgspec.field(default=None, name="Z")
    lon: Annotated[float, msgspec.Meta(ge=-180, le=180)] | None = None
    lat: Annotated[float, msgspec.Meta(ge=-90, le=90)] | None = None
    alt: float | None = None


class Target(Coordinates, frozen=True, kw_only=True):
    """A hidden place: a person, a fire, a leak, a delivery point. `weight` or `demand` is what it wants, in kg."""

    person_id: str | int = ""
    target_id: str | int = ""
    fire_id: str | int = ""
    point_id: str | int = ""
    id: str | int = ""
    name: str = ""
    weight: Annotated[float, msgspec.Meta(ge=0)] | None = None
    demand: Annotated[float, msgspec.Meta(ge=0)] | None = None
    data: Coordinates | None = None
    position: Coordinates | None = None

    @property
    def place(self) -> Coordinates:
        """Where it lies."""
        return self.data or self.position or self

    @property
    def key(self) -> str:
        """The id that tells it from the others of its list; "" if it has none."""
        given = (self.person_id, self.target_id, self.fire_id, self.point_id, self.id)
        return next((str(code) for code in given if code != ""), "")

    @property
    def code(self) -> str:
        """The document's own name for it."""
        return self.key or self.name


Places = tuple[Annotated[Target, PLACED_DEEPER], ...] | Annotated[Target, PLACED_DEEPER]


class Corner(Coordinates, frozen=True, kw_only=True):
    """One corner of the search area; the corners go around it in order."""

    range_id: str | int = ""


class Equipment(Part, frozen=True, kw_only=True):
    """One entity. `heading` and `raw` are compass degrees, `yaw` is Unreal's."""

    equipment_code: str | int = ""
    name: str = ""
    side: Free = ""
    data: Annotated[Coordinates, PLACED]
    heading: float | None = None
    raw: float | None = None
    yaw: float | None = None
    sensor_type: Free = ""


class Satellite(Equipment, frozen=True, kw_only=True):
    """An entity in orbit: its two-line elements place it, coordinates may be missing. The lines stand under `tle1` and
    `tle2`, or both in `tle`, as a list or as one text."""

    data: Coordinates = Coordinates()
    tle1: str = ""
    tle2: str = ""
    tle: str | tuple[str, ...] = ""

    @property
    def lines(self) -> tuple[str, ...]:
        """The element lines; a name line before them is left out. Empty if there are none."""
        given = self.tle.splitlines() if isinstance(self.tle, str) else self.tle
        both = (self.tle1, self.tle2) if self.tle1 or self.tle2 else tuple(given)
        return tuple(line.strip() for line in both if line.strip())[-2:]


class EquipmentList(Part, frozen=True, kw_only=True):
    """The six lists; one that is not there is empty."""

    drone_entity_list: tuple[Equipment, ...] = ()
    unmanned_dog_entity_list: tuple[Equipment, ...] = ()
    auto_vehicle_entity_list: tuple[Equipment, ...] = ()
    satellite_entity_list: tuple[Satellite, ...] = ()
    ship_entity_list: tuple[Equipment, ...] = ()
    plane_entity_list: tuple[Equipment, ...] = ()


class InitialState(Part, frozen=True, kw_only=True):
    """What the task begins with; the hidden places are here. They are read by `lingjing.mission.reset_fields`, which
    knows their other spellings too."""

    weather: str | dict[str, Any] = ""
    uav_count: float | None = msgspec.field(default=None, name="uav_count")
    rescue_range: tuple[Annotated[Corner, PLACED], ...] = ()
    rescue_person_position: Places = ()
    goal_fire_position: Places = ()
    leak_position: Places = ()
    fracture_position: Places = ()
    congestion_position: Places = ()
    warehouse_position: Places = ()
    delivery_points: Places = ()
    destination_position: Places = ()
    goal_position: Places = ()
    task_points: Places = ()


class Task(Part, frozen=True, kw_only=True):
    """One row of the task matrix."""

    task_level: Free = ""
    task_id: Free = msgspec.field(default="", name="task_id")
    task_type: str = ""
    task_type_snake: str = msgspec.field(default="", name="task_type")
    goal: str = ""
    initial_state: InitialState = msgspec.field(default=InitialState(), name="initial_state")


class Lingjing(Part, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What this project adds to a document so that the way back is exact: the template, how it was set, and
    the places of target groups that no field of the document stands for. It is this project's own, so an unknown key
    is an error."""

    mission: str
    mode: Literal["star", "broadcast", "single"] | None = None
    settings: dict[str, float] = {}
    seed: int | None = None
    targets: dict[str, tuple[Annotated[Target, PLACED_DEEPER], ...]] = {}


class Scenario(Part, frozen=True, kw_only=True):
    """The scenario itself."""

    command_type: Literal["resetScenario"] = "resetScenario"
    scene_name: str = ""
    collaboration_type: str = ""
    scene_region: Free = ""
    task_type: str = ""
    task_type_snake: str = msgspec.field(default="", name="task_type")
    lingjing: Lingjing | None = None
    equipment_list: EquipmentList
    task_matrix: Annotated[tuple[Task, ...], msgspec.Meta(min_length=1)]


class Envelope(Part, frozen=True, kw_only=True):
    """The command that carries a scenario."""

    command_type: Literal["resetScenario"] = "resetScenario"
    task_id: Free = ""
    scenario: Scenario


@dataclass(frozen=True, slots=True)
class Parsed:
    """A document that was read: the scenario, the JSON path of the scenario, its plain values without nulls, and notes
    on spellings that were read as others."""

    scenario: Scenario
    path: str
    file: str
    raw: Mapping[str, object]
    envelope: Mapping[str, object] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

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

    def holders(self) -> tuple[tuple[Mapping[str, object], str], ...]:
        """The objects that may hold hidden places, and their JSON paths: initial state, task, scenario."""
        task = _first(self.raw.get("taskMatrix"))
        state = task.get("initial_state")
        inner: Mapping[str, object] = state if isinstance(state, dict) else {}
        return (inner, self.state_path), (task, self.task_path), (self.raw, self.path)

    def placeless(self, where: str) -> MissionError:
        """The error for a place that has no coordinates that are understood."""
        if reset_places.lower_case(self.envelope or self.raw, where):
            message = "has 'x' and 'y', whose unit and direction the document does not say"
            return self.fault(where, message, "write X and Y for Unreal's centimetres (Y to the south), or lon and lat")
        return self.fault(where, "has no place", "give X and Y in centimetres, or lon and lat in degrees")

    def fault(self, where: str, message: str, hint: str) -> MissionError:
        """An error at a JSON path of this document."""
        return MissionError(f"{self.file}: {where}: {message}", hint=hint)


def _first(rows: object) -> Mapping[str, object]:
    return rows[0] if isinstance(rows, list) and rows and isinstance(rows[0], dict) else {}


def parse(text: str, path: str) -> Parsed:
    """Read a document; `UsageError` if it is not JSON, `MissionError` with a JSON path if it is not a scenario."""
    notes: list[str] = []
    raw = reset_places.unify(reset_elements.unify(_without_nulls(jsontext.load(text, path))), notes)
    if not isinstance(raw, dict) or not ({"scenario", "equipmentList"} & raw.keys()):
        raise MissionError(
            f"{path}: $ is not a resetScenario: it holds neither 'scenario' nor 'equipmentList'",
            hint="give a resetScenario document, a mission.json or an .ljs file",
        )
    try:
        if "scenario" in raw:
            scenario = msgspec.convert(raw, Envelope).scenario
            return Parsed(scenario, "$.scenario", path, raw["scenario"], raw, tuple(notes))
        return Parsed(msgspec.convert(raw, Scenario), "$", path, raw, notes=tuple(notes))
    except msgspec.ValidationError as error:
        raise MissionError(f"{path}: {_readable(str(error))}", hint=_way_out(str(error))) from None


def converted(value: object, type_: type[P], where: str, parsed: Parsed) -> P:
    """A part of the document as `type_`; `MissionError` with its JSON path if it is none."""
    try:
        return msgspec.convert(value, type_)
    except msgspec.ValidationError as error:
        message = f"{parsed.file}: {where}{_readable(str(error)).removeprefix('$')}"
        raise MissionError(message, hint=_way_out(str(error))) from None


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


def _readable(message: str) -> str:
    """Put the path of a validation message (`Expected … - at `$.a``) first, as in every other message."""
    said, _, where = message.partition(" - at ")
    where = where.strip("`") or "$"
    said = said.replace("`", "'").replace(" | null", "")
    return f"{where}: {said[0].lower()}{said[1:]}"


def _way_out(message: str) -> str:
    if "unknown field" in message:
        return "the object 'lingjing' knows mission, mode, settings, seed and targets"
    if "missing required field" in message:
        return "add the field; schemas/reset-scenario.schema.json describes the document"
    if "`float" in message and "got `str`" in message:
        return "write the number without quotes"
    return "schemas/reset-scenario.schema.json describes the document"
