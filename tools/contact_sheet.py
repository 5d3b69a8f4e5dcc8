"""Draw the contact sheet: every target, asset and distractor through the cameras of its mission (`make pictures`).

It writes `contact-sheet.png` (targets), `contact-sheet-weather.png` (night, fog and rain) and
`contact-sheet-assets.png` to `docs/images`, and `contact-sheet.md` with a table: class, camera, distance and size in
pixels of the ground-truth box. Nothing is enlarged: a picture is cut out of a frame of the camera's own size, so that a
small thing in it is also small for an agent. Scenes and places of targets are those of the missions with seed 7.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import cos, radians, sin, tan
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from lingjing.dsl.checking import library
from lingjing.dsl.checking.toplevel import load_library
from lingjing.dsl.loading.load import load_mission
from lingjing.engines.camera.engine import CameraEngine
from lingjing.mission.instance import CameraSpec, Entity, Instance, Vector
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import CameraMount
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Box

ROOT = Path(__file__).parents[1]
SHEET = ROOT / "docs" / "images" / "contact-sheet.png"
WEATHER = SHEET.with_name("contact-sheet-weather.png")
ASSETS = SHEET.with_name("contact-sheet-assets.png")
SHEETS = {"Targets": SHEET, "Night, fog and rain": WEATHER, "Assets and distractors": ASSETS}
SEED = 7
"""Seed of the instances."""
TIME_S = 24.0
"""Simulated time of the pictures, seconds."""
CELL = (384, 216)
"""Width and height of a picture on the sheet, pixels."""
COLUMNS = 4
"""Pictures in a row."""
CAPTION_PX = 34
"""Height of a caption, pixels."""
BEARINGS = 16
"""Bearings that are tried to find the best view."""
IN_FULL = 3
"""Rows up to which a sheet is written in full colour. Larger ones get 256 colours to be small; night needs more."""

VIEWS = {"nadir": (1920, 1080, 84.0), "oblique": (1280, 720, 70.0), "front": (1280, 720, 84.0),
         "dog_eye": (1280, 720, 90.0), "dash": (1280, 720, 90.0), "orbit": (1920, 1080, 2.1)}  # fmt: skip
"""Camera presets of `std.sensors`: columns, rows, horizontal field of view in degrees."""
BODIES = {"dog_eye": "robot_dog", "dash": "car", "orbit": "satellite"}
"""Type of the body that carries a preset; others are on a quadrotor."""
MOUNTED = {"dog_eye": "front", "dash": "front", "orbit": "nadir"}
"""View of a preset's mount, where it differs."""
EYES_M = {"dog_eye": 0.30, "dash": 0.0}
"""Elevation of the body's origin over the ground, metres."""
PITCH_DEG = {"orbit": -90.0}
"""Pitch of the body by preset, degrees. A satellite's camera looks along its nose."""


@dataclass(frozen=True, slots=True)
class Photo:
    """One picture of the sheet."""

    title: str
    """Caption."""
    mission: str
    """Name of the mission."""
    target: str
    """Id of the target."""
    view: str
    """Camera preset."""
    ahead_m: float
    """Distance of the viewer from the target on the ground, metres."""
    above_m: float
    """Height of the viewer over the target, metres."""
    extra: tuple[tuple[str, float, float, float, float], ...] = ()
    """Additional entities, relative to the target: kind, right, ahead, up (metres), heading (degrees)."""
    states: dict[str, str] = field(default_factory=dict)
    """Status by entity."""
    bearing: float | None = None
    """Bearing of the viewer from the target, clockwise from its heading, degrees (0: in front); None for the best
    view."""
    ambient: tuple[tuple[str, float, float, float], ...] = ()
    """Background traffic, relative to the target: kind, right, ahead (metres), heading (degrees)."""
    props: tuple[str, ...] = ()
    """Models of props. The nearest one is shown instead of the target."""
    orange_roof: bool = False
    """True to show the nearest orange roof instead of the target."""
    seaside: bool = False
    """True for a whole city by the sea instead of the mission's own scene."""
    weather: Mapping[str, float] = field(default_factory=dict)
    """Changes to the mission's weather."""


