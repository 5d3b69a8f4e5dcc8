"""Redaction of pictures: no class of a hidden entity, and no box of an invisible one."""

from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from lingjing.engines.camera.contrast import LEAST_CONTRAST, contrast, projected_rect
from lingjing.mission.instance import Entity, Instance, Weather
from lingjing.plugins.engine import Frame
from lingjing.scene.city import City, Pipe, Solid, Water
from lingjing.trace.records import CameraPose
from tests.engines.camera_town import CLASSES, WHY_NOT, CameraEngine, box, entity, instance, look, ready, town

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)

PLACES = {
    "person_in_water": [(30.0, -70.0, -1.5), (-60.0, -90.0, -1.5)],
    "building_fire": [(-45.0, 55.0, 36.0), (15.0, 55.0, 12.0)],
    "fire_source": [(20.0, -14.0, 0.0), (-20.0, 20.0, 0.0)],
    "queue_of_people": [(40.0, 30.0, 0.0), (-40.0, 20.0, 0.0)],
    "delivery_door": [(-45.0, 38.0, 0.0), (18.0, 38.0, 0.0)],
    "bridge_fracture": [(0.0, -60.0, 8.0), (0.0, -120.0, 8.0)],
    "pipeline_leak": [(-30.0, -20.0, 1.0), (25.0, -20.0, 1.0)],
    "reference_building": [(-45.0, 55.0, 0.0), (15.0, 55.0, 0.0)],
}
"""Two places of each kind of target that can be hidden."""
VIEWS = [
    ("nadir", (0.0, -10.0, 130.0), 0.0),
    ("nadir", (3.0, -110.0, 60.0), 40.0),
    ("front", (0.0, -90.0, 30.0), 0.0),
    ("oblique", (10.0, 20.0, 40.0), 180.0),
]
"""(camera, place of the body, heading)."""


@pytest.fixture(scope="module")
def engine() -> Iterator[CameraEngine]:
    camera = CameraEngine()
    yield camera
    camera.close()


def city() -> City:
    """Return the town with a pipe along its bank and railings on its bridge."""
    railing = tuple(
        Solid(id=f"rail{side}", polygon=box(4.2 * side - 0.1, -170, 4.2 * side + 0.1, -8), base_m=8.0, top_m=9.0)
        for side in (-1, 1)
    )
    pipe = Pipe(id="pipe", path=((-100.0, -20.0, 1.0), (100.0, -20.0, 1.0)), radius_m=0.4)
    return town(pipes=(pipe,), solids=railing)


def target(kind: str, at: tuple[float, float, float], **more: object) -> Entity:
    properties = {"colour": "red"} if kind == "reference_building" else {}
    made = entity("goal", kind, at, hidden=("position",), properties=properties)
    return msgspec.structs.replace(made, role="target", **more)


def shots(engine: CameraEngine, episode: Instance) -> list[Frame]:
    ready(engine, episode, city())
    return [look(engine, at, view, heading) for view, at, heading in VIEWS]


@pytest.fixture(scope="module")
def bare(engine: CameraEngine) -> list[Frame]:
    """Return the pictures without any target."""
    return shots(engine, instance())


@pytest.mark.parametrize(("kind", "place"), [(kind, k) for kind in PLACES for k in range(2)])
def test_class_pictures_show_no_hidden_entity(kind: str, place: int, engine: CameraEngine, bare: list[Frame]) -> None:
    """Instances that differ only in a hidden target have the same class pictures: those without it."""
    with_it = shots(engine, instance(target(kind, PLACES[kind][place])))
    assert any(frame.info.boxes for frame in with_it), "the target is in none of the pictures"
    for mine, other in zip(with_it, bare, strict=True):
        assert np.array_equal(mine.semantic, other.semantic)
        assert np.array_equal(mine.instance, other.instance) and not mine.info.instance_ids
        if mine.info.boxes:
            assert not np.array_equal(mine.rgb, other.rgb)


def test_class_pictures_show_public_entities(engine: CameraEngine) -> None:
    """A hidden target in front of a public one shows the public one's class; depth shows the hidden one."""
    parcels = msgspec.structs.replace(entity("shop", "delivery_point", (20.0, 20.0, 0.0)), role="target")
    person = target("fire_source", (22.4, 20.0, 2.1))
    frames = {}
    for name, others in (("both", (parcels, person)), ("public", (parcels,))):
        ready(engine, instance(*others), city())
        frames[name] = look(engine, (22.0, 20.0, 30.0))
    both, public = frames["both"], frames["public"]
    assert {seen.entity for seen in both.info.boxes} == {"shop", "goal"}
    assert np.array_equal(both.semantic, public.semantic)
    assert np.array_equal(both.instance, public.instance)
    assert both.info.instance_ids == {"shop": 2} and set(np.unique(both.instance)) == {0, 2}
    assert np.array_equal(both.instance == 2, both.semantic == CLASSES["delivery_point"])
    assert (both.semantic == CLASSES["delivery_point"]).sum() > 20
    assert (both.semantic != CLASSES["fire_source"]).all()
    assert (both.depth < public.depth - 0.05).any()


