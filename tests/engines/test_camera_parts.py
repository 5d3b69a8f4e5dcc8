"""The parts of the camera that need no GL: the sea, the ground, the id buffer, the models."""

import importlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from lingjing.engines.camera.boxes import LEAST_PIXELS, THINGS, all_boxes, entity_boxes, other_boxes
from lingjing.engines.camera.classes import FIRST_ENTITY
from lingjing.engines.camera.ground import build_ground, height_under
from lingjing.engines.camera.instances import DrawnPart, by_detail, entity_batches, in_sight, matrix, mesh_radius
from lingjing.engines.camera.mesh_chunks import CHUNK, chunks_of
from lingjing.engines.camera.meshes import indexed
from lingjing.engines.camera.models import (
    CLOTHES,
    LOOKS,
    POSES,
    WAVES,
    entity_model,
    figures,
    in_water,
    on_foot,
    painted,
    pose_on_foot,
    posed,
    prop_model,
    prop_part,
    skin,
    vehicle,
)  # fmt: skip
from lingjing.engines.camera.noise import lace_texture, noise_texture
from lingjing.engines.camera.ocean import SIZE, Ocean
from lingjing.mission.instance import Entity, SceneSpec, Weather
from lingjing.plugins.geometry import world_to_pixel
from lingjing.testing import city_of
from lingjing.trace.records import CameraPose
from tests.engines.camera_town import CLASSES

TOOLS = Path(__file__).parents[2] / "tools"
PEOPLE = 24
"""People on foot that differ."""
STORED = tuple(LOOKS)
CYCLES = ("motorcycle", "bicycle")

BAY = city_of(SceneSpec(kind="bay", datum_m=-3.5, seed=7))


@pytest.mark.parametrize("height", [0.0, 0.2, 0.8, 2.0])
def test_the_significant_wave_height_is_that_of_the_weather(height: float) -> None:
    ocean = Ocean(Weather(wind_mps=5, wave_height_m=height, wave_period_s=5), 1)
    height_of_sea = np.mean([4.0 * ocean.surfaces(10.0 * k)[0].height.std() for k in range(6)])
    assert abs(height_of_sea - height) < 0.06 * height + 1e-9


def test_slopes_are_the_gradient_of_the_height() -> None:
    swell = Ocean(Weather(wave_height_m=1.0, wave_period_s=9.0), 1).surfaces(3.0)[0]
    step = swell.length_m / SIZE
    east = (np.roll(swell.height, -1, axis=1) - np.roll(swell.height, 1, axis=1)) / (2 * step)
    north = (np.roll(swell.height, -1, axis=0) - np.roll(swell.height, 1, axis=0)) / (2 * step)
    assert np.corrcoef(east.ravel(), swell.slope_x.ravel())[0, 1] > 0.99
    assert np.corrcoef(north.ravel(), swell.slope_y.ravel())[0, 1] > 0.99


def test_waves_travel_downwind() -> None:
    ocean = Ocean(Weather(wave_height_m=1.0, wave_period_s=6.0, wind_from_deg=270.0), 2)
    now, later = ocean.surfaces(0.0)[0].height, ocean.surfaces(0.25)[0].height
    match = {shift: float((np.roll(now, shift, axis=1) * later).sum()) for shift in (-4, 4)}
    assert match[4] > match[-4]


def test_sea_is_a_function_of_weather_seed_and_time() -> None:
    weather = Weather(wave_height_m=0.5, wind_mps=12)
    a, b = Ocean(weather, 1), Ocean(weather, 1)
    b.surfaces(99.0)
    assert np.array_equal(a.surfaces(5.0)[0].height, b.surfaces(5.0)[0].height)
    assert not np.array_equal(a.surfaces(5.0)[0].height, Ocean(weather, 2).surfaces(5.0)[0].height)


def test_whitecaps_grow_with_the_wind() -> None:
    cover = [Ocean(Weather(wave_height_m=0.5, wind_mps=u), 1).surfaces(5.0)[0].foam.mean() for u in (0, 6, 12)]
    assert cover[0] == 0.0 and cover[0] < cover[1] < cover[2] < 0.1