SEASIDE = {"kind": "city", "datum_m": -3.0, "options": {"extent_m": 3000.0}}
"""Changes to the scene: a city of all districts, with its harbour and its coast."""
NIGHT = {"sun_elevation_deg": -20.0}
FOG = {"visibility_m": 300.0, "cloud": 1.0}
RAIN = {"rain": 0.7, "cloud": 1.0, "visibility_m": 4000.0}
JAM = tuple(
    (kind, x, y, 0.0)
    for x, column in (
        (-1.7, ("car", "truck", "car", "car", "bus")),
        (1.7, ("car", "car", "delivery_van", "car", "car")),
    )
    for kind, y in zip(column, (-22.0, -12.0, -2.0, 6.0, 16.0), strict=True)
)
"""Background traffic in a jam: kind, right, ahead (m), heading relative to the road (deg)."""


STREET = "truck"
SHOTS: tuple[Photo, ...] = (
    Photo("building_fire", "ufr", "fire[1]", "nadir", 0.0, 110.0),
    Photo("building_fire", "ufr", "fire[2]", "nadir", 0.0, 80.0),
    Photo("building_fire", "ufr", "fire[1]", "front", 90.0, 22.0),
    Photo("building_fire, out", "ufr", "fire[1]", "nadir", 0.0, 80.0, states={"fire[1]": "out"}),
    Photo("fire_source", "idf", "fire[1]", "dog_eye", 3.0, 0.0),
    Photo("fire_source", "idf", "fire[1]", "dog_eye", 8.0, 0.0),
    Photo("fire_source", "idf", "fire[1]", "dog_eye", 16.0, 0.0),
    Photo("fire_source, out", "idf", "fire[1]", "dog_eye", 4.0, 0.0, states={"fire[1]": "out"}),
    Photo("pipeline_leak", "upr", "leak", "nadir", 0.0, 60.0),
    Photo("pipeline_leak", "upr", "leak", "nadir", 0.0, 25.0),
    Photo("pipeline_leak", "upr", "leak", "oblique", 14.0, 14.0),
    Photo("pipeline_leak, sealed", "upr", "leak", "oblique", 14.0, 14.0, states={"leak": "sealed"}),
    Photo("bridge_fracture", "bi", "fracture", "nadir", 0.0, 60.0),
    Photo("bridge_fracture", "bi", "fracture", "nadir", 0.0, 100.0),
    Photo("bridge_fracture", "bi", "fracture", "front", 70.0, 30.0),
    Photo("bridge_fracture", "bi", "fracture", "front", 30.0, 14.0),
    Photo("person_in_water, vest", "ssr", "victim[1]", "nadir", 0.0, 100.0),
    Photo("person_in_water, vest", "ssr", "victim[2]", "nadir", 0.0, 60.0),
    Photo("person_in_water, no vest", "ssr", "victim[3]", "nadir", 0.0, 60.0),
    Photo("person_in_water", "ssr", "victim[1]", "front", 22.0, 6.0),
    Photo("congestion", "cr", "jam[1]", "nadir", 0.0, 80.0, ambient=JAM),
    Photo("congestion", "cr", "jam[1]", "nadir", 0.0, 40.0, ambient=JAM),
    Photo("reference_building", "vdn", "home", "dog_eye", 38.0, 0.0),
    Photo("reference_building", "vdn", "home", "dog_eye", 75.0, 0.0),
    Photo("destination", "cr", "goal_place", "dash", 14.0, 0.0, bearing=180.0),
    Photo("delivery_point", "cd", "point[1]", "dash", 12.0, 0.0, bearing=200.0),
    Photo("delivery_point, served", "cd", "point[1]", "dash", 12.0, 0.0, states={"point[1]": "served"}, bearing=200.0),
    Photo("warehouse", "cd", "depot", "dash", 15.0, 0.0, bearing=190.0),
    Photo("delivery_door", "ld", "house", "dog_eye", 5.0, 0.0),
    Photo("delivery_door, served", "ld", "house", "dog_eye", 5.0, 0.0, states={"house": "served"}),
    Photo("queue_of_people", "queue", "shop[2]", "nadir", 0.0, 40.0),
    Photo("queue_of_people", "queue", "shop[2]", "dog_eye", 14.0, 0.0),
)
"""All pictures."""
TARGETS = len(SHOTS)
"""Number of pictures on the sheet of targets."""
SHOTS += (
    Photo("building_fire, night", "ufr", "fire[1]", "front", 60.0, 22.0, weather=NIGHT),
    Photo("fire_source, night", "idf", "fire[1]", "dog_eye", 8.0, 0.0, weather=NIGHT),
    Photo("fire_truck, night", "ufr", STREET, "dash", 14.0, 0.0, bearing=25.0, weather=NIGHT),
    Photo("congestion, night", "cr", "jam[1]", "nadir", 0.0, 40.0, ambient=JAM, weather=NIGHT),
    Photo("building_fire, fog", "ufr", "fire[2]", "nadir", 0.0, 80.0, weather=FOG),
    Photo("bridge_fracture, fog", "bi", "fracture", "front", 70.0, 30.0, weather=FOG),
    Photo("pipeline_leak, rain", "upr", "leak", "oblique", 14.0, 14.0, weather=RAIN),
    Photo("lifeboat, night", "ssr", "boat", "front", 18.0, 5.0, bearing=40.0, weather=NIGHT),
)
WEATHERED = len(SHOTS)
"""Number of pictures on the first two sheets."""
SHOTS += (
    Photo("robot_dog", "idf", "dog[1]", "dog_eye", 2.0, 0.0, bearing=35.0),
    Photo("robot_dog", "upr", "dog", "nadir", 0.0, 20.0),
    Photo("quadrotor", "ufr", "uav[1]", "front", 3.0, 0.6, bearing=30.0),
    Photo("fixed_wing", "ufr", STREET, "front", 25.0, 3.0, extra=(("fixed_wing", 0.0, 0.0, 60.0, 60.0),)),
    Photo("lifeboat", "ssr", "boat", "front", 18.0, 5.0, bearing=40.0),
    Photo("lifeboat", "ssr", "boat", "nadir", 0.0, 100.0),
    Photo("fire_truck", "ufr", STREET, "dash", 12.0, 0.0, bearing=25.0),
    Photo("fire_truck", "ufr", STREET, "nadir", 0.0, 60.0),
    *(
        Photo(kind, "ufr", STREET, "dash", away, 0.0, extra=((kind, 0.0, 14.0, 0.0, 0.0),), bearing=25.0)
        for kind, away in (
            ("car", 8.0),
            ("taxi", 8.0),
            ("delivery_van", 9.0),
            ("truck", 12.0),
            ("bus", 14.0),
            ("motorcycle", 5.0),
            ("bicycle", 5.0),
            ("person", 4.0),
        )
    ),
    Photo("car", "ufr", STREET, "nadir", 0.0, 60.0, extra=(("car", 0.0, 14.0, 0.0, 0.0),)),
    Photo("what a satellite sees", "ufr", STREET, "orbit", 0.0, 550e3, seaside=True),
    Photo("satellite", "ufr", STREET, "front", 9.0, 1.0, extra=(("satellite", 0.0, 0.0, 550e3, 30.0),)),
    Photo("parked truck", "idf", "fire[1]", "front", 14.0, 6.0, props=("parked_truck",)),
    Photo("steam", "idf", "fire[1]", "front", 9.0, 3.0, props=("steam_vent",)),
    Photo("buoy", "ssr", "victim[1]", "nadir", 0.0, 60.0, props=("buoy_orange",)),
    Photo("orange roof", "ufr", "fire[2]", "nadir", 0.0, 80.0, orange_roof=True),
    Photo("containers", "cd", "depot", "nadir", 0.0, 60.0, props=("container",)),
)


