"""Names to models, for entities, background traffic and props.

An entity's type declares its `look`, the name of a model, and its `part`s, which are drawn with it. An entity without a
look is drawn with its declared shape, size and colour. An entity without look, size and parts is a cube of one metre,
so that an entity of a new plug-in is visible.

Random choices (colours, clothes) come from the entity's index or a hash of a body's id. Some looks have no model of
their own. `congestion` is its vehicles, a fire or spray is an effect, and a reference building is the building with
people before its door.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from math import cos, hypot, radians, sin

from lingjing.engines.bodies import shape_of
from lingjing.engines.camera.meshes import Mesh, SameMesh, box, main_colour, merge, recoloured, solid
from lingjing.engines.camera.models import air, dog, nature, people, places, sea, street, vehicles
from lingjing.engines.camera.models.shapes import ModelPart, at, turned
from lingjing.engines.camera.models.skeleton import gait
from lingjing.mission.appearance import BARE, COLOURS, MEASURES, VARIANT, LinearRgb
from lingjing.mission.instance import Datum, Entity
from lingjing.mission.model import BodyPart
from lingjing.plugins.bodies import entity_size, solid_size, sunk_m
from lingjing.scene.own_models import SHA, own_look, own_model
from lingjing.trace.records import BodyState

MOST_IN_LINE = 40
"""Most people that a queue shows (chosen)."""

SPACING_M = 0.8
"""Distance between people in a queue without a declared one, metres (chosen)."""

PIPE_RADIUS_M = 0.4
"""Radius of a pipe without a known one, metres (chosen)."""

UNPAINTED = COLOURS["grey"]
"""Colour of a body without a declared one."""

KEPT_REPAINTED = 256
"""Repainted models in memory (chosen)."""

STROLL_M = 2.5
"""Distance to both sides of a person walking up and down before a house, metres (chosen)."""
STROLL_MPS = 1.1
"""Speed of that person, m/s (chosen)."""


@dataclass(frozen=True, slots=True)
class _DrawnEntity:
    """An entity in a state, as the input of a model."""

    number: int
    """Index of the entity, which selects variants of its look."""
    state: BodyState
    """Its state."""
    time_s: float
    """Simulated time, seconds."""
    properties: Mapping[str, Datum]
    """Its properties."""
    kerb_m: float = places.KERB_M
    """Distance to its right at which its road ends, metres."""
    pipe_m: float = PIPE_RADIUS_M
    """Radius of the pipe that it is on, metres."""
    facing_deg: float | None = None
    """Heading at which it has space, degrees; None keeps its own."""
    served: bool = False
    """True if its interaction is done."""

    @property
    def speed_mps(self) -> float:
        """Speed over the ground, m/s."""
        return hypot(self.state.velocity[0], self.state.velocity[1])


Parts = tuple[ModelPart, ...]


def entity_parts(
    entity: Entity, state: BodyState, time_s: float, kerb_m: float = places.KERB_M, pipe_m: float = PIPE_RADIUS_M,
    facing_deg: float | None = None,
) -> Parts:  # fmt: skip
    """Return the meshes of an entity in its body's frame (x right, y ahead, z up); empty for looks without a model.

    `kerb_m`, `pipe_m` and `facing_deg` are its surroundings (`town_changes.Site`).
    """
    look, own = look_of(entity), tuple(map(_part, entity.parts))
    if own_look(entity):
        return (painted(_own_part(entity), _colour(entity)), *own)
    if look in MODELS:
        drawn = MODELS[look](
            _DrawnEntity(
                number=variant_of(entity, entity.index - 1),
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
    """Return the name of the model that an entity's type declares; empty if there is none."""
    return str(entity.properties.get("look", ""))


def variant_of(entity: Entity, otherwise: int) -> int:
    """Return the number of the variant of an entity's look: the declared one, else the given one."""
    value = entity.properties.get(VARIANT)
    return int(value) if isinstance(value, float) else otherwise


def _own_part(entity: Entity) -> ModelPart:
    """Return the model in a file of the entity's own, with its base where its body has it."""
    levels = own_model(own_look(entity), str(entity.properties.get(SHA, ""))).levels
    return ModelPart(f"own-{entity.properties.get(SHA)}", levels[0], at((0.0, 0.0, -sunk_m(entity))), levels[1:])


def _part(part: BodyPart) -> ModelPart:
    mesh = solid(part.shape, part.length_m, part.width_m, part.height_m, COLOURS.get(part.colour, UNPAINTED))
    if part.glow:
        mesh = mesh.copy()  # bodies of equal measures share the mesh
        mesh[:, 9] = -part.glow
    place = at((part.right_m, part.ahead_m, part.above_m), part.heading_deg)
    key = f"{part.shape}-{part.length_m}-{part.width_m}-{part.height_m}-{part.colour}-{part.glow}"
    return ModelPart(key, mesh, place)


