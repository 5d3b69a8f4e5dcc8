"""Models of a user's own (`look = "file.glb"`): size, colours, levels, and one message for each bad file."""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from lingjing.errors import UsageError
from lingjing.testing import compile_text, compiled, instantiate, placed, play, run_command
from lingjing.trace.records import BodyState

pytestmark = pytest.mark.skipif(
    not (find_spec("trimesh") and find_spec("fast_simplification")), reason="the extra `models` is not installed"
)

MISSION = """
ljs 2
use std.air { quadrotor }

target statue { engine = city, look = "statue.glb" }

mission own "A look of its own" {
  goal "Look."
  scene residential { extent = 300 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 3 }
  region yard = box((0 m, -60 m), (40 m, -20 m))
  target one : statue { position = (0 m, -60 m), colour = red }
  asset uav : quadrotor { position = (0 m, -60 m, 30 m) }
  agent pilot as pilot controls uav { observes uav.*, events }
  success when uav in yard
}
"""

Change = Callable[[dict[str, Any]], None]


def quads(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a rounded column of 2 m across (x), 6 m along (z) and 3 m high (y), off its origin."""
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, count + 1), np.linspace(0, 3, count + 1))
    points = np.column_stack([np.cos(around).ravel() + 5, up.ravel() + 7, 3 * np.sin(around).ravel() - 4])
    places = np.column_stack([around.ravel() / (2 * np.pi), up.ravel() / 3])
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    faces = np.concatenate([np.column_stack([first, first + 1, first + count + 1]),
                            np.column_stack([first + 1, first + count + 2, first + count + 1])])  # fmt: skip
    return points.astype("<f4"), places.astype("<f4"), faces.astype("<u4")


def glb(
    change: Change = lambda document: None, count: int = 20, *, textured: bool = True, picture: tuple[int, int] = (8, 8)
) -> bytes:
    """Return a file with one mesh, with a texture (left half red, right half blue) or a green factor."""
    points, places, faces = quads(count)
    image = PIL.Image.new("RGB", picture, (0, 0, 255))
    image.paste((255, 0, 0), (0, 0, picture[0] // 2, picture[1]))
    png = io.BytesIO()
    image.save(png, "PNG")
    blobs = [points.tobytes(), places.tobytes(), faces.tobytes(), png.getvalue()]
    views, data = [], b""
    for blob in blobs:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(blob)})
        data += blob + b"\0" * (-len(blob) % 4)
    colour = {"baseColorTexture": {"index": 0}} if textured else {"baseColorFactor": [0.0, 1.0, 0.0, 1.0]}
    document: dict[str, Any] = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
             "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()},
            {"bufferView": 1, "componentType": 5126, "count": len(places), "type": "VEC2"},
            {"bufferView": 2, "componentType": 5125, "count": 3 * len(faces), "type": "SCALAR"},
        ],
        "materials": [{"pbrMetallicRoughness": colour}],
        "textures": [{"source": 0}], "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "bufferViews": views, "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(data)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, size) + chunks


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.ljs").write_text(MISSION, encoding="utf-8")
    return tmp_path


def parts_of(folder: Path) -> Any:
    from lingjing.engines.camera.models import entity_parts

    instance, _ = placed(folder / "own.ljs")
    return instance.entities[0], entity_parts(instance.entities[0], BodyState(id="one", position=(0.0, 0.0, 0.0)), 0.0)


def test_the_file_gives_size_surface_and_colours(folder: Path) -> None:
    (folder / "own.ljs").write_text(MISSION.replace(", colour = red", ""), encoding="utf-8")
    (folder / "statue.glb").write_bytes(glb())
    entity, (part,) = parts_of(folder)
    assert [entity.number(f"{name}_m") for name in ("length", "width", "height")] == pytest.approx([6, 2, 3], abs=0.01)
    points = part.levels[0][:, :3]
    assert points.min(axis=0) == pytest.approx([-1, -3, 0], abs=0.01)
    assert points.max(axis=0) == pytest.approx([1, 3, 3], abs=0.01)
    assert len(part.levels[0]) == 3 * 800
    sizes = [len(level) for level in part.levels]
    assert len(sizes) >= 2 and sizes == sorted(sizes, reverse=True) and sizes[1] < 0.35 * sizes[0]
    for level in part.levels:  # front (+z of the file) is ahead: u < 1/2 there, red; behind it is blue
        ahead, behind = level[level[:, 1] > 1.0], level[level[:, 1] < -1.0]
        assert (ahead[:, 6] > 0.9).mean() > 0.9 and (behind[:, 8] > 0.9).mean() > 0.9
        across = np.linalg.norm(level[:, 3:6], axis=1)
        assert across == pytest.approx(np.ones(len(across)), abs=1e-3)


def test_a_declared_colour_or_a_colour_factor_of_the_file_colours_a_model(folder: Path) -> None:
    (folder / "statue.glb").write_bytes(glb(textured=False))
    _, (red,) = parts_of(folder)
    assert red.levels[0][0, 6] > red.levels[0][0, 7]
    (folder / "own.ljs").write_text(MISSION.replace(", colour = red", ""), encoding="utf-8")
    _, (green,) = parts_of(folder)
    assert green.levels[0][:, 6:9] == pytest.approx(np.tile([0.0, 1.0, 0.0], (2400, 1)), abs=0.01)


def test_a_replaced_model_file_is_an_error(folder: Path) -> None:
    (folder / "statue.glb").write_bytes(glb())
    first, _ = placed(folder / "own.ljs")
    (folder / "statue.glb").write_bytes(glb(count=12))
    with pytest.raises(UsageError, match="is not the file that the episode was made with"):
        placed(first)


def _far(document: dict[str, Any]) -> None:
    document["nodes"][0]["scale"] = [1000, 1000, 1000]


def _without_place(data: bytes) -> bytes:
    first = quads(20)[0][0].tobytes()
    return data.replace(first, struct.pack("<3f", float("nan"), 0.0, 0.0), 1)


def _with_texture_of(pixels: int) -> bytes:
    """Return a file with a texture. The texture's header declares a square of this many pixels a side; none is made."""
    header = b"IHDR" + struct.pack(">2I", 8, 8)
    data = glb()
    start = data.index(header)
    declared = b"IHDR" + struct.pack(">2I", pixels, pixels) + data[start + 12 : start + 17]
    return data[:start] + declared + struct.pack(">I", zlib.crc32(declared)) + data[start + 21 :]


def _flat(document: dict[str, Any]) -> None:
    document["nodes"][0]["scale"] = [0, 0, 0]


def _with_node(document: dict[str, Any], name: str, place: list[float], **more: Any) -> None:
    document["nodes"].append({"name": name, "translation": place, **more})
    document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)


