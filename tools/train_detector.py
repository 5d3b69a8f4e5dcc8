"""Train the agents' detector on an exported set of frames: only numpy, minutes per class on one processor.

    lingjing frames export --play ssr --set victims=6 --seeds 2000-2011 -o frames
    python tools/train_detector.py frames --classes person_in_water

Each class gets its own network (`lingjing_agents.perception.learned`). It is trained on squares of the frames of the
`train` split: around targets, at random places, and, in a second round, at errors of the first round's network. Then
weights and activations are quantised to integers, and the confidences are fitted on the `validation` split. With one
thread, fixed seeds and pinned kernels, the same set and library versions give the same bytes on every x86-64 processor
with AVX2.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from lingjing.numerics import pin

if __name__ == "__main__":
    pin()

import numpy as np
import numpy.typing as npt
from lingjing_agents.perception.learned.detector import LearnedDetector
from lingjing_agents.perception.learned.network import (
    CELL_PX,
    DILATIONS,
    MIDDLE,
    STRIDES,
    TOP,
    IntegerLayer,
    IntegerNetwork,
    taps,
)
from lingjing_agents.perception.learned.targets import SCALES, TargetScale, reduced

from lingjing.analysis.detection import iou
from lingjing.bench.frame_sets.balance import SetFrame
from lingjing.bench.frame_sets.folder import read_class, read_picture
from lingjing.trace.images import decode_jpeg

WEIGHTS = Path(__file__).parents[1] / "agents/lingjing_agents/perception/learned/weights"
CHANNELS = (3, 12, 16, 24, 24, 24)
"""Channels of the layers."""
INPUT_SCALE = 1.0 / 64.0
"""Value of one step of a pixel for the first layer."""
REACH_PX = 16.0
"""Unit of the distances that the network predicts, pixels."""
CROP_PX = 96
"""Side of a training square, pixels."""
SIZES_PX = (5.0, 48.0)
"""Longest side of a target that a scale is trained on, pixels. The smallest and the largest scale also cover sizes
beyond."""
BATCH = 32
"""Squares of one training step."""
CROPS_OF_A_TARGET = 8
"""Squares around each target."""
RANDOM_CROPS = 6
"""Random squares of each frame."""
MINED = 12
"""Most squares from one frame of the second round; errors with the highest confidence come first."""
BEND = 0.1
"""Transition of Huber's loss from a parabola to a line, as a share of the target's shorter side."""
MINE_EVERY = 2
"""Errors are searched in every second picture."""
RATE = 3e-3
"""Learning rate at the beginning."""
PRIOR = -4.0
"""Evidence of the untrained network: targets are rare."""
SEED = 12
"""Seed of the random numbers."""

Float32 = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]
BoxArray = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrainingPicture:
    """A picture at one scale. Boxes are in pixels of the reduced picture."""

    picture: Bytes
    targets: BoxArray
    """Boxes that this scale is trained on."""
    ignored: BoxArray
    """Boxes that count neither as right nor as wrong."""


@dataclass(frozen=True, slots=True)
class Cutout:
    """A square of a picture. Boxes are relative to its corner."""

    picture: Bytes
    targets: BoxArray
    ignored: BoxArray


def samples(folder: Path, cls: str, frames: Iterable[SetFrame], scale: TargetScale) -> Iterator[TrainingPicture]:
    """Yield every frame at every scale at which the detector examines it."""
    for frame in frames:
        rgb = decode_jpeg(read_picture(folder, cls, frame))
        size = np.array([rgb.shape[1], rgb.shape[0]] * 2, np.float64)
        boxes = np.array([box.box for box in frame.frame.shows(cls)]).reshape(-1, 4) * size
        factors = scale.factors_for(frame.frame.pose, frame.frame.level_m)
        for factor in factors:
            here = boxes / factor
            longest = np.maximum(here[:, 2] - here[:, 0], here[:, 3] - here[:, 1])
            large_enough = (longest >= SIZES_PX[0]) | (factor == factors[0])
            fits = large_enough & ((longest <= SIZES_PX[1]) | (factor == factors[-1]))
            yield TrainingPicture(reduced(rgb, factor), here[fits], here[~fits])


def cut(sample: TrainingPicture, x: int, y: int) -> Cutout:
    """The square with its upper left corner at (x, y), filled with grey beyond the picture."""
    height, width = sample.picture.shape[:2]
    square = np.full((CROP_PX, CROP_PX, 3), MIDDLE, np.uint8)
    x0, y0, x1, y1 = max(x, 0), max(y, 0), min(x + CROP_PX, width), min(y + CROP_PX, height)
    square[y0 - y : y1 - y, x0 - x : x1 - x] = sample.picture[y0:y1, x0:x1]
    corner = np.array([x, y, x, y], np.float64)
    return Cutout(square, _inside(sample.targets - corner), _inside(sample.ignored - corner))


def _inside(boxes: BoxArray) -> BoxArray:
    return boxes[(boxes[:, 2] > 0) & (boxes[:, 3] > 0) & (boxes[:, 0] < CROP_PX) & (boxes[:, 1] < CROP_PX)]


def first_crops(sample: TrainingPicture, random: np.random.Generator) -> tuple[list[Cutout], list[Cutout]]:
    """Squares with a target at a random place in them, and random squares without a target."""
    with_target = []
    for box in sample.targets:
        middle = (box[:2] + box[2:]) / 2.0
        for _ in range(CROPS_OF_A_TARGET):
            x, y = np.rint(middle - CROP_PX / 2 + random.uniform(-24, 24, 2)).astype(int)
            with_target.append(cut(sample, int(x), int(y)))
    anywhere = [
        cut(sample, *(int(random.integers(-16, max(1, side - CROP_PX + 16))) for side in sample.picture.shape[1::-1]))
        for _ in range(RANDOM_CROPS)
    ]
    return with_target, [crop for crop in anywhere if not len(crop.targets)]


def mistakes(sample: TrainingPicture, network: IntegerNetwork) -> list[Cutout]:
    """Squares around false detections of a network."""
    finder = LearnedDetector(TargetScale(factors=(1,)), network, (0.0, 1.0), (0.0, 1.0))
    known = [tuple(box) for box in np.concatenate([sample.targets, sample.ignored])]
    wrong = []
    for box in finder.boxes(sample.picture, None, 0.0):  # type: ignore[arg-type]  # factors need no pose
        if not any(iou(tuple(box[:4]), each) > 0.1 for each in known):
            x, y = np.rint((box[:2] + box[2:4]) / 2.0 - CROP_PX / 2).astype(int)
            wrong.append(cut(sample, int(x), int(y)))
    return wrong[:MINED]


def turned(crop: Cutout, random: np.random.Generator, *, upright: bool) -> Cutout:
    """The square, randomly flipped, rotated (unless it has an upper side) and with other brightness."""
    picture, boxes, ignored = crop.picture, crop.targets, crop.ignored
    if random.random() < 0.5:
        picture = picture[:, ::-1]
        boxes, ignored = (_flipped(each) for each in (boxes, ignored))
    for _ in range(0 if upright else int(random.integers(4))):
        picture = np.rot90(picture, -1)  # clockwise
        boxes, ignored = (_quarter(each) for each in (boxes, ignored))
    gain = random.uniform(0.85, 1.15) * random.uniform(0.95, 1.05, 3)
    lit = np.clip(picture * gain + random.uniform(-8, 8), 0, TOP).astype(np.uint8)
    return Cutout(lit, boxes, ignored)


def _flipped(boxes: BoxArray) -> BoxArray:
    return np.stack([CROP_PX - boxes[:, 2], boxes[:, 1], CROP_PX - boxes[:, 0], boxes[:, 3]], axis=1)


def _quarter(boxes: BoxArray) -> BoxArray:
    return np.stack([CROP_PX - boxes[:, 3], boxes[:, 0], CROP_PX - boxes[:, 1], boxes[:, 2]], axis=1)


def lesson(crop: Cutout) -> tuple[Float32, Float32]:
    """The intended output for a square.

    (cells, cells): 1 in the middle of a target, 0 away from targets, -1 where it does not matter. (cells, cells, 5):
    the distances to the target's sides and its shorter side, in pixels.
    """
    count = CROP_PX // CELL_PX
    centres = np.arange(count) * CELL_PX + 0.5
    wanted = np.zeros((count, count), np.float32)
    sides = np.zeros((count, count, 5), np.float32)
    for box in [*crop.ignored, *crop.targets]:
        near = (centres > box[0] - 2) & (centres < box[2] + 2), (centres > box[1] - 2) & (centres < box[3] + 2)
        wanted[np.ix_(near[1], near[0])] = -1.0
    for box in crop.targets:
        half = np.maximum(2.01, (box[2:] - box[:2]) / 5.0)
        middle = (box[:2] + box[2:]) / 2.0
        columns, rows = (np.flatnonzero(np.abs(centres - middle[axis]) <= half[axis]) for axis in (0, 1))
        for row in rows:
            for column in columns:
                wanted[row, column] = 1.0
                x, y = centres[column], centres[row]
                sides[row, column] = (x - box[0], y - box[1], box[2] - x, box[3] - y, max(6.0, min(box[2:] - box[:2])))
    return wanted, sides


class Student:
    """The network in floating point during training: weights, their gradients, and Adam."""

    def __init__(self, random: np.random.Generator) -> None:
        shapes = [(9 * i, o) for i, o in pairwise(CHANNELS)] + [(CHANNELS[-1], 5)]
        self.values: list[Float32] = []
        for rows, columns in shapes:
            self.values.append((random.standard_normal((rows, columns)) * np.sqrt(2.0 / rows)).astype(np.float32))
            self.values.append(np.zeros(columns, np.float32))
        self.values[-2] *= np.float32(0.1)
        self.values[-1][:] = (PRIOR, 0.4, 0.4, 0.4, 0.4)
        self._mean = [np.zeros_like(each) for each in self.values]
        self._square = [np.zeros_like(each) for each in self.values]
        self._steps = 0

    def forward(self, pictures: Bytes) -> tuple[list[Float32], list[Float32], Float32]:
        """The input and output of every layer, and the final output."""
        outputs = [(pictures.astype(np.float32) - MIDDLE) * np.float32(INPUT_SCALE)]
        inputs = []
        for n, (stride, dilation) in enumerate(zip(STRIDES, DILATIONS, strict=True)):
            inputs.append(taps(outputs[-1], stride, dilation))
            outputs.append(np.maximum(inputs[-1] @ self.values[2 * n] + self.values[2 * n + 1], 0))
        return inputs, outputs, outputs[-1] @ self.values[-2] + self.values[-1]

    def gradients(self, inputs: Sequence[Float32], outputs: Sequence[Float32], top: Float32) -> list[Float32]:
        """The gradients of all values, from the gradient of the final output."""
        grads: list[Float32] = [np.empty(0, np.float32)] * len(self.values)
        flat = top.reshape(-1, 5)
        grads[-2], grads[-1] = outputs[-1].reshape(-1, CHANNELS[-1]).T @ flat, flat.sum(axis=0)
        back = top @ self.values[-2].T
        for n in reversed(range(len(STRIDES))):
            back = back * (outputs[n + 1] > 0)
            flat = back.reshape(-1, back.shape[-1])
            grads[2 * n], grads[2 * n + 1] = inputs[n].reshape(len(flat), -1).T @ flat, flat.sum(axis=0)
            if n:
                back = untaps(back @ self.values[2 * n].T, outputs[n].shape, STRIDES[n], DILATIONS[n])
        return grads

    def learn(self, grads: Sequence[Float32], rate: float) -> None:
        """One step of Adam."""
        self._steps += 1
        for value, grad, mean, square in zip(self.values, grads, self._mean, self._square, strict=True):
            mean += np.float32(0.1) * (grad - mean)
            square += np.float32(0.01) * (grad * grad - square)
            step = mean / np.float32(1 - 0.9**self._steps)
            value -= np.float32(rate) * step / (np.sqrt(square / np.float32(1 - 0.99**self._steps)) + np.float32(1e-7))


def untaps(gradient: Float32, shape: tuple[int, ...], stride: int, dilation: int) -> Float32:
    """The adjoint of `taps`, for gradients: each tap's part is added to its cell."""
    _, rows, columns, _ = gradient.shape
    channels = shape[-1]
    padded = np.zeros((shape[0], shape[1] + 2 * dilation, shape[2] + 2 * dilation, channels), np.float32)
    for tap in range(9):
        top, left = tap // 3 * dilation, tap % 3 * dilation
        down = slice(top, top + stride * (rows - 1) + 1, stride)
        across = slice(left, left + stride * (columns - 1) + 1, stride)
        padded[:, down, across] += gradient[..., tap * channels : (tap + 1) * channels]
    return padded[:, dilation:-dilation, dilation:-dilation]