def _measured(entity: Entity) -> bool:
    return any(entity.number(f"{name}_m") for name in MEASURES)


def _body(entity: Entity) -> Parts:
    """Return the shape, size and colour that an entity declares; a cube of one metre without any size."""
    if not _measured(entity):
        return (painted(ModelPart("unknown", unknown()), _colour(entity)),)
    size, shape, colour = entity_size(entity), shape_of(entity), str(entity.properties.get("colour", "grey"))
    mesh = solid(shape, size.length_m, size.width_m, size.height_m, COLOURS.get(colour, UNPAINTED))
    rows = at((0.0, 0.0, 0.5 * size.height_m - sunk_m(entity)))
    return (ModelPart(f"{shape}-{size.length_m}-{size.width_m}-{size.height_m}-{colour}", mesh, rows),)


def _colour(entity: Entity) -> str:
    """Return the declared colour of a body; empty for the model's own colours and for entities without a body."""
    return "" if solid_size(entity) is None else str(entity.properties.get("colour", ""))


def painted(part: ModelPart, colour: str) -> ModelPart:
    """Return a part with the colour that covers most of its surface replaced, at all levels of detail."""
    if colour not in COLOURS:
        return part
    levels = _repainted(f"{part.key}-{colour}", COLOURS[colour], SameMesh(part.levels))
    return ModelPart(f"{part.key}-{colour}", levels[0], part.rows, levels[1:])


@lru_cache(maxsize=KEPT_REPAINTED)
def _repainted(name: str, colour: LinearRgb, of: SameMesh) -> tuple[Mesh, ...]:
    old = main_colour(of.levels[0])
    return tuple(recoloured(mesh, old, colour) for mesh in of.levels)


def ambient_parts(state: BodyState, time_s: float) -> Parts:
    """Return the meshes of a body of background traffic, by its `kind`."""
    build = MODELS.get(state.kind, _unknown)
    return build(_DrawnEntity(zlib.crc32(state.id.encode()), state, time_s, {}))


def entity_model(kind: str, index: int, time_s: float) -> tuple[str, Mesh]:
    """Return (key, mesh) of the `index`-th entity of a look at a time, at rest."""
    build = MODELS.get(kind, _unknown)
    parts = build(_DrawnEntity(index - 1, BodyState(id=kind, position=(0.0, 0.0, 0.0)), time_s, {}))
    if len(parts) == 1:
        return parts[0].key, parts[0].mesh
    return f"{kind}-{index}", merge(*(turned(part.mesh, part.rows) for part in parts))


def prop_part(model: str, variant: int) -> ModelPart:
    """Return the model of a prop."""
    if model in PARKED:
        look = vehicles.LOOKS[PARKED[model]]
        return vehicles.vehicle(PARKED[model], variant % look.count)
    if model == "person":
        return people.on_foot(variant, people.STANDING[variant % len(people.STANDING)])
    if model in VARIED:
        build, count = VARIED[model]
        levels = nature.coarser(model, variant % count) if model in nature.VARIED else ()
        return ModelPart(f"{model}-{variant % count}", build(variant % count), coarser=levels)
    if model in SINGLE:
        return ModelPart(model, SINGLE[model]())
    return ModelPart("unknown", unknown())


def prop_model(model: str, variant: int) -> tuple[str, Mesh]:
    """Return (key, mesh) of a prop's model at its finest level of detail."""
    part = prop_part(model, variant)
    return part.key, part.mesh


@cache
def unknown() -> Mesh:
    """Return the model of an unknown look: a grey cube of one metre that stands on its position."""
    return box((0.0, 0.0, 0.5), (1.0, 1.0, 1.0), (0.4, 0.4, 0.4))


def _unknown(drawn: _DrawnEntity) -> Parts:
    return (ModelPart("unknown", unknown()),)


def _nothing(drawn: _DrawnEntity) -> Parts:
    return ()


def _single(key: str, build: Callable[[], Mesh]) -> Callable[[_DrawnEntity], Parts]:
    return lambda drawn: (ModelPart(key, build()),)


def _vehicle(name: str) -> Callable[[_DrawnEntity], Parts]:
    return lambda drawn: (vehicles.vehicle(name, drawn.number),)


def _person(drawn: _DrawnEntity) -> Parts:
    state = drawn.state
    pose = people.pose_on_foot(drawn.number, state.status, drawn.speed_mps, state.position, state.heading_deg)
    return (people.on_foot(drawn.number, pose),)


def _swimmer(drawn: _DrawnEntity) -> Parts:
    return (people.in_water(drawn.number, drawn.time_s),)


def people_in_line(people: object) -> int:
    """Return the number of people that a queue shows for a declared number."""
    count = int(people) if isinstance(people, int | float) else 4
    return max(0, min(count, MOST_IN_LINE))