def test_a_queue_of_hidden_length_is_not_outlined(engine: CameraEngine, bare: list[Frame]) -> None:
    """A queue with a public place and a hidden length."""
    for people in (3, 17):
        queue = target("queue_of_people", (40.0, 30.0, 0.0), hidden=("people",), properties={"people": people})
        (frame, *_) = shots(engine, instance(queue))
        assert frame.info.boxes and np.array_equal(frame.semantic, bare[0].semantic)


def test_a_hidden_target_at_the_lens_changes_no_class(engine: CameraEngine) -> None:
    """The nearest thing decides how finely layers of the ground are separated, but not if it is hidden."""
    at = (0.0, 0.0, 30.0)
    ready(engine, instance(), city())
    bare = look(engine, at)
    for off in (0.0, 0.6):
        ready(engine, instance(target("fire_source", (off, off, 27.0))), city())
        frame = look(engine, at)
        assert frame.info.boxes and np.array_equal(frame.semantic, bare.semantic)


def test_hidden_entities_are_redacted_in_open_country(engine: CameraEngine) -> None:
    sea = City(id="sea", origin=(31.0, 121.5), bounds=(-500.0, -500.0, 500.0, 500.0),
               waters=(Water(polygon=box(-500, -500, 500, 500), level_m=0.0),))  # fmt: skip
    frames = []
    for others in ((), (target("person_in_water", (5.0, 5.0, 0.0)),), (target("person_in_water", (-9.0, 3.0, 0.0)),)):
        ready(engine, instance(*others), sea)
        frames.append(look(engine, (0.0, 0.0, 40.0)))
    assert [len(frame.info.boxes) for frame in frames] == [0, 1, 1]
    assert all(np.array_equal(frame.semantic, frames[0].semantic) for frame in frames)


@pytest.mark.parametrize("view", ["nadir", "front"])
def test_a_redrawn_part_equals_the_whole_picture(engine: CameraEngine, view: str) -> None:
    """The parts agree pixel by pixel, also in rain and after dark."""
    weather = Weather(sun_azimuth_deg=180.0, sun_elevation_deg=-10.0, rain=0.6, wind_mps=4.0)
    people = [target("fire_source", (12.0 * k, 20.0, 0.0), id=f"f{k}") for k in range(3)]
    episode = instance(*people, weather=weather)
    ready(engine, episode, city())
    whole = look(engine, (10.0, -60.0, 25.0), view)
    renderer, scenery = engine._renderer, engine._scenery(episode.entities[0])
    assert renderer is not None
    near_m = renderer.near_plane(whole.info.pose, scenery)
    for place in ((0, 0, 480, 270), (100, 37, 211, 101), (479, 269, 1, 1)):
        left, top, width, height = place
        rgb = renderer.redraw(whole.info.pose, scenery, True, place, near_m).rgb
        assert np.array_equal(rgb, whole.rgb[top : top + height, left : left + width])


def test_a_picture_does_not_depend_on_earlier_redraws(engine: CameraEngine) -> None:
    ready(engine, instance(target("bridge_fracture", PLACES["bridge_fracture"][0])), city())
    first, second = (look(engine, (0.0, -60.0, 50.0)) for _ in range(2))
    assert np.array_equal(first.rgb, second.rgb) and first.info == second.info
    middle = first.semantic[:, 200:280], first.depth[:, 200:280]
    assert ((middle[0] == CLASSES["road"]) & (middle[1] > 50.0)).any(), "water is seen where the road would be"


@pytest.mark.parametrize(("visibility", "seen"), [(4000.0, True), (150.0, True), (55.0, False)])
@pytest.mark.parametrize("kind", ["person_in_water", "reference_building", "delivery_door"])
def test_targets_in_fog_have_no_visible_pixels(kind: str, visibility: float, seen: bool, engine: CameraEngine) -> None:
    """Below the least contrast a target has no visible pixels; its box is recorded as faint."""
    place = PLACES[kind][0]
    weather = Weather(sun_azimuth_deg=180.0, visibility_m=visibility)
    ready(engine, instance(target(kind, place), weather=weather), city())
    frame = look(engine, (place[0], place[1] - 20.0, 95.0))
    (shown,) = (*frame.info.boxes, *frame.info.faint)
    assert bool(frame.info.boxes) == seen and shown.pixels > 0
    assert shown.contrast is not None and (shown.contrast >= LEAST_CONTRAST) == seen


def test_contrast_is_a_root_mean_square_of_the_largest_difference() -> None:
    base = np.full((4, 3), 100, np.uint8)
    other = base.copy()
    other[0] = (90, 103, 100)
    assert contrast(base, base) == 0.0 and contrast(base[:0], base[:0]) == 0.0
    assert contrast(other, base) == 5.0 == contrast(base, other)


def test_a_projected_box_is_clipped_to_the_picture() -> None:
    pose = CameraPose(position=(0.0, 0.0, 50.0), heading_deg=30.0, tilt_deg=60.0, width=480, height=270)
    part = projected_rect((-5.0, -5.0, 0.0, 5.0, 20.0, 3.0), pose)
    assert part is not None and 0 < part[2] < 480
    assert projected_rect((-5.0, -5.0, 40.0, 5.0, 5.0, 60.0), pose) == (0, 0, 480, 270)
    assert projected_rect((-500.0, -400.0, 0.0, -490.0, -390.0, 3.0), pose) is None
