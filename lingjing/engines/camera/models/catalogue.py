"""Names → models: what an entity, a body of the background traffic or a prop looks like.

An entity's type declares its `look`, the name of a model, and its `part`s, which are drawn beside it. One without a
look is the shape, size and colour that it declares, beside its parts. One without look, size and parts is a metre cube,
so that a new plug-in's entity is seen.
Chance (colours, clothes) comes from the entity's index or a hash of a body's id. Some looks have no model of their
own: `congestion` is its vehicles, a fire or spray is an effect, a reference building is the building and people before
its door.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from math import cos, hypot, radians, sin

from lingjing.engines.bodies import shape_of
from lingjing.engines.camera.meshes import Mesh, box, merge, repainted, solid
from lingjing.engines.camera.models import air, dog, nature, people, places, sea, street, vehicles
from lingjing.engines.camera.models.shapes import HERE, ModelPart, Placement, at, turned
from lingjing.mission.appearance import BARE, COLOURS, MEASURES
from lingjing.mission.instance import Datum, Entity
from lingjing.mission.model import BodyPart
from lingjing.plugins.bodies import entity_size, solid_size, sunk_m
from lingjing.trace.records import BodyState

MOST_IN_LINE = 40
SPACING_M = 0.8
PIPE_RADIUS_M = 0.4
UNPAINTED = COLOURS["grey"]
STROLL_M = 2.5
"""Somebody who walks up and down before a house goes so far to both sides."""
STROLL_MPS = 1.1


@dataclass(frozen=True, slots=True)
class DrawnEntity:
    """Who is drawn: `number` feeds its looks, `properties` are its entity's; `kerb_m` is how far to its right the road
    ends, `pipe_m` the radius of the pipe it is on, `facing_deg` the bearing that it is drawn facing, where its
    surroundings leave it no room for its own, `served` whether what it waited for was done to it."""

    number: int
    state: BodyState
    time_s: float
    properties: Mapping[str, Datum]
    kerb_m: float = places.KERB_M
    pipe_m: float = PIPE_RADIUS_M
    facing_deg: float | None = None
    served: bool = False

    @property
    def speed_mps(self) -> float:
        """Over the ground."""
        return hypot(self.state.velocity[0], self.state.velocity[1])


Parts = tuple[ModelPart, ...]


def entity_parts(
    entity: Entity, state: BodyState, time_s: float, kerb_m: float = places.KERB_M, pipe_m: float = PIPE_RADIUS_M,
    facing_deg: float | None = None,
) -> Parts:  # fmt: skip
    """The meshes of an entity in its body's frame (x right, y ahead, z up); () for what shows itself otherwise.

    `kerb_m`, `pipe_m` and `facing_deg` are what its surroundings are (`town_changes.Site`).
    """
    look, own = look_of(entity), tuple(map(_part, entity.parts))
    if look in MODELS:
        drawn = MODELS[look](
            DrawnEntity(
                number=entity.index - 1,
                state=state,
                time_s=time_s,
                properties=entity.properties,
                kerb_m=kerb_m,
                pipe_m=pipe_m,
                facing_deg=facing_deg,
                served=entity.is_served(state.status),
            )
        )
        return (*(painted(part, _colour(entity)) for part in drawn), *own)
    if look == BARE or (own and not _measured(entity)):
        return own
    return (*_body(entity), *own)


def look_of(entity: Entity) -> str:
    """The name of the model that an entity's type declares; "" for none."""
    return str(entity.properties.get("look", ""))


def _part(part: BodyPart) -> ModelPart:
    mesh = solid(part.shape, part.length_m, part.width_m, part.height_m, COLOURS.get(part.colour, UNPAINTED))
    place = at((part.right_m, part.ahead_m, part.above_m), part.heading_deg)
    return ModelPart(f"{part.shape}-{part.length_m}-{part.width_m}-{part.height_m}-{part.colour}", mesh, place)


def _measured(entity: Entity) -> bool:
    return any(entity.number(f"{name}_m") for name in MEASURES)


def _body(entity: Entity) -> Parts:
    """The shape, size and colour that an entity declares; a metre cube without any size."""
    if not _measured(entity):
        return (painted(ModelPart("unknown", unknown()), _colour(entity)),)
    size, shape, colour = entity_size(entity), shape_of(entity), str(entity.properties.get("colour", "grey"))
    mesh = solid(shape, size.length_m, size.width_m, size.height_m, COLOURS.get(colour, UNPAINTED))
    rows = at((0.0, 0.0, 0.5 * size.height_m - sunk_m(entity)))
    return (ModelPart(f"{shape}-{size.length_m}-{size.width_m}-{size.height_m}-{colour}", mesh, rows),)


