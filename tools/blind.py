"""A blind test of pictures: nameless crops of targets and of things that resemble them, to be named by forced choice.

`tools/blind.py draw FOLDER` draws `PER_CLASS` crops of each class at the distances of its mission, in the frames of the
mission's camera and in native pixels, and writes them with numbers in random order. `join` puts them on sheets. A judge
looks at the sheets and writes one class for each number, a line each: `17 steam`. `blind.py score ANSWERS` prints the
confusion matrix. The order follows from `--order`, so the key is computed and never stored; another judge gets sheets
of another order and of other `--seeds`.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice, pairwise
from math import cos, sin
from pathlib import Path

import contact_sheet as sheets
import msgspec
import numpy as np
from contact_sheet import JAM, ROOT, Photo, Studio
from PIL import Image, ImageDraw

from lingjing.mission.instance import Entity, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.scene.anchor import anchor
from lingjing.scene.camera_geometry import camera_axes, focal_px
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Box, CameraPose

PER_CLASS, SEEDS, ORDER = 40, (2101, 2102), 2026
"""Crops of each class, usual seeds of the instances, and usual seed of their order."""
CROP_PX, CELL_PX, COLUMNS, ROWS = 128, 176, 8, 5
"""Least side of a crop in the frame; side of a cell, columns and rows of a sheet."""
LEAST_PX, TRIES = 60, 12
"""Least visible pixels of a target, and views that are tried for one crop."""
FLOWING = (("car", -1.7, -24.0, 0.0), ("car", 1.7, 21.0, 0.0))


@dataclass(frozen=True)
class Subject:
    """A class of crops."""

    mission: str
    view: str
    away_m: tuple[float, float]
    """Least and greatest distance of the viewer on the ground, or height for a view from above."""
    target: str = ""
    """Group of the target; empty for a look-alike."""
    props: tuple[str, ...] = ()
    status: str = ""
    ambient: tuple[tuple[str, float, float, float], ...] = ()
    place: str = ""
    """Place of a look-alike without a prop: `roof`, `bridge`, `door`, `crowd`."""
    above_m: float = 0.0

    @property
    def crops(self) -> int:
        """Number of crops: `PER_CLASS` of a target, half of them of a look-alike."""
        return PER_CLASS if self.target and not self.status else PER_CLASS // 2


SUBJECTS = {
    "building fire": Subject("ufr", "nadir", (70.0, 110.0), "fire"),
    "orange roof": Subject("ufr", "nadir", (70.0, 110.0), place="roof"),
    "fire on the ground": Subject("idf", "dog_eye", (4.0, 16.0), "fire"),
    "steam": Subject("idf", "front", (6.0, 12.0), props=("steam_vent",), above_m=3.0),
    "leak": Subject("upr", "nadir", (25.0, 60.0), "leak"),
    "sound pipe": Subject("upr", "nadir", (25.0, 60.0), "leak", status="sealed"),
    "fracture": Subject("bi", "nadir", (60.0, 100.0), "fracture"),
    "whole bridge": Subject("bi", "nadir", (60.0, 100.0), place="bridge"),
    "person in water": Subject("ssr", "nadir", (60.0, 100.0), "victim"),
    "buoy": Subject("ssr", "nadir", (60.0, 100.0), props=("buoy_orange", "buoy_red", "buoy_yellow")),
    "jam": Subject("cr", "nadir", (40.0, 80.0), "jam", ambient=JAM),
    "flowing traffic": Subject("cr", "nadir", (40.0, 80.0), "jam", ambient=FLOWING),
    "house with delivery door": Subject("ld", "dog_eye", (4.0, 9.0), "house"),
    "other entrance": Subject("ld", "dog_eye", (4.0, 9.0), place="door"),
    "parcel locker": Subject("cd", "dash", (8.0, 15.0), "point"),
    "warehouse": Subject("cd", "dash", (11.0, 20.0), "depot"),
    "parking sign": Subject("cr", "dash", (8.0, 15.0), "goal_place"),
    "queue": Subject("queue", "nadir", (25.0, 40.0), "shop"),
    "people at random": Subject("queue", "nadir", (25.0, 40.0), place="crowd"),
}
"""Classes by the name that a judge writes."""


def order(seed: int = ORDER) -> list[tuple[str, int]]:
    """Return class and number within the class of each crop, in the order of the sheets that a seed gives."""
    crops = [(name, k) for name, subject in SUBJECTS.items() for k in range(subject.crops)]
    random.Random(seed).shuffle(crops)
    return crops


class Artist:
    """A studio with the instances of some seeds."""

    def __init__(self, seeds: Sequence[int] = SEEDS) -> None:
        self.studio = Studio()
        self.seeds = tuple(seeds)

    def crops(self, name: str) -> Iterator[Image.Image]:
        """Yield the crops of a class."""
        subject = SUBJECTS[name]
        chance = random.Random(name if self.seeds == SEEDS else f"{name} {self.seeds}")
        for seed in self.seeds:
            bare = instantiate(sheets.load_mission(ROOT / "scenarios" / f"{subject.mission}.ljs"), seed=seed)
            city = self.studio.host.scene(bare.scene.kind).build(bare.scene)
            instance, many = anchor(bare, city), subject.crops // len(self.seeds)
            sets = self._sets(subject, instance, city, chance)
            views = (self._views(subject, instance, city, *some, chance) for some in sets)
            yield from islice(chain.from_iterable(views), many)

    def _sets(
        self, subject: Subject, instance: Instance, city: City, chance: random.Random
    ) -> Iterator[tuple[list[Entity], Entity, int]]:
        """Yield entities, the one in the middle, and the crops of it that are wanted."""
        known = [e for e in instance.entities if e.group == subject.target or e.id == subject.target]
        sample = known[0] if known else instance.entities[0]
        half = subject.crops // len(self.seeds)
        if subject.target:
            for target in known * 2:
                yield known, target, -(-half // len(known))
            return
        places = list(_places(subject, sample, instance, city, chance))
        chance.shuffle(places)
        for middle in places[: half * 3]:
            people = _crowd(middle, chance) if subject.place == "crowd" else []
            yield people, middle, 2

    def _views(
        self, subject: Subject, instance: Instance, city: City, entities: list[Entity], middle: Entity, wanted: int,
        chance: random.Random,
    ) -> Iterator[Image.Image]:  # fmt: skip
        viewer = sheets._viewer(Photo("", subject.mission, "", subject.view, 1.0, 0.0), middle, 0.0)
        cast = (*entities, viewer)
        played = msgspec.structs.replace(instance, entities=cast, events=())
        self.studio.engine.reset(EngineSpec(engine="camera", instance=played, owns=()), city, 7)
        states = [BodyState(id=e.id, position=e.position, heading_deg=e.heading_deg, status=subject.status)
                  for e in entities]  # fmt: skip
        traffic = sheets._ambient(Photo("", "", "", "", 0.0, 0.0, ambient=subject.ambient), middle)
        made = 0
        for _ in range(TRIES):
            if made == wanted:
                return
            crop = self._view(subject, middle, viewer, [*states, *traffic], bool(subject.target), chance)
            if crop is not None:
                made += 1
                yield crop

    def _view(
        self, subject: Subject, middle: Entity, viewer: Entity, states: list[BodyState], is_target: bool,
        chance: random.Random,
    ) -> Image.Image | None:  # fmt: skip
        away, time_s = chance.uniform(*subject.away_m), chance.uniform(5.0, 60.0)
        if subject.view == "nadir":
            photo = Photo("", "", "", "nadir", 0.0, away)
            heading, bearing = chance.uniform(0.0, 360.0), 0.0
        else:
            ahead = subject.view == "dash"
            bearing = middle.heading_deg + (chance.uniform(175.0, 200.0) if ahead else chance.uniform(-40.0, 40.0))
            if subject.mission == "idf":
                bearing = chance.uniform(0.0, 360.0)
            photo = Photo("", "", "", subject.view, away, subject.above_m)
            heading = (bearing + 180.0) % 360.0
        at = replace_viewer(viewer, photo, middle, bearing, heading)
        self.studio.engine.advance(time_s, [*states, at])
        (frame,) = self.studio.engine.capture(
            [CaptureRequest(frame="f", entity="viewer", camera="eye", tick=1, time_s=time_s)]
        )
        box = next((box for box in frame.info.boxes if box.entity == middle.id), None)
        if is_target and subject.mission != "cr" and (box is None or box.pixels < LEAST_PX):
            return None
        return cropped(frame.rgb, box, frame.info.pose, middle.position)


def replace_viewer(viewer: Entity, photo: Photo, middle: Entity, bearing: float, heading: float) -> BodyState:
    """Return the state of the viewer of a photo."""
    placed = sheets._viewer(photo, middle, bearing)
    return BodyState(id=viewer.id, position=placed.position, heading_deg=heading)


Place = tuple[tuple[float, float, float], float]
"""Position (m) and heading (deg) of a look-alike."""


def _places(
    subject: Subject, sample: Entity, instance: Instance, city: City, chance: random.Random
) -> Iterator[Entity]:
    """Yield the places of a look-alike."""
    if subject.props:
        props = (prop for prop in city.props if prop.model in subject.props)
        places: Iterator[Place] = ((prop.position, prop.heading_deg) for prop in props)
    elif subject.place == "roof":
        places = _orange_roofs(city)
    elif subject.place == "bridge":
        places = _on_bridges(city, chance)
    elif subject.place == "door":
        doors = (b for b in city.buildings if b.entrance is not None and b.base_m < 1.0)
        places = (((b.entrance[0], b.entrance[1], b.base_m), b.entrance[2]) for b in doors if b.entrance)
    else:
        shops = [e.position for e in instance.entities if e.group == "shop"]
        places = ((position, chance.uniform(0.0, 360.0)) for position in shops * 8)
    for position, heading_deg in places:
        yield msgspec.structs.replace(sample, id="place", position=position, heading_deg=heading_deg)


def _orange_roofs(city: City) -> Iterator[Place]:
    for b in city.buildings:
        if b.roof_colour[0] > 2.0 * b.roof_colour[1] > 6.0 * b.roof_colour[2]:
            x, y = (sum(axis) / len(b.polygon) for axis in zip(*b.polygon, strict=True))
            yield (x, y, b.top_m), 0.0


def _on_bridges(city: City, chance: random.Random) -> Iterator[Place]:
    for bridge in city.bridges:
        for (x0, y0, z0), (x1, y1, z1) in pairwise(bridge.path):
            for share in (chance.random() for _ in range(20)):
                yield (x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0 + share * (z1 - z0)), 0.0


def _crowd(middle: Entity, chance: random.Random) -> list[Entity]:
    """Return persons at random places around a place."""
    x, y, z = middle.position
    people = []
    for k in range(chance.randrange(5, 9)):
        a, r = chance.uniform(0.0, 6.28), 4.0 * chance.random() ** 0.5
        people.append(Entity(id=f"p{k}", group="p", index=k + 1, role="asset", type="person", engine="x",
                             position=(x + r * sin(a), y + r * cos(a), z), heading_deg=chance.uniform(0.0, 360.0),
                             properties={"look": "person"}))  # fmt: skip
    return people


def cropped(rgb: np.ndarray, box: Box | None, pose: CameraPose, place: tuple[float, float, float]) -> Image.Image:
    """Return the part of a frame around a box, or around a place, at the frame's own scale if it is small enough."""
    height, width = rgb.shape[:2]
    if box is not None:
        x, y = 0.5 * (box.box[0] + box.box[2]) * width, 0.5 * (box.box[1] + box.box[3]) * height
        side = max(CROP_PX, 1.5 * (box.box[2] - box.box[0]) * width, 1.5 * (box.box[3] - box.box[1]) * height)
    else:
        right, down, axis = (np.array(a) for a in camera_axes(pose))
        offset = np.array(place) - np.array(pose.position)
        scale = focal_px(pose) / max(float(offset @ axis), 0.1)
        x, y = width / 2.0 + scale * float(offset @ right), height / 2.0 + scale * float(offset @ down)
        side = max(CROP_PX, 8.0 * scale)
    side = min(side, height)
    left, top = min(max(x - side / 2.0, 0.0), width - side), min(max(y - side / 2.0, 0.0), height - side)
    picture = Image.fromarray(rgb)
    return picture.resize((CELL_PX, CELL_PX), Image.Resampling.BICUBIC, box=(left, top, left + side, top + side))


