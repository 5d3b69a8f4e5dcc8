"""Cars from above: a small net that is trained on one half of their looks finds the other half's?

No packaged detector looks down, so the net is that of the policy `learned`, trained here (`tools/train_detector.py`)
on pictures of a street from 50 m with three of the six shapes of a car in five of ten paints. It is tested at places
that training has not shown, with these looks and, at the same places in the same poses, with the three other shapes in
the five other paints; with `--paints shared` both halves have all paints. A car is found if a box with a confidence of
0.5 overlaps its exact box by half; confidences are fitted on places of their own, with the looks of training. Pictures
of the same streets without cars are searched for false detections.

It shows that what such a net learns of one half of the looks holds for the other half. It shows no realism, and nothing
about photographs.

    python -m benchmarks.aerial_looks --paints shared
"""

from __future__ import annotations

import argparse
import random
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

from lingjing.numerics import pin

if __name__ == "__main__":
    pin()

import numpy as np
from lingjing_agents.perception.learned.detector import LearnedDetector
from lingjing_agents.perception.learned.targets import TargetScale
from PIL import Image

from benchmarks.eyes_street import AWAY, SCENE, WEATHER, Place, Street, without_vehicles
from lingjing.analysis.detection import iou
from lingjing.engines.camera.engine import CameraEngine
from lingjing.mission.instance import CameraSpec, Entity
from lingjing.mission.model import CameraMount
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.testing import bare_instance, city_of
from lingjing.trace.records import BodyState
from tools.train_detector import (
    MINE_EVERY,
    RATE,
    SEED,
    Course,
    Curve,
    Judged,
    Student,
    TrainingPicture,
    first_crops,
    fit_confidences,
    mistakes,
    quantise,
    train,
)

SIZE = 640, 360
HFOV_DEG, HEIGHT_M = 84.0, 50.0
SHAPES, PAINTS = 6, 10
"""Shapes and paints of a car (`lingjing.engines.camera.models.vehicles`)."""
HALVES = {"trained": (0, 2, 4), "held out": (1, 3, 5)}
"""Shapes of each half; its paints are those of the same parity, unless both have all."""
CARS = 6
"""Cars in a picture."""
SLOTS_M = (-19.0, -12.0, -5.0, 2.0, 9.0, 16.0)
"""Places of the cars along the lane."""
LEAST_PX = 120
"""Visible pixels from which a car counts (chosen: a third of one)."""
SPLITS = {"training": (60, 1), "validation": (20, 2), "test": (40, 3)}
"""Pictures and seed of the places of each part."""
SURE = 0.5
Z90 = 1.2816
EMPTY = np.zeros((0, 4))


@dataclass(frozen=True)
class Seen:
    """A picture and the boxes of its cars, pixels."""

    rgb: np.ndarray
    boxes: np.ndarray
    paints: tuple[int, ...]
    """The paint of the car in each box."""


def variants(half: str, paints_of: str) -> list[int]:
    """Return the numbers of the looks of a half."""
    shapes = HALVES[half]
    paints = range(PAINTS) if paints_of == "shared" else range(shapes[0] % 2, PAINTS, 2)
    return [SHAPES * ((paint - shape) % PAINTS) + shape for shape in shapes for paint in paints]


def paint_of(number: int) -> int:
    turn, shape = divmod(number, SHAPES)
    return (turn + shape) % PAINTS


