"""What moves, glows, smokes and drips about entities and props: pure functions of (id, state, time, weather).

`effects_of(entity, state, time_s, weather)` is what an entity shows beside its model (`camera.models`), `prop_effects`
the same for a prop (`steam`, `fountain`). Both give an `Effects`:

- `billboards`: rows of `BILLBOARD`, quads that face the camera, stretched along `axis` as it is seen. Rows with `id`
  0 are blended (smoke, mist, glow), farthest first, depth-tested, never written to ids or depth. Rows with `id` 1 are
  the body of a target (flames, spray): drawn before them, unblended, where the shape covers, writing depth and the
  entity's id, so that a fire's or a leak's ground-truth box is that of its flames or its spray.
- `decals`: rows of `DECAL`, flat blots on the ground (wet, scorched), blended over what is drawn, no id, no depth;
  after dark also pools of light (`night`), which brighten what is drawn.
- `solids`: meshes with the entity's id and a model-to-world matrix (debris, broken edges), drawn as any object.

`drawing.EffectPass` draws the first two with the camera's uniforms (`u_clip`, `u_eye`, … of `common.glsl`) and its
noise texture: `decals` after the ground and before objects, `bodies` with the objects, `clouds` last of all, after the
projected shadows. Nothing here casts a shadow.

What targets do to the static city is in `town_changes`: `changes_of(near, ground, entities)`, asked once an episode,
gives the tiles with the gap of a fractured bridge cut out of decks and lanes and the reference building painted, the
buildings whose pixels are an entity's, and for each entity what its effect must know of its surroundings (`Site`: the
deck of the bridge, the pipe, the ground under it), which is handed to `effects_of`.

Modules: `targets` says which entity shows which effect, `fire`, `water`, `fracture`, `lights` and `night` make them of
the rows of `particles`; `free_space` says what has room where; `town_changes` changes tiles; `drawing` draws.

Chance comes from hashes of the id and the particle's number, time from `time_s` alone: the same state at the same time
is the same picture, whatever was drawn before.
"""

from __future__ import annotations

from lingjing.engines.camera.effects.particles import BILLBOARD, DECAL, Effects, EffectSolid
from lingjing.engines.camera.effects.targets import SHOWING, effects_of, prop_effects
from lingjing.engines.camera.effects.town_changes import (
    Site,
    TownChanges,
    altered,
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
    "altered",
    "changes_of",
    "effects_of",
    "prop_effects",
    "site_of",
]