def slope(answer: Float32, wanted: Float32, sides: Float32) -> tuple[Float32, float]:
    """The gradient of the loss with respect to the output, and the loss.

    The loss is the focal loss of the evidence (Lin et al. 2017, gamma 2) and the Huber loss of the sides, as shares of
    the target's shorter side.
    """
    evidence = np.clip(answer[..., 0].astype(np.float64), -30, 30)
    p = 1.0 / (1.0 + np.exp(-evidence))
    right, wrong = wanted == 1, wanted == 0
    log_p, log_q = np.log(np.maximum(p, 1e-12)), np.log(np.maximum(1 - p, 1e-12))
    positives = max(1.0, float(right.sum()))
    grad = np.zeros(answer.shape, np.float64)
    grad[..., 0] = (
        right * (1 - p) ** 2 * (2 * p * log_p - (1 - p)) + wrong * p**2 * (p - 2 * (1 - p) * log_q)
    ) / positives
    loss = float(-(right * (1 - p) ** 2 * log_p + wrong * p**2 * log_q).sum() / positives)
    unit = np.maximum(sides[..., 4:], 1.0)
    off = (answer[..., 1:] * REACH_PX - sides[..., :4]) / unit
    of_target = 2.0 * right[..., None] / positives
    grad[..., 1:] = of_target * np.clip(off / BEND, -1, 1) * REACH_PX / unit
    loss += float((of_target * np.where(np.abs(off) < BEND, off**2 / 2 / BEND, np.abs(off) - BEND / 2)).sum())
    return grad.astype(np.float32), loss