BAD = {
    "does not exist": None,
    "is cut": lambda: glb()[:-500],
    "is no binary glTF file": lambda: b"solid ascii stl",
    "damaged in its description": lambda: glb().replace(b'{"asset"', b'{asset"": ', 1),
    "has no size": lambda: glb(_flat),
    "at most 1000 m are drawn": lambda: glb(_far),
    "shows no triangles": lambda: glb(lambda document: document["nodes"][0].pop("mesh")),
    "lacks its texture `skin.png`": lambda: glb(lambda document: document.update(images=[{"uri": "skin.png"}])),
    "has a damaged texture": lambda: glb(lambda document: document["images"][0].update(bufferView=0)),
    "lacks a texture": lambda: glb(lambda document: document.update(textures=[])),
    "a part of it has 1206006 values": lambda: glb(lambda document: document["accessors"][2].update(count=1_206_006)),
    "needs the extension KHR_draco": lambda: glb(
        lambda document: document.update(extensionsRequired=["KHR_draco_mesh_compression"])
    ),
    "its nodes are a circle": lambda: glb(lambda document: document["nodes"][0].update(children=[0])),
    "refers to nothing": lambda: glb(lambda document: document["nodes"][0].update(mesh=7)),
    "has fewer than its 90000 values": lambda: glb(lambda document: document["accessors"][0].update(count=90_000)),
    "an animation refers to nothing": lambda: glb(
        lambda document: document.update(
            animations=[{"samplers": [], "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}]}]
        )
    ),
    "an animation refers to (nothing)": lambda: glb(
        lambda document: document.update(
            animations=[{"samplers": [{"input": 7, "output": 8}], "channels": [{"sampler": 0, "target": {"node": 0}}]}]
        )
    ),
    "has a texture that is too large": lambda: _with_texture_of(20_000),
    "has a corner without a place": lambda: _without_place(glb()),
    "beside its middle": lambda: glb(lambda document: _with_node(document, "mount_front", [9.0, 8.0, -4.0])),
    "another file": lambda: glb(lambda document: document["buffers"][0].update(uri="data.bin")),
}


@pytest.mark.parametrize("message", BAD)
def test_a_file_that_cannot_be_used_gives_one_clear_message(folder: Path, message: str) -> None:
    make = BAD[message]
    if make is not None:
        (folder / "statue.glb").write_bytes(make())
    with pytest.raises(UsageError, match=message) as raised:
        placed(folder / "own.ljs")
    assert "`statue.glb`" in str(raised.value) and "\n" not in str(raised.value)


def test_nodes_of_the_file_are_the_mounts_of_cameras(folder: Path) -> None:
    def change(document: dict[str, Any]) -> None:
        half = np.radians(15.0)  # turned about x by 30 degrees: its front points down
        _with_node(document, "mount_front", [5.0, 9.0, -2.0], rotation=[float(np.sin(half)), 0, 0, float(np.cos(half))])
        _with_node(document, "mount_nadir", [5.0, 7.5, -4.0])

    (folder / "statue.glb").write_bytes(glb(change))
    text = MISSION.replace("quadrotor }\n", 'quadrotor }\nasset own_uav : quadrotor { look = "statue.glb" }\n', 1)
    (folder / "own.ljs").write_text(text.replace("asset uav : quadrotor", "asset uav : own_uav"), encoding="utf-8")
    instance, _ = placed(folder / "own.ljs")
    mounts = {mount.view: mount for mount in instance.entities[1].mounts}
    middle_m = 1.5 if instance.entities[1].properties.get("origin") == "middle" else 0.0
    front = mounts["front"]
    assert (front.ahead_m, front.above_m) == (pytest.approx(2.0, abs=0.01), pytest.approx(2.0 - middle_m, abs=0.01))
    assert front.tilt_deg == pytest.approx(30.0, abs=0.1)
    assert mounts["nadir"].above_m == pytest.approx(0.5 - middle_m, abs=0.01) and mounts["nadir"].tilt_deg == 90.0


def test_an_enormous_file_is_not_read(folder: Path) -> None:
    with (folder / "statue.glb").open("wb") as file:
        file.truncate(1 << 33)
    with pytest.raises(UsageError, match="has 8192 MB, and at most 64 are read"):
        placed(folder / "own.ljs")


def test_only_a_glb_file_can_be_named(folder: Path) -> None:
    text = MISSION.replace("statue.glb", "statue.obj")
    messages = [item.message for item in compile_text(text).diagnostics if item.severity == "error"]
    assert messages == ["`look` cannot be the file `statue.obj`"]
    assert instantiate(compiled(folder / "own.ljs")).entities[0].properties["look"] == "statue.glb"


def test_validation_warns_of_a_missing_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["validate", "own.ljs"]) == 0
    assert "look of `one`: there is no `statue.glb`" in "".join(capsys.readouterr())
    (folder / "statue.glb").write_bytes(glb())
    assert run_command(["validate", "own.ljs"]) == 0
    assert "there is no" not in "".join(capsys.readouterr())


def test_a_picture_shows_the_model_with_the_size_of_its_box(folder: Path) -> None:
    (folder / "statue.glb").write_bytes(glb())
    camera = "camera nadir { size = 200 by 200, hfov = 60 deg, channels = [rgb, instance], capture = each_tick }"
    text = MISSION.replace("position = (0 m, -60 m, 30 m)", f"position = (0 m, -60 m, 30 m), {camera}")
    (folder / "own.ljs").write_text(text.replace(", colour = red", ""), encoding="utf-8")
    trace = play(folder / "own.ljs", folder, policy="idle", seed=1).trace
    (frame,) = trace.boundaries[0].frames
    picture = trace.picture(frame.id)
    assert picture.instance is not None
    rows, columns = np.nonzero(picture.instance)
    across_m, along_m = 2 * 27 * np.tan(np.radians(30)) * np.array([np.ptp(columns), np.ptp(rows)]) / 200
    assert across_m == pytest.approx(2.0, abs=0.5) and along_m == pytest.approx(6.0, abs=0.8)
