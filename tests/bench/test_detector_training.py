"""Tests of `tools/train_detector.py`: its gradients, its training, and equal bytes from equal sets."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lingjing.bench.frame_sets.balance import class_set
from lingjing.bench.frame_sets.folder import write_set
from lingjing.testing import encode_jpeg
from lingjing.trace.records import Box, CameraPose
from tests.bench.frame_kit import made_frame

ROOT = Path(__file__).parents[2]
FIRE = "fire_source"


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("train_detector", ROOT / "tools" / "train_detector.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_gradients_match_finite_differences_of_the_loss(tool: ModuleType) -> None:
    dice = np.random.Generator(np.random.PCG64(1))
    student = tool.Student(dice)
    pictures = dice.integers(0, 256, (2, 24, 24, 3)).astype(np.uint8)
    wanted = dice.choice([-1.0, 0.0, 1.0], (2, 6, 6)).astype(np.float32)
    sides = dice.uniform(4, 20, (2, 6, 6, 5)).astype(np.float32)

    def loss() -> float:
        return tool.slope(student.forward(pictures)[2].astype(np.float64), wanted, sides)[1]

    saw, logits, answer = student.forward(pictures)
    grads = student.gradients(saw, logits, tool.slope(answer, wanted, sides)[0])
    for place in (0, 3, 6, 10, 11):
        value, grad = student.values[place], grads[place]
        at = np.unravel_index(int(np.abs(grad).argmax()), grad.shape)
        kept, step = float(value[at]), 2e-3
        value[at] = kept + step
        above = loss()
        value[at] = kept - step
        below = loss()
        value[at] = kept
        assert (above - below) / (2 * step) == pytest.approx(float(grad[at]), rel=0.08), place


def test_a_lesson_marks_the_middle_of_a_target_and_its_sides(tool: ModuleType) -> None:
    none = np.empty((0, 4))
    crop = tool.Cutout(np.zeros((96, 96, 3), np.uint8), np.array([[30.0, 40.0, 50.0, 56.0]]), none)
    wanted, sides = tool.lesson(crop)
    rows, columns = np.nonzero(wanted == 1)
    assert {(int(r), int(c)) for r, c in zip(rows, columns, strict=True)} == {
        (r, c) for r in (12,) for c in (9, 10)
    }  # fmt: skip
    assert sides[12, 10].tolist() == [10.5, 8.5, 9.5, 7.5, 16.0]
    assert wanted[0, 0] == 0 and wanted[11, 8] == -1
    hidden = tool.lesson(tool.Cutout(crop.picture, none, crop.targets))[0]
    assert set(np.unique(hidden)) == {-1.0, 0.0}


def test_turning_a_square_turns_its_boxes(tool: ModuleType) -> None:
    picture = np.zeros((96, 96, 3), np.uint8)
    picture[40:56, 30:50] = 200
    crop = tool.Cutout(picture, np.array([[30.0, 40.0, 50.0, 56.0]]), np.empty((0, 4)))
    for seed in range(12):
        turned = tool.turned(crop, np.random.Generator(np.random.PCG64(seed)), upright=False)
        rows, columns = np.nonzero(turned.picture[..., 0] > 100)
        edges = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert turned.targets.tolist() == [[float(each) for each in edges]]


def test_the_same_set_gives_the_same_bytes(tool: ModuleType, tmp_path: Path) -> None:
    dice = np.random.default_rng(3)
    pose = CameraPose(position=(0.0, 0.0, 1.0), heading_deg=0.0, tilt_deg=0.0, width=160, height=120)
    pictures, frames = {}, []
    for number in range(6):
        rgb = dice.integers(60, 120, (120, 160, 3)).astype(np.uint8)
        if number % 2:
            rgb[40:60, 50:70] = (240, 150, 40)
        pictures[number] = encode_jpeg(rgb)
        box = Box(entity="fire[1]", cls=FIRE, box=(50 / 160, 40 / 120, 70 / 160, 60 / 120), pixels=400)
        import hashlib

        digest = hashlib.sha256(pictures[number]).hexdigest()
        frames.append(made_frame(number, 2000 + number // 2, pose=pose, targets=(FIRE,), sha256=digest,
                                 boxes=(box,) if number % 2 else ()))  # fmt: skip
    write_set(tmp_path / "set", [class_set(frames, FIRE, 0.2)], {f.name: pictures[f.tick] for f in frames}.__getitem__)
    reports = [tool.train_class(tmp_path / "set", FIRE, 3, tmp_path / name) for name in ("one", "two")]
    assert reports[0] == reports[1]
    first, second = ((tmp_path / name / f"{FIRE}.npz").read_bytes() for name in ("one", "two"))
    assert first == second
    assert reports[0]["frames"] == 4 and reports[0]["seeds"] == [2000, 2001]
