"""A package of types of another author: its bodies are drawn, rendered, carry cameras and collide."""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lingjing import Mission
from lingjing.engines.camera.engine import CameraEngine
from lingjing.mission.appearance import COLOURS
from lingjing.mission.instance import Instance
from lingjing.plugins.bodies import solid_size
from lingjing.plugins.conformance import BodyCase, ConformanceError, check_body, check_can_be_hit, check_is_seen
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.plugins.geometry import world_to_pixel
from lingjing.testing import brief_of, city_of, compile_text, instantiate
from lingjing.trace.records import BodyState, CameraPose

TYPES = """ljs 1
use std.air { quadrotor }
asset balloon : quadrotor {
  length = 6 m, width = 6 m, height = 6 m
  shape = sphere, colour = red, mass = 40 kg
  mount front { ahead = 3.2 m, above = -1 m, tilt = 20 deg }
}
asset rig {
  engine = multirotor
  length = 2 m, width = 2 m, height = 1 m
  part deck : box { length = 2 m, width = 2 m, height = 0.2 m, above = 0.1 m, colour = yellow }
  part mast : cylinder { length = 0.2 m, width = 0.2 m, height = 0.8 m, above = 0.6 m, ahead = 0.5 m, colour = blue }
  verb stop()
}
target kiosk {
  engine = city
  on = ground
  length = 3 m, width = 2 m, height = 2.5 m
  colour = blue
}
target smell {
  engine = city
  look = none
}
"""
MISSION = """ljs 1
use acme.things
use std.messages { report }
mission strange "Strange" {
  goal "Look."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 5, policy <= 9 s, engine <= 30 s, capture <= 10 s }
  mode single
  target kiosk : kiosk { position = (330 m, -600 m, 1 m) }
  target smell : smell { position = (340 m, -600 m, 1 m) }
  asset rig : rig { position = (300 m, -640 m, 8 m) }
  asset balloon : balloon {
    position = (310 m, -600 m, 30 m)
    camera front { size = 320 by 240, hfov = 60 deg, channels = [rgb], capture = on_request }
  }
  agent pilot as pilot controls balloon { observes balloon.*, events }
  success when distance_xy(balloon, kiosk) <= 2 m
}
"""


@pytest.fixture
def strange(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mission:
    """A mission on an installed package `acme` that brings its types through the entry-point group `lingjing.std`."""
    package = tmp_path / "acme_types"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "things.ljs").write_text(TYPES)
    info = tmp_path / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing.std]\nacme = acme_types\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "acme_types", raising=False)
    result = compile_text(MISSION)
    assert result.mission is not None, [item.message for item in result.diagnostics]
    return result.mission


@pytest.fixture
def instance(strange: Mission) -> Instance:
    return instantiate(strange, seed=1)


def test_mission_and_instance_contain_the_declared_bodies(strange: Mission, instance: Instance) -> None:
    balloon = next(entity for entity in instance.entities if entity.id == "balloon")
    assert "look" not in balloon.properties, "a body that differs from its base's does not have its look"
    assert (balloon.properties["length_m"], balloon.properties["origin"]) == (6.0, "middle")
    mounts = {mount.view: mount for mount in balloon.mounts}
    assert mounts["front"].ahead_m == 3.2 and mounts["nadir"].above_m == -0.1
    rig = next(entity for entity in instance.entities if entity.id == "rig")
    assert [(part.name, part.shape, part.colour) for part in rig.parts] == [
        ("deck", "box", "yellow"),
        ("mast", "cylinder", "blue"),
    ]
    assert msgspec.json.decode(msgspec.json.encode(strange), type=Mission) == strange


def test_the_brief_of_an_agent_omits_properties_that_only_engines_need(instance: Instance) -> None:
    brief = brief_of(instance, instance.agents[0].id)
    (balloon,) = brief.resources
    assert balloon.id == "balloon" and not {"length_m", "colour", "shape"} & balloon.properties.keys()