class Studio:
    """One camera engine, with a cache of missions and their cities."""

    def __init__(self) -> None:
        self.engine = CameraEngine()
        self.host = PluginHost()
        self._made: dict[tuple[str, bool], tuple[Instance, City]] = {}

    def take(self, shot: Photo) -> tuple[npt.NDArray[np.uint8], Box | None]:
        """The frame that shows most of the target, and the target's box."""
        instance, city = self._stage(shot.mission, shot.seaside)
        subject = next(entity for entity in instance.entities if entity.id == shot.target)
        entities = [e for e in instance.entities if e.role == "target" or e.id == shot.target]
        if shot.extra:
            subject = _extra(subject, shot.extra[0])
            entities = [subject]
        if shot.props:
            subject = _prop(subject, city, shot.props)
            entities = []
        if shot.orange_roof:
            subject = _roof(subject, city)
            entities = []
        best: tuple[npt.NDArray[np.uint8], Box | None] | None = None
        for bearing in _bearings(shot, subject):
            frame, box = self._frame(shot, instance, city, entities, subject, bearing)
            if best is None or (box is not None and (best[1] is None or box.pixels > best[1].pixels)):
                best = frame, box
        assert best is not None
        return best

    def _stage(self, name: str, seaside: bool) -> tuple[Instance, City]:
        if (name, seaside) not in self._made:
            bare = instantiate(load_mission(ROOT / "scenarios" / f"{name}.ljs"), seed=SEED)
            if seaside:
                bare = msgspec.structs.replace(bare, scene=msgspec.structs.replace(bare.scene, **SEASIDE))
            city = self.host.scene(bare.scene.kind).build(bare.scene)
            self._made[name, seaside] = anchor(bare, city), city
        return self._made[name, seaside]

    def _frame(
        self,
        shot: Photo,
        instance: Instance,
        city: City,
        entities: Sequence[Entity],
        subject: Entity,
        bearing: float,
    ) -> tuple[npt.NDArray[np.uint8], Box | None]:
        viewer = _viewer(shot, subject, bearing)
        cast = (*entities, viewer)
        weather = msgspec.structs.replace(instance.weather, **shot.weather)
        played = msgspec.structs.replace(instance, entities=cast, events=(), weather=weather)
        self.engine.reset(EngineSpec(engine="camera", instance=played, owns=()), city, SEED)
        states = [BodyState(id=e.id, position=e.position, heading_deg=e.heading_deg, status=shot.states.get(e.id, ""),
                            pitch_deg=PITCH_DEG.get(shot.view, 0.0) if e is viewer else 0.0) for e in cast]  # fmt: skip
        self.engine.advance(TIME_S, [*states, *_ambient(shot, subject)])
        (frame,) = self.engine.capture(
            [CaptureRequest(frame="f", entity=viewer.id, camera="eye", tick=1, time_s=TIME_S)]
        )
        box = next((box for box in frame.info.boxes if box.entity == subject.id), None)
        return frame.rgb, box