@dataclass(frozen=True, slots=True)
class Course:
    """Parameters of a round of training."""

    steps: int
    """Number of steps."""
    upright: bool
    """True if pictures have an upper side."""
    rate: float
    """Learning rate at the beginning."""


def train(student: Student, pools: Sequence[Sequence[Cutout]], course: Course, random: np.random.Generator) -> None:
    """Train in steps over batches with equal numbers of squares from each pool. The rate follows half a cosine to 0."""
    pools = [pool for pool in pools if pool]
    share = BATCH // len(pools)
    total = 0.0
    for step in range(course.steps):
        chosen = [
            turned(pool[k], random, upright=course.upright)
            for pool in pools
            for k in random.integers(0, len(pool), share)
        ]
        lessons = [lesson(crop) for crop in chosen]
        inputs, outputs, answer = student.forward(np.stack([crop.picture for crop in chosen]))
        grad, loss = slope(answer, np.stack([each[0] for each in lessons]), np.stack([each[1] for each in lessons]))
        warm = min(1.0, (step + 1) / 20)
        rate = course.rate * warm * 0.5 * (1 + np.cos(np.pi * step / course.steps))
        student.learn(student.gradients(inputs, outputs, grad), rate)
        total += loss
        if step % 50 == 49:
            print(f"  step {step + 1}: loss {total / 50:.3f}", file=sys.stderr, flush=True)
            total = 0.0


