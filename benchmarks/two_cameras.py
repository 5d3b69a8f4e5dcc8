"""This camera and MuJoCo's own renderer over the same scene: what `render.py` and `city.py` compare, side by side.

MuJoCo gets the same triangles in static geoms and the same camera poses, always without its anti-aliasing. Ours is one
pass, boxes included; MuJoCo needs a pass for each of RGB, depth and segmentation. Rounds alternate the sides; medians
count.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Sequence
from math import atan, cos, degrees, radians, sin, tan
from pathlib import Path

os.environ["MUJOCO_GL"] = "egl"

import numpy as np

from lingjing.mission.expression import Flag
from lingjing.mission.instance import Budget, CameraSpec, Clock, CommsSpec, Entity, Instance, SceneSpec, Weather
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.scene.city import City
from lingjing.trace.records import BodyState

SIZE = 1920, 1080

Pictures = tuple[np.ndarray, np.ndarray, np.ndarray]
"""RGB, depth and ids."""

PictureCost = tuple[float, float]
"""Milliseconds of one picture: wall, CPU."""


def instance(scene: SceneSpec, weather: Weather, others: Sequence[Entity] = ()) -> Instance:
    """Return an instance with a UAV, a camera down and one ahead, and further entities."""
    cameras = tuple(
        CameraSpec(name=view, view=view, width=SIZE[0], height=SIZE[1], hfov_deg=84.0,
                   channels=("rgb", "depth", "semantic"), capture="on_request")
        for view in ("nadir", "front")
    )  # fmt: skip
    uav = Entity(id="uav", group="uav", index=1, role="asset", type="quadrotor", engine="multirotor",
                 position=(0.0, 0.0, 100.0), cameras=cameras)  # fmt: skip
    return Instance(
        mission="pictures", title="", goal="", seed=7, settings={}, regions=(), cells=(), agents=(), messages=(),
        scene=scene, clock=Clock(tick_s=10, sync_s=0.5), budget=Budget(ticks=1, policy_s=1, engine_s=1, capture_s=1),
        weather=weather, entities=(uav, *others), comms=CommsSpec(mode="broadcast", hub=None), rules=(), unlocks=(),
        stages=(), relations=(), success=Flag(value=True),
    )  # fmt: skip


class OurCamera:
    """The camera engine with all channels."""

    def __init__(self, placed: Instance, city: City) -> None:
        from lingjing.engines.camera.engine import CameraEngine

        self.others = [BodyState(id=entity.id, position=entity.position) for entity in placed.entities[1:]]
        self.engine = CameraEngine()
        self.engine.reset(EngineSpec(engine="camera", instance=placed, owns=()), city, 7)

    def look(self, camera: str, position: tuple[float, float, float], heading: float) -> None:
        uav = BodyState(id="uav", position=position, heading_deg=heading)
        self.engine.advance(10.0, [uav, *self.others])
        self.request = CaptureRequest(frame="f", entity="uav", camera=camera, tick=1, time_s=10.0)

    def shoot(self) -> Pictures:
        (frame,) = self.engine.capture([self.request])
        return frame.rgb, frame.depth, frame.semantic


class MujocoCamera:
    """A sky, a sun and the meshes and cameras that are added before the model is `compiled`.

    It draws between the planes `near` and `far`, in kilometres.
    """

    def __init__(self, near: float, far: float) -> None:
        import mujoco

        self.mujoco = mujoco
        spec = self.spec = mujoco.MjSpec()
        spec.visual.global_.offwidth, spec.visual.global_.offheight = SIZE
        spec.visual.quality.offsamples = 0
        spec.visual.map.znear, spec.visual.map.zfar = near, far
        spec.stat.extent, spec.stat.center = 1000.0, (0, 0, 0)
        kind, paint = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
        spec.add_texture(name="sky", type=kind, builtin=paint, rgb1=(0.4, 0.5, 0.6), rgb2=(0.1, 0.2, 0.5),
                         width=256, height=256)  # fmt: skip
        spec.worldbody.add_light(
            pos=(0, 0, 500), dir=(-0.35, 0.61, -0.71), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        )
        self.meshes: dict[str, int] = {}
        self.triangles = 0

    def add_model(
        self, key: str, mesh: np.ndarray, position: tuple[float, ...] = (0.0, 0.0, 0.0), heading_deg: float = 0.0,
        scale: float = 1.0,
    ) -> None:  # fmt: skip
        """Add one geom of a mesh of our models: three rows of position, normal and colour for each triangle."""
        if key not in self.meshes:
            points, index = np.unique(mesh[:, :3], axis=0, return_inverse=True)
            self.add_mesh(key, scale * points, index.reshape(-1, 3))
        self.add_geom(key, mesh[:, 6:9].mean(axis=0), position, heading_deg)

    def add_mesh(self, key: str, points: np.ndarray, faces: np.ndarray) -> None:
        """Add a mesh for geoms."""
        self.meshes[key] = len(faces)
        self.spec.add_mesh(name=key, uservert=points.astype(float).ravel(), userface=faces.ravel(),
                           inertia=self.mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)  # fmt: skip

    def add_geom(
        self, key: str, colour: np.ndarray, position: tuple[float, ...] = (0.0, 0.0, 0.0), heading_deg: float = 0.0
    ) -> None:
        """Add one geom of the mesh; `colour` is linear."""
        self.triangles += self.meshes[key]
        half = -radians(heading_deg) / 2.0
        self.spec.worldbody.add_geom(
            type=self.mujoco.mjtGeom.mjGEOM_MESH, meshname=key, pos=position, quat=(cos(half), 0, 0, sin(half)),
            rgba=(*colour**0.5, 1), contype=0, conaffinity=0,
        )  # fmt: skip

    def add_view(self, name: str, mount: CameraSpec, position: tuple[float, float, float], heading: float) -> None:
        """Add a camera in the pose of a UAV's camera at a place."""
        from lingjing.plugins.geometry import camera_axes, mounted_camera_pose

        pose = mounted_camera_pose(BodyState(id="u", position=position, heading_deg=heading), mount, ())
        right, down, _ = camera_axes(pose)
        turn = np.stack([right, -np.array(down), np.cross(right, -np.array(down))], axis=1)
        quat = np.zeros(4)
        self.mujoco.mju_mat2Quat(quat, turn.ravel())
        fovy = degrees(2.0 * atan(tan(radians(mount.hfov_deg / 2.0)) * SIZE[1] / SIZE[0]))
        self.spec.worldbody.add_camera(name=name, pos=pose.position, quat=quat, fovy=fovy)

    def compiled(self) -> None:
        """Compile the model from all added parts."""
        self.model = self.spec.compile()
        self.data = self.mujoco.MjData(self.model)
        self.mujoco.mj_forward(self.model, self.data)
        self.renderer = self.mujoco.Renderer(self.model, SIZE[1], SIZE[0], max_geom=20_000)

    def look(self, view: str, shadows: bool) -> None:
        self.view = view
        self.renderer.scene.flags[self.mujoco.mjtRndFlag.mjRND_SHADOW] = shadows

    def shoot(self) -> Pictures:
        self.renderer.update_scene(self.data, self.view)
        rgb = self.renderer.render()
        self.renderer.enable_depth_rendering()
        depth = self.renderer.render()
        self.renderer.disable_depth_rendering()
        self.renderer.enable_segmentation_rendering()
        ids = self.renderer.render()
        self.renderer.disable_segmentation_rendering()
        return rgb, depth, ids


