"""One picture with RGB, depth and ids at 1920x1080: this camera against MuJoCo's own renderer, side by side.

Both draw the same bay: MuJoCo gets one mesh geom for each of our instances with the same triangles, the same ground
and a plane for the sea, and the same camera poses. Ours shades waves, glint, foam and fog and draws all shadows;
MuJoCo's
renderer is timed with its shadows and without, always without its anti-aliasing. Ours is one pass, boxes included;
MuJoCo needs a pass for each of RGB, depth and segmentation. Rounds alternate the sides; medians count.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable
from math import atan, cos, degrees, radians, sin, tan
from pathlib import Path

os.environ["MUJOCO_GL"] = "egl"

import mujoco
import numpy as np

from lingjing.engines.camera.engine import CameraEngine
from lingjing.engines.camera.ground import build_ground
from lingjing.engines.camera.models import entity_model, prop_model
from lingjing.engines.camera.noise import noise_texture
from lingjing.mission.expression import Flag
from lingjing.mission.instance import Budget, CameraSpec, Clock, CommsSpec, Entity, Instance, SceneSpec, Weather
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.plugins.geometry import camera_axes, mounted_camera_pose
from lingjing.scene.bay import build
from lingjing.trace.records import BodyState

LEVEL = -3.5
ROUNDS = 9
SIZE = 1920, 1080
VIEWS = {
    "search, 100 m": ("nadir", (200.0, -900.0, 96.6), 0.0),
    "harbour, 100 m": ("nadir", (200.0, -640.0, 96.6), 0.0),
    "harbour, ahead": ("front", (200.0, -900.0, 56.6), 10.0),
}


def instance() -> Instance:
    """A UAV with both cameras, the lifeboat and six people in the search area."""
    cameras = tuple(
        CameraSpec(name=view, view=view, width=SIZE[0], height=SIZE[1], hfov_deg=84.0,
                   channels=("rgb", "depth", "semantic"), capture="on_request")
        for view in ("nadir", "front")
    )  # fmt: skip
    who = [("uav[1]", "quadrotor", (200.0, -900.0, 96.6), cameras), ("boat", "lifeboat", (170.0, -880.0, LEVEL), ())]
    who += [(f"victim[{k}]", "person_in_water", (170.0 + 12 * k, -925.0 + 9 * (k % 4), LEVEL), ()) for k in range(1, 7)]
    entities = tuple(
        Entity(
            id=name,
            group=name,
            index=k,
            role="asset",
            type=kind,
            engine="x",
            position=at,
            cameras=mounts,
            properties={"look": kind, "on": "water"},
        )
        for k, (name, kind, at, mounts) in enumerate(who)
    )
    return Instance(
        mission="render", title="", goal="", seed=7, settings={}, regions=(), cells=(), agents=(), messages=(),
        scene=SceneSpec(kind="bay", datum_m=LEVEL, seed=7), clock=Clock(tick_s=10, sync_s=0.5),
        budget=Budget(ticks=1, policy_s=1, engine_s=1, capture_s=1),
        weather=Weather(wind_mps=4, wind_from_deg=220, wave_height_m=0.5), entities=entities,
        comms=CommsSpec(mode="broadcast", hub=None), rules=(), unlocks=(), stages=(), relations=(),
        success=Flag(value=True),
    )  # fmt: skip


class OurBay:
    """The camera engine with all channels."""

    def __init__(self, given: Instance) -> None:
        self.given = given
        self.engine = CameraEngine()
        self.engine.reset(EngineSpec(engine="camera", instance=given, owns=()), build(given.scene), 7)

    def look(self, view: str) -> None:
        camera, position, heading = VIEWS[view]
        first, *rest = self.given.entities
        states = [BodyState(id=e.id, position=e.position) for e in rest]
        self.engine.advance(10.0, [BodyState(id=first.id, position=position, heading_deg=heading), *states])
        self.request = CaptureRequest(frame="f", entity=first.id, camera=camera, tick=1, time_s=10.0)

    def shoot(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        (frame,) = self.engine.capture([self.request])
        return frame.rgb, frame.depth, frame.semantic


class MujocoBay:
    """The same scene as geoms of one static model."""

    def __init__(self, given: Instance) -> None:
        self.spec = mujoco.MjSpec()
        self.spec.visual.global_.offwidth, self.spec.visual.global_.offheight = SIZE
        self.spec.visual.quality.offsamples = 0
        self.spec.visual.map.znear, self.spec.visual.map.zfar = 0.0004, 40.0
        self.spec.stat.extent, self.spec.stat.center = 1000.0, (0, 0, 0)
        kind, paint = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
        self.spec.add_texture(name="sky", type=kind, builtin=paint, rgb1=(0.4, 0.5, 0.6), rgb2=(0.1, 0.2, 0.5),
                              width=256, height=256)  # fmt: skip
        self.meshes: set[str] = set()
        self.triangles = 0
        self._world(given)
        self.model = self.spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.renderer = mujoco.Renderer(self.model, SIZE[1], SIZE[0], max_geom=4096)

    def _world(self, given: Instance) -> None:
        city = build(given.scene)
        body = self.spec.worldbody
        body.add_light(pos=(0, 0, 500), dir=(-0.35, 0.61, -0.71), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(15000, 15000, 1), pos=(0, 0, LEVEL),
                      rgba=(0.1, 0.3, 0.35, 1), contype=0, conaffinity=0)  # fmt: skip
        ground = build_ground(city, noise_texture()[::4, ::4, 0])
        lands = [s.vertices[np.concatenate([p.triangles.ravel() for p in s.patches])] for s in ground.surfaces]
        for k, mesh in enumerate((*lands, *(mesh for _, mesh in ground.solids))):
            self._geom(f"ground-{k}", mesh, (0.0, 0.0, 0.0), 0.0)
        for prop in city.props:
            key, mesh = prop_model(prop.model, int(prop.options.get("variant", 0)))
            self._geom(key, mesh, prop.position, prop.heading_deg)
        for entity in given.entities[1:]:
            key, mesh = entity_model(entity.type, entity.index, 10.0)
            self._geom(key, mesh, entity.position, 0.0)
        for name, (camera, position, heading) in VIEWS.items():
            mount = next(c for c in given.entities[0].cameras if c.name == camera)
            pose = mounted_camera_pose(BodyState(id="u", position=position, heading_deg=heading), mount, ())
            right, down, _ = camera_axes(pose)
            turn = np.stack([right, -np.array(down), np.cross(right, -np.array(down))], axis=1)
            quat = np.zeros(4)
            mujoco.mju_mat2Quat(quat, turn.ravel())
            fovy = degrees(2.0 * atan(tan(radians(42.0)) * SIZE[1] / SIZE[0]))
            body.add_camera(name=name, pos=pose.position, quat=quat, fovy=fovy)

    def _geom(self, key: str, mesh: np.ndarray, position: tuple[float, ...], heading: float) -> None:
        self.triangles += len(mesh) // 3
        if key not in self.meshes:
            self.meshes.add(key)
            points, faces = np.unique(mesh[:, :3], axis=0, return_inverse=True)
            self.spec.add_mesh(name=key, uservert=points.ravel(), userface=faces.ravel(),
                               inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)  # fmt: skip
        half = -radians(heading) / 2.0
        self.spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=key, pos=position, quat=(cos(half), 0, 0, sin(half)),
            rgba=(*mesh[:, 6:9].mean(axis=0) ** 0.5, 1), contype=0, conaffinity=0,
        )  # fmt: skip

    def look(self, view: str, shadows: bool) -> None:
        self.view = view
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        self.shadows = shadows

    def shoot(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        self.renderer.update_scene(self.data, self.view)
        rgb = self.renderer.render()
        self.renderer.enable_depth_rendering()
        depth = self.renderer.render()
        self.renderer.disable_depth_rendering()
        self.renderer.enable_segmentation_rendering()
        ids = self.renderer.render()
        self.renderer.disable_segmentation_rendering()
        return rgb, depth, ids


def timed(shoot: Callable[[], object]) -> tuple[float, float]:
    """(wall, CPU) milliseconds of one call; CPU counts all threads, the software renderer's too."""
    wall, cpu = time.perf_counter(), time.process_time()
    shoot()
    return 1e3 * (time.perf_counter() - wall), 1e3 * (time.process_time() - cpu)


