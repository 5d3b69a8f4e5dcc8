"""A satellite with pictures far wider than the scene gives a warning at its declaration; one that fits does not."""

from __future__ import annotations

import pytest

from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import extent_m
from lingjing.scene.districts.options import plan
from lingjing.testing import compile_text

TEXT = """\
ljs 1
use std.orbit { satellite }
use std.sensors { nadir_hd, orbit }
mission wide "A wide area" {
  goal "Look."
  scene city { extent = 3 km, datum = sea level at -3 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 24 }
  asset sat[1..2] : satellite { camera eye : nadir_hd { size = 960 by 540 }, actions { takePhoto } }
  agent orbiter as orbiter controls sat[1] { observes sat[1].* }
  success when sat[1].position.x < 0 m
}
"""
ELEMENTS = 'tle1 = "1 25544U 98067A   26079.50000000  .00016717  00000-0  10270-3 0  9005"'


def test_a_camera_for_aircraft_on_a_satellite_gives_a_warning() -> None:
    compilation = compile_text(TEXT)
    (diagnostic,) = compilation.diagnostics
    assert compilation.mission is not None and diagnostic.severity == "warning"
    assert (diagnostic.code, diagnostic.span.line, diagnostic.span.column) == ("LJ0506", 9, 9)
    assert (
        "from 550 km, 84 deg show 990 km across, the scene is 3 km wide and covers 2.9 of 960 px" in diagnostic.message
    )
    assert "`sat[2]`" in diagnostic.message and "`orbit` of `std.sensors`" in diagnostic.hint


def test_the_default_extent_of_a_city_is_known() -> None:
    assert "the scene is 3 km wide" in compile_text(TEXT.replace("extent = 3 km, ", "")).diagnostics[0].message
    assert plan(SceneSpec(kind="city", datum_m=-3.0)).extent_m == extent_m(SceneSpec(kind="city")) == 3000.0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("nadir_hd { size", "orbit { size"),
        ("960 by 540", "960 by 540, hfov = 15 deg"),
        ("scene city { extent = 3 km,", "scene moon {"),
    ],
)
def test_fitting_and_unknown_pictures_give_no_warning(old: str, new: str) -> None:
    assert TEXT.count(old) == 1
    assert compile_text(TEXT.replace(old, new)).diagnostics == ()


def test_the_orbit_preset_fits_a_small_district() -> None:
    small = TEXT.replace("city { extent = 3 km, datum = sea level at -3 m }", "commercial { extent = 600 m }")
    assert compile_text(small.replace("nadir_hd { size", "orbit { size")).diagnostics == ()
    assert [item.code for item in compile_text(small).diagnostics] == ["LJ0506"]


def test_the_height_of_the_orbit_is_computed_from_the_elements() -> None:
    text = TEXT.replace("satellite { camera", f"satellite {{ {ELEMENTS}, camera")
    assert "from 160 km" in compile_text(text).diagnostics[0].message