def timed(shoot: Callable[[], object]) -> PictureCost:
    """Return wall and CPU milliseconds of one call; CPU counts all threads, the software renderer's too."""
    wall, cpu = time.perf_counter(), time.process_time()
    shoot()
    return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)


def medians(ours: OurCamera, at: tuple, theirs: MujocoCamera, view: str, rounds: int) -> dict[str, PictureCost]:
    """Return the median cost of a picture of `ours` looking from `at`, and of theirs `shaded` and `plain`."""
    sides: dict[str, tuple[Callable[[], None], Callable[[], object]]] = {
        "ours": (lambda: ours.look(*at), ours.shoot),
        "shaded": (lambda: theirs.look(view, True), theirs.shoot),
        "plain": (lambda: theirs.look(view, False), theirs.shoot),
    }
    times: dict[str, list[PictureCost]] = {name: [] for name in sides}
    for turn in range(rounds + 1):
        for name, (look, shoot) in sides.items():
            look()
            spent = timed(shoot)
            if turn:
                times[name].append(spent)
    return {
        name: (statistics.median(wall for wall, _ in spent), statistics.median(cpu for _, cpu in spent))
        for name, spent in times.items()
    }


def agreement(ours: OurCamera, at: tuple, theirs: MujocoCamera, view: str, within_m: float) -> float:
    """Return the share of pixels with equal distance in both pictures.

    Both pictures are stored in the folder LINGJING_RENDER_PICTURES, if it is set.
    """
    ours.look(*at)
    theirs.look(view, True)
    (picture, mine, _), (other_picture, other, _) = ours.shoot(), theirs.shoot()
    if folder := os.environ.get("LINGJING_RENDER_PICTURES"):
        from PIL import Image

        for side, pixels in (("ours", picture), ("mujoco", other_picture)):
            Image.fromarray(pixels).save(Path(folder) / f"{view.replace(', ', '-').replace(' ', '-')}-{side}.png")
    near = np.isfinite(mine) & (mine < 500.0)
    same = np.abs(mine[near] - other[near]) < 0.02 * mine[near] + within_m
    return float(same.mean())
