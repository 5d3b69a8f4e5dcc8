"""Vehicles and people before eyes trained on photographs: a detector of COCO's classes from a package (`make eyes`).

The detector (CenterNet, or NanoDet with `--net nanodet`; both MIT) looks at native 1080p pictures through windows of
540 and 1,080 pixels with half overlap; a body is found if a detection of a right class with a score of 0.4 overlaps its
exact box by half. First come false detections on empty streets; then single bodies at 6 to 16 m from three bearings;
then street frames. Models from a package stand at the same places in the same pose, street, shader and camera, as a
reference; pairs are compared by the difference of recalls, with its lower 90 % bound.

It shows that vehicles and people can be recognised by such a net. It shows no realism and no transfer to photographs.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
from collections.abc import Iterator, Sequence
from math import cos, radians, sin, sqrt
from pathlib import Path

import numpy as np
from eyes_models import reference_models
from eyes_street import SIZE, Body, Picture, Place, Street, offer
from PIL import Image

from lingjing.trace.records import Box

HERE = Path(__file__).resolve().parent
NET = HERE / "eyes_net" / "detect.mjs"
SIDES = {"centernet": 512, "nanodet": 416}
"""Nets, and the side of the picture that each reads, pixels."""
SCORE, OVERLAP = 0.4, 0.5
CLASSES = {0: "person", 1: "bicycle", 2: "car", 3: "motorcycle", 5: "bus", 7: "truck"}
RIGHT = {"car": {"car"}, "truck": {"truck"}, "delivery_van": {"car", "truck", "bus"}, "person": {"person"}}
"""Classes of COCO that are right for each of our looks."""
HALF_M = {"car": 2.3, "truck": 4.5, "delivery_van": 3.0, "person": 0.4}
BEARINGS = (30.0, 95.0, 155.0)
"""Bearings of the viewer from the body's heading, degrees (0: in front)."""
NEAR_M, FAR_M = 6.0, 16.0
Z90 = 1.2816
VARIANTS = 12

Detection = tuple[str, float, float, float, float, float]
"""Class, score, and the box in pixels."""