class Above:
    """A camera that looks down on the street of `eyes.py`, and all looks of cars."""

    def __init__(self, paints_of: str) -> None:
        self.looks = {half: variants(half, paints_of) for half in HALVES}
        self.city, self.engine = without_vehicles(city_of(SCENE)), CameraEngine()
        camera = CameraSpec(name="down", view="nadir", width=SIZE[0], height=SIZE[1], hfov_deg=HFOV_DEG,
                            channels=("rgb",), capture="on_request")  # fmt: skip
        mount = CameraMount(view="nadir", ahead_m=0.0, above_m=0.0, tilt_deg=90.0, gimbal=True)
        viewer = Entity(id="viewer", group="viewer", index=1, role="asset", type="quadrotor", engine="x",
                        position=(0.0, 0.0, HEIGHT_M), cameras=(camera,), mounts=(mount,))  # fmt: skip
        self.numbers = [number for looks in self.looks.values() for number in looks]
        pool = [
            Entity(id=f"car/{number}", group="car", index=k + 1, role="asset", type="car", engine="x", position=AWAY,
                   properties={"look": "car", "look_variant": number})
            for k, number in enumerate(self.numbers)
        ]  # fmt: skip
        instance = bare_instance((viewer, *pool), scene=SCENE, weather=WEATHER)
        self.engine.reset(EngineSpec(engine="camera", instance=instance, owns=()), self.city, 7)

    def shoot(self, centre: Place, cars: dict[int, Place]) -> Seen:
        """Return a picture from above a place, with cars by the number of their look."""
        x, y, z = centre.position
        states = [BodyState(id="viewer", position=(x, y, z + HEIGHT_M), heading_deg=centre.heading_deg)]
        for number in self.numbers:
            place = cars.get(number, Place(AWAY, 0.0))
            states.append(BodyState(id=f"car/{number}", position=place.position, heading_deg=place.heading_deg))
        self.engine.advance(10.0, states)
        request = CaptureRequest(frame="f", entity="viewer", camera="down", tick=1, time_s=10.0)
        (frame,) = self.engine.capture([request])
        boxes = [box for box in frame.info.boxes if box.pixels >= LEAST_PX]
        corners = np.array([box.box for box in boxes]).reshape(-1, 4) * [*SIZE, *SIZE]
        return Seen(frame.rgb, corners, tuple(paint_of(int(box.entity.split("/")[1])) for box in boxes))


def scenes(places: Sequence[Place], chance: random.Random) -> Iterator[tuple[Place, list[Place]]]:
    """Yield the place of each picture, turned at random, and those of its cars."""
    for lane in places:
        cars = []
        for along in chance.sample(SLOTS_M, CARS):
            turn = chance.choice((0.0, 180.0)) + chance.uniform(-12.0, 12.0)
            cars.append(beside(lane, chance.uniform(-4.5, 2.0), along + chance.uniform(-0.8, 0.8), turn))
        yield Place(lane.position, chance.uniform(0.0, 360.0)), cars


def beside(place: Place, right: float, ahead: float, turn_deg: float) -> Place:
    """Return a place right and ahead of another (m), turned."""
    h = np.radians(place.heading_deg)
    x, y, z = place.position
    east, north = right * np.cos(h) + ahead * np.sin(h), ahead * np.cos(h) - right * np.sin(h)
    return Place((x + float(east), y + float(north), z), (place.heading_deg + turn_deg) % 360.0)


def pictures(above: Above, street: Sequence[Place], seed: int, halves: Sequence[str]) -> Iterator[list[Seen]]:
    """Yield for each place the pictures with looks of each half, in the same poses, and the one without cars."""
    chance = random.Random(seed)
    for centre, cars in scenes(street, chance):
        shown = [dict(zip(chance.sample(above.looks[half], CARS), cars, strict=True)) for half in halves]
        yield [above.shoot(centre, each) for each in (*shown, {})]


def learned(seen: Sequence[Seen], steps: int) -> LearnedDetector:
    """Return a net that is trained as `tools/train_detector.py` trains: two rounds, the second with its mistakes."""
    chance = np.random.Generator(np.random.PCG64(SEED))
    samples = [TrainingPicture(each.rgb, each.boxes, EMPTY) for each in seen]
    pools = [first_crops(sample, chance) for sample in samples]
    targets, others = [crop for some, _ in pools for crop in some], [crop for _, some in pools for crop in some]
    student = Student(chance)
    train(student, [targets, others], Course(steps, False, RATE), chance)
    crops = np.stack([crop.picture for crop in [*targets[:200], *others[:200]]])
    network = quantise(student, crops)
    wrong = [crop for sample in samples[::MINE_EVERY] for crop in mistakes(sample, network)] or others
    train(student, [targets, wrong, targets, others], Course(steps, False, RATE / 2), chance)
    return LearnedDetector(TargetScale(factors=(1,)), quantise(student, crops), (0.0, 1.0), (0.0, 1.0))