def _bearings(shot: Photo, subject: Entity) -> tuple[float, ...]:
    if shot.ahead_m == 0.0:
        return (0.0,)
    if shot.bearing is not None:
        return (subject.heading_deg + shot.bearing,)
    return tuple(360.0 * k / BEARINGS for k in range(BEARINGS))


def _extra(subject: Entity, offset: tuple[str, float, float, float, float]) -> Entity:
    kind, right, ahead, up, heading = offset
    place = _beside(subject, right, ahead, up)
    heading += subject.heading_deg
    return Entity(id="extra", group="extra", index=1, role="target", type=kind, engine="city", position=place,
                  heading_deg=heading % 360.0, properties={"look": kind})  # fmt: skip


def _prop(subject: Entity, city: City, models: tuple[str, ...]) -> Entity:
    """The subject at the place of the nearest prop of these models."""
    x, y, _ = subject.position
    prop = min(
        (prop for prop in city.props if prop.model in models),
        key=lambda prop: (prop.position[0] - x) ** 2 + (prop.position[1] - y) ** 2,
    )
    return msgspec.structs.replace(subject, id="prop", position=prop.position, heading_deg=prop.heading_deg)


def _roof(subject: Entity, city: City) -> Entity:
    """The subject at the place of the nearest orange roof."""
    x, y, _ = subject.position
    roofs = [b for b in city.buildings if b.roof_colour[0] > 2.0 * b.roof_colour[1] > 6.0 * b.roof_colour[2]]
    roof = min(roofs, key=lambda b: min((px - x) ** 2 + (py - y) ** 2 for px, py in b.polygon))
    middle = [sum(axis) / len(roof.polygon) for axis in zip(*roof.polygon, strict=True)]
    return msgspec.structs.replace(subject, id="roof", position=(middle[0], middle[1], roof.top_m))