def test_ground_keeps_the_citys_elevations() -> None:
    ground = build_ground(BAY, noise_texture()[::4, ::4, 0])
    assert ground.level_m == -3.5
    by_class = {surface.cls: surface for surface in ground.surfaces}
    assert by_class[CLASSES["concrete"]].vertices[:, 2].max() == np.float32(0.9)
    for surface in ground.surfaces:
        assert surface.patches and max(p.triangles.max() for p in surface.patches) < len(surface.vertices)
    sand = by_class[CLASSES["sand"]].vertices
    assert sand[:, 2].min() < -3.5 < sand[:, 2].max()
    assert height_under(BAY, 306.6, -620.2) == 0.9 and height_under(BAY, 200.0, -900.0) == -3.5


def test_the_shore_map_distinguishes_land_and_sea() -> None:
    shore = build_ground(BAY, noise_texture()[::4, ::4, 0]).shore

    def near(east: float, north: float) -> int:
        return int(shore[int((north + 3000) / 6000 * 1024), int((east + 3000) / 6000 * 1024), 0])

    assert near(300, -560) == 0 and near(0, -1300) == 255 and 0 < near(300, -700) < 255


def test_the_edge_of_the_shore_map_shows_no_shore() -> None:
    """Pictures repeat the edge of the map beyond the bounds."""
    town = city_of(SceneSpec(kind="coastal", seed=11, options={"extent_m": 500.0}, datum_m=-3.0))
    near = build_ground(town, noise_texture()[::4, ::4, 0]).shore[..., 0]
    assert (near[1:-1, 1:-1] < 255).any()  # the town has a shore, and it leaves the bounds
    assert (near[0] == 255).all() and (near[-1] == 255).all() and (near[:, [0, -1]] == 255).all()


def test_textures_are_seamless_and_constant() -> None:
    noise = noise_texture()
    assert np.array_equal(noise, noise_texture()) and noise.shape == (256, 256, 4)
    smooth = noise[..., 0].astype(int)
    assert np.abs(smooth[:, 0] - smooth[:, -1]).max() <= np.abs(np.diff(smooth, axis=1)).max()
    assert 100 < lace_texture().mean() < 155


def test_models_have_unit_normals_and_sane_sizes() -> None:
    meshes = [prop_model(p.model, k)[1] for p in BAY.props[:400] for k in (0, 1)]
    meshes += [entity_model(kind, 1, 0.0)[1] for kind in ("lifeboat", "quadrotor", "anything")]
    for mesh in meshes:
        assert len(mesh) % 3 == 0 and np.isfinite(mesh).all() and np.abs(mesh[:, :3]).max() < 15.0
        assert np.allclose(np.linalg.norm(mesh[:, 3:6], axis=1), 1.0, atol=1e-3)
    for index in range(1, len(CLOTHES) + 1):
        keys = {entity_model("person_in_water", index, 0.25 * t)[0] for t in range(8)}
        assert len(keys) == WAVES
        mesh = entity_model("person_in_water", index, 0.0)[1]
        assert 1.0 < np.ptp(mesh[:, 0]) < 1.6 and mesh[:, 2].max() < 0.6


def test_indexed_mesh_draws_the_same_triangles() -> None:
    mesh = entity_model("lifeboat", 1, 0.0)[1]
    vertices, index = indexed(mesh)
    assert len(vertices) < len(mesh) and np.array_equal(vertices[index], mesh)


def test_rotation_follows_the_compass_and_the_body() -> None:
    ahead, right, up = np.array([0, 1, 0, 1.0]), np.array([1, 0, 0, 1.0]), np.array([0, 0, 1, 1.0])
    at = (5.0, 6.0, 7.0)
    assert np.allclose(matrix(at, 90, 0, 0) @ ahead, (6, 6, 7))
    assert np.allclose(matrix(at, 0, 90, 0) @ ahead, (5, 6, 8))
    assert np.allclose(matrix(at, 0, 0, 90) @ right, (5, 6, 6))
    assert np.allclose(matrix(at, 180, 0, 0) @ up, (5, 6, 8))