class Detector:
    """The detector in a process of its own."""

    def __init__(self, net: str) -> None:
        self.side = SIDES[net]
        self.process = subprocess.Popen(["node", str(NET), net], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def find(self, rgb: np.ndarray, windows: Sequence[tuple[int, int, int]]) -> list[Detection]:
        """Return the detections in windows (left, top, side) of a picture, in its pixels."""
        detections: list[Detection] = []
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        for left, top, side in windows:
            part = Image.fromarray(rgb[top : top + side, left : left + side])
            self.process.stdin.write(part.resize((self.side, self.side), Image.Resampling.BILINEAR).tobytes())
            self.process.stdin.flush()
            for kind, score, *box in json.loads(self.process.stdout.readline()):
                if kind in CLASSES and score >= SCORE:
                    x0, y0, x1, y1 = (v * side for v in box)
                    detections.append((CLASSES[kind], score, left + x0, top + y0, left + x1, top + y1))
        return detections

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait()


def windows() -> list[tuple[int, int, int]]:
    """Return all windows of a picture: left, top, side."""
    out = []
    for side in (540, 1080):
        lefts = [*range(0, SIZE[0] - side, side // 2), SIZE[0] - side]
        tops = [*range(0, SIZE[1] - side, side // 2), SIZE[1] - side]
        out += [(left, top, side) for top in tops for left in lefts]
    return out


def around(box: tuple[float, float, float, float]) -> list[tuple[int, int, int]]:
    """Return the windows that hold at least half of a box, those that hold most of it first."""
    x0, y0, x1, y1 = box
    area = max((x1 - x0) * (y1 - y0), 1.0)

    def held(left: int, top: int, side: int) -> float:
        wide = min(x1, left + side) - max(x0, left)
        high = min(y1, top + side) - max(y0, top)
        return max(wide, 0.0) * max(high, 0.0) / area

    return sorted((window for window in windows() if held(*window) >= OVERLAP), key=lambda window: -held(*window))


def overlap(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the intersection over the union of two boxes."""
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    both = max(wide, 0.0) * max(high, 0.0)
    return both / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - both)


def pixels(box: Box) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = box.box
    return x0 * SIZE[0], y0 * SIZE[1], x1 * SIZE[0], y1 * SIZE[1]


class Observer:
    """The street with both sets of models, and the detector."""

    def __init__(self, package: Path, net: str) -> None:
        models = reference_models(package)
        for kind, meshes in models.items():
            offer(f"reference/{kind}", meshes)
        self.street = Street([*RIGHT, *(f"reference/{kind}" for kind in RIGHT)], VARIANTS)
        self.detector = Detector(net)

    def empty(self, count: int) -> dict[str, int]:
        """Return the false detections by class in pictures of empty streets."""
        counts = dict.fromkeys(CLASSES.values(), 0)
        for place in self.street.places(count, 1):
            picture = self.street.shoot(*self.street.view_of(place, 180.0, 10.0), ())
            for detection in distinct(self.detector.find(picture.rgb, windows())):
                counts[detection[0]] += 1
        return counts

    def singles(self, kind: str, count: int, save: Path | None) -> list[tuple[float, bool, bool]]:
        """Return (bearing, ours found, reference found) for each pose."""
        chance, out = random.Random(f"{kind}-single"), []
        for number, place in enumerate(self.street.places(30 * count, 2)):
            if len(out) == count:
                break
            bearing = BEARINGS[number % 3]
            away = chance.uniform(NEAR_M, FAR_M) + HALF_M[kind] * (1.0 - 0.5 * sin(radians(bearing)))
            turned = bearing + chance.uniform(-15.0, 15.0)
            view = self.street.view_of(place, turned if chance.random() < 0.5 else -turned, away)
            if not self.street.is_clear(*view, away, HALF_M[kind]):
                continue
            pair = []
            for look in (kind, f"reference/{kind}"):
                body = Body(look, number, place)
                picture = self.street.shoot(*view, [body])
                pair.append(self.is_found(picture, kind, 0))
                if save is not None:
                    keep(save / f"{kind}-{number:03d}-{look.split('/')[0]}-{int(pair[-1])}.png", picture)
            out.append((bearing, *pair))
        return out

    def is_found(self, picture: Picture, kind: str, which: int) -> bool:
        box = picture.boxes[which]
        if box is None:
            return False
        mine = pixels(box)
        return any(  # a window at a time: most bodies are found in the first
            name in RIGHT[kind] and overlap(mine, corners) >= OVERLAP
            for window in around(mine)
            for name, _, *corners in self.detector.find(picture.rgb, [window])
        )

    def frames(self, count: int) -> Iterator[tuple[str, bool, bool]]:
        """Yield (kind, ours found, reference found) for each body of street frames that both pictures show."""
        chance = random.Random("frames")
        for number, place in enumerate(self.street.places(count, 3)):
            view = self.street.view_of(place, 180.0, 8.0)
            kinds = ["car", "truck", "car", "delivery_van", "person", "person", "person"]
            spots = [beside(place, *spot) for spot in standing(chance)]
            pictures = [
                self.street.shoot(*view, [Body(before + kind, 7 * number + k, spot)
                                          for k, (kind, spot) in enumerate(zip(kinds, spots, strict=True))])
                for before in ("", "reference/")
            ]  # fmt: skip
            for which, kind in enumerate(kinds):
                boxes = [picture.boxes[which] for picture in pictures]
                if all(box is not None and box.pixels >= LEAST_PX for box in boxes):
                    ours, theirs = (self.is_found(picture, kind, which) for picture in pictures)
                    yield kind, ours, theirs


LEAST_PX = 900
"""Pixels from which a body of a street frame counts (chosen)."""


def standing(chance: random.Random) -> list[tuple[float, float, float]]:
    """Return right, ahead (m) and turn (deg) of the bodies of a street frame."""
    ahead, out = chance.uniform(2.0, 5.0), []
    for k, side in enumerate((0.0, -3.3, 0.0, -3.3)):
        out.append((side, ahead + 11.0 * k + chance.uniform(-1.5, 1.5), 180.0 if side < 0.0 else 0.0))
    out += [(chance.uniform(2.5, 6.0), chance.uniform(0.0, 16.0), chance.uniform(0.0, 360.0)) for _ in range(3)]
    return out


def beside(place: Place, right: float, ahead: float, turn_deg: float) -> Place:
    h = radians(place.heading_deg)
    x, y, z = place.position
    east, north = right * cos(h) + ahead * sin(h), ahead * cos(h) - right * sin(h)
    return Place((x + east, y + north, z), (place.heading_deg + turn_deg) % 360.0)


def distinct(detections: list[Detection]) -> list[Detection]:
    """Return detections without those that overlap a better one of their class by half."""
    kept: list[Detection] = []
    for candidate in sorted(detections, key=lambda d: -d[1]):
        if all(candidate[0] != other[0] or overlap(candidate[2:], other[2:]) < OVERLAP for other in kept):
            kept.append(candidate)
    return kept


def keep(file: Path, picture: Picture) -> None:
    """Write the part of a picture around its first body."""
    box = picture.boxes[0]
    if box is not None:
        x0, y0, x1, y1 = pixels(box)
        Image.fromarray(picture.rgb).crop((int(x0) - 40, int(y0) - 40, int(x1) + 40, int(y1) + 40)).save(file)


def difference(pairs: Sequence[tuple[bool, bool]]) -> tuple[float, float]:
    """Return the paired difference of recalls and its lower 90 % bound, each in points.

    The bound is Agresti and Min's: half a pair more in each cell of the table.
    """
    n = len(pairs) + 2.0
    more = sum(a and not b for a, b in pairs) + 0.5
    less = sum(b and not a for a, b in pairs) + 0.5
    mean = (more - less) / n
    spread = sqrt(max((more + less) / n - mean * mean, 0.0) / n)
    plain = sum(a - b for a, b in pairs) / max(len(pairs), 1)
    return 100.0 * plain, 100.0 * (mean - Z90 * spread)


def row(name: str, pairs: Sequence[tuple[bool, bool]]) -> str:
    n = len(pairs)
    ours, theirs = sum(a for a, _ in pairs), sum(b for _, b in pairs)
    if not n:
        return f"| {name:22} |      0 |        - |         - |          - |           - |"
    mean, bound = difference(pairs)
    return f"| {name:22} | {n:6d} | {ours:8d} | {theirs:9d} | {mean:+10.0f} | {bound:+11.0f} |"


HEAD = f"| {'bodies':22} | {'poses':>6} | {'ours':>8} | {'reference':>9} | {'difference':>10} | {'lower bound':>11} |"


def main(arguments: Sequence[str]) -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a tenth of the pictures")
    parser.add_argument("--kinds", nargs="+", choices=RIGHT, default=list(RIGHT), help="single bodies of these kinds")
    parser.add_argument("--only", choices=("empty", "singles", "frames"), help="one part")
    parser.add_argument("--count", type=int, help="poses of each kind")
    parser.add_argument("--package", type=Path, default=HERE.parent / "build" / "eyes", help="the reference's folder")
    parser.add_argument("--net", choices=SIDES, default="centernet", help="the detector (default: centernet)")
    parser.add_argument("--save", type=Path, help="a folder for the pictures of single bodies")
    options = parser.parse_args(arguments)
    if options.save is not None:
        options.save.mkdir(parents=True, exist_ok=True)
    count = options.count or (12 if options.quick else 102)
    observer = Observer(options.package, options.net)
    if options.only in (None, "empty"):
        streets = 4 if options.quick else 30
        print(f"False detections on {streets} empty streets: {observer.empty(streets)}\n", flush=True)
    print(HEAD, "\n|" + "-" * (len(HEAD) - 2) + "|", sep="")
    if options.only in (None, "singles"):
        for kind in options.kinds:
            poses = observer.singles(kind, count, options.save)
            for bearing in BEARINGS:
                print(row(f"{kind}, {bearing:.0f} deg", [(a, b) for at, a, b in poses if at == bearing]))
            print(row(kind, [(a, b) for _, a, b in poses]), flush=True)
    if options.only in (None, "frames"):
        bodies = list(observer.frames(4 if options.quick else 30))
        for kind in RIGHT:
            print(row(f"street: {kind}", [(a, b) for name, a, b in bodies if name == kind]), flush=True)
    observer.detector.close()
    observer.street.engine.close()


if __name__ == "__main__":
    main(sys.argv[1:])
