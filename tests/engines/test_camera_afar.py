"""Distant things keep their place and look: ground before water, lands below their map, props, rivers."""

import numpy as np
import pytest

from lingjing.engines.camera import view as choosing
from lingjing.engines.camera.culling import FULL_M, blunt_from
from lingjing.engines.camera.instances import prop_batches
from lingjing.engines.camera.light import light_of
from lingjing.engines.camera.reduced_meshes import COARSE_CELLS, coarsened, reduced
from lingjing.engines.camera.town_ground import REACH_M, build_town_ground
from lingjing.plugins.geometry import camera_axes, focal_px
from lingjing.scene.city import City, Land, PaintedArea, Pieces, Prop, Water
from tests.engines.camera_town import CLASSES, WHY_NOT, CameraEngine, box, instance, look, ready, seen_at, town

EVERYWHERE = Water(polygon=box(-5000, -5000, 5000, 5000), level_m=-3.0)
COAST = Land(polygon=box(-3000, -3000, 0, 3000), top_m=0.0, surface="grass")


def shore() -> City:
    """Return a city with land in the west, a field of asphalt on it, and the sea in the east."""
    field = PaintedArea(polygon=box(-900, -100, -700, 100), surface="asphalt")
    return City(id="shore", origin=(31.0, 121.5), bounds=(-3000.0, -3000.0, 3000.0, 3000.0), lands=(COAST,),
                waters=(EVERYWHERE,), areas=(field,))  # fmt: skip


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
@pytest.mark.parametrize("height", [30.0, 150.0, 900.0])
def test_distant_land_is_drawn_over_the_water_under_it(height: float) -> None:
    engine = CameraEngine()
    ready(engine, instance(), shore())
    frame = look(engine, (-200.0, 0.0, height), "front", heading=270.0)
    engine.close()
    pose = frame.info.pose
    right, down, axis = (np.asarray(a) for a in camera_axes(pose))
    x, y = np.meshgrid(np.arange(pose.width) + 0.5 - pose.width / 2, np.arange(pose.height) + 0.5 - pose.height / 2)
    rays = axis + (x[..., None] * right + y[..., None] * down) / focal_px(pose)
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.asarray(pose.position) + rays * (-pose.position[2] / rays[..., 2:])
    inland = (rays[..., 2] < 0.0) & (ground[..., 0] > -2700.0) & (np.abs(ground[..., 1]) < 2700.0)
    assert inland.sum() > 1000
    assert not (frame.semantic[inland] == CLASSES["water"]).any()
    distance = np.where(inland, -pose.position[2] / rays[..., 2], 0.0)
    assert np.allclose(frame.depth[inland], distance[inland], rtol=2e-3, atol=0.05)


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_distant_lands_show_the_map() -> None:
    engine = CameraEngine()
    ready(engine, instance(), shore())
    frame = look(engine, (-800.0, 0.0, 2000.0))
    engine.close()
    field, meadow = (seen_at(frame, -800.0, north, 0.0)[2] for north in (0.0, 500.0))
    assert meadow[1] > meadow[2] + 10, "grass is green"
    assert abs(field[1] - field[2]) < 10, "asphalt is grey"


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_a_body_at_a_high_camera_does_not_reduce_the_depth_resolution() -> None:
    engine = CameraEngine()
    ready(engine)
    renderer = engine._renderer
    assert renderer is not None and renderer._town is not None
    near = {}
    for height in (1.0, 100.0):
        pose = look(engine, (-400.0, -300.0, height)).info.pose
        with renderer.context:
            view = renderer._town.view(pose, 10_000.0, light_of(instance().weather, height))
        near[height] = renderer._town.near_plane(view, pose, 0.0)
    assert near[1.0] < 0.1, "close to the ground what touches is still drawn"
    assert near[100.0] > 0.3
    engine.close()


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_tiles_without_grain_keep_their_place_and_mean_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = CameraEngine()
    ready(engine)
    place = (0.0, 0.0, 150.0)
    sharp = look(engine, place)
    monkeypatch.setattr(choosing, "blunt_from", lambda reach: (0.0, 0.0))
    blunt = look(engine, place)
    engine.close()
    assert np.array_equal(sharp.depth, blunt.depth) and np.array_equal(sharp.semantic, blunt.semantic)
    assert not np.array_equal(sharp.rgb, blunt.rgb)
    off = sharp.rgb.reshape(-1, 3).mean(axis=0) - blunt.rgb.reshape(-1, 3).mean(axis=0)
    assert np.abs(off).max() < 2.0


def test_a_picture_of_short_range_is_drawn_without_reduced_detail() -> None:
    assert blunt_from(FULL_M[0]) == (np.inf, np.inf)
    assert max(blunt_from(FULL_M[1])) < np.inf


def test_a_distant_prop_has_fewer_triangles_in_the_same_place() -> None:
    car = Prop(id="c", cls="car", model="parked_car", position=(0.0, 0.0, 0.0))
    tree = Prop(id="t", cls="tree", model="tree", position=(9.0, 0.0, 0.0))
    batches = {batch.key.split("-")[0]: batch for batch in prop_batches(Pieces(props=(car, tree)))}
    coarse, full = coarsened(batches["car"]), batches["car"].mesh
    assert coarse is not None
    assert 12 <= len(coarse) // 3 < len(full) // 3 // 2
    cell = np.linalg.norm(np.ptp(full[:, :3], axis=0)) / 2.0 / COARSE_CELLS
    assert np.abs(coarse[:, :3].min(axis=0) - full[:, :3].min(axis=0)).max() < cell
    assert np.abs(coarse[:, :3].max(axis=0) - full[:, :3].max(axis=0)).max() < cell
    lump = coarsened(batches["car"], lump=True)
    assert lump is not None and len(lump) < len(coarse)
    assert coarsened(batches["tree"]) is None and reduced(batches["tree"]) is not None


def test_a_river_ends_beyond_the_bounds_and_a_sea_does_not() -> None:
    river = build_town_ground(town())
    assert 500.0 < np.abs(river.waters[0][1].vertices["position"][:, 0]).max() < 1000.0
    coast = Water(polygon=box(-500, -500, 500, -40), level_m=-1.5)
    sea = build_town_ground(town(waters=(coast,)))
    assert np.abs(sea.waters[0][1].vertices["position"][:, 1]).max() > 0.9 * REACH_M


def test_lands_and_ground_are_split_into_cells_that_contain_all_their_triangles() -> None:
    town_ground = build_town_ground(shore())
    for part, ranges, boxes in (
        (town_ground.lands, town_ground.land_ranges, town_ground.land_boxes),
        (build_town_ground(town()).ground, build_town_ground(town()).ranges, build_town_ground(town()).boxes),
    ):
        assert len(ranges) > 100
        assert ranges[:, 1].sum() == len(part.index)
        for (first, count), cell in zip(ranges.tolist(), boxes, strict=True):
            points = part.vertices["position"][part.index[first : first + count]]
            assert (points >= cell[:3] - 1e-3).all() and (points <= cell[3:] + 1e-3).all()