def _colour(entity: Entity) -> str:
    """What a body is to be painted; "" for a body of its model's own colours, and for what is no body."""
    return "" if solid_size(entity) is None else str(entity.properties.get("colour", ""))


def painted(part: ModelPart, colour: str) -> ModelPart:
    """A part whose paint, the colour that most of its surface has, is another one."""
    return (
        part
        if colour not in COLOURS
        else ModelPart(f"{part.key}-{colour}", repainted(part.mesh, COLOURS[colour]), part.rows)
    )


def ambient_parts(state: BodyState, time_s: float) -> Parts:
    """The meshes of a body of the background traffic, by its `kind`."""
    build = MODELS.get(state.kind, _unknown)
    return build(DrawnEntity(zlib.crc32(state.id.encode()), state, time_s, {}))


def entity_model(kind: str, index: int, time_s: float) -> tuple[str, Mesh]:
    """(key, mesh) of the `index`-th entity of a look at a time, standing still."""
    build = MODELS.get(kind, _unknown)
    parts = build(DrawnEntity(index - 1, BodyState(id=kind, position=(0.0, 0.0, 0.0)), time_s, {}))
    if len(parts) == 1:
        return parts[0].key, parts[0].mesh
    return f"{kind}-{index}", merge(*(turned(part.mesh, part.rows) for part in parts))


def prop_model(model: str, variant: int) -> tuple[str, Mesh]:
    """(key, mesh) of a prop's model."""
    if model in VARIED:
        build, count = VARIED[model]
        return f"{model}-{variant % count}", build(variant % count)
    if model in SINGLE:
        return model, SINGLE[model]()
    return "unknown", unknown()


@cache
def unknown() -> Mesh:
    """What has no model: a grey metre cube standing on its position."""
    return box((0.0, 0.0, 0.5), (1.0, 1.0, 1.0), (0.4, 0.4, 0.4))


def _unknown(who: DrawnEntity) -> Parts:
    return (ModelPart("unknown", unknown()),)


def _nothing(who: DrawnEntity) -> Parts:
    return ()


def _one(key: str, build: Callable[[], Mesh]) -> Callable[[DrawnEntity], Parts]:
    return lambda who: (ModelPart(key, build()),)


def _painted(key: str, build: Callable[[int], Mesh], count: int) -> Callable[[DrawnEntity], Parts]:
    def look(who: DrawnEntity) -> Parts:
        paint = who.number % count
        return (ModelPart(f"{key}-{paint}", build(paint)),)

    return look