def _beside(subject: Entity, right: float, ahead: float, up: float) -> Vector:
    h = radians(subject.heading_deg)
    x, y, z = subject.position
    return x + right * cos(h) + ahead * sin(h), y - right * sin(h) + ahead * cos(h), z + up


def _ambient(shot: Photo, subject: Entity) -> list[BodyState]:
    return [
        BodyState(id=f"traffic/{k}", kind=kind, position=_beside(subject, right, ahead, 0.0),
                  heading_deg=(subject.heading_deg + heading) % 360.0)
        for k, (kind, right, ahead, heading) in enumerate(shot.ambient)
    ]  # fmt: skip


def _viewer(shot: Photo, subject: Entity, bearing: float) -> Entity:
    """The entity with the camera: at `bearing` from the target, facing it."""
    b = radians(bearing)
    x, y, z = subject.position
    ground = min(z, 0.2) if shot.view in EYES_M else z
    place = x + shot.ahead_m * sin(b), y + shot.ahead_m * cos(b), ground + EYES_M.get(shot.view, 0.0) + shot.above_m
    width, height, hfov = VIEWS[shot.view]
    camera = CameraSpec(name="eye", view=MOUNTED.get(shot.view, shot.view), width=width, height=height, hfov_deg=hfov,  # type: ignore[arg-type]
                        channels=("rgb",), capture="on_request")  # fmt: skip
    heading = 0.0 if shot.ahead_m == 0.0 else (bearing + 180.0) % 360.0
    return Entity(id="viewer", group="viewer", index=1, role="asset", type=BODIES.get(shot.view, "quadrotor"),
                  engine="x", position=place, heading_deg=heading, cameras=(camera,),
                  mounts=_mounts(BODIES.get(shot.view, "quadrotor")))  # fmt: skip


def _mounts(kind: str) -> tuple[CameraMount, ...]:
    """Camera mounts that a type of the standard library declares."""
    files = [library.find_file(("std", name)) for name in ("air", "ground", "orbit")]
    types = [load_library(file)[0].types for file in files if file is not None]
    return next(tuple(known[kind].mounts.values()) for known in types if kind in known)


