"""A street for `eyes.py`: places on its lanes, bodies on them, and a camera that looks at them at eye height."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, degrees, hypot, radians, sin

import msgspec
import numpy as np

from lingjing.engines.camera.engine import CameraEngine
from lingjing.engines.camera.meshes import Mesh
from lingjing.engines.camera.models import MODELS, ModelPart
from lingjing.mission.instance import CameraSpec, Entity, SceneSpec, Vector, Weather
from lingjing.mission.model import CameraMount
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.scene.city import City
from lingjing.scene.lines import line_length
from lingjing.scene.sizes import SIZES
from lingjing.testing import bare_instance, city_of
from lingjing.trace.records import BodyState, Box

SIZE = 1920, 1080
GLANCE = 480, 270
"""Size of the pictures that show whether a place is clear."""
FOV_DEG = 84.0
EYE_M = 1.6
AWAY: Vector = (0.0, 0.0, -3000.0)
"""Position of a body that is not in the picture."""
SCENE = SceneSpec(kind="commercial", seed=11, options={"extent_m": 600.0})
WEATHER = Weather(wind_mps=2, sun_elevation_deg=45.0)


@dataclass(frozen=True)
class Place:
    """A point on a lane with its heading."""

    position: Vector
    heading_deg: float


@dataclass(frozen=True)
class Body:
    """A body in a picture."""

    look: str
    variant: int
    place: Place


@dataclass(frozen=True)
class Picture:
    """A picture with the boxes of its bodies, in the order of the bodies; None for one without a pixel."""

    rgb: np.ndarray
    depth: np.ndarray
    boxes: tuple[Box | None, ...]


def offer(look: str, meshes: Sequence[Mesh]) -> None:
    """Make meshes a look, one for each variant."""

    def build(drawn) -> tuple[ModelPart, ...]:
        variant = drawn.number % len(meshes)
        return (ModelPart(f"{look}-{variant}", meshes[variant]),)

    MODELS[look] = build


def without_vehicles(city: City) -> City:
    """Return the city without parked vehicles, which a detector may find on an empty street."""
    kept = tuple(prop for prop in city.props if prop.cls not in SIZES and not prop.model.startswith("parked_"))
    kept = tuple(prop for prop in kept if prop.model not in MODELS)
    return msgspec.structs.replace(city, id=f"{city.id}-empty", sha256="", props=kept)


class Street:
    """One camera in a street, with a pool of bodies that each picture places."""

    def __init__(self, looks: Sequence[str], variants: int) -> None:
        self.city, self.engine, self.variants = without_vehicles(city_of(SCENE)), CameraEngine(), variants
        camera, glance = (
            CameraSpec(name=name, view="front", width=width, height=height, hfov_deg=FOV_DEG, channels=("rgb", "depth"),
                       capture="on_request")
            for name, (width, height) in (("eye", SIZE), ("glance", GLANCE))
        )  # fmt: skip
        mount = CameraMount(view="front", ahead_m=0.0, above_m=0.0, tilt_deg=0.0, gimbal=True)
        viewer = Entity(id="viewer", group="viewer", index=1, role="asset", type="quadrotor", engine="x",
                        position=(0.0, 0.0, EYE_M), cameras=(camera, glance), mounts=(mount,))  # fmt: skip
        pool = [
            Entity(id=f"{look}/{k}", group=look, index=k + 1, role="asset", type=look, engine="x", position=AWAY,
                   properties={"look": look})
            for look in looks for k in range(variants)
        ]  # fmt: skip
        instance = bare_instance((viewer, *pool), scene=SCENE, weather=WEATHER)
        self.ids = [entity.id for entity in pool]
        self.engine.reset(EngineSpec(engine="camera", instance=instance, owns=()), self.city, 7)

    def places(self, count: int, seed: int) -> list[Place]:
        """Return points on lanes of straight streets, at least 30 m from the lane's ends."""
        lanes = [lane for road in self.city.roads for lane in road.lanes if lane.kind == "car" and len(lane.shape) == 2]
        lanes = [lane for lane in lanes if line_length(lane.shape) > 70.0]
        chance, places = random.Random(seed), []
        for _ in range(count):
            (x0, y0, z0), (x1, y1, _) = chance.choice(lanes).shape
            length = hypot(x1 - x0, y1 - y0)
            share = chance.uniform(30.0, length - 30.0) / length
            places.append(Place((x0 + share * (x1 - x0), y0 + share * (y1 - y0), z0), degrees(atan2(x1 - x0, y1 - y0))))
        return places

    def shoot(self, eye: Vector, heading_deg: float, bodies: Sequence[Body], camera: str = "eye") -> Picture:
        """Return a picture of a camera from `eye`. Bodies of one look and variant may not occur twice."""
        shown = {f"{body.look}/{body.variant % self.variants}": body.place for body in bodies}
        states = [BodyState(id="viewer", position=eye, heading_deg=heading_deg)]
        for name in self.ids:
            place = shown.get(name, Place(AWAY, 0.0))
            states.append(BodyState(id=name, position=place.position, heading_deg=place.heading_deg))
        self.engine.advance(10.0, states)
        request = CaptureRequest(frame="f", entity="viewer", camera=camera, tick=1, time_s=10.0)
        (frame,) = self.engine.capture([request])
        boxes = {box.entity: box for box in frame.info.boxes}
        named = tuple(boxes.get(f"{body.look}/{body.variant % self.variants}") for body in bodies)
        return Picture(frame.rgb, frame.depth, named)

    def view_of(self, place: Place, bearing_deg: float, away_m: float) -> tuple[Vector, float]:
        """Return eye and heading of a viewer at a bearing from the body's own heading (0: in front of it)."""
        b = radians(place.heading_deg + bearing_deg)
        x, y, z = place.position
        return (x + away_m * sin(b), y + away_m * cos(b), z + EYE_M), (degrees(b) + 180.0) % 360.0

    def is_clear(self, eye: Vector, heading_deg: float, away_m: float, half_m: float) -> bool:
        """Return whether nothing stands between the eye and a body of `half_m` at `away_m`, in the empty street."""
        empty = self.shoot(eye, heading_deg, (), "glance").depth
        across, down = GLANCE[0] // 2, GLANCE[1] // 2
        focal = across / np.tan(radians(FOV_DEG) / 2.0)
        near = max(away_m - half_m, 2.0)
        wide, high = int(focal * half_m / near), int(focal * 0.9 / near)
        middle = empty[down - 1 : down + high, max(across - wide, 0) : across + wide]
        rows = np.arange(down - 1, down + high)[:, None] - down
        ground = np.where(rows > 0, focal * EYE_M / np.maximum(rows, 1), np.inf)[: len(middle)]
        return bool((middle > np.minimum(ground, away_m + half_m) - 0.6).all())