def draw(folder: Path, names: Sequence[str], seed: int = ORDER, seeds: Sequence[int] = SEEDS) -> None:
    """Write the crops of classes, named by their numbers in an order alone."""
    folder.mkdir(parents=True, exist_ok=True)
    artist, numbers = Artist(seeds), {key: number for number, key in enumerate(order(seed))}
    for name in names or SUBJECTS:
        for k, crop in enumerate(artist.crops(name)):
            crop.save(folder / f"{numbers[name, k]:03d}.png")


def join(folder: Path) -> None:
    """Write the crops of a folder on numbered sheets."""
    files = sorted(folder.glob("[0-9]*.png"))
    for first in range(0, len(files), COLUMNS * ROWS):
        sheet = Image.new("RGB", (COLUMNS * CELL_PX, ROWS * (CELL_PX + 14)))
        pen = ImageDraw.Draw(sheet)
        for k, file in enumerate(files[first : first + COLUMNS * ROWS]):
            left, top = k % COLUMNS * CELL_PX, k // COLUMNS * (CELL_PX + 14)
            sheet.paste(Image.open(file), (left, top + 14))
            pen.text((left + 3, top + 1), str(int(file.stem)), (255, 255, 0))
        sheet.save(folder / f"sheet-{first // (COLUMNS * ROWS):02d}.png")


