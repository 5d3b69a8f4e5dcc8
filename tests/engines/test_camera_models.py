"""Models, effects and changes of a city by targets, without pictures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lingjing.engines.camera.classes import entity_class
from lingjing.engines.camera.effects import (
    Effects,
    Site,
    changes_of,
    effects_of,
    prop_effects,
    site_of,
)
from lingjing.engines.camera.effects.town_changes import facing_building, split, with_change
from lingjing.engines.camera.meshes import indexed
from lingjing.engines.camera.models import (
    MODELS,
    PARKED,
    ambient_parts,
    entity_model,
    entity_parts,
    look_of,
    prop_model,
)  # fmt: skip
from lingjing.engines.camera.models.catalogue import SINGLE, VARIED
from lingjing.engines.camera.models.dog import STANDING, STANDING_M, dog_parts
from lingjing.engines.camera.models.shapes import turned
from lingjing.mission import appearance
from lingjing.mission.appearance import COLOURS
from lingjing.mission.instance import Entity, Weather
from lingjing.plugins.bodies import entity_size
from lingjing.scene.city import Bridge, Building, Lane, Pieces, Pipe, Prop, Road, Solid, Tile
from lingjing.scene.sizes import SIZES
from lingjing.testing import declared
from lingjing.testing.declarations import BodyPart
from lingjing.testing.engines import library_types
from lingjing.trace.records import BodyState
from tests.engines.camera_town import CLASSES

TYPES = sorted(library_types())
CALM = Weather(wind_mps=3.0, wind_from_deg=220.0)
MOST = {
    "robot_dog": 2000,
    "person": 3000,
    "person_in_water": 3000,
    "street_tree": 700,
    "poplar": 400,
    "birch": 400,
    "conifer": 260,
}
MOST |= dict.fromkeys(PARKED, 4000) | dict.fromkeys(("queue_of_people", "reference_building"), 15_000)
UNBODIED = {"building_fire", "bridge_fracture", "congestion"}


def thing(kind: str, place: tuple[float, float, float] = (0.0, 0.0, 0.0), **more: object) -> Entity:
    return declared(
        Entity(id=f"{kind}[2]", group=kind, index=2, role="target", type=kind, engine="city", position=place, **more)
    )  # type: ignore[arg-type]


def state(entity: Entity, **more: object) -> BodyState:
    return BodyState(id=entity.id, position=entity.position, heading_deg=entity.heading_deg, **more)  # type: ignore[arg-type]


def looks(entity: Entity, time_s: float = 20.0, site: Site | None = None, **more: object) -> Effects:
    return effects_of(entity, state(entity, **more), time_s, CALM, site or Site())


@pytest.mark.parametrize("name", TYPES)
def test_every_type_of_the_library_has_a_look_and_a_class(name: str) -> None:
    entity = thing(name)
    kind = look_of(entity)
    parts, effects = entity_parts(entity, state(entity), 3.0), looks(entity)
    if kind == "none":  # a place in the air has no look; a rival has the parts that its type declares
        assert len(parts) == len(entity.parts) and not len(effects.billboards) and not effects.solids
        return
    assert kind in MODELS and "unknown" not in {part.key for part in parts}
    assert parts or len(effects.billboards) or effects.solids or kind == "congestion"
    assert (not parts) == (kind in UNBODIED)
    assert entity_class(entity) == CLASSES[kind] != CLASSES["entity"]


def test_a_user_defined_type_has_the_look_that_it_declares() -> None:
    taxi = thing("my_taxi", properties={"look": "car"})
    assert entity_parts(taxi, state(taxi), 0.0)[0].key.startswith("car-") and entity_class(taxi) == CLASSES["car"]
    blaze = thing("warehouse_fire", properties={"look": "building_fire"})
    assert len(looks(blaze).billboards) > 50
    cube = thing("contraption")
    assert entity_parts(cube, state(cube), 0.0)[0].key == "unknown" and entity_class(cube) == CLASSES["entity"]
    assert entity_parts(thing("idea", properties={"look": "none"}), state(cube), 0.0) == ()


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "cone"])
def test_a_type_without_a_look_is_the_shape_size_and_colour_it_declares(shape: str) -> None:
    declared_body: dict[str, object] = {
        "length_m": 6.0,
        "width_m": 4.0,
        "height_m": 3.0,
        "shape": shape,
        "colour": "red",
    }
    for origin, low in (("base", 0.0), ("middle", -1.5)):
        balloon = thing("balloon", properties={**declared_body, "origin": origin})
        (part,) = entity_parts(balloon, state(balloon), 0.0)
        mesh = turned(part.mesh, part.rows)
        assert np.ptp(mesh[:, :3], axis=0) == pytest.approx([4.0, 6.0, 3.0], abs=0.08)
        assert mesh[:, 2].min() == pytest.approx(low, abs=1e-5)
        assert np.allclose(np.linalg.norm(mesh[:, 3:6], axis=1), 1.0, atol=1e-3)
        assert np.allclose(mesh[:, 6:9], COLOURS["red"])


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "cone"])
@pytest.mark.parametrize("measure", [1e-7, 1e-3])
def test_the_smallest_body_has_faces_to_draw(shape: str, measure: float) -> None:
    speck = BodyPart(name="speck", shape=shape, length_m=measure, width_m=measure, height_m=measure)  # type: ignore[arg-type]
    sizes = {"length_m": measure, "width_m": measure, "height_m": measure, "shape": shape}
    for drawn in entity_parts(thing("mote", parts=(speck,), properties=sizes), state(thing("mote")), 0.0):
        vertices, _ = indexed(drawn.mesh)
        assert len(vertices) and np.isfinite(vertices).all()


def test_a_part_that_glows_has_light_of_its_own_and_a_mesh_of_its_own() -> None:
    sizes: dict[str, Any] = {"name": "lamp", "shape": "sphere", "length_m": 1.0, "width_m": 1.0, "height_m": 1.0}
    parts = BodyPart(**sizes), BodyPart(**sizes, glow=0.4)
    dull, bright = entity_parts(thing("lamps", parts=parts, properties={"look": "none"}), state(thing("lamps")), 0.0)
    assert dull.key != bright.key
    assert (dull.mesh[:, 9] == 0.0).all() and np.allclose(bright.mesh[:, 9], -0.4)


def test_parts_of_a_type_are_drawn_at_their_declared_place_beside_its_look() -> None:
    crate = BodyPart(name="crate", shape="box", length_m=2.0, width_m=1.0, height_m=0.5, ahead_m=3.0, right_m=-1.0,
                     above_m=4.0, heading_deg=90.0, colour="blue")  # fmt: skip
    measures = {"length_m": 9.0, "width_m": 9.0, "height_m": 9.0}
    alone = thing("frame", parts=(crate,), properties={**measures, "look": "none"})
    (part,) = entity_parts(alone, state(alone), 0.0)
    assert [p.key for p in entity_parts(thing("stand", parts=(crate,)), state(alone), 0.0)] == [part.key]
    shown = entity_parts(thing("hall", parts=(crate,), properties=measures), state(alone), 0.0)
    assert [p.key for p in shown] == ["box-9.0-9.0-9.0-grey", part.key]
    mesh = turned(part.mesh, part.rows)[:, :3]
    assert mesh.min(axis=0) == pytest.approx([-2.0, 2.5, 3.75]) and mesh.max(axis=0) == pytest.approx([0.0, 3.5, 4.25])
    carried = thing("crane", parts=(crate,), properties={"look": "truck"})
    assert len(entity_parts(carried, state(carried), 0.0)) == 2


def test_a_declared_colour_paints_a_vehicle_but_not_a_reference_building() -> None:
    plain, red = (declared_car(colour) for colour in ("", "red"))
    (was,), (now,) = (entity_parts(car, state(car), 0.0) for car in (plain, red))
    changed = (was.mesh[:, 6:9] != now.mesh[:, 6:9]).any(axis=1)
    assert was.key != now.key and 0.2 < changed.mean() < 0.9
    assert np.allclose(now.mesh[changed, 6:9], COLOURS["red"])
    house = thing("reference_building", properties={"colour": "red"})
    assert [p.key for p in entity_parts(house, state(house), 0.0)] == [
        p.key for p in entity_parts(thing("reference_building"), state(house), 0.0)
    ]


def declared_car(colour: str) -> Entity:
    return thing("car", properties={"colour": colour} if colour else {})


def test_missions_may_name_exactly_the_looks_that_are_drawn() -> None:
    assert sorted(MODELS) == sorted(appearance.MODELS)


def test_kinds_of_traffic_are_as_large_as_the_types_of_that_name() -> None:
    for kind in SIZES.keys() & library_types().keys():
        assert entity_size(thing(kind)) == SIZES[kind], kind


@pytest.mark.parametrize("name", [*MODELS, *VARIED, *SINGLE, *PARKED, "person"])
def test_meshes_are_whole_and_small(name: str) -> None:
    mesh = entity_model(name, 1, 0.0)[1] if name in MODELS and name not in UNBODIED else prop_model(name, 1)[1]
    assert len(mesh) % 3 == 0 and len(mesh) > 0 and np.isfinite(mesh).all()
    assert np.allclose(np.linalg.norm(mesh[:, 3:6], axis=1), 1.0, atol=1e-3)
    assert (mesh[:, 6:9] >= 0.0).all() and (mesh[:, 6:9] <= 0.95).all()
    assert len(mesh) // 3 <= MOST.get(name, 2000)


@pytest.mark.parametrize(
    "kind", ["car", "delivery_van", "truck", "bus", "fire_truck", "motorcycle", "bicycle", "person"]
)
def test_traffic_is_drawn_in_the_size_that_engines_use(kind: str) -> None:
    size = SIZES[kind]
    for number in range(6):
        (part,) = ambient_parts(BodyState(id=f"traffic/{number}", kind=kind, position=(0.0, 0.0, 0.0)), 0.0)
        extent = np.ptp(part.mesh[:, :3], axis=0)
        assert abs(extent[1] - size.length_m) < 0.25 * size.length_m + 0.1
        assert abs(extent[2] - size.height_m) < 0.22 * size.height_m and part.mesh[:, 2].min() > -0.05
        assert extent[0] < 1.35 * size.width_m + 0.1


def test_background_traffic_comes_in_many_colours_and_keeps_them() -> None:
    states = [BodyState(id=f"traffic/{n}", kind="car", position=(0.0, 0.0, 0.0)) for n in range(40)]
    keys = [ambient_parts(body, 0.0)[0].key for body in states]
    assert len(set(keys)) > 8 and keys == [ambient_parts(body, 50.0)[0].key for body in states]


def test_a_dogs_feet_follow_its_joints() -> None:
    def feet(joints: tuple[float, ...]) -> np.ndarray:
        parts = [part for part in dog_parts(joints) if part.key == "dog-calf"]
        return np.array([turned(part.mesh, part.rows)[:, :3].min(axis=0)[2] for part in parts])

    assert np.allclose(feet(()), 0.0, atol=0.01)
    assert np.allclose(feet(STANDING), -STANDING_M, atol=0.01)
    straight = feet((0.0, 0.0, 0.0) * 4)
    assert np.allclose(straight, -0.449, atol=0.01)
    raised = feet((0.0, 1.6, -2.5, *STANDING[3:]))
    assert raised[0] > feet(STANDING)[0] + 0.03 and np.allclose(raised[1:], feet(STANDING)[1:])
    calves = [part.rows[:, 3] for part in dog_parts((0.5, 0.9, -1.8) * 4) if part.key == "dog-calf"]
    assert calves[0][0] < 0.0 < calves[1][0] and calves[0][1] > 0.0 > calves[2][1]


def test_effects_depend_on_the_id_the_time_and_nothing_else() -> None:
    fire = thing("building_fire", (5.0, 6.0, 20.0))
    again, later, other = looks(fire), looks(fire, 20.4), looks(thing("building_fire", (5.0, 6.0, 20.0)), 20.0)
    assert looks(fire).billboards.tobytes() == again.billboards.tobytes() == other.billboards.tobytes()
    assert later.billboards.tobytes() != again.billboards.tobytes()
    neighbour = looks(
        declared(
            Entity(
                id="fire[3]",
                group="fire",
                index=3,
                role="target",
                type="building_fire",
                engine="city",
                position=(5.0, 6.0, 20.0),
            )
        )
    )
    assert neighbour.billboards.tobytes() != again.billboards.tobytes()


@pytest.mark.parametrize("kind", ["building_fire", "fire_source", "pipeline_leak"])
def test_only_flames_and_spray_carry_the_id_of_the_target(kind: str) -> None:
    rows = looks(thing(kind, (0.0, 0.0, 1.0))).billboards
    body, cloud = rows[rows["id"] > 0], rows[rows["id"] == 0]
    assert len(body) > 20 and len(cloud) > 20
    reach = {"building_fire": 6.0, "fire_source": 1.5, "pipeline_leak": 7.5}[kind]
    assert np.linalg.norm(body["place"][:, :2], axis=1).max() < reach
    assert (body["alpha"] == 1.0).all() and (cloud["alpha"] < 0.8).all()
    assert (rows["colour"] <= 0.8).all()


def test_fires_shrink_with_their_heat_and_smoke_goes_with_the_wind() -> None:
    fire = thing("building_fire")
    full, low, out = looks(fire), looks(fire, resources={"heat": 0.2}), looks(fire, status="out")
    assert len(full.billboards) > len(low.billboards) > len(out.billboards) > 0
    assert (out.billboards["id"] == 0).all() and (out.billboards["glow"] == 0.0).all() and len(out.decals) == 1
    smoke = full.billboards[(full.billboards["id"] == 0) & (full.billboards["glow"] == 0.0)]
    assert smoke["place"][:, 0].mean() > 5.0 and smoke["place"][:, 1].mean() > 5.0, "wind from the south-west"


def test_a_sealed_leak_leaves_wet_ground_and_a_clamp() -> None:
    leak = thing("pipeline_leak", (0.0, 0.0, 1.2))
    sealed = looks(leak, status="sealed")
    assert len(sealed.billboards) == 0 and len(sealed.decals) == 2
    assert entity_parts(leak, state(leak, status="sealed"), 0.0)[0].key.startswith("clamp")
    spray = looks(leak, site=Site(heading_deg=90.0)).billboards
    body = spray[spray["id"] > 0]["place"]
    assert np.ptp(body[:, 1]) > 2.0 * np.ptp(body[:, 0]), "the jet leaves a pipe that runs east to its side"
    assert body[:, 2].min() > -0.1


def test_lights_flash_and_vents_steam() -> None:
    truck = thing("fire_truck")
    flashes = {looks(truck, 0.1 * k).billboards["place"][:, 0].tobytes() for k in range(10)}
    assert len(flashes) == 2
    vent = Prop(id="v", cls="steam_vent", model="steam_vent", position=(3.0, 4.0, 0.0))
    steam = prop_effects(vent, 7.0, CALM)
    assert len(steam.billboards) > 10 and (steam.billboards["id"] == 0).all()
    assert len(prop_effects(Prop(id="b", cls="bench", model="bench", position=(0, 0, 0)), 7.0, CALM).billboards) == 0


PATH = ((0.0, 0.0, 8.0), (100.0, 0.0, 8.0), (200.0, 0.0, 12.0))
LANE = Lane(id="a_0", shape=((0.0, -3.0, 8.0), (200.0, -3.0, 12.0)), width_m=3.2)
SPAN = Pieces(
    bridges=(Bridge(id="b", path=PATH, width_m=14.0),),
    roads=(Road(id="a", lanes=(LANE,), bridge=True), Road(id="street", lanes=(LANE,))),
)
BREAK = thing("bridge_fracture", (120.0, 2.0, 0.0), properties={"width_m": 8.0})


def test_a_path_is_split_about_a_point() -> None:
    left, right = split(PATH, 120.0, 2.0, 8.0)
    assert left[0] == PATH[0] and right[-1] == PATH[-1]
    assert np.allclose(left[-1], (116.0, 0.0, 8.64)) and np.allclose(right[0], (124.0, 0.0, 8.96))
    assert [len(part) for part in split(PATH, -5.0, 0.0, 8.0)] == [0, 3]


def test_a_fracture_cuts_the_bridge_and_its_lanes() -> None:
    cut = with_change(SPAN, BREAK, (), site_of(BREAK, [SPAN], 0.0))
    assert [bridge.path[0][0] for bridge in cut.bridges] == pytest.approx([0.0, 124.0])
    spans = [road for road in cut.roads if road.bridge]
    assert len(spans) == 2 and spans[0].lanes[0].shape[-1][0] == pytest.approx(116.0)
    assert cut.roads[-1] == SPAN.roads[1], "a street under the bridge stays whole"
    far = thing("bridge_fracture", (120.0, 400.0, 0.0))
    assert with_change(SPAN, far, (), site_of(far, [SPAN], 0.0)) is SPAN


def test_a_fracture_cuts_the_railings_on_its_deck() -> None:
    rails = tuple(
        Solid(id=f"rail-{z:g}", polygon=((60, 6.8), (190, 6.8), (190, 7.0), (60, 7.0)), base_m=z, top_m=z + 1.0)
        for z in (8.8, 0.0)
    )
    tile = Tile(key=(0, 0), bridges=SPAN.bridges)
    other = Tile(key=(0, 1), solids=rails)
    made = changes_of(lambda x, y, radius: (tile, other), lambda x, y: 0.0, [BREAK])
    parts = made.tiles[(0, 1)].solids
    assert [solid.id for solid in parts] == ["rail-8.8-a", "rail-8.8-b", "rail-0"]
    assert max(x for x, _ in parts[0].polygon) == pytest.approx(116.0)
    assert min(x for x, _ in parts[1].polygon) == pytest.approx(124.0)


def test_rubble_fits_the_deck_that_it_fell_from() -> None:
    site = site_of(BREAK, [SPAN], ground_m=0.0)
    assert site.heading_deg == pytest.approx(90.0) and site.width_m == 14.0 and site.deck_m == pytest.approx(8.8)
    (solid,) = looks(BREAK, site=site).solids
    points = turned(solid.mesh, solid.rows)[:, :3]
    assert points[:, 2].min() < 0.8 and 8.5 < points[:, 2].max() < 9.3
    assert 111.0 < points[:, 0].min() < 117.0 and 123.0 < points[:, 0].max() < 129.0
    assert np.ptp(points[:, 1]) < 17.0


def test_a_leak_has_the_heading_and_radius_of_its_pipe() -> None:
    pipes = Pieces(pipes=(Pipe(id="p", path=((0, 0, 1.2), (0, 50, 1.2)), radius_m=0.25),))
    site = site_of(thing("pipeline_leak", (0.2, 20.0, 1.2)), [pipes], 0.0)
    assert site.heading_deg == pytest.approx(0.0) and site.radius_m == 0.25


def test_signs_stand_at_the_kerb_whatever_the_lane() -> None:
    def lane(index: int) -> Lane:
        return Lane(id=f"e_{index}", shape=((3.2 * -index, 0.0, 0.0), (3.2 * -index, 90.0, 0.0)), width_m=3.2)

    street = Pieces(roads=(Road(id="e", lanes=(lane(0), lane(1))),))
    outer, inner = (thing("destination", (x, 40.0, 0.0), properties={"on": "road"}) for x in (0.0, -3.2))
    edges = []
    for entity in (outer, inner):
        site = site_of(entity, [street], 0.0)
        (part,) = entity_parts(entity, state(entity), 0.0, site.kerb_m)
        edges.append(entity.position[0] + turned(part.mesh, part.rows)[:, 0].min())
    assert edges[0] == pytest.approx(edges[1], abs=1e-5) and edges[0] > 1.6


def test_the_reference_building_is_painted_and_named() -> None:
    def house(name: str, x: float) -> Building:
        return Building(id=name, polygon=((x, 0), (x + 10, 0), (x + 10, 10), (x, 10)), base_m=0.0, top_m=9.0)

    tile = Tile(key=(0, 0), buildings=(house("near", 0.0), house("far", 30.0)))
    home = thing("reference_building", (5.0, -3.0, 0.0), properties={"colour": "red"})
    changed = with_change(tile, home, facing_building(tile.buildings, home), Site(0.0))
    assert changed.buildings[1] == tile.buildings[1] and changed.buildings[0].colour[0] > changed.buildings[0].colour[1]
    assert facing_building(tile.buildings, home) == ("near",)
    anchored = thing("reference_building", (5.0, -3.0, 0.0), properties={"colour": "red", "building": "far"})
    assert facing_building(tile.buildings, anchored) == ("far",)
    made = changes_of(lambda x, y, radius: (tile,), lambda x, y: 0.0, [BREAK, home])
    assert (
        made.entity_buildings == {"near": 1} and set(made.tiles) == {(0, 0)} and set(made.sites) == {BREAK.id, home.id}
    )