def quantise(student: Student, pictures: Bytes) -> IntegerNetwork:
    """The network with int8 weights. `pictures` (squares) determine the range of each layer's values."""
    _, outputs, _ = student.forward(pictures)
    layers = []
    unit = INPUT_SCALE
    for n in range(len(STRIDES) + 1):
        weights, bias = student.values[2 * n].astype(np.float64), student.values[2 * n + 1].astype(np.float64)
        steps = np.maximum(np.abs(weights).max(axis=0), 1e-6) / 127.0
        if n < len(STRIDES):
            above = float(np.quantile(outputs[n + 1], 0.9998)) / TOP
            scale = unit * steps / above
        else:
            above = 1.0
            scale = unit * steps * np.array([1.0, *[REACH_PX] * 4])
        layers.append(IntegerLayer(
            np.rint(weights / steps).astype(np.float32),
            np.rint(bias / (unit * steps)).astype(np.float32),
            scale.astype(np.float32),
        ))  # fmt: skip
        unit = above
    return IntegerNetwork(tuple(layers))


Judged = list[tuple[float, bool]]
"""The evidence of each detected box, and True if it matches a target (IoU at least 0.5, each target once)."""

Curve = tuple[list[float], list[float]]
"""Evidence, and the confidence for it."""


def match_detections(finder: LearnedDetector, folder: Path, cls: str, frames: Iterable[SetFrame]) -> tuple[Judged, int]:
    """Every detected box in the frames, and the number of targets."""
    detections: Judged = []
    count = 0
    for frame in frames:
        rgb = decode_jpeg(read_picture(folder, cls, frame))
        size = np.array([rgb.shape[1], rgb.shape[0]] * 2, np.float64)
        left = [tuple(np.array(box.box) * size) for box in frame.frame.shows(cls)]
        count += len(left)
        for box in finder.boxes(rgb, frame.frame.pose, frame.frame.level_m):
            hit = next((each for each in left if iou(tuple(box[:4]), each) >= 0.5), None)
            if hit is not None:
                left.remove(hit)
            detections.append((float(box[4]), hit is not None))
    return detections, count