def judged(finder: LearnedDetector, seen: Seen) -> tuple[Judged, list[float]]:
    """Return each detected box with its evidence and whether it is right, and each car's evidence (-inf: not found)."""
    left, evidence, boxes = [tuple(box) for box in seen.boxes], [-np.inf] * len(seen.boxes), []
    for box in finder.boxes(seen.rgb, None, 0.0):  # type: ignore[arg-type]  # a fixed factor needs no pose
        hit = next((k for k, each in enumerate(left) if each and iou(tuple(box[:4]), each) >= 0.5), None)
        if hit is not None:
            left[hit], evidence[hit] = (), float(box[4])
        boxes.append((float(box[4]), hit is not None))
    return boxes, evidence


def confident(evidence: float, curve: Curve) -> bool:
    return bool(np.isfinite(evidence) and np.interp(evidence, *curve) >= SURE)


def main() -> None:
    """Train, test and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=400, help="of each of the two rounds (default 400)")
    parser.add_argument("--paints", choices=("apart", "shared"), default="apart", help="of the halves (default: apart)")
    parser.add_argument("--save", type=Path, help="a folder for the pictures of the test")
    options = parser.parse_args()
    above, spent = Above(options.paints), time.process_time()
    street = {name: Street.places(above, count, seed) for name, (count, seed) in SPLITS.items()}  # type: ignore[arg-type]
    shown = list(pictures(above, street["training"], 1, ("trained",)))
    finder = learned([each for pair in shown for each in pair], options.steps)
    checks = [judged(finder, pair[0])[0] for pair in pictures(above, street["validation"], 2, ("trained",))]
    curve = fit_confidences([box for boxes in checks for box in boxes])
    cars: dict[str, list[bool]] = {half: [] for half in HALVES}
    by_paint: dict[int, list[bool]] = {paint: [] for paint in range(PAINTS)}
    false = dict.fromkeys((*HALVES, "no cars"), 0)
    for number, seen in enumerate(pictures(above, street["test"], 3, tuple(HALVES))):
        for name, picture in zip(false, seen, strict=True):
            boxes, evidence = judged(finder, picture)
            false[name] += sum(not right and confident(value, curve) for value, right in boxes)
            if name in cars:
                cars[name] += [confident(value, curve) for value in evidence]
                for paint, value in zip(picture.paints, evidence, strict=True):
                    by_paint[paint] += [confident(value, curve)] if name == "held out" else []
            if options.save is not None:
                options.save.mkdir(parents=True, exist_ok=True)
                Image.fromarray(picture.rgb).save(options.save / f"{number:02d}-{name.replace(' ', '-')}.png")
    above.engine.close()
    print("| Looks | Cars | Found | Share, 90 % bounds | False, in 40 pictures |\n|---|---|---|---|---|")
    for name, hits in cars.items():
        print(f"| {name} | {len(hits)} | {sum(hits)} | {share(sum(hits), len(hits))} | {false[name]} |")
    print(f"| no cars | 0 | | | {false['no cars']} |\n")
    print("held out, by paint:", ", ".join(f"{paint}: {sum(v)} of {len(v)}" for paint, v in by_paint.items() if v))
    print(f"{time.process_time() - spent:.0f} s of CPU")


def share(hits: int, count: int) -> str:
    """Return a share with Wilson's 90 % bounds."""
    n, p = max(count, 1), hits / max(count, 1)
    z = 1.6449
    middle, spread = p + z * z / (2 * n), z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = ((middle + sign * spread) / (1 + z * z / n) for sign in (-1, 1))
    return f"{p:.2f} [{low:.2f}, {high:.2f}]"


if __name__ == "__main__":
    main()