def main() -> None:
    """Print the table."""
    given = instance()
    ours, theirs = OurBay(given), MujocoBay(given)
    print(f"{theirs.model.ngeom} geoms, {theirs.triangles} triangles, {SIZE[0]}x{SIZE[1]}, RGB + depth + ids, "
          f"median of {ROUNDS}, milliseconds wall / CPU")  # fmt: skip
    print(f"GL: {ours.engine.fingerprint()['gl']}; MuJoCo {mujoco.__version__}\n")
    print(f"| {'view':16} | {'this camera':>13} | {'MuJoCo, shadows':>15} | {'no shadows':>13} | {'ratio':>13} |")
    print(f"| {'-' * 16} | {'-' * 13} | {'-' * 15} | {'-' * 13} | {'-' * 13} |")
    for view in VIEWS:
        report(view, ours, theirs)
    ours.engine.close()
    theirs.renderer.close()


def report(view: str, ours: OurBay, theirs: MujocoBay) -> None:
    """One row; the two sides must agree on where the picture's middle is."""
    sides: tuple[tuple[str, Callable[[], None], Callable[[], object]], ...] = (
        ("ours", lambda: ours.look(view), ours.shoot),
        ("shaded", lambda: theirs.look(view, True), theirs.shoot),
        ("plain", lambda: theirs.look(view, False), theirs.shoot),
    )
    times: dict[str, list[tuple[float, float]]] = {name: [] for name, _, _ in sides}
    for turn in range(ROUNDS + 1):
        for name, look, shoot in sides:
            look()
            spent = timed(shoot)
            if turn:
                times[name].append(spent)
    check(view, ours, theirs)
    middle = {
        name: tuple(statistics.median(part) for part in zip(*spent, strict=True)) for name, spent in times.items()
    }
    ratio = f"{middle['shaded'][0] / middle['ours'][0]:.1f}x {middle['plain'][0] / middle['ours'][0]:.1f}x"
    cells = [f"{middle[name][0]:.0f} / {middle[name][1]:.0f}" for name in ("ours", "shaded", "plain")]
    print(f"| {view:16} | {cells[0]:>13} | {cells[1]:>15} | {cells[2]:>13} | {ratio:>13} |", flush=True)


def check(view: str, ours: OurBay, theirs: MujocoBay) -> None:
    """The scenes are the same: nearly every pixel is equally far in both."""
    ours.look(view)
    theirs.look(view, True)
    mine, other = ours.shoot()[1], theirs.shoot()[1]
    near = np.isfinite(mine) & (mine < 500.0)
    same = np.abs(mine[near] - other[near]) < 0.02 * mine[near] + 0.05
    if same.mean() < 0.97:
        raise SystemExit(f"render: the scenes differ in `{view}`: {100 * same.mean():.1f} % of the depths agree")
    if folder := os.environ.get("LINGJING_RENDER_PICTURES"):
        save(Path(folder), view, ours.shoot()[0], theirs.shoot()[0])


def save(folder: Path, view: str, *pictures: np.ndarray) -> None:
    """Both sides' pictures, for the eye."""
    from PIL import Image

    for side, picture in zip(("ours", "mujoco"), pictures, strict=True):
        Image.fromarray(picture).save(folder / f"{view.replace(', ', '-').replace(' ', '-')}-{side}.png")


if __name__ == "__main__":
    main()
