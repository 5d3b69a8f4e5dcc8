"""The tiles of a picture: all that it shows, and only nearby ones, for a city of any size."""

from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lingjing.engines.camera.building_meshes import building
from lingjing.engines.camera.cityscape import KEPT_TILES, Cityscape
from lingjing.engines.camera.culling import (
    boxes_in_sight,
    casters,
    distances,
    light_matrix,
    near_plane,
    shade_window,
)
from lingjing.engines.camera.light import light_of
from lingjing.engines.camera.mesh_rows import triangles
from lingjing.engines.camera.road_meshes import CENTRE, EDGE, areas, lanes, middles_of
from lingjing.engines.camera.view import choose
from lingjing.mission.instance import Weather
from lingjing.plugins.geometry import world_to_pixel
from lingjing.scene.city import Building, City, Lane, PaintedArea, Pieces, Prop, Road
from lingjing.scene.store import write_store
from lingjing.trace.records import CameraPose
from tests.engines.camera_town import WHY_NOT, CameraEngine, box, instance, look, ready, town

TOWER = (-10.0, -10.0, 0.0, 10.0, 10.0, 30.0)


@given(st.floats(-400, 400), st.floats(-400, 400), st.floats(2, 300), st.floats(0, 359), st.floats(0, 90))
def test_no_box_in_the_picture_is_left_out(x: float, y: float, z: float, heading: float, tilt: float) -> None:
    pose = CameraPose(position=(x, y, z), heading_deg=heading, tilt_deg=tilt)
    shown = False
    for corner in ((a, b, c) for a in (-10.0, 10.0) for b in (-10.0, 10.0) for c in (0.0, 30.0)):
        seen = world_to_pixel(pose, corner)
        if seen is not None and 0 <= seen[0] <= 1920 and 0 <= seen[1] <= 1080:
            shown = True
            away = float(distances(np.array([TOWER]), pose.position)[0])
            assert away == 0.0 or near_plane(pose, away) <= seen[2]
    assert bool(boxes_in_sight(np.array([TOWER]), pose)[0]) or not shown


@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(5, 400), st.floats(0, 359), st.floats(10, 90),
       st.floats(0, 359), st.floats(6, 80))  # fmt: skip
@settings(max_examples=60)
def test_the_shadow_window_holds_the_ground_in_sight(
    x: float, y: float, z: float, heading: float, tilt: float, azimuth: float, elevation: float
) -> None:
    pose = CameraPose(position=(x, y, z), heading_deg=heading, tilt_deg=tilt)
    a, e = np.radians(azimuth), np.radians(elevation)
    sun = (float(np.sin(a) * np.cos(e)), float(np.cos(a) * np.cos(e)), float(np.sin(e)))
    window = shade_window(pose, sun)
    matrix = light_matrix(window, np.array([TOWER]))
    middle = np.array([x + 30 * np.sin(np.radians(heading)), y + 30 * np.cos(np.radians(heading)), 0.0, 1.0])
    seen = world_to_pixel(pose, (float(middle[0]), float(middle[1]), 0.0))
    if seen is not None and 0 < seen[0] < 1920 and 0 < seen[1] < 1080 and seen[2] < 300.0:
        assert np.abs((matrix @ middle)[:2]).max() <= 1.0
        occluder = middle[:3] + 60.0 * np.array(sun)
        around = np.array([[*(occluder - 1.0), *(occluder + 1.0)]])
        assert casters(around, window)[0], "what stands between it and the sun may shade it"


