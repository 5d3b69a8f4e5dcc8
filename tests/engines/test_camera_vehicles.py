"""Vehicles that are kept as data: their levels of detail, their measures, and the tool that makes them."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lingjing.engines.camera.instances import by_detail, entity_batches, matrix
from lingjing.engines.camera.models import entity_model, levels, prop_model
from lingjing.trace.records import CameraPose

TOOL = Path(__file__).parents[2] / "tools" / "vehicle_models.py"
STORED = ("car", "delivery_van", "truck")


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("vehicle_models", TOOL)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["vehicle_models"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["sedan", "hatch", "suv", "van", "truck"])
@pytest.mark.parametrize("level", [0, 1, 2])
def test_the_tool_makes_what_is_stored(tool: ModuleType, name: str, level: int) -> None:
    made, index = tool.packed(tool.MADE[name](level))
    with np.load(tool.FILE) as arrays:
        vertices, triples = arrays[f"{name}/{level}/vertices"], arrays[f"{name}/{level}/index"]
    # Another processor may round a last digit otherwise, and so order or merge vertices otherwise.
    assert len(index) == len(triples)
    ours, theirs = (np.sort(rows[which][:, :3].astype(int), axis=0) for rows, which in
                    ((made, index), (vertices, triples)))  # fmt: skip
    assert np.abs(ours - theirs).max() <= 1


@pytest.mark.parametrize("name", STORED)
def test_levels_are_of_one_shape_and_ever_fewer_triangles(name: str) -> None:
    for number in range(1, 30, 7):
        fine, middle, coarse = levels(entity_model(name, number, 0.0)[1])
        assert 2000 <= len(fine) // 3 <= 4000 and len(middle) < 0.7 * len(fine) and len(coarse) < 0.25 * len(fine)
        for mesh in (middle, coarse):
            assert np.allclose(np.ptp(mesh[:, 1:3], axis=0), np.ptp(fine[:, 1:3], axis=0), rtol=0.08)
            assert abs(np.ptp(mesh[:, 0]) - np.ptp(fine[:, 0])) < 0.4  # the coarsest has no outside mirrors


@pytest.mark.parametrize("name", STORED)
def test_vehicles_stand_on_their_wheels_and_are_smooth_and_symmetrical(name: str) -> None:
    mesh = entity_model(name, 1, 0.0)[1]
    assert abs(mesh[:, 2].min()) < 0.01
    assert abs(mesh[:, 0].min() + mesh[:, 0].max()) < 0.01
    faces = mesh.reshape(-1, 3, 10)
    bent = np.linalg.norm(faces[:, 0, 3:6] - faces[:, 1, 3:6], axis=1) > 0.02
    assert bent.mean() > 0.15  # a box has flat faces alone


def test_the_level_follows_the_size_in_the_picture() -> None:
    _, mesh = entity_model("car", 1, 0.0)
    away = (8.0, 20.0, 300.0)
    placed = [(matrix((0.0, y, 0.0), 0.0, 0.0, 0.0), "entity/car", mesh, 256 + k, 0.0) for k, y in enumerate(away)]
    (batch,) = entity_batches(placed)
    pose = CameraPose(position=(0.0, 0.0, 1.5), heading_deg=0.0, tilt_deg=0.0)
    parts = list(by_detail(batch, pose))
    assert [part.key for part in parts] == ["entity/car", "entity/car/level-1", "entity/car/level-2"]
    assert [part.rows["id"].tolist() for part in parts] == [[256], [257], [258]]
    assert [len(part.mesh) for part in parts] == [len(m) for m in levels(mesh)]


def test_a_mesh_without_levels_is_drawn_as_it_is() -> None:
    _, mesh = prop_model("bench", 0)
    assert levels(mesh) == (mesh,)