@given(st.floats(-300, 300), st.floats(-300, 300), st.floats(-3, 120))
def test_culling_never_drops_a_point_inside_the_picture(x: float, y: float, z: float) -> None:
    for tilt in (10.0, 45.0, 90.0):
        pose = CameraPose(position=(0, 0, 100), heading_deg=30.0, tilt_deg=tilt)
        seen = world_to_pixel(pose, (x, y, z))
        inside = seen is not None and 0 <= seen[0] <= 1920 and 0 <= seen[1] <= 1080
        kept = bool(in_sight(np.array([[x, y, z]]), np.array([0.01]), pose)[0])
        assert kept or not inside


@given(st.lists(st.tuples(st.integers(0, 39), st.integers(0, 29), st.integers(0, 3)), max_size=60))
def test_boxes_equal_brute_force(spots: list[tuple[int, int, int]]) -> None:
    entities = [
        Entity(id=f"e{k}", group="e", index=k, role="asset", type="t", engine="x", position=(0, 0, 0)) for k in range(4)
    ]
    ids = np.ones((30, 40), np.uint16)
    for x, y, k in spots:
        ids[y, x] = 256 + k
    boxes_by_id = {box.entity: box for box in entity_boxes(ids, entities)}
    for k in range(4):
        where = [(x, y) for y in range(30) for x in range(40) if ids[y, x] == 256 + k]
        assert (f"e{k}" in boxes_by_id) == bool(where)
        if where:
            xs, ys = [w[0] for w in where], [w[1] for w in where]
            box = boxes_by_id[f"e{k}"]
            assert box.box == (min(xs) / 40, min(ys) / 30, (max(xs) + 1) / 40, (max(ys) + 1) / 30)
            assert box.pixels == len(where)


@pytest.fixture(scope="module")
def tools() -> Iterator[dict[str, ModuleType]]:
    names = ("model_lofts", "people_models", "vehicle_models")
    sys.path.insert(0, str(TOOLS))
    try:
        yield {name: importlib.import_module(name) for name in names}
    finally:
        sys.path.remove(str(TOOLS))
        for name in names:
            sys.modules.pop(name, None)


def alike(made: np.ndarray, index: np.ndarray, file: Mapping[str, np.ndarray], name: str) -> None:
    """Another processor may round a last digit differently, and so order or merge vertices differently."""
    vertices, triples = file[f"{name}/vertices"], file[f"{name}/index"]
    assert len(index) == len(triples)
    ours, theirs = (np.sort(rows[which][:, :3].astype(int), axis=0) for rows, which in
                    ((made, index), (vertices, triples)))  # fmt: skip
    assert np.abs(ours - theirs).max() <= 1


@pytest.mark.parametrize("level", [0, 2])
def test_the_model_tools_reproduce_the_stored_models(tools: dict[str, ModuleType], level: int) -> None:
    with np.load(tools["vehicle_models"].FOLDER / "vehicles.npz") as file:
        made = tools["vehicle_models"].MADE
        assert {name.split("/")[0] for name in file.files} == set(made)
        for name in ("sedan", "van", "truck", "fire_truck", "motorcycle"):
            alike(*tools["model_lofts"].packed(made[name](level)), file, f"{name}/{level}")
    with np.load(tools["people_models"].FOLDER / "people.npz") as file:
        made = tools["people_models"].FIGURES
        assert {name.split("/")[0] for name in file.files} == set(made)
        for name, figure in made.items():
            alike(*tools["people_models"].packed_figure(figure, level), file, f"{name}/{level}")
            assert np.array_equal(tools["people_models"].packed_joints(figure), file[f"{name}/joints"])