def town_of_squares(tallest_m: float) -> tuple[SimpleNamespace, SimpleNamespace]:
    """Return the inputs of `choose`: a skyline and a ground of squares of 250 m over 3 km, one with a tower."""
    keys = [(column, row) for column in range(-6, 6) for row in range(-6, 6)]
    boxes = np.array([(250.0 * c, 250.0 * r, 0.0, 250.0 * c + 250.0, 250.0 * r + 250.0, 12.0 + (7 * c + 5 * r) % 40)
                      for c, r in keys])  # fmt: skip
    boxes[len(keys) // 2 + 6, 5] = tallest_m
    ranges = np.zeros((len(keys), 2), np.int64)
    none = {"ranges": ranges[:0], "boxes": boxes[:0], "land_ranges": ranges[:0], "land_boxes": boxes[:0]}
    return SimpleNamespace(keys=keys, boxes=boxes, ranges=(ranges, ranges)), SimpleNamespace(**none)


@pytest.mark.parametrize("tallest_m", [60.0, 240.0])
@pytest.mark.parametrize("up", [60.0, 150.0, 260.0, 280.0, 300.0, 405.0, 430.0, 520.0, 545.0, 570.0, 700.0, 1400.0])
def test_a_picture_from_straight_above_has_one_level_of_detail(up: float, tallest_m: float) -> None:
    """A picture from above has no edge between full and painted streets, or between levels of grain or details."""
    sky, town_ground = town_of_squares(tallest_m)
    light = light_of(Weather(), up)
    pose = CameraPose(position=(100.0, 60.0, up), heading_deg=20.0, tilt_deg=90.0)
    view = choose(sky, town_ground, pose, 10_000.0, light)
    seen = {key for key, shown in zip(sky.keys, boxes_in_sight(sky.boxes, pose), strict=True) if shown}
    assert len(seen) > 1 or up < 100.0
    assert set(view.full) in (seen, set()) and len(view.full) <= KEPT_TILES
    assert view.detailed in (set(view.full), set()) and view.blunt in (set(view.full), set())
    far = choose(
        sky, town_ground, msgspec.structs.replace(pose, position=(0.0, 0.0, 60.0), tilt_deg=5.0), 10_000.0, light
    )
    assert 0 < len(far.full) < len(sky.keys) // 2, "ahead, what is far off is drawn less finely"


def test_neighbouring_poses_share_their_shadow_map() -> None:
    sun = (0.3, -0.6, 0.74)
    windows = {shade_window(CameraPose(position=(float(k), 0.0, 100.0), heading_deg=0.0, tilt_deg=90.0), sun)
               for k in range(20)}  # fmt: skip
    assert len(windows) <= 3


@given(st.integers(3, 12), st.floats(5, 60))
def test_outlines_are_triangulated_whole(count: int, size: float) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) * size * (1.0 + 0.4 * (np.arange(count) % 2))[:, None]
    hole = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    points, index = triangles([ring, hole])
    a, b, c = (points[index[k::3]] for k in range(3))
    area = 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    following = np.roll(ring, -1, axis=0)
    whole = 0.5 * np.sum(ring[:, 0] * following[:, 1] - following[:, 0] * ring[:, 1])
    assert (area >= -1e-9).all() and np.isclose(area.sum(), whole - 4.0)


def test_walls_face_outwards_and_have_the_same_triangle_count_at_any_height() -> None:
    low = Building(id="a", polygon=box(0, 0, 20, 10), base_m=0.0, top_m=3.9, levels=1)
    high = Building(id="b", polygon=box(0, 0, 20, 10)[::-1], base_m=0.0, top_m=300.0, levels=90)
    for house in (low, high):
        walls, _, _ = building(house, 11)
        assert len(walls.index) == 24
        out = walls.vertices["position"][:, :2] - (10.0, 5.0)
        assert ((out * walls.vertices["normal"][:, :2]).sum(axis=1) > 0.0).all()


def test_later_areas_lie_on_earlier_ones() -> None:
    parts = areas([PaintedArea(polygon=box(0, 0, 50, 50), surface="grass"),
                   PaintedArea(polygon=box(10, 10, 20, 20), surface="plaza"),
                   PaintedArea(polygon=box(200, 0, 250, 50), surface="sand")])  # fmt: skip
    layers = {tuple(v["colour"][:3].round(2)): float(v["layer"]) for part in parts for v in part.vertices}
    assert sorted(layers.values()) == [1.0, 1.0, 2.5]


