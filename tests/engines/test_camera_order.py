"""Culling and reordering change no picture: uniforms, walls, sky, ids."""

from __future__ import annotations

import numpy as np
import pytest

from lingjing.engines.camera.classes import FIRST_ENTITY, semantic_picture, semantic_table
from lingjing.engines.camera.culling import sky_bounds
from lingjing.engines.camera.mesh_rows import walls
from lingjing.engines.camera.programs import active, carried, source, uniforms
from lingjing.engines.camera.wall_order import planes_of, walls_of
from lingjing.mission.instance import Entity
from lingjing.plugins.geometry import camera_axes, focal_px
from lingjing.testing import declared
from lingjing.trace.records import CameraPose
from tests.engines.camera_town import CLASSES

SQUARE = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]


def test_fragments_read_varyings_in_place_of_uniforms() -> None:
    vertex = "#version 330\nuniform vec3 u_eye;\nin vec3 p;\nvoid main() {\n  gl_Position = vec4(p - u_eye, 1.0);\n}\n"
    fragment = (
        "#version 330\nuniform vec3 u_eye, u_sun;\nuniform sampler2D u_grain;\nout vec4 c;\n"
        "void main() { c = texture(u_grain, u_eye.xy) * u_sun.x; }\n"
    )
    over, under = carried(vertex, fragment)
    assert uniforms(over) == {"u_eye": "vec3", "u_sun": "vec3"}
    assert uniforms(under) == {}
    assert "flat in vec3 k_eye, k_sun;" in under
    assert "texture(u_grain, k_eye.xy) * k_sun.x" in under
    assert "k_eye = u_eye;" in over and "k_sun = u_sun;" in over


def test_inactive_preprocessor_lines_are_removed() -> None:
    source = "#define A\n#ifdef A\none\n#ifdef B\ntwo\n#else\nthree\n#endif\n#else\nfour\n#endif\n"
    assert active(source) == "#define A\none\nthree\n"


def test_a_shader_source_starts_with_its_defines_and_has_each_include_once() -> None:
    text = source("soil.frag", "WET", "JOINTED")
    assert text.startswith("#version 330\n#define WET\n#define JOINTED\n")
    assert "#include" not in text
    assert text.count("vec3 sky_of(vec3 d)") == 1
    assert "seam" in active(text) and "seam" not in active(source("soil.frag", "WET"))


def test_walls_that_face_eye_and_sun_come_first_and_near_ones_before_far_ones() -> None:
    part = walls(SQUARE, 0.0, 5.0, (0.5, 0.5, 0.5), 11)
    eye, sun = np.array((-20.0, -5.0, 2.0)), np.array((-0.8, 0.0, 0.6))
    index, lit, seen = walls_of(part).ordered((-20.0, -5.0, 2.0), (-0.8, 0.0, 0.6))
    triangles = index.reshape(-1, 3)
    assert sorted(map(tuple, triangles.tolist())) == sorted(map(tuple, part.index.reshape(-1, 3).tolist()))
    assert (lit, seen) == (6, 12)  # the west wall, then the south wall
    normals, corners = part.vertices["normal"][triangles[:, 0]], part.vertices["position"][triangles]
    assert (normals[:2, 0] < -0.99).all()
    assert (normals[2:4, 1] < -0.99).all()
    assert (normals[:2] @ sun > 0.0).all() and (normals[2:4] @ sun <= 1e-6).all()
    assert (np.einsum("ij,ij->i", normals[4:], eye - corners[4:, 0]) < 0.0).all()
    nearest = np.linalg.norm(corners[4:] - eye, axis=2).min(axis=1)
    assert (np.diff(nearest) >= 0.0).all()


def test_only_the_walls_of_a_range_that_face_the_camera_are_drawn() -> None:
    part = walls(SQUARE, 0.0, 5.0, (0.5, 0.5, 0.5), 11)
    planes = planes_of(part)
    west = planes.among([(0, len(part.index))], (-20.0, 5.0, 2.0))
    assert len(west) == 6 and (part.vertices["normal"][west][:, 0] < -0.99).all()
    assert len(planes.among([(0, 6), (12, 6)], (5.0, 5.0, 2.0))) == 0  # from within, every wall is seen from behind


@pytest.mark.parametrize("roll", [0.0, 25.0, -60.0])
@pytest.mark.parametrize("tilt", [90.0, 40.0, 10.0, 0.0, -20.0])
def test_the_sky_is_drawn_at_every_pixel_with_a_rising_ray(tilt: float, roll: float) -> None:
    pose = CameraPose(position=(0.0, 0.0, 100.0), heading_deg=30.0, tilt_deg=tilt, roll_deg=roll, width=192, height=108)
    right, down, axis = (np.asarray(a) for a in camera_axes(pose))
    x, y = np.meshgrid(np.arange(192) + 0.5 - 96.0, np.arange(108) + 0.5 - 54.0)
    rising = axis[2] + (x * right[2] + y * down[2]) / focal_px(pose) > 0.0
    shown = sky_bounds(pose, 0.0)
    if shown is None:
        assert not rising.any()
        return
    left, top, width, height = shown
    inside = np.zeros_like(rising)
    inside[top : top + height, left : left + width] = True
    assert not (rising & ~inside).any()
    assert left >= 0 and left + width <= 192 and top >= 0 and top + height <= 108


def test_a_nadir_picture_has_no_sky_unless_from_a_great_height() -> None:
    low = CameraPose(position=(0.0, 0.0, 100.0), heading_deg=0.0, tilt_deg=90.0)
    high = CameraPose(position=(0.0, 0.0, 500_000.0), heading_deg=0.0, tilt_deg=90.0)
    assert sky_bounds(low, 0.0) is None
    assert sky_bounds(high, 0.0) == (0, 0, high.width, high.height)


def test_classes_of_a_picture_are_those_of_the_table() -> None:
    kinds = ("car", "person", "no_such_kind")
    entities = [
        declared(
            Entity(id=f"e[{k}]", group="e", index=k, role="target", type=kind, engine="x", position=(0.0, 0.0, 0.0))
        )
        for k, kind in enumerate(kinds)
    ]
    ids = np.array([[0, 12, FIRST_ENTITY], [FIRST_ENTITY + 2, FIRST_ENTITY + 1, 255]], np.uint16)
    assert np.array_equal(semantic_picture(ids, entities), semantic_table(entities)[ids])
    assert semantic_picture(ids, entities)[0, 2] == CLASSES["car"]
    assert ids[0, 2] == FIRST_ENTITY, "the drawn ids stay"