def score(answers: Path, seed: int = ORDER) -> None:
    """Print the confusion matrix of a judge's answers: rows are classes, columns answers."""
    key = order(seed)
    counts: Counter[tuple[str, str]] = Counter()
    for line in answers.read_text(encoding="utf-8").splitlines():
        number, _, answer = line.strip().partition(" ")
        if answer:
            counts[key[int(number)][0], answer] += 1
    print("| shown | crops | right | named otherwise |\n| --- | --- | --- | --- |")
    for name in SUBJECTS:
        total = sum(n for (shown, _), n in counts.items() if shown == name)
        others = ", ".join(f"{answer} {n}" for (shown, answer), n in sorted(counts.items())
                           if shown == name and answer != name)  # fmt: skip
        right = counts[name, name]
        print(f"| {name} | {total} | {right} ({100 * right / max(total, 1):.0f} %) | {others} |")
    print(f"\n{sum(n for (a, b), n in counts.items() if a == b)} of {sum(counts.values())} right")


def main(arguments: Sequence[str]) -> None:
    """Draw or score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step", choices=("draw", "join", "score"))
    parser.add_argument("path", type=Path)
    parser.add_argument("--classes", nargs="+", choices=SUBJECTS, default=[], help="draw these classes alone")
    parser.add_argument("--order", type=int, default=ORDER, help=f"the seed of the order (default {ORDER})")
    parser.add_argument("--seeds", type=int, nargs=2, default=SEEDS, help="the seeds of the instances")
    options = parser.parse_args(arguments)
    if options.step == "draw":
        draw(options.path, options.classes, options.order, options.seeds)
    elif options.step == "join":
        join(options.path)
    else:
        score(options.path, options.order)


if __name__ == "__main__":
    main(sys.argv[1:])