def fit_confidences(detections: Judged) -> Curve:
    """Points of a logistic curve of a box's probability by its evidence (Platt's scaling and prior)."""
    x = np.array([evidence for evidence, _ in detections] or [0.0])
    hits = np.array([float(hit) for _, hit in detections] or [0.0])
    n1, n0 = hits.sum(), len(hits) - hits.sum()
    wanted = np.where(hits > 0, (n1 + 1) / (n1 + 2), 1 / (n0 + 2))
    a, b = 1.0, 0.0
    for _ in range(100):
        p = 1 / (1 + np.exp(-np.clip(a * x + b, -30, 30)))
        w = np.maximum(p * (1 - p), 1e-6)
        g = np.array([((p - wanted) * x).sum() + 1e-2 * (a - 1.0), (p - wanted).sum() + 1e-2 * b])
        h = np.array([[(w * x * x).sum() + 1e-2, (w * x).sum()], [(w * x).sum(), w.sum() + 1e-2]])
        da, db = np.clip(np.linalg.solve(h, g), -1, 1)
        a, b = max(0.2, a - da), b - db
    knots = np.linspace(-2.0, 8.0, 21)
    return knots.tolist(), np.round(1 / (1 + np.exp(-(a * knots + b))), 4).tolist()


def scores(detections: Judged, targets: int, curve: Curve) -> dict[str, float]:
    """Precision and recall of boxes with a confidence of at least 1/2."""
    sure = [hit for evidence, hit in detections if np.interp(evidence, *curve) >= 0.5]
    hits = sum(sure)
    shares = {"precision": hits / max(1, len(sure)), "recall": hits / max(1, targets)}
    return {"targets": targets, **{name: round(value, 3) for name, value in shares.items()}}