def test_bent_lanes_keep_their_width() -> None:
    bend = Lane(id="l", shape=((0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (80.0, 40.0, 2.0)), width_m=3.0)
    part = lanes([Road(id="r", lanes=(bend,))], (), middles_of(()))
    left, right = part.vertices["position"][0::2], part.vertices["position"][1::2]
    assert np.allclose(np.linalg.norm(left - right, axis=1)[[0, 2]], 3.0, atol=1e-4)
    assert part.vertices["position"][:, 2].max() == 2.0


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_a_picture_loads_the_same_tiles_in_a_wide_city_as_in_a_small_one(tmp_path: Path) -> None:
    def block(east: int, north: int) -> Building:
        return Building(id=f"b{east}_{north}", polygon=box(east + 10, north + 10, east + 60, north + 60), base_m=0.0,
                        top_m=12.0 + (east + north) % 40, levels=4)  # fmt: skip

    def stored(reach: int) -> City:
        spots = [(e, n) for e in range(-reach, reach, 100) for n in range(-reach, reach, 100)]
        trees = tuple(Prop(id=f"t{e}_{n}", cls="tree", model="tree", position=(e + 5.0, n + 5.0, 0.0))
                      for e, n in spots)  # fmt: skip
        pieces = Pieces(buildings=tuple(block(e, n) for e, n in spots), props=trees)
        light = City(id=f"w{reach}", origin=(31.0, 121.5), bounds=(-reach, -reach, reach, reach))
        return write_store(tmp_path / str(reach), light, pieces)

    used = {}
    for reach in (500, 1500):
        engine = CameraEngine()
        ready(engine, instance(), stored(reach))
        town = engine._renderer._town
        assert town is not None
        assert 4 <= len(town._residents) <= 32, "what is about the start is ready"
        for key in list(town._residents):
            for sheet in town._residents.pop(key).sheets.values():
                sheet.release()
        town._shade_is = None
        frame = look(engine, (30.0, 30.0, 100.0))
        used[reach] = len(town._residents), frame.rgb.astype(int)
        for k in range(40):
            look(engine, (-400.0 + 20 * k, 30.0, 100.0))
        assert len(town._residents) <= KEPT_TILES
        engine.close()
    assert used[500][0] == used[1500][0], "the same tiles"
    assert np.abs(used[500][1] - used[1500][1]).max() <= 3, "the same picture, but for the far map under it"


def test_only_two_way_streets_have_a_yellow_middle() -> None:
    there = Road(id="a", lanes=(Lane(id="a_0", shape=((0.0, -1.5, 0.0), (50.0, -1.5, 0.0)), width_m=3.0),))
    back = Road(id="b", lanes=(Lane(id="b_0", shape=((50.0, 1.5, 0.0), (0.0, 1.5, 0.0)), width_m=3.0),))
    alone = lanes([there], (), middles_of([there])).vertices["style"][0, 2]
    paired = lanes([there], (), middles_of([there, back])).vertices["style"][0, 2]
    assert (alone % 4, paired % 4) == (EDGE, CENTRE)


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_a_city_with_other_props_is_drawn_as_by_a_new_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boats and buoys of a harbour differ from episode to episode; no mesh is built again for them."""

    def boat(name: str, east: float, north: float, cls: str = "moored_boat", model: str = "sailboat") -> Prop:
        return Prop(id=name, cls=cls, model=model, position=(east, north, -1.5), floating=True)

    standing = town().props
    vent = Prop(id="v", cls="steam_vent", model="steam_vent", position=(40.0, 30.0, 0.0))
    first = town(props=(*standing, boat("a", 30.0, -90.0), boat("b", -450.0, -150.0)), sha256="1")
    second = town(props=(*standing[1:], vent, boat("a", 60.0, -70.0), boat("c", 450.0, -150.0)), sha256="2")
    shots = [((0.0, 0.0, 100.0), "nadir"), ((-60.0, -60.0, 12.0), "front"), ((380.0, -150.0, 40.0), "nadir")]
    warm, new = CameraEngine(), CameraEngine()
    try:
        ready(warm, city=first)
        assert len([look(warm, *shot) for shot in shots]) == 3
        monkeypatch.setattr(Cityscape, "__init__", lambda *_: pytest.fail("the town was made again"))
        ready(warm, city=second)
        monkeypatch.undo()
        ready(new, city=second)
        for shot in (*shots, *reversed(shots)):
            mine, other = look(warm, *shot), look(new, *shot)
            assert (mine.rgb == other.rgb).all() and mine.info == other.info
            assert mine.semantic is not None and (mine.semantic == other.semantic).all()
            assert mine.depth is not None and (mine.depth == other.depth).all()
    finally:
        warm.close()
        new.close()