@pytest.mark.parametrize("name", STORED)
def test_levels_of_detail_have_the_same_size_and_fewer_triangles(name: str) -> None:
    for number in range(0, LOOKS[name].count, 7):
        fine, middle, coarse = vehicle(name, number).levels
        assert 2000 <= len(fine) // 3 <= 4000 and len(middle) < 0.7 * len(fine) and len(coarse) < 0.31 * len(fine)
        for mesh in (middle, coarse):
            assert np.allclose(np.ptp(mesh[:, 1:3], axis=0), np.ptp(fine[:, 1:3], axis=0), rtol=0.08)
            assert abs(np.ptp(mesh[:, 0]) - np.ptp(fine[:, 0])) < 0.6  # the coarsest has no outside mirrors


@pytest.mark.parametrize("name", STORED)
def test_vehicles_stand_on_their_wheels_and_are_smooth_and_symmetrical(name: str) -> None:
    mesh = vehicle(name, 1).mesh
    assert abs(mesh[:, 2].min()) < 0.01
    assert name in CYCLES or abs(mesh[:, 0].min() + mesh[:, 0].max()) < 0.01
    faces = mesh.reshape(-1, 3, 10)
    bent = np.linalg.norm(faces[:, 0, 3:6] - faces[:, 1, 3:6], axis=1) > 0.02
    assert bent.mean() > 0.15  # a box has flat faces alone


def test_variants_differ_in_shape_colour_and_proportions() -> None:
    made = [vehicle("car", number) for number in range(LOOKS["car"].count)]
    assert len({part.key for part in made}) == len(made)
    assert len({part.rows.tobytes() for part in made}) == len(made)
    assert all(abs(part.rows[k, k] - 1.0) < 0.0251 for part in made for k in (1, 2))
    assert vehicle("car", 3).rows.tobytes() == vehicle("car", 3).rows.tobytes()


def test_a_repainted_vehicle_keeps_its_levels_of_detail() -> None:
    part = vehicle("car", 0)
    red = painted(part, "red")
    assert [len(mesh) for mesh in red.levels] == [len(mesh) for mesh in part.levels]
    for was, now in zip(part.levels, red.levels, strict=True):
        changed = (was[:, 6:9] != now[:, 6:9]).any(axis=1)
        assert changed.mean() > 0.2 and len(np.unique(now[changed, 6:9], axis=0)) == 1
        assert np.array_equal(was[:, :6], now[:, :6])
    assert painted(part, "red").mesh is red.mesh  # made once


def drawn(levels: tuple[np.ndarray, ...], away: Sequence[float], scale: float = 1.0) -> list[DrawnPart]:
    return [
        DrawnPart(matrix((0.0, y, 0.0), 0.0, 0.0, 0.0, scale), "entity/car", levels, 256 + k, 0.0)
        for k, y in enumerate(away)
    ]


def test_the_level_follows_the_size_in_the_picture() -> None:
    levels = vehicle("car", 0).levels
    (batch,) = entity_batches(drawn(levels, (8.0, 20.0, 300.0)))
    pose = CameraPose(position=(0.0, 0.0, 1.5), heading_deg=0.0, tilt_deg=0.0)
    parts = list(by_detail(batch, pose))
    assert [part.key for part in parts] == ["entity/car", "entity/car/level-1", "entity/car/level-2"]
    assert [part.rows["id"].tolist() for part in parts] == [[256], [257], [258]]
    assert [len(part.mesh) for part in parts] == [len(mesh) for mesh in levels]
    assert all(part.coarsest is levels[-1] for part in parts)  # of every level, for its shadow


def test_a_lengthened_body_has_a_larger_radius() -> None:
    levels = vehicle("car", 0).levels
    (batch,) = entity_batches([*drawn(levels, (8.0,)), *drawn(levels, (8.0,), 1.5)])
    assert np.allclose(batch.radius, [mesh_radius(levels[0]), 1.5 * mesh_radius(levels[0])])


def test_a_mesh_without_levels_is_drawn_as_it_is() -> None:
    part = prop_part("bench", 0)
    assert part.levels == (part.mesh,)