def _car(who: DrawnEntity) -> Parts:
    shape = vehicles.SHAPES[who.number // 7 % len(vehicles.SHAPES)]
    paint = who.number % len(vehicles.PAINTS)
    return (ModelPart(f"car-{shape}-{paint}", vehicles.motorcar(shape, paint)),)


def _figure(look: int, pose: int, rows: Placement = HERE) -> ModelPart:
    return ModelPart(f"pedestrian-{look}-{pose}", people.pedestrian(look, pose), rows)


def _person(who: DrawnEntity) -> Parts:
    pose = people.pose_of(who.speed_mps, who.time_s, 0.37 * who.number)
    return (_figure(who.number % len(people.OUTFITS), pose),)


def _swimmer(who: DrawnEntity) -> Parts:
    look = who.number % len(sea.CLOTHES)
    pose = int((who.time_s / sea.WAVE_PERIOD_S + 0.37 * (who.number + 1)) * sea.POSES) % sea.POSES
    return (ModelPart(f"person-{look}-{pose}", sea.person(look, pose)),)


def people_in_line(given: object) -> int:
    """How many people a queue shows that is said to have so many."""
    count = int(given) if isinstance(given, int | float) else 4
    return max(0, min(count, MOST_IN_LINE))


def spacing_in_line(given: object) -> float:
    """How far apart people stand in a queue that is said to have that spacing (m)."""
    return float(given) if isinstance(given, int | float) else SPACING_M


def _queue(who: DrawnEntity) -> Parts:
    """People in a line behind the position, who sway a little."""
    turn_deg = 0.0 if who.facing_deg is None else who.facing_deg - who.state.heading_deg
    line = [ModelPart("barrier", places.crowd_barrier(), at((0.0, 0.0, 0.0), turn_deg))]
    behind = radians(turn_deg)
    spacing_m = spacing_in_line(who.properties.get("spacing_m"))
    for k in range(people_in_line(who.state.resources.get("people", who.properties.get("people", 4)))):
        look = (3 * k + who.number) % len(people.OUTFITS)
        aside = 0.12 * ((5 * k + 3 * who.number) % 7 - 3) / 3.0
        turn = turn_deg + 11.0 * ((3 * k + who.number) % 5 - 2)
        back = -spacing_m * (k + 1)
        place = aside * cos(behind) + back * sin(behind), back * cos(behind) - aside * sin(behind), 0.0
        line.append(_figure(look, people.STAND, at(place, turn)))
    return tuple(line)


def _residents(who: DrawnEntity) -> Parts:
    """Two people who talk before a house's door and one who walks up and down beside them (the paper's VDN profile)."""
    looks = [(3 * who.number + k) % len(people.OUTFITS) for k in (0, 2, 5)]
    round_m = 4.0 * STROLL_M
    gone = (STROLL_MPS * who.time_s) % round_m
    back = gone > 0.5 * round_m
    place = STROLL_M - abs(gone - 0.5 * round_m)
    pose = people.pose_of(STROLL_MPS, who.time_s, 0.0)
    return (
        _figure(looks[0], people.STAND, at((1.5, 2.4, 0.0), -66.0)),
        _figure(looks[1], people.STAND, at((0.6, 2.8, 0.0), 114.0)),
        _figure(looks[2], pose, at((place, 3.6, 0.0), -90.0 if back else 90.0)),
    )


def _leak(who: DrawnEntity) -> Parts:
    radius = round(who.pipe_m, 2)
    if who.state.status == "sealed":
        return (ModelPart(f"clamp-{radius}", places.clamp(radius)),)
    return (ModelPart(f"cracked-{radius}", places.cracked_pipe(radius)),)


def _kerbside(look: Callable[[DrawnEntity], Parts]) -> Callable[[DrawnEntity], Parts]:
    """Moved from where kerbs are by default to where this one is."""

    def moved(who: DrawnEntity) -> Parts:
        rows = at((who.kerb_m - places.KERB_M, 0.0, 0.0))
        return tuple(ModelPart(part.key, part.mesh, rows) for part in look(who))

    return moved


def _served(key: str, build: Callable[[bool], Mesh]) -> Callable[[DrawnEntity], Parts]:
    def look(who: DrawnEntity) -> Parts:
        return (ModelPart(f"{key}-{int(who.served)}", build(who.served)),)

    return look


MODELS: dict[str, Callable[[DrawnEntity], Parts]] = {
    "quadrotor": _one("quadrotor", air.quadrotor),
    "fixed_wing": _one("fixed_wing", air.fixed_wing),
    "satellite": _one("satellite", air.satellite),
    "robot_dog": lambda who: dog.dog_parts(who.state.joints),
    "car": _car,
    "taxi": _one("taxi", vehicles.taxi),
    "delivery_van": _painted("van", vehicles.van, len(vehicles.VAN_PAINTS)),
    "truck": _painted("truck", vehicles.truck, 4),
    "bus": _painted("bus", vehicles.bus, len(vehicles.BUS_PAINTS)),
    "fire_truck": _one("fire_truck", vehicles.fire_truck),
    "motorcycle": _painted("motorcycle", vehicles.motorcycle, 3),
    "bicycle": _painted("bicycle", vehicles.bicycle, 4),
    "person": _person,
    "lifeboat": _one("lifeboat", sea.lifeboat),
    "person_in_water": _swimmer,
    "building_fire": _nothing,
    "fire_source": _one("embers", places.embers),
    "pipeline_leak": _leak,
    "bridge_fracture": _nothing,
    "congestion": _nothing,
    "destination": _kerbside(_one("parking_sign", places.parking_sign)),
    "delivery_point": _kerbside(_served("parcel_station", places.parcel_station)),
    "delivery_door": _served("doorstep", places.doorstep),
    "warehouse": _kerbside(_one("dock", places.dock)),
    "reference_building": _residents,
    "queue_of_people": _queue,
}
"""Look, or kind of background traffic → its meshes."""

_PARKED: dict[str, tuple[Callable[[int], Mesh], int]] = {
    "car": (lambda v: vehicles.motorcar(vehicles.SHAPES[v % 3], v // 3), 3 * len(vehicles.PAINTS)),
    "delivery_van": (vehicles.van, len(vehicles.VAN_PAINTS)),
    "truck": (vehicles.truck, 4),
    "bus": (vehicles.bus, len(vehicles.BUS_PAINTS)),
    "motorcycle": (vehicles.motorcycle, 3),
    "person": (lambda v: people.pedestrian(v, people.STAND), len(people.OUTFITS)),
}
_PARKED |= {"parked_car": _PARKED["car"], "parked_truck": _PARKED["truck"], "parked_van": _PARKED["delivery_van"]}
VARIED = sea.VARIED | nature.VARIED | street.VARIED | _PARKED
"""Prop models that come in several looks, picked by the prop's option `variant`."""
SINGLE = sea.SINGLE | nature.SINGLE | street.SINGLE | {"taxi": vehicles.taxi, "steam_vent": street.SINGLE["steam"]}
"""Prop models of one look."""
