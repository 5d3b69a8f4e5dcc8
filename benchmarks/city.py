"""A city in pictures: against MuJoCo's renderer, and 10 x 10 km against its busiest square kilometre.

`--only render`: Lujiazui where `../shared/data` holds its map, else the district `commercial`. The same triangles of
buildings, streets, ground and trees for both, those of a tile and material in one geom, a tree in one, 1080p, RGB and
depth and ids (`two_cameras.py` says how). Ours with shadows; MuJoCo's with its shadows and without.

`--only streaming`: the scene `city` of 10 km is flown over inside its busiest square kilometre, and so is a city that
is this square kilometre alone; each in a process of its own. What a picture costs (the best of the flights'
medians) and what the process holds, all of it.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import msgspec
import numpy as np
from two_cameras import SIZE, MujocoCamera, OurCamera, agreement, instance, medians, timed

from lingjing.mission.instance import Entity, Instance, SceneSpec, Weather
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City, Pieces, Prop, Tile
from lingjing.scene.store import read_store, write_store
from lingjing.scene.tiles import TILED, Tiles

HERE = Path(__file__).resolve().parent
MAP = HERE.parent.parent / "shared" / "data" / "shanghai_lujiazui.osm"
WEATHER = Weather(wind_mps=2, sun_elevation_deg=45.0)
ROUNDS = 7
VIEWS = {
    "down from 150 m": ("nadir", 150.0, 0.0),
    "ahead from 120 m": ("front", 120.0, 60.0),
    "ahead from 40 m": ("front", 40.0, 200.0),
}
WIDE = SceneSpec(kind="city", options={"extent_m": 10_000.0}, datum_m=-3.0)
FLIGHT, FLIGHTS = 40, 3


class MujocoTown(MujocoCamera):
    """MuJoCo's renderer of the same triangles as static geoms: one for each material of a tile, one for each prop."""

    def __init__(self, city: City, placed: Instance) -> None:
        super().__init__(near=0.001, far=20.0)
        self._city(city)
        for name, (camera, height, heading) in VIEWS.items():
            mount = next(c for c in placed.entities[0].cameras if c.name == camera)
            self.add_view(name, mount, (0.0, 0.0, height), heading)
        self.compiled()

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
        self.add_model(f"{key}-{prop.scale:.1f}", mesh, prop.position, prop.heading_deg, prop.scale)

    def _geom(self, name: str, part) -> None:
        points, index = np.unique(part.vertices["position"], axis=0, return_inverse=True)
        faces = index.ravel()[part.index].reshape(-1, 3)
        faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])]
        if len(faces) and len(points) >= 4:
            self.add_mesh(name, points, faces)
            self.add_geom(name, part.vertices["colour"][:, :3].mean(axis=0))


