"""The camera engine on the real renderer: ids, boxes, depth, occlusion, determinism."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lingjing.engines.camera import context
from lingjing.engines.camera.classes import semantic_table
from lingjing.engines.camera.draw import Renderer
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import (
    CameraSpec,
    Entity,
    Instance,
    InteractionSpec,
    SceneSpec,
    Weather,
)
from lingjing.plugins.conformance import ENGINE_CHECKS, EngineCase
from lingjing.plugins.engine import BodyState, CaptureRequest, City, Command, EnginePlugin, EngineSpec, Frame
from lingjing.plugins.geometry import pixel_to_world, world_to_pixel
from lingjing.scene.city import Solid, Water
from lingjing.testing import bare_instance, city_of, declared
from tests.engines.camera_town import CLASSES, WHY_NOT, CameraEngine

LEVEL = -3.5


pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)


def mounts(size: tuple[int, int] = (960, 540)) -> tuple[CameraSpec, ...]:
    def mount(view: str, channels: tuple[str, ...]) -> CameraSpec:
        return CameraSpec(
            name=view, view=view, width=size[0], height=size[1], hfov_deg=84.0, channels=channels, capture="on_request"
        )

    return mount("nadir", ("rgb", "depth", "semantic")), mount("front", ("rgb",)), mount("oblique", ("rgb", "depth"))


def entity(name: str, kind: str, position: tuple[float, float, float], **more: object) -> Entity:
    group, _, rest = name.partition("[")
    return declared(
        Entity(
            id=name,
            group=group,
            index=int(rest[:-1]) if rest else 1,
            type=kind,
            engine="vessel" if kind == "lifeboat" else "x",
            role="target" if kind == "person_in_water" else "asset",
            position=position,
            **more,
        )
    )


PICK_UP = InteractionSpec(name="pick_up", by="vessel", within_m=50.0, status="safe", aboard=True)


def instance(weather: Weather | None = None, size: tuple[int, int] = (960, 540)) -> Instance:
    entities = (
        entity("uav[1]", "quadrotor", (100.0, -900.0, 96.5), cameras=mounts(size)),
        entity("uav[2]", "quadrotor", (310.0, -590.1, 1.1), cameras=mounts(size)),
        entity("boat", "lifeboat", (120.0, -920.0, LEVEL), heading_deg=30.0),
        entity("victim[1]", "person_in_water", (110.0, -890.0, LEVEL), interactions=(PICK_UP,)),
        entity("victim[2]", "person_in_water", (80.0, -910.0, LEVEL), heading_deg=70.0, interactions=(PICK_UP,)),
        entity("gizmo", "weather_vane", (95.0, -880.0, LEVEL)),
    )
    scene = SceneSpec(kind="bay", datum_m=LEVEL, seed=3)
    weather = weather or Weather(wind_mps=4, wind_from_deg=220, wave_height_m=0.5)
    return bare_instance(entities, seed=3, scene=scene, weather=weather)


def states(episode: Instance, **changes: dict[str, object]) -> list[BodyState]:
    """Return all entities at their declared places; `changes` by id without brackets (uav1)."""
    out = []
    for e in episode.entities:
        state = BodyState(id=e.id, position=e.position, heading_deg=e.heading_deg)
        out.append(msgspec.structs.replace(state, **changes.get(e.id.replace("[", "").replace("]", ""), {})))
    return out


def take(engine: CameraEngine, camera: str = "nadir", viewer: str = "uav[1]", time_s: float = 10.0) -> Frame:
    (frame,) = engine.capture(
        [CaptureRequest(frame=f"f1-{viewer}-{camera}", entity=viewer, camera=camera, tick=1, time_s=time_s)]
    )
    return frame


def ready(engine: CameraEngine, episode: Instance, city: City | None = None) -> None:
    engine.reset(EngineSpec(engine="camera", instance=episode, owns=()), city or city_of(episode.scene), 3)
    engine.advance(10.0, states(episode))


@pytest.fixture(scope="module")
def warm() -> Iterator[CameraEngine]:
    engine = CameraEngine()
    yield engine
    engine.close()


@pytest.fixture
def engine(warm: CameraEngine) -> CameraEngine:
    ready(warm, instance())
    return warm


def boxes(frame: Frame) -> dict[str, tuple[float, float, float, float]]:
    return {box.entity: box.box for box in frame.info.boxes}


def test_frame_has_the_declared_channels_and_shapes(engine: CameraEngine) -> None:
    nadir, front = take(engine), take(engine, "front")
    assert nadir.rgb.shape == (540, 960, 3) and nadir.rgb.dtype == np.uint8
    assert nadir.depth is not None and nadir.depth.dtype == np.float32 and nadir.depth.shape == (540, 960)
    assert nadir.semantic is not None and nadir.semantic.dtype == np.uint8
    assert front.depth is None and front.semantic is None
    assert nadir.info.id == "f1-uav[1]-nadir" and nadir.info.pose.tilt_deg == 90.0
    assert nadir.info.renderer == engine.fingerprint()["gl"]


def test_a_reset_draws_a_small_picture_once_for_each_kind_of_weather(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    render = Renderer._render
    monkeypatch.setattr(Renderer, "_render", lambda *arguments: drawn.append(1) or render(*arguments))
    new = CameraEngine()
    try:
        for weather, times in (({}, 2), ({"wind_mps": 9.0}, 2), ({"rain": 0.5}, 4), ({"rain": 0.9}, 4), ({}, 4)):
            ready(new, instance(Weather(**weather)))
            assert len(drawn) == times
    finally:
        new.close()


def test_boxes_enclose_the_drawn_pixels_exactly(engine: CameraEngine) -> None:
    frame = take(engine)
    boxes_by_entity = {box.entity: box for box in frame.info.boxes}
    assert set(boxes_by_entity) == {"boat", "victim[1]", "victim[2]", "gizmo"}
    assert {boxes_by_entity[name].cls for name in ("boat", "victim[1]", "gizmo")} == {
        "lifeboat", "person_in_water", "weather_vane"
    }  # fmt: skip
    assert frame.semantic is not None
    for name, cls in (("boat", "lifeboat"), ("gizmo", "entity")):
        rows, columns = np.nonzero(frame.semantic == CLASSES[cls])
        tight = columns.min() / 960, rows.min() / 540, (columns.max() + 1) / 960, (rows.max() + 1) / 540
        assert boxes_by_entity[name].box == tight and boxes_by_entity[name].pixels == len(rows)
    people = boxes_by_entity["victim[1]"].pixels + boxes_by_entity["victim[2]"].pixels
    assert people == int((frame.semantic == CLASSES["person_in_water"]).sum())


def test_projected_entity_lies_in_its_box(engine: CameraEngine) -> None:
    for camera, north, expected in (("nadir", -905.0, 4), ("front", -985.0, 4)):
        engine.advance(10.0, states(instance(), uav1={"position": (100.0, north, 50.0)}))
        frame = take(engine, camera)
        boxes_by_id = boxes(frame)
        assert len(boxes_by_id) == expected
        for state in states(instance()):
            seen = world_to_pixel(frame.info.pose, (*state.position[:2], state.position[2] + 0.1))
            if state.id in boxes_by_id and seen is not None:
                x0, y0, x1, y1 = boxes_by_id[state.id]
                assert x0 - 2 / 960 <= seen[0] / 960 <= x1 + 2 / 960
                assert y0 - 2 / 540 <= seen[1] / 540 <= y1 + 2 / 540


def test_the_depth_of_the_sea_equals_the_distance_to_its_plane(engine: CameraEngine) -> None:
    frame = take(engine)
    assert frame.depth is not None and frame.semantic is not None
    sea = frame.depth[frame.semantic == CLASSES["water"]]
    assert np.allclose(sea, 96.4 - LEVEL, atol=1e-3)
    oblique = take(engine, "oblique")
    assert oblique.depth is not None
    for row, column in ((30, 20), (270, 480), (520, 930)):
        east, north, up = pixel_to_world(oblique.info.pose, column + 0.5, row + 0.5, float(oblique.depth[row, column]))
        assert abs(up - LEVEL) < 0.01, (east, north)


def test_sky_has_no_depth() -> None:
    episode = instance()
    first = msgspec.structs.replace(episode.entities[0], cameras=tuple(
        msgspec.structs.replace(c, channels=("rgb", "depth", "semantic")) for c in mounts((320, 180))))  # fmt: skip
    engine = CameraEngine()
    ready(engine, msgspec.structs.replace(episode, entities=(first, *episode.entities[1:])))
    frame = take(engine, "front")
    engine.close()
    assert frame.depth is not None and frame.semantic is not None
    assert np.isinf(frame.depth[0]).all() and (frame.semantic[0] == CLASSES["sky"]).all()
    assert np.isfinite(frame.depth[-1]).all() and np.array_equal(np.isinf(frame.depth), frame.semantic == 0)


def test_an_entity_out_of_sight_or_aboard_has_no_box(engine: CameraEngine) -> None:
    episode = instance()
    engine.advance(10.0, states(episode, victim1={"position": (900.0, -900.0, LEVEL)}, victim2={"status": "safe"}))
    frame = take(engine)
    assert set(boxes(frame)) == {"boat", "gizmo"}
    assert frame.semantic is not None and not (frame.semantic == CLASSES["person_in_water"]).any()


def test_a_solid_hides_entities_under_it(warm: CameraEngine) -> None:
    episode = instance()
    roof = Solid(id="roof", polygon=((105, -895), (115, -895), (115, -885), (105, -885)), base_m=0.0, top_m=0.5)
    open_water = City(id="w", origin=(0.0, 0.0), bounds=(-3000, -3000, 3000, 3000), datum_m=LEVEL,
                      waters=(Water(polygon=((-3000, -3000), (3000, -3000), (3000, 3000), (-3000, 3000)),
                                    level_m=LEVEL),))  # fmt: skip
    ready(warm, episode, open_water)
    assert "victim[1]" in boxes(take(warm))
    ready(warm, episode, msgspec.structs.replace(open_water, solids=(roof,)))
    assert set(boxes(take(warm))) == {"boat", "victim[2]", "gizmo"}


def test_an_entity_partly_hidden_by_a_closer_one_has_fewer_pixels(engine: CameraEngine) -> None:
    episode = instance()
    alone = {b.entity: b.pixels for b in take(engine).info.boxes}["victim[1]"]
    engine.advance(10.0, states(episode, boat={"position": (110.0, -891.0, LEVEL), "heading_deg": 0.0}))
    under = {b.entity: b.pixels for b in take(engine).info.boxes}.get("victim[1]", 0)
    assert under < alone


def test_a_camera_does_not_see_its_own_body_but_that_of_others(engine: CameraEngine) -> None:
    episode = instance()
    near = {"position": (100.0, -890.0, 96.4)}
    engine.advance(10.0, states(episode, uav2=near))
    assert set(boxes(take(engine, "front"))) == {"uav[2]"}
    engine.advance(10.0, states(episode))
    assert "uav[1]" not in boxes(take(engine))
    assert "uav[2]" not in boxes(take(engine, viewer="uav[2]"))


def test_the_camera_of_a_grounded_aircraft_sees_the_concrete_of_the_apron(engine: CameraEngine) -> None:
    frame = take(engine, viewer="uav[2]")
    assert frame.semantic is not None and frame.depth is not None
    assert (frame.semantic == CLASSES["concrete"]).mean() > 0.9
    assert abs(float(np.median(frame.depth)) - 0.1) < 0.03


def test_gimbal_ignores_pitch_and_roll(engine: CameraEngine) -> None:
    level = take(engine)
    engine.advance(10.0, states(instance(), uav1={"pitch_deg": 12.0, "roll_deg": -8.0}))
    assert take(engine).rgb.tobytes() == level.rgb.tobytes()


def test_pictures_do_not_depend_on_earlier_ones(engine: CameraEngine) -> None:
    episode = instance()
    first = take(engine)
    take(engine, "front")
    engine.advance(400.0, states(episode, uav1={"position": (300.0, -640.0, 80.0)}, boat={"position": (0, 0, LEVEL)}))
    other = take(engine)
    ready(engine, instance(Weather(wind_mps=12, wave_height_m=2.0)))
    rough = take(engine)
    ready(engine, episode)
    again = take(engine)
    assert first.rgb.tobytes() == again.rgb.tobytes() and first.info == again.info
    assert first.depth is not None and again.depth is not None and first.depth.tobytes() == again.depth.tobytes()
    assert first.rgb.tobytes() != other.rgb.tobytes() and first.rgb.tobytes() != rough.rgb.tobytes()


def test_a_used_camera_draws_other_floating_props_like_a_new_one(engine: CameraEngine) -> None:
    episode = instance()
    other = city_of(msgspec.structs.replace(episode.scene, seed=4))
    assert other.props != city_of(episode.scene).props
    poses = {"uav1": {"position": (300.0, -640.0, 80.0)}, "uav2": {"position": (60.0, -1300.0, 30.0)}}
    seen = []
    for camera in (engine, CameraEngine()):
        ready(camera, episode, other)
        camera.advance(10.0, states(episode, **poses))
        seen.append([take(camera, "front", viewer).rgb.tobytes() for viewer in ("uav[1]", "uav[2]")])
    camera.close()
    assert seen[0] == seen[1]


def test_waves_move_with_time_and_only_with_time(engine: CameraEngine) -> None:
    a = take(engine).rgb
    engine.advance(11.0, states(instance()))
    b = take(engine).rgb
    engine.advance(10.0, states(instance()))
    assert np.mean(a != b) > 0.2 and np.array_equal(take(engine).rgb, a)


def test_two_engines_in_one_process_do_not_disturb_each_other(engine: CameraEngine) -> None:
    before = take(engine).rgb.tobytes()
    other = CameraEngine()
    ready(other, instance())
    assert take(other).rgb.tobytes() == before
    other.close()
    assert take(engine).rgb.tobytes() == before


def test_an_engine_can_be_closed_twice_and_used_again() -> None:
    engine = CameraEngine()
    engine.close()
    ready(engine, instance())
    first = take(engine).rgb.tobytes()
    engine.close()
    engine.close()
    ready(engine, instance())
    assert take(engine).rgb.tobytes() == first
    engine.close()


def digest() -> str:
    engine = CameraEngine()
    ready(engine, instance())
    frames = [take(engine), take(engine, "front"), take(engine, "oblique")]
    engine.close()
    return hashlib.sha256(b"".join(f.rgb.tobytes() + msgspec.json.encode(f.info) for f in frames)).hexdigest()


def test_another_process_draws_the_same_pictures_and_exits_silently() -> None:
    """The process has a hash seed of its own; this one has that of the tests."""
    root = str(Path(__file__).parents[2])
    code = f"import sys; sys.path.insert(0, {root!r}); import tests.engines.test_camera_engine as t; print(t.digest())"
    environment = {**os.environ, "PYTHONHASHSEED": "1"}
    run = subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True)
    assert (run.stdout.strip(), run.stderr) == (digest(), "")


def test_misuse_is_named(engine: CameraEngine) -> None:
    with pytest.raises(InfrastructureError, match="before its reset"):
        CameraEngine().advance(1.0, ())
    with pytest.raises(InfrastructureError, match=r"`boat` has no camera `nadir`"):
        take(engine, viewer="boat")
    (receipt,) = engine.submit([Command(id="c1-1", tick=1, sender="a", resource="uav[1]", verb="stop")])
    assert (receipt.status, receipt.reason, receipt.request) == ("rejected", "unknown_verb", "c1-1")


def test_the_error_of_a_missing_egl_names_the_packages_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(**_: object) -> None:
        raise RuntimeError("libEGL.so.1: cannot open shared object file")

    monkeypatch.setattr(context.moderngl, "create_context", broken)
    with pytest.raises(InfrastructureError) as error:
        CameraEngine().reset(EngineSpec(engine="camera", instance=instance(), owns=()), city_of(instance().scene), 1)
    assert "libEGL" in str(error.value) and "apt-get install -y libegl1 libgl1" in error.value.hint


@pytest.mark.parametrize("check", ENGINE_CHECKS, ids=lambda check: check.__name__)
def test_conformance(check: Callable[[EngineCase], None]) -> None:
    plugin = EnginePlugin(name="camera", factory=CameraEngine, place="camera", sensor=True)
    episode = instance(size=(240, 136))
    check(EngineCase(plugin, episode, city_of(episode.scene), mirrors=tuple(states(episode))))


def test_the_semantic_table_maps_ids_to_classes() -> None:
    table = semantic_table(instance().entities)
    assert table[:256].tolist() == list(range(256))
    assert table[256:].tolist() == [18, 18, 17, 16, 16, 31]
