"""The shape of a `resetScenario` document: what is read of it. Whatever else it holds is allowed and kept as text.

Two spellings occur: an envelope (`commandType`, `taskId`, `scenario`) and the scenario alone. Coordinates are Unreal
centimetres (`X`, `Y`, `Z`) or WGS84 (`lon`, `lat`, `alt`); see `lingjing.mission.frames`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import jsontext

PLACED = msgspec.Meta(extra_json_schema={"anyOf": [{"required": ["X", "Y"]}, {"required": ["lon", "lat"]}]})
"""What the schema says beyond the types: a place has a pair of coordinates (checked where it is used)."""


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


class Person(Coordinates, frozen=True, kw_only=True):
    """A person to be found: a hidden place."""

    person_id: str = ""


class Corner(Coordinates, frozen=True, kw_only=True):
    """One corner of the search area; the corners go around it in order."""

    range_id: str = ""


class Equipment(Part, frozen=True, kw_only=True):
    """One entity. `heading` and `raw` are compass degrees, `yaw` is Unreal's."""

    equipment_code: str = ""
    name: str = ""
    side: str = ""
    data: Annotated[Coordinates, PLACED]
    heading: float | None = None
    raw: float | None = None
    yaw: float | None = None
    sensor_type: str = ""


class Satellite(Equipment, frozen=True, kw_only=True):
    """An entity in orbit: its two-line elements place it, coordinates may be missing."""

    data: Coordinates = Coordinates()


class EquipmentList(Part, frozen=True, kw_only=True):
    """The six lists; one that is not there is empty."""

    drone_entity_list: tuple[Equipment, ...] = ()
    unmanned_dog_entity_list: tuple[Equipment, ...] = ()
    auto_vehicle_entity_list: tuple[Equipment, ...] = ()
    satellite_entity_list: tuple[Satellite, ...] = ()
    ship_entity_list: tuple[Equipment, ...] = ()
    plane_entity_list: tuple[Equipment, ...] = ()


class InitialState(Part, frozen=True, kw_only=True):
    """What the task begins with; the hidden places are here."""

    weather: str = ""
    uav_count: int | None = msgspec.field(default=None, name="uav_count")
    rescue_person_position: tuple[Annotated[Person, PLACED], ...] = ()
    rescue_range: tuple[Annotated[Corner, PLACED], ...] = ()
    goal_fire_position: tuple[Coordinates, ...] = ()


class Task(Part, frozen=True, kw_only=True):
    """One row of the task matrix."""

    task_level: str = ""
    task_id: str = msgspec.field(default="", name="task_id")
    task_type: str = ""
    task_type_snake: str = msgspec.field(default="", name="task_type")
    goal: str = ""
    initial_state: InitialState = msgspec.field(default=InitialState(), name="initial_state")


class Lingjing(Part, frozen=True, kw_only=True):
    """What this project adds to a document so that the way back is exact: the template and how it was set."""

    mission: str
    mode: Literal["star", "broadcast"] | None = None
    settings: dict[str, float] = {}
    seed: int | None = None


class Scenario(Part, frozen=True, kw_only=True):
    """The scenario itself."""

    command_type: Literal["resetScenario"] = "resetScenario"
    scene_name: str = ""
    collaboration_type: str = ""
    scene_region: str = ""
    task_type: str = ""
    task_type_snake: str = msgspec.field(default="", name="task_type")
    lingjing: Lingjing | None = None
    equipment_list: EquipmentList
    task_matrix: Annotated[tuple[Task, ...], msgspec.Meta(min_length=1)]


class Envelope(Part, frozen=True, kw_only=True):
    """The command that carries a scenario."""

    command_type: Literal["resetScenario"] = "resetScenario"
    task_id: str = ""
    scenario: Scenario


@dataclass(frozen=True, slots=True)
class Parsed:
    """A document that was read: the scenario, and the JSON path of the scenario and of its first task."""

    scenario: Scenario
    path: str
    file: str

    @property
    def task(self) -> Task:
        """The row of the task matrix that is played."""
        return self.scenario.task_matrix[0]

    @property
    def state_path(self) -> str:
        """JSON path of the initial state."""
        return f"{self.path}.taskMatrix[0].initial_state"

    def fault(self, where: str, message: str, hint: str) -> MissionError:
        """An error at a JSON path of this document."""
        return MissionError(f"{self.file}: {where}: {message}", hint=hint)


def parse(text: str, path: str) -> Parsed:
    """Read a document; `UsageError` if it is not JSON, `MissionError` with a JSON path if it is not a scenario."""
    raw = jsontext.load(text, path)
    if not isinstance(raw, dict) or not ({"scenario", "equipmentList"} & raw.keys()):
        raise MissionError(
            f"{path}: $ is not a resetScenario: it holds neither 'scenario' nor 'equipmentList'",
            hint="give a resetScenario document, a mission.json or an .ljs file",
        )
    try:
        if "scenario" in raw:
            return Parsed(msgspec.convert(raw, Envelope).scenario, "$.scenario", path)
        return Parsed(msgspec.convert(raw, Scenario), "$", path)
    except msgspec.ValidationError as error:
        raise MissionError(f"{path}: {_readable(str(error))}", hint=_way_out(str(error))) from None


def _readable(message: str) -> str:
    """Put the path of a validation message (`Expected … - at `$.a``) first, as in every other message."""
    said, _, where = message.partition(" - at ")
    where = where.strip("`") or "$"
    said = said.replace("`", "'").replace(" | null", "")
    return f"{where}: {said[0].lower()}{said[1:]}"


def _way_out(message: str) -> str:
    if "missing required field" in message:
        return "add the field; schemas/reset-scenario.schema.json describes the document"
    if "`float" in message and "got `str`" in message:
        return "write the number without quotes"
    return "schemas/reset-scenario.schema.json describes the document"