def render() -> None:
    """Print the table of the two renderers."""
    scene = SceneSpec(kind="map", options={"file": str(MAP)}) if MAP.is_file() else SceneSpec(kind="commercial")
    placed, city = instance(scene, WEATHER), PluginHost().scene(scene.kind).build(scene)
    ours, theirs = OurCamera(placed, city), MujocoTown(city, placed)
    print(f"{city.id}: {theirs.model.ngeom} geoms, {theirs.triangles} triangles, {SIZE[0]}x{SIZE[1]}, "
          f"RGB + depth + ids, median of {ROUNDS}, milliseconds wall / CPU\n")  # fmt: skip
    print("| view | this camera | MuJoCo, shadows | no shadows | ratios, wall | ratios, CPU | depths that agree |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for view, (camera, height, heading) in VIEWS.items():
        at = (camera, (0.0, 0.0, height), heading)
        middle = medians(ours, at, theirs, view, ROUNDS)
        ratios = [
            " ".join(f"{middle[name][k] / middle['ours'][k]:.1f}x" for name in ("shaded", "plain")) for k in (0, 1)
        ]
        cells = [f"{wall:.0f} / {cpu:.0f}" for wall, cpu in middle.values()]
        same = agreement(ours, at, theirs, view, within_m=0.3)
        print(f"| {view} | {' | '.join(cells)} | {' | '.join(ratios)} | {100 * same:.0f} % |", flush=True)
    ours.engine.close()
    theirs.renderer.close()


def streaming(folder: Path) -> None:
    """Print the cost of the wide city beside its busiest square kilometre alone."""
    city = PluginHost().scene(WIDE.kind).build(WIDE)
    buildings = sum(len(tile.buildings) for tile in Tiles(city))
    centre, alone = busiest(city, folder)
    rows: dict[str, dict[str, float]] = {}
    for _ in range(FLIGHTS):
        for name, store in (("10 x 10 km", city.store), ("its busiest km2 alone", alone)):
            command = [sys.executable, str(HERE / "city.py"), "--fly", json.dumps([store, centre])]
            done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
            measured = json.loads(done.stdout.splitlines()[-1])
            rows[name] = {key: min(value, rows.get(name, measured)[key]) for key, value in measured.items()}
    flown = f"{FLIGHTS} flights of {FLIGHT} pictures in turn, {SIZE[0]}x{SIZE[1]}, RGB + depth + ids"
    print(f"\n{city.id}: {buildings} buildings; {flown}\n")
    print("| city | down, CPU ms | ahead, CPU ms | the camera's process, MB | with three dogs in it, MB |")
    print("| --- | --- | --- | --- | --- |")
    for name, of in rows.items():
        print(f"| {name} | {of['nadir']:.0f} | {of['front']:.0f} | {of['camera_mb']:.0f} | {of['dogs_mb']:.0f} |")
    wide, small = rows.values()
    print(f"| more | {' | '.join(f'{100 * (wide[key] / small[key] - 1):+.0f} %' for key in wide)} |\n")


def busiest(city: City, folder: Path) -> tuple[tuple[float, float], str]:
    """Return the centre of the square kilometre with the most buildings, and the folder of a city that consists of it
    alone.
    """
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
    """Return median CPU milliseconds of a picture, down and ahead, on a flight across, and the memory of camera and
    dogs in MB.
    """
    from lingjing.engines.quadruped.engine import QuadrupedEngine

    city = read_store(Path(store))
    placed = instance(WIDE, WEATHER)
    ours = OurCamera(placed, city)
    measured: dict[str, float] = {}
    for camera in ("nadir", "front"):
        spent = []
        for step in range(FLIGHT):
            x, y = centre[0] - 300.0 + 600.0 * step / FLIGHT, centre[1] + 40.0
            ours.look(camera, (x, y, 100.0), 90.0)
            spent.append(timed(ours.shoot)[1])
        measured[camera] = statistics.median(spent)
    measured["camera_mb"] = memory_mb()
    dogs = tuple(
        Entity(id=f"dog[{k}]", group="dog", index=k, role="asset", type="robot_dog", engine="quadruped",
               position=(centre[0] + 20.0 * k, centre[1], 0.5))
        for k in (1, 2, 3)
    )  # fmt: skip
    engine = QuadrupedEngine()
    spec = EngineSpec(engine="quadruped", owns=tuple(dog.id for dog in dogs),
                      instance=msgspec.structs.replace(placed, entities=dogs))  # fmt: skip
    engine.reset(spec, city, 7)
    engine.advance(2.0, ())
    measured["dogs_mb"] = memory_mb()
    return measured


def memory_mb() -> float:
    """Return the resident memory of this process in MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    raise RuntimeError("the memory of a process cannot be read on this system")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("render", "streaming"))
    parser.add_argument("--fly", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.fly:
        print(json.dumps(fly(*json.loads(arguments.fly))))
        return
    if arguments.only != "streaming":
        render()
    if arguments.only != "render":
        with tempfile.TemporaryDirectory() as folder:
            streaming(Path(folder))


if __name__ == "__main__":
    main()
