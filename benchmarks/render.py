"""One picture with RGB, depth and ids at 1920x1080: this camera against MuJoCo's own renderer, side by side.

Both draw the same bay (`two_cameras.py` says how): MuJoCo gets one geom for each of our instances, the same ground and
a plane for the sea. Ours shades waves, glint, foam and fog and draws all shadows; MuJoCo's renderer is timed with its
shadows and without.
"""

from __future__ import annotations

import numpy as np
from two_cameras import SIZE, MujocoCamera, OurCamera, agreement, instance, medians

from lingjing.engines.camera.ground import build_ground
from lingjing.engines.camera.models import entity_model, prop_model
from lingjing.engines.camera.noise import noise_texture
from lingjing.mission.instance import Entity, Instance, SceneSpec, Weather
from lingjing.scene.bay import build
from lingjing.scene.city import City

LEVEL = -3.5
ROUNDS = 9
VIEWS = {
    "search, 100 m": ("nadir", (200.0, -900.0, 96.6), 0.0),
    "harbour, 100 m": ("nadir", (200.0, -640.0, 96.6), 0.0),
    "harbour, ahead": ("front", (200.0, -900.0, 56.6), 10.0),
}


def at_sea() -> tuple[Entity, ...]:
    """The lifeboat and six people in the search area."""
    who = [("boat", "lifeboat", (170.0, -880.0, LEVEL))]
    who += [(f"victim[{k}]", "person_in_water", (170.0 + 12 * k, -925.0 + 9 * (k % 4), LEVEL)) for k in range(1, 7)]
    return tuple(
        Entity(id=name, group=name, index=k, role="asset", type=kind, engine="x", position=at,
               properties={"look": kind, "on": "water"})
        for k, (name, kind, at) in enumerate(who, 1)
    )  # fmt: skip


class MujocoBay(MujocoCamera):
    """MuJoCo's renderer of the same scene as geoms of one static model."""

    def __init__(self, city: City, placed: Instance) -> None:
        super().__init__(near=0.0004, far=40.0)
        self.spec.worldbody.add_geom(
            type=self.mujoco.mjtGeom.mjGEOM_PLANE, size=(15000, 15000, 1), pos=(0, 0, LEVEL),
            rgba=(0.1, 0.3, 0.35, 1), contype=0, conaffinity=0,
        )  # fmt: skip
        ground = build_ground(city, noise_texture()[::4, ::4, 0])
        lands = [s.vertices[np.concatenate([p.triangles.ravel() for p in s.patches])] for s in ground.surfaces]
        for k, mesh in enumerate((*lands, *(mesh for _, mesh in ground.solids))):
            self.add_model(f"ground-{k}", mesh)
        for prop in city.props:
            key, mesh = prop_model(prop.model, int(prop.options.get("variant", 0)))
            self.add_model(key, mesh, prop.position, prop.heading_deg)
        for entity in placed.entities[1:]:
            key, mesh = entity_model(entity.type, entity.index, 10.0)
            self.add_model(key, mesh, entity.position)
        for name, (camera, position, heading) in VIEWS.items():
            mount = next(c for c in placed.entities[0].cameras if c.name == camera)
            self.add_view(name, mount, position, heading)
        self.compiled()


def main() -> None:
    """Print the table. Nearly every pixel must be equally far in both scenes."""
    scene = SceneSpec(kind="bay", datum_m=LEVEL, seed=7)
    weather = Weather(wind_mps=4, wind_from_deg=220, wave_height_m=0.5)
    placed, city = instance(scene, weather, at_sea()), build(scene)
    ours, theirs = OurCamera(placed, city), MujocoBay(city, placed)
    print(f"{theirs.model.ngeom} geoms, {theirs.triangles} triangles, {SIZE[0]}x{SIZE[1]}, RGB + depth + ids, "
          f"median of {ROUNDS}, milliseconds wall / CPU")  # fmt: skip
    print(f"GL: {ours.engine.fingerprint()['gl']}; MuJoCo {theirs.mujoco.__version__}\n")
    print(f"| {'view':16} | {'this camera':>13} | {'MuJoCo, shadows':>15} | {'no shadows':>13} | {'ratio':>13} |")
    print(f"| {'-' * 16} | {'-' * 13} | {'-' * 15} | {'-' * 13} | {'-' * 13} |")
    for view, at in VIEWS.items():
        middle = medians(ours, at, theirs, view, ROUNDS)
        same = agreement(ours, at, theirs, view, within_m=0.05)
        if same < 0.97:
            raise SystemExit(f"render: the scenes differ in `{view}`: {100 * same:.1f} % of the depths agree")
        ratio = f"{middle['shaded'][0] / middle['ours'][0]:.1f}x {middle['plain'][0] / middle['ours'][0]:.1f}x"
        cells = [f"{wall:.0f} / {cpu:.0f}" for wall, cpu in middle.values()]
        print(f"| {view:16} | {cells[0]:>13} | {cells[1]:>15} | {cells[2]:>13} | {ratio:>13} |", flush=True)
    ours.engine.close()
    theirs.renderer.close()


if __name__ == "__main__":
    main()
