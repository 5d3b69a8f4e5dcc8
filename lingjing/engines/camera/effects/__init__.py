"""Effects of entities and props: fire, smoke, water, debris and light, as functions of (id, state, time, weather).

`effects_of` returns the effects of an entity in addition to its model (`camera.models`), and `prop_effects` those of a
prop (`steam`, `fountain`). Both return an `Effects`:

- `billboards`: rows of `BILLBOARD`, quads that face the camera, stretched along `axis`. Rows with `id` 0 are soft
  sprites (flames, spray, smoke, mist, glow). They are blended, farthest first, with a depth test, and write neither ids
  nor depth. Rows with `id` 1 are the solid body of a target inside its flames or spray. They write depth and the
  entity's id, and no colour. The ground-truth box of a fire or a leak is thus that of its flames or spray.
- `decals`: rows of `DECAL`, flat blots on the ground (wet, scorched), blended over the picture without id and depth.
  After dark they are also pools of light (`night`), which brighten the picture.
- `solids`: meshes with the entity's id and a model-to-world matrix (debris, broken edges), drawn as any object.

`drawing.EffectPass` draws billboards and decals with the camera's uniforms (`u_clip`, `u_eye`, … of `common.glsl`) and
its noise texture. `decals` follow the ground and precede objects. `clouds` come after the objects, and `bodies` last.
Effects cast no shadows.

`town_changes` holds the effects of targets on the static city. `changes_of`, called once an episode, returns the
changed tiles: a fractured bridge has a gap, and a reference building has its declared colour. It also returns the
buildings that are drawn as an entity, and the surroundings of each entity (`Site`: the deck of the bridge, the pipe,
the ground), which `effects_of` receives.

Modules: `entity_effects` selects the effects of an entity; `fire`, `water`, `fracture`, `lights` and `night` build them
from the rows of `particles`; `free_space` finds free space; `town_changes` changes tiles; `drawing` draws.

Random values are hashes of the id and the particle's number, and time is `time_s` alone. The same state at the same
time gives the same picture, whatever was drawn before.
"""

from __future__ import annotations

from lingjing.engines.camera.effects.entity_effects import SHOWING, effects_of, prop_effects
from lingjing.engines.camera.effects.particles import BILLBOARD, DECAL, Effects, EffectSolid
from lingjing.engines.camera.effects.town_changes import (
    Site,
    TownChanges,
    changed_boxes,
    changes_of,
    site_of,
)

__all__ = [
    "BILLBOARD",
    "DECAL",
    "SHOWING",
    "EffectSolid",
    "Effects",
    "Site",
    "TownChanges",
    "changed_boxes",
    "changes_of",
    "effects_of",
    "prop_effects",
    "site_of",
]
