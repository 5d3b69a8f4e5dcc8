"""A city in pictures: against MuJoCo's renderer, and 10 x 10 km against its busiest square kilometre.

`--only render`: Lujiazui where `../shared/data` holds its map, else the district `commercial`. The same triangles of
buildings, streets, ground and trees for both, those of a tile and material in one geom, a tree in one, 1080p, RGB and
depth and ids. Ours with shadows; MuJoCo's with its shadows and without, always without anti-aliasing. Ours is one
pass, boxes included; MuJoCo needs one for each of the three. Rounds alternate the sides, medians count.

`--only streaming`: the scene `city` of 10 km is flown over inside its busiest square kilometre, and so is a city that
is this square kilometre alone; each in a process of its own. What a picture costs (the best of the flights'
medians) and what the process holds, all of it.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from math import atan, cos, degrees, radians, sin, tan
from pathlib import Path

os.environ["MUJOCO_GL"] = "egl"

import msgspec
import numpy as np

from lingjing.mission.expression import Flag
from lingjing.mission.instance import Budget, CameraSpec, Clock, CommsSpec, Entity, Instance, SceneSpec, Weather
from lingjing.plugins.engine import CaptureRequest, EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City, Pieces, Prop, Tile
from lingjing.scene.store import read_store, write_store
from lingjing.scene.tiles import TILED, Tiles
from lingjing.trace.records import BodyState

HERE = Path(__file__).resolve().parent
MAP = HERE.parent.parent / "shared" / "data" / "shanghai_lujiazui.osm"
SIZE = 1920, 1080
ROUNDS = 7
VIEWS = {
    "down from 150 m": ("nadir", 150.0, 0.0),
    "ahead from 120 m": ("front", 120.0, 60.0),
    "ahead from 40 m": ("front", 40.0, 200.0),
}
WIDE = SceneSpec(kind="city", options={"extent_m": 10_000.0}, datum_m=-3.0)
FLIGHT, FLIGHTS = 40, 3


def instance(scene: SceneSpec, size: tuple[int, int] = SIZE) -> Instance:
    """One UAV with both cameras."""
    cameras = tuple(
        CameraSpec(name=view, view=view, width=size[0], height=size[1], hfov_deg=84.0,
                   channels=("rgb", "depth", "semantic"), capture="on_request")
        for view in ("nadir", "front")
    )  # fmt: skip
    uav = Entity(id="uav", group="uav", index=1, role="asset", type="quadrotor", engine="multirotor",
                 position=(0.0, 0.0, 100.0), cameras=cameras)  # fmt: skip
    return Instance(
        mission="pictures", title="", goal="", seed=7, settings={}, regions=(), cells=(), agents=(), messages=(),
        scene=scene, clock=Clock(tick_s=10, sync_s=0.5), budget=Budget(ticks=1, policy_s=1, engine_s=1, capture_s=1),
        weather=Weather(wind_mps=2, sun_elevation_deg=45.0), entities=(uav,),
        comms=CommsSpec(mode="broadcast", hub=None), rules=(), unlocks=(), stages=(), relations=(),
        success=Flag(value=True),
    )  # fmt: skip


class OurTown:
    """The camera engine with all channels over a city."""

    def __init__(self, given: Instance, city: City) -> None:
        from lingjing.engines.camera.engine import CameraEngine

        self.engine = CameraEngine()
        self.engine.reset(EngineSpec(engine="camera", instance=given, owns=()), city, 7)

    def look(self, camera: str, position: tuple[float, float, float], heading: float) -> None:
        self.engine.advance(10.0, [BodyState(id="uav", position=position, heading_deg=heading)])
        self.request = CaptureRequest(frame="f", entity="uav", camera=camera, tick=1, time_s=10.0)

    def shoot(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        (frame,) = self.engine.capture([self.request])
        return frame.rgb, frame.depth, frame.semantic


class MujocoTown:
    """The same triangles as static geoms: one for each material of a tile, one for each prop."""

    def __init__(self, city: City, given: Instance) -> None:
        import mujoco

        self.mujoco = mujoco
        spec = self.spec = mujoco.MjSpec()
        spec.visual.global_.offwidth, spec.visual.global_.offheight = SIZE
        spec.visual.quality.offsamples = 0
        spec.visual.map.znear, spec.visual.map.zfar = 0.001, 20.0
        spec.stat.extent, spec.stat.center = 1000.0, (0, 0, 0)
        kind, paint = mujoco.mjtTexture.mjTEXTURE_SKYBOX, mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
        spec.add_texture(name="sky", type=kind, builtin=paint, rgb1=(0.4, 0.5, 0.6), rgb2=(0.1, 0.2, 0.5),
                         width=256, height=256)  # fmt: skip
        spec.worldbody.add_light(
            pos=(0, 0, 500), dir=(-0.35, 0.61, -0.71), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        )
        self.triangles = 0
        self.meshes: set[str] = set()
        self._city(city)
        self._cameras(given)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.renderer = mujoco.Renderer(self.model, SIZE[1], SIZE[0], max_geom=20_000)

    def _city(self, city: City) -> None:
        from lingjing.engines.camera.tile_mesh import crossings_of, mesh_tile
        from lingjing.engines.camera.town_ground import build_town_ground
        from lingjing.scene.terrain import Terrain

        town_ground, surface = build_town_ground(city), Terrain(city).surface
        self._geom("ground", town_ground.ground)
        self._geom("quays", town_ground.quays)
        for number, (_, water) in enumerate(town_ground.waters):
            self._geom(f"water-{number}", water)
        for tile in Tiles(city):
            mesh = mesh_tile(tile, crossings_of(tile.junctions), {}, surface)
            for name, part in mesh.parts.items():
                self._geom(f"{tile.key}-{name}", part)
            for prop in tile.props:
                self._prop(prop)

    def _prop(self, prop: Prop) -> None:
        from lingjing.engines.camera.models import prop_model

        key, mesh = prop_model(prop.model, int(prop.options.get("variant", 0)))
        key = f"{key}-{prop.scale:.1f}"
        self.triangles += len(mesh) // 3
        if key not in self.meshes:
            self.meshes.add(key)
            points, faces = np.unique(mesh[:, :3], axis=0, return_inverse=True)
            self.spec.add_mesh(name=key, uservert=(prop.scale * points).ravel(), userface=faces.ravel(),
                               inertia=self.mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)  # fmt: skip
        half = -radians(prop.heading_deg) / 2.0
        self.spec.worldbody.add_geom(
            type=self.mujoco.mjtGeom.mjGEOM_MESH, meshname=key, pos=prop.position, contype=0, conaffinity=0,
            quat=(cos(half), 0, 0, sin(half)), rgba=(*mesh[:, 6:9].mean(axis=0) ** 0.5, 1),
        )  # fmt: skip

    def _geom(self, name: str, part) -> None:
        points, index = np.unique(part.vertices["position"], axis=0, return_inverse=True)
        faces = index.ravel()[part.index].reshape(-1, 3)
        faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])]
        if len(faces) == 0 or len(points) < 4:
            return
        self.triangles += len(faces)
        self.spec.add_mesh(name=name, uservert=points.astype(float).ravel(), userface=faces.ravel(),
                           inertia=self.mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)  # fmt: skip
        self.spec.worldbody.add_geom(
            type=self.mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0,
            rgba=(*part.vertices["colour"][:, :3].mean(axis=0) ** 0.5, 1),
        )  # fmt: skip

    def _cameras(self, given: Instance) -> None:
        from lingjing.plugins.geometry import camera_axes, mounted_camera_pose

        for name, (camera, height, heading) in VIEWS.items():
            mount = next(c for c in given.entities[0].cameras if c.name == camera)
            pose = mounted_camera_pose(BodyState(id="u", position=(0.0, 0.0, height), heading_deg=heading), mount, ())
            right, down, _ = camera_axes(pose)
            turn = np.stack([right, -np.array(down), np.cross(right, -np.array(down))], axis=1)
            quat = np.zeros(4)
            self.mujoco.mju_mat2Quat(quat, turn.ravel())
            fovy = degrees(2.0 * atan(tan(radians(42.0)) * SIZE[1] / SIZE[0]))
            self.spec.worldbody.add_camera(name=name, pos=pose.position, quat=quat, fovy=fovy)

    def look(self, view: str, shadows: bool) -> None:
        self.view = view
        self.renderer.scene.flags[self.mujoco.mjtRndFlag.mjRND_SHADOW] = shadows

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


def render() -> None:
    """Print the table of the two renderers."""
    scene = SceneSpec(kind="map", options={"file": str(MAP)}) if MAP.is_file() else SceneSpec(kind="commercial")
    given = instance(scene)
    city = PluginHost().scene(scene.kind).build(scene)
    ours, theirs = OurTown(given, city), MujocoTown(city, given)
    print(f"{city.id}: {theirs.model.ngeom} geoms, {theirs.triangles} triangles, {SIZE[0]}x{SIZE[1]}, "
          f"RGB + depth + ids, median of {ROUNDS}, milliseconds wall / CPU\n")  # fmt: skip
    print("| view | this camera | MuJoCo, shadows | no shadows | ratios, wall | ratios, CPU | depths that agree |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for view, (camera, height, heading) in VIEWS.items():
        at = (0.0, 0.0, height)
        row(view, lambda: ours.look(camera, at, heading), ours.shoot, theirs)  # noqa: B023 - called at once
    ours.engine.close()
    theirs.renderer.close()


def row(view: str, look: Callable[[], None], shoot: Callable[[], tuple], theirs: MujocoTown) -> None:
    """Time one view of both sides, in turn."""
    times: dict[str, list[tuple[float, float]]] = {"ours": [], "shaded": [], "plain": []}
    for turn in range(ROUNDS + 1):
        look()
        spent = {"ours": timed(shoot)}
        for name in ("shaded", "plain"):
            theirs.look(view, name == "shaded")
            spent[name] = timed(theirs.shoot)
        if turn:
            for name, one in spent.items():
                times[name].append(one)
    middle = {name: [statistics.median(part) for part in zip(*all_, strict=True)] for name, all_ in times.items()}
    ratios = [" ".join(f"{middle[name][k] / middle['ours'][k]:.1f}x" for name in ("shaded", "plain")) for k in (0, 1)]
    cells = [f"{middle[name][0]:.0f} / {middle[name][1]:.0f}" for name in ("ours", "shaded", "plain")]
    print(f"| {view} | {' | '.join(cells)} | {' | '.join(ratios)} | {100 * agreement(shoot, theirs, view):.0f} % |",
          flush=True)  # fmt: skip


def agreement(shoot: Callable[[], tuple], theirs: MujocoTown, view: str) -> float:
    """The share of pixels that are equally far in both."""
    picture, mine, _ = shoot()
    theirs.look(view, True)
    other_picture, other, _ = theirs.shoot()
    if folder := os.environ.get("LINGJING_RENDER_PICTURES"):
        from PIL import Image

        for side, pixels in (("ours", picture), ("mujoco", other_picture)):
            Image.fromarray(pixels).save(Path(folder) / f"{view.replace(' ', '-')}-{side}.png")
    near = np.isfinite(mine) & (mine < 500.0)
    same = np.abs(mine[near] - other[near]) < 0.02 * mine[near] + 0.3
    return float(same.mean())


def streaming(folder: Path) -> None:
    """Print what the wide city costs beside its busiest square kilometre alone."""
    city = PluginHost().scene(WIDE.kind).build(WIDE)
    buildings = sum(len(tile.buildings) for tile in Tiles(city))
    centre, alone = busiest(city, folder)
    rows: dict[str, dict[str, float]] = {}
    for _ in range(FLIGHTS):
        for name, store in (("10 x 10 km", city.store), ("its busiest km2 alone", alone)):
            command = [sys.executable, str(HERE / "city.py"), "--fly", json.dumps([store, centre])]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            found = json.loads(done.stdout.splitlines()[-1])
            rows[name] = {key: min(value, rows.get(name, found)[key]) for key, value in found.items()}
    flown = f"{FLIGHTS} flights of {FLIGHT} pictures in turn, {SIZE[0]}x{SIZE[1]}, RGB + depth + ids"
    print(f"\n{city.id}: {buildings} buildings; {flown}\n")
    print("| city | down, CPU ms | ahead, CPU ms | the camera's process, MB | with three dogs in it, MB |")
    print("| --- | --- | --- | --- | --- |")
    for name, of in rows.items():
        print(f"| {name} | {of['nadir']:.0f} | {of['front']:.0f} | {of['camera_mb']:.0f} | {of['dogs_mb']:.0f} |")
    wide, small = rows.values()
    print(f"| more | {' | '.join(f'{100 * (wide[key] / small[key] - 1):+.0f} %' for key in wide)} |\n")


def busiest(city: City, folder: Path) -> tuple[tuple[float, float], str]:
    """The middle of the square kilometre with the most buildings, and the folder of a city that is it alone."""
    tiles = {tile.key: tile for tile in Tiles(city)}
    side = max(1, round(1000.0 / city.tile_m))

    def square(key: tuple[int, int]) -> list[Tile]:
        return [tiles[x, y] for x in range(key[0], key[0] + side) for y in range(key[1], key[1] + side)
                if (x, y) in tiles]  # fmt: skip

    best = max(sorted(tiles), key=lambda key: sum(len(tile.buildings) for tile in square(key)))
    pieces = Pieces(**{name: tuple(p for tile in square(best) for p in getattr(tile, name)) for name in TILED})
    west, south = best[0] * city.tile_m, best[1] * city.tile_m
    reach = side * city.tile_m
    bounds = (west, south, west + reach, south + reach)
    small = write_store(folder / "alone", msgspec.structs.replace(city, store="", bounds=bounds), pieces)
    return (west + reach / 2.0, south + reach / 2.0), small.store


def fly(store: str, centre: tuple[float, float]) -> dict[str, float]:
    """Median CPU milliseconds of a picture, down and ahead, on a flight across; memory held by camera and dogs."""
    from lingjing.engines.quadruped.engine import QuadrupedEngine

    city = read_store(Path(store))
    given = instance(WIDE)
    ours = OurTown(given, city)
    found: dict[str, float] = {}
    for camera in ("nadir", "front"):
        spent = []
        for step in range(FLIGHT):
            x, y = centre[0] - 300.0 + 600.0 * step / FLIGHT, centre[1] + 40.0
            ours.look(camera, (x, y, 100.0), 90.0)
            spent.append(timed(ours.shoot)[1])
        found[camera] = statistics.median(spent)
    found["camera_mb"] = memory_mb()
    dogs = tuple(
        Entity(id=f"dog[{k}]", group="dog", index=k, role="asset", type="robot_dog", engine="quadruped",
               position=(centre[0] + 20.0 * k, centre[1], 0.5))
        for k in (1, 2, 3)
    )  # fmt: skip
    engine = QuadrupedEngine()
    spec = EngineSpec(engine="quadruped", owns=tuple(dog.id for dog in dogs),
                      instance=msgspec.structs.replace(given, entities=dogs))  # fmt: skip
    engine.reset(spec, city, 7)
    engine.advance(2.0, ())
    found["dogs_mb"] = memory_mb()
    return found


def memory_mb() -> float:
    """Resident memory of this process."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    raise RuntimeError("this system does not tell the memory of a process")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("render", "streaming"))
    parser.add_argument("--fly", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.fly:
        print(json.dumps(fly(*json.loads(asked.fly))))
        return
    if asked.only != "streaming":
        render()
    if asked.only != "render":
        with tempfile.TemporaryDirectory() as folder:
            streaming(Path(folder))


if __name__ == "__main__":
    main()