def spacing_in_line(spacing_m: object) -> float:
    """Return the distance between people of a queue for a declared one, metres."""
    return float(spacing_m) if isinstance(spacing_m, int | float) else SPACING_M


def _queue(drawn: _DrawnEntity) -> Parts:
    """Return people in a line behind the position; they sway a little."""
    turn_deg = 0.0 if drawn.facing_deg is None else drawn.facing_deg - drawn.state.heading_deg
    line = [ModelPart("barrier", places.crowd_barrier(), at((0.0, 0.0, 0.0), turn_deg))]
    behind = radians(turn_deg)
    spacing_m = spacing_in_line(drawn.properties.get("spacing_m"))
    for k in range(people_in_line(drawn.state.resources.get("people", drawn.properties.get("people", 4)))):
        look = 5 * k + drawn.number
        aside = 0.12 * ((5 * k + 3 * drawn.number) % 7 - 3) / 3.0
        turn = turn_deg + 11.0 * ((3 * k + drawn.number) % 5 - 2)
        back = -spacing_m * (k + 1)
        place = aside * cos(behind) + back * sin(behind), back * cos(behind) - aside * sin(behind), 0.0
        line.append(people.on_foot(look, people.STANDING[k % len(people.STANDING)], at(place, turn)))
    return tuple(line)


def _residents(drawn: _DrawnEntity) -> Parts:
    """Return two people in conversation at a house's door, and one walking beside them (the paper's VDN profile)."""
    looks = [3 * drawn.number + k for k in (0, 4, 9)]
    round_m = 4.0 * STROLL_M
    walked = (STROLL_MPS * drawn.time_s) % round_m
    back = walked > 0.5 * round_m
    place = STROLL_M - abs(walked - 0.5 * round_m)
    return (
        people.on_foot(looks[0], "stand-1", at((1.5, 2.4, 0.0), -66.0)),
        people.on_foot(looks[1], "stand-0", at((0.6, 2.8, 0.0), 114.0)),
        people.on_foot(looks[2], gait(STROLL_MPS, walked), at((place, 3.6, 0.0), -90.0 if back else 90.0)),
    )


def _leak(drawn: _DrawnEntity) -> Parts:
    radius = round(drawn.pipe_m, 2)
    if drawn.state.status == "sealed":
        return (ModelPart(f"clamp-{radius}", places.clamp(radius)),)
    return (ModelPart(f"cracked-{radius}", places.cracked_pipe(radius)),)


def _kerbside(look: Callable[[_DrawnEntity], Parts]) -> Callable[[_DrawnEntity], Parts]:
    """Return a function that moves a model from the default kerb to the kerb of its road."""

    def moved(drawn: _DrawnEntity) -> Parts:
        rows = at((drawn.kerb_m - places.KERB_M, 0.0, 0.0))
        return tuple(ModelPart(part.key, part.mesh, rows, part.coarser) for part in look(drawn))

    return moved


def _served(key: str, build: Callable[[bool], Mesh]) -> Callable[[_DrawnEntity], Parts]:
    def look(drawn: _DrawnEntity) -> Parts:
        return (ModelPart(f"{key}-{int(drawn.served)}", build(drawn.served)),)

    return look


MODELS: dict[str, Callable[[_DrawnEntity], Parts]] = {
    "quadrotor": _single("quadrotor", air.quadrotor),
    "fixed_wing": _single("fixed_wing", air.fixed_wing),
    "satellite": _single("satellite", air.satellite),
    "robot_dog": lambda drawn: dog.dog_parts(drawn.state.joints),
    **{name: _vehicle(name) for name in vehicles.LOOKS},
    "person": _person,
    "lifeboat": _single("lifeboat", sea.lifeboat),
    "person_in_water": _swimmer,
    "building_fire": _nothing,
    "fire_source": _single("embers", places.embers),
    "pipeline_leak": _leak,
    "bridge_fracture": _nothing,
    "congestion": _nothing,
    "destination": _kerbside(_single("parking_sign", places.parking_sign)),
    "delivery_point": _kerbside(_served("parcel_station", places.parcel_station)),
    "delivery_door": _served("doorstep", places.doorstep),
    "warehouse": _kerbside(_single("dock", places.dock)),
    "reference_building": _residents,
    "queue_of_people": _queue,
}
"""Functions that build the meshes of each look and of each kind of background traffic."""

PARKED = {name: name for name in vehicles.LOOKS}
PARKED |= {"parked_car": "car", "parked_truck": "truck", "parked_van": "delivery_van"}
"""Prop models of vehicles, with their looks; the prop's option `variant` selects one of the variants."""
VARIED = sea.VARIED | nature.VARIED | street.VARIED
"""Other prop models with several variants, which the prop's option `variant` selects."""
SINGLE = sea.SINGLE | nature.SINGLE | street.SINGLE | {"steam_vent": street.SINGLE["steam"]}
"""Prop models without variants."""