def train_class(folder: Path, cls: str, steps: int, out: Path) -> dict[str, object]:
    """Train, quantise, fit and write one class. Return its entry in the card."""
    scale, random = SCALES[cls], np.random.Generator(np.random.PCG64(SEED))
    frames = read_class(folder, cls)
    own = [frame for frame in frames if frame.split == "train"]
    pictures = list(samples(folder, cls, own, scale))
    pools = [first_crops(sample, random) for sample in pictures]
    targets, others = [crop for some, _ in pools for crop in some], [crop for _, some in pools for crop in some]
    print(f"{cls}: {len(own)} frames, {len(targets)} squares with a target, {len(others)} without", file=sys.stderr)
    student, upright = Student(random), bool(scale.factors)
    train(student, [targets, others], Course(steps, upright, RATE), random)
    seen = np.stack([crop.picture for crop in [*targets[:200], *others[:200]]])
    network = quantise(student, seen)
    wrong = [crop for sample in pictures[::MINE_EVERY] for crop in mistakes(sample, network)]
    print(f"{cls}: {len(wrong)} mistakes for the second round", file=sys.stderr)
    train(student, [targets, wrong, targets, others], Course(steps, upright, RATE / 2), random)
    network = quantise(student, np.concatenate([seen, *[crop.picture[None] for crop in wrong[:200]]]))
    finder = LearnedDetector(scale, network, (0.0, 1.0), (0.0, 1.0))
    detections, count = match_detections(
        finder, folder, cls, [frame for frame in frames if frame.split == "validation"]
    )
    curve = fit_confidences(detections)
    arrays: dict[str, npt.NDArray[np.generic]] = {"evidence": np.array(curve[0]), "confidences": np.array(curve[1])}
    for n, layer in enumerate(network.layers):
        arrays |= {f"weights{n}": layer.weights.astype(np.int8), f"bias{n}": layer.bias.astype(np.int32)}
        arrays |= {f"scale{n}": layer.scale}
    out.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(out / f"{cls}.npz", **arrays)  # type: ignore[arg-type]
    file = out / f"{cls}.npz"
    entry = {
        "class": cls, "frames": len(own), "seeds": sorted({frame.frame.seed for frame in own}),
        "validation": scores(detections, count, curve),
        "set_sha256": hashlib.sha256((folder / cls / "frames.jsonl").read_bytes()).hexdigest(),
        "weights_sha256": hashlib.sha256(file.read_bytes()).hexdigest(), "numpy": np.__version__,
    }  # fmt: skip
    file.with_suffix(".json").write_text(json.dumps(entry, indent=1) + "\n", encoding="utf-8")
    return entry


CARD = """\
# Weights of the trained detector

One network a class (`lingjing_agents.perception.learned.network`) with int8 weights, written by
`tools/train_detector.py`. They were trained on frames that `lingjing frames export` chose of development episodes of
the heuristic: none of the seeds that an evaluation plays (0 to 199). The last fifth of the seeds was kept from
training; the confidences were fitted on it, and precision and recall of boxes that are sure by half (IoU at least 0.5)
are of it, so they flatter. `docs/frames.md` has what is found on seeds that had no part in either.

| class | frames | seeds of training | targets of the validation | precision | recall | SHA-256 |
| --- | ---: | --- | ---: | ---: | ---: | --- |
{rows}

Trained with numpy {numpy}. The same set, numpy and kernels (`lingjing.numerics`) give the same bytes; the SHA-256 of
each set's `frames.jsonl` stands beside the weights. License: that of the project.
"""


def write_card(folder: Path) -> None:
    """Write the card of all weights in a folder, from their records."""
    entries = [json.loads(file.read_text(encoding="utf-8")) for file in sorted(folder.glob("*.json"))]
    rows = [_card_row(entry, entry["validation"]) for entry in entries]
    numpy = ", ".join(sorted({entry["numpy"] for entry in entries}))
    (folder / "CARD.md").write_text(CARD.format(rows="\n".join(rows), numpy=numpy), encoding="utf-8")


def _card_row(entry: dict[str, Any], validation: dict[str, Any]) -> str:
    return (
        f"| `{entry['class']}` | {entry['frames']} | {', '.join(map(str, entry['seeds']))} | {validation['targets']} "
        f"| {validation['precision']:.2f} | {validation['recall']:.2f} | `{entry['weights_sha256'][:16]}` |"
    )


def main() -> int:
    """Train the requested classes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path, metavar="SET", help="a folder of `lingjing frames export`")
    parser.add_argument("--classes", nargs="+", choices=sorted(SCALES), default=sorted(SCALES), metavar="CLASS")
    parser.add_argument("--steps", type=int, default=400, help="of each of the two rounds (default 400)")
    parser.add_argument("-o", "--output", type=Path, default=WEIGHTS, metavar="DIR", help="default: the shipped ones")
    args = parser.parse_args()
    for cls in args.classes:
        print(json.dumps(train_class(args.set, cls, args.steps, args.output)), flush=True)
        write_card(args.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