def cell(frame: npt.NDArray[np.uint8], box: Box | None, view: str) -> Image.Image:
    """The part of a frame around a box at its own scale; the whole frame, reduced, if the box is larger.

    Without a box: the centre of a nadir frame at half its size, or the whole of another frame. A frame from orbit is
    always shown whole.
    """
    picture = Image.fromarray(frame)
    width, height = picture.size
    if view == "orbit" or (box is None and view != "nadir"):
        return picture.resize(CELL, Image.Resampling.LANCZOS)
    if box is None:
        left, top = width // 2 - CELL[0], height // 2 - CELL[1]
        return picture.resize(CELL, Image.Resampling.LANCZOS, box=(left, top, width - left, height - top))
    x0, y0, x1, y1 = (v * float(s) for v, s in zip(box.box, (width, height, width, height), strict=True))
    share = max((x1 - x0) / (0.85 * CELL[0]), (y1 - y0) / (0.85 * CELL[1]), 1.0)
    w, h = min(CELL[0] * share, width), min(CELL[1] * share, height)
    west = min(max((x0 + x1 - w) / 2.0, 0.0), width - w)
    north = min(max((y0 + y1 - h) / 2.0, 0.0), height - h)
    return picture.resize(CELL, Image.Resampling.LANCZOS, box=(west, north, west + w, north + h))


def caption(shot: Photo, frame: npt.NDArray[np.uint8], box: Box | None) -> tuple[str, str]:
    """The title, and a line with camera, distance and size of the box in pixels of the frame."""
    away = (shot.ahead_m**2 + shot.above_m**2) ** 0.5
    if shot.view == "orbit":
        across_km = 2.0 * away * tan(radians(VIEWS["orbit"][2]) / 2.0) / 1000.0
        return shot.title, f"{shot.view}, {away / 1000.0:.0f} km, the whole frame: {across_km:.0f} km across"
    if box is None:
        return shot.title, f"{shot.view}, {away:.0f} m"
    height, width = frame.shape[:2]
    size = f"{round((box.box[2] - box.box[0]) * width)} x {round((box.box[3] - box.box[1]) * height)} px"
    return shot.title, f"{shot.view}, {away:.0f} m, {size}"


def main(arguments: Sequence[str]) -> None:
    """Draw all sheets. With words as arguments, draw only pictures with such a word in the title
    (`contact-part.png`)."""
    studio = Studio()
    if arguments:
        draw(
            studio, [shot for shot in SHOTS if any(word in shot.title for word in arguments)], Path("contact-part.png")
        )
    else:
        parts = SHOTS[:TARGETS], SHOTS[TARGETS:WEATHERED], SHOTS[WEATHERED:]
        tables = [draw(studio, part, sheet) for part, sheet in zip(parts, SHEETS.values(), strict=True)]
        _describe(tables)
    studio.engine.close()


def draw(studio: Studio, shots: Sequence[Photo], out: Path) -> list[str]:
    """Write a sheet and return the rows of its table."""
    rows = -(-len(shots) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * CELL[0], rows * (CELL[1] + CAPTION_PX)), (24, 26, 30))
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
    table = []
    for k, shot in enumerate(shots):
        frame, box = studio.take(shot)
        left, top = k % COLUMNS * CELL[0], k // COLUMNS * (CELL[1] + CAPTION_PX)
        sheet.paste(cell(frame, box, shot.view), (left, top))
        title, detail = caption(shot, frame, box)
        pen.text((left + 6, top + CELL[1] + 1), title, (240, 240, 240), font)
        pen.text((left + 6, top + CELL[1] + 16), detail, (160, 170, 180), font)
        table.append(f"| {title} | {shot.mission} | {detail} |")
        print(title, detail, flush=True)
    if rows > IN_FULL:
        sheet = sheet.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.FLOYDSTEINBERG)
    sheet.save(out, optimize=True)
    return table


def _describe(tables: Sequence[list[str]]) -> None:
    text = (
        "# Contact sheet\n\nWhat targets, assets and distractors look like through the cameras of the missions (seed "
        f"{SEED}), drawn by\n`make pictures`. Pictures are cut out of frames of the cameras' own size, nothing is "
        "enlarged.\nTables read left to right, top to bottom.\n"
    )
    for (name, sheet), table in zip(SHEETS.items(), tables, strict=True):
        text += f"\n## {name}\n\n![{name}]({sheet.name})\n\n| What | Mission | Camera, distance, size of its box |\n"
        text += "|---|---|---|\n" + "\n".join(table) + "\n"
    SHEET.with_suffix(".md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