@pytest.mark.parametrize("figure", figures())
def test_people_have_levels_of_detail_of_equal_size(figure: str) -> None:
    fine, middle, coarse = posed(figure, "stand-0", ())
    assert 2000 <= len(fine) // 3 <= 3000 and len(middle) < 0.7 * len(fine) and len(coarse) < 0.25 * len(fine)
    assert abs(fine[:, 2].min()) < 0.01 and 1.38 < fine[:, 2].max() < 1.9
    for mesh in (middle, coarse):
        assert np.allclose(np.ptp(mesh[:, :3], axis=0), np.ptp(fine[:, :3], axis=0), atol=0.09)


@pytest.mark.parametrize("pose", POSES)
def test_poses_bend_joints_without_tearing_the_mesh(tools: dict[str, ModuleType], pose: str) -> None:
    for figure in ("jacket", "child"):
        rest, bent = (skin(figure, POSES[name], 0) for name in ("stand-0", pose))
        with np.load(tools["people_models"].FOLDER / "people.npz") as file:
            triples = file[f"{figure}/0/index"].reshape(-1, 3)
        sides = [
            np.linalg.norm(points[triples] - points[np.roll(triples, 1, axis=1)], axis=2) for points, *_ in (rest, bent)
        ]
        assert (sides[1] < 2.5 * sides[0] + 0.09).all()
        assert np.allclose(np.linalg.norm(bent[1], axis=1), 1.0)


def test_people_on_foot_differ_in_figure_and_clothes() -> None:
    people = [on_foot(number, "stand-0") for number in range(PEOPLE)]
    assert len({part.key for part in people}) == len({part.mesh.tobytes() for part in people}) == PEOPLE
    heights = [float(part.mesh[:, 2].max()) for part in people]
    assert max(heights) - min(heights) > 0.3


def test_the_phase_of_a_walk_follows_the_distance_walked() -> None:
    def at(north: float, speed: float = 1.35, status: str = "", heading: float = 0.0) -> str:
        return pose_on_foot(0, status, speed, (0.0, north, 0.0), heading)

    cycle_m = 0.75 + 0.55 * 1.35
    assert [at(cycle_m * (k + 0.5) / 8) for k in range(9)] == [f"walk-{k % 8}" for k in range(9)]
    assert at(-cycle_m * 0.5 / 8, heading=180.0) == at(cycle_m * 0.5 / 8)  # southwards
    assert at(3.0, 0.0).startswith("stand-") and at(0.1, 3.0).startswith("run-")
    assert at(3.0, 0.0, "injured") == "lie" and at(3.0, 0.0, "sitting") == "sit"


def test_a_walkers_feet_alternate_and_touch_the_ground() -> None:
    for phase in range(8):
        points = on_foot(0, f"walk-{phase}").mesh[:, :3]
        assert abs(points[:, 2].min()) < 1e-3
        right, left = (points[(points[:, 2] < 0.2) & (side * points[:, 0] > 0.02)][:, 1] for side in (1.0, -1.0))
        assert len(right) and len(left)
        if phase in (0, 4):
            assert (right.mean() - left.mean()) * (1.0 if phase == 0 else -1.0) > 0.3


def test_people_in_the_water_show_head_shoulders_and_arms() -> None:
    for number in range(len(CLOTHES)):
        for time_s in np.arange(0.0, 2.0, 0.25):
            points = in_water(number, float(time_s)).mesh[:, :3]
            above = points[points[:, 2] > 0.0]
            assert 0.25 < above[:, 2].max() < 0.6 and 0.9 < np.ptp(above[:, 0]) < 1.7
            assert points[:, 2].min() < -0.4


def test_objects_without_an_entity_have_one_box_per_connected_patch() -> None:
    ids = np.full((60, 100), CLASSES["road"], np.uint16)
    ids[10:14, 20:30] = ids[10:14, 40:50] = CLASSES["car"]
    ids[40:46, 5:9], ids[50, 50] = CLASSES["buoy"], CLASSES["person"]
    ids[20:30, 60:70] = FIRST_ENTITY
    assert [(box.entity, box.cls, box.box, box.pixels) for box in other_boxes(ids)] == [
        ("", "buoy", (0.05, 40 / 60, 0.09, 46 / 60), 24),
        ("", "car", (0.2, 10 / 60, 0.3, 14 / 60), 40),
        ("", "car", (0.4, 10 / 60, 0.5, 14 / 60), 40),
    ]