def test_a_balloon_of_six_metres_is_drawn_six_metres_large_in_its_colour(instance: Instance) -> None:
    pose = CameraPose(position=(310.0, -640.0, 30.0), heading_deg=0.0, tilt_deg=0.0, hfov_deg=60.0, width=640,
                      height=640)  # fmt: skip
    engine = CameraEngine()
    try:
        engine.reset(EngineSpec(engine="camera", instance=instance, owns=()), city_of(instance.scene), 1)
        request = CaptureRequest(frame="f", entity="balloon", camera="c", tick=0, time_s=0.0, pose=pose)
        (frame,) = engine.capture((request,))
        look = CaptureRequest(frame="g", entity="balloon", camera="front", tick=0, time_s=0.0)
        (own,) = engine.capture((look,))
    finally:
        engine.close()
    (box,) = (box for box in frame.info.boxes if box.entity == "balloon")
    focal = 320.0 / np.tan(np.radians(30.0))
    for low, high in ((box.box[0], box.box[2]), (box.box[1], box.box[3])):
        assert (high - low) * 640.0 * 40.0 / focal == pytest.approx(6.0, rel=0.05)
    u, v, _ = world_to_pixel(pose, (310.0, -600.0, 30.0)) or (0.0, 0.0, 0.0)
    middle = frame.rgb[round(v) - 8 : round(v) + 8, round(u) - 8 : round(u) + 8].reshape(-1, 3).mean(axis=0)
    red = COLOURS["red"]
    assert middle[0] > 2.0 * max(middle[1], middle[2]) and red[0] > red[1]
    assert own.info.pose.position == pytest.approx((310.0, -596.8, 29.0)) and own.info.pose.tilt_deg == 20.0
    assert "balloon" not in {box.entity for box in own.info.boxes}, "its own camera does not show it"


@pytest.mark.parametrize("entity", ["balloon", "rig", "kiosk"])
def test_the_types_of_a_foreign_package_pass_the_conformance_kit(strange: Mission, entity: str) -> None:
    check_body(strange, entity)


def test_an_invisible_body_fails_the_conformance_kit(strange: Mission, instance: Instance) -> None:
    smell = next(entity for entity in instance.entities if entity.id == "smell")
    assert solid_size(smell) is None
    with pytest.raises(ConformanceError, match=r"is_seen: no picture from .* shows `smell`"):
        check_body(strange, "smell")


def test_the_kit_detects_a_body_that_is_drawn_larger_than_declared(instance: Instance) -> None:
    rig = next(entity for entity in instance.entities if entity.id == "rig")
    city = city_of(instance.scene)
    parts = tuple(msgspec.structs.replace(part, height_m=9.0) for part in rig.parts)
    tall = msgspec.structs.replace(rig, parts=parts)
    entities = tuple(tall if entity.id == "rig" else entity for entity in instance.entities)
    with pytest.raises(ConformanceError, match=r"`rig` is drawn .* m high, its measures allow 1\.0 m"):
        check_is_seen(BodyCase(msgspec.structs.replace(instance, entities=entities), city, tall))


def test_a_body_of_shape_none_has_no_collisions(instance: Instance) -> None:
    kiosk = next(entity for entity in instance.entities if entity.id == "kiosk")
    ghost = msgspec.structs.replace(kiosk, properties={**kiosk.properties, "shape": "none"})
    assert solid_size(ghost) is None and solid_size(kiosk) is not None
    check_can_be_hit(BodyCase(instance, city_of(instance.scene), ghost))


def test_a_sphere_is_not_hit_in_the_corners_of_its_bounding_box(instance: Instance) -> None:
    from lingjing.engines.neighbours import Neighbours

    around = Neighbours(instance)
    around.look([BodyState(id="balloon", position=(0.0, 0.0, 30.0))], 0.0)
    (balloon,) = around.near((0.0, 0.0, 30.0), 1.0, 0.01)
    assert balloon.touches((2.9, 0.0, 30.0), 0.01, 0.01, 0.0)
    assert not balloon.touches((2.5, 2.5, 30.0), 0.01, 0.01, 0.0)
    assert not balloon.touches((2.0, 0.0, 32.6), 0.01, 0.01, 0.0)