AHEAD = CameraPose(
    position=(0.0, 0.0, 2.0), heading_deg=0.0, tilt_deg=0.0, roll_deg=0.0, hfov_deg=60.0, width=64, height=48
)


def cloud(count: int, seed: int) -> SimpleNamespace:
    """Return small triangles in groups along a line through the eye."""
    chance = np.random.default_rng(seed)
    middles = np.stack([np.zeros(count), np.linspace(-200.0, 200.0, count), np.zeros(count)], axis=1)
    corners = middles[:, None, :] + chance.normal(size=(count, 3, 3))
    vertices = {"position": corners.reshape(-1, 3).astype(np.float32)}
    return SimpleNamespace(vertices=vertices, index=np.arange(3 * count, dtype=np.uint32))


def test_chunks_hold_all_triangles_in_sight_in_order():
    part = cloud(20 * CHUNK + 7, 3)
    chunks = chunks_of(part)
    runs = chunks.in_sight(AHEAD)
    shown = np.concatenate([np.arange(first, first + count) for first, count in runs])
    assert (np.diff(shown) > 0).all() and len(shown) % 3 == 0 and shown[-1] == len(part.index) - 1
    assert len(shown) < 0.6 * len(part.index)
    ahead = np.flatnonzero(part.vertices["position"][:, 1] > 0.0)
    assert np.isin(ahead, shown).all()


def test_chunks_stop_at_the_coarse_part():
    chunks = chunks_of(cloud(5 * CHUNK, 4))
    turned = CameraPose(**{**{f: getattr(AHEAD, f) for f in AHEAD.__struct_fields__}, "heading_deg": 180.0})
    assert chunks.in_sight(AHEAD, 0) == []
    assert sum(count for _, count in chunks.in_sight(turned, 3 * CHUNK + 3)) == 3 * CHUNK + 3


def test_boxes_from_strips_equal_those_from_labelled_pixels():
    chance = np.random.default_rng(5)
    entities = tuple(
        Entity(id=f"e{k}", group="e", index=k, role="asset", type="car", engine="x", position=(0.0, 0.0, 0.0))
        for k in range(1, 5)
    )
    pool = np.array([1, 4, *list(THINGS)[:3], FIRST_ENTITY, FIRST_ENTITY + 3], np.uint16)
    for share in (2, 4, len(pool)):
        for shape in ((1, 1), (1, 30), (30, 1), (23, 37)):
            ids = pool[chance.integers(0, share + 1 if share < len(pool) else share, shape)]
            entities_seen, others = all_boxes(ids, entities)
            assert (entity_boxes(ids, entities), other_boxes(ids)) == (entities_seen, others)
            assert [box.pixels for box in entities_seen] == [
                int((ids == FIRST_ENTITY + k).sum()) for k in range(4) if (ids == FIRST_ENTITY + k).any()
            ]
            assert [(box.cls, box.pixels, box.box) for box in others] == list(labelled(ids))


def labelled(ids):
    height, width = ids.shape
    for number in sorted(THINGS):
        patches, count = ndimage.label(ids == number, structure=np.ones((3, 3)))
        for patch, (down, across) in zip(range(1, count + 1), ndimage.find_objects(patches), strict=True):
            if (pixels := int((patches == patch).sum())) >= LEAST_PIXELS:
                box = across.start / width, down.start / height, across.stop / width, down.stop / height
                yield THINGS[number], pixels, box


def test_trees_have_levels_with_fewer_leaf_cards_over_the_same_crown():
    for model in ("tree", "street_tree", "birch", "poplar", "bush"):
        levels = prop_part(model, 0).levels
        assert [len(mesh) for mesh in levels] == sorted({len(mesh) for mesh in levels}, reverse=True)
        assert len(levels) == 3
        for mesh in levels[1:]:
            assert np.abs(mesh[:, :3].max(axis=0) - levels[0][:, :3].max(axis=0)).max() < 0.4
    assert len(prop_part("pine", 0).levels) == 1
