"""Models of everything that is drawn: triangle meshes in the format of `camera.meshes`, built from numbers.

`catalogue` selects a model by name: `entity_parts` for an entity of a mission, `ambient_parts` for background traffic,
`prop_part` for a prop. Its tables refer to `sea`, `air`, `dog`, `vehicles`, `people`, `nature`, `street` and `places`.
`vehicles` and `people` are data with three levels of detail, which `stored` reads and colours; `skeleton` poses people.
The others build meshes with `shapes` in the colours of `palette`. Moving parts such as flames and water are in
`camera.effects`.

Frames: x right, y ahead, z up; metres. The origin of vehicles, people and props is the middle of their footprint on the
ground. It is the waterline of floating things, and 0.2 m over the ends of a quadrotor's legs. A dog has it in its trunk
if its joints are known, otherwise at its feet.

Prop models (those with variants are marked *). Sea: buoy_orange, buoy_red, buoy_yellow, life_ring, crate, jerrycan,
sailboat, driftwood*, barrel*, seaweed*, tarpaulin*, rowing_boat*, dinghy*, fishing_boat*. Plants: rock*, tree*, pine*
(rich ones), street_tree*, poplar*, birch*, conifer*, palm*, bush*, flowerbed*, hedge (3 m along x), helipad. Streets
and yards: lamp, park_lamp, bench, bin*, bollard, cone, hydrant, traffic_light, bus_stop, fence (3 m along x),
container*, container_long*, pallets*, crates*, drums*, tank*, silo, chimney, steam (steams), fountain (sprays),
water_tank, rooftop_unit*, parasol*, stall*, billboard*, gantry. Standing: car*, taxi*, police_car*, ambulance*,
delivery_van*, truck*, bus*, fire_truck, motorcycle*, bicycle*, person*; parked_car*, parked_truck*, parked_van* and
steam_vent are other names of car, truck, delivery_van and steam.
"""

from __future__ import annotations

from lingjing.engines.camera.models.catalogue import (
    MODELS,
    PARKED,
    ambient_parts,
    entity_model,
    entity_parts,
    look_of,
    painted,
    prop_model,
    prop_part,
    variant_of,
)
from lingjing.engines.camera.models.people import CLOTHES, WAVES, in_water, on_foot, pose_on_foot
from lingjing.engines.camera.models.shapes import HERE, ModelPart
from lingjing.engines.camera.models.skeleton import POSES, figures, posed, skin
from lingjing.engines.camera.models.stored import level_of
from lingjing.engines.camera.models.vehicles import LOOKS, vehicle

__all__ = [
    "CLOTHES",
    "HERE",
    "LOOKS",
    "MODELS",
    "PARKED",
    "POSES",
    "WAVES",
    "ModelPart",
    "ambient_parts",
    "entity_model",
    "entity_parts",
    "figures",
    "in_water",
    "level_of",
    "look_of",
    "on_foot",
    "painted",
    "pose_on_foot",
    "posed",
    "prop_model",
    "prop_part",
    "skin",
    "variant_of",
    "vehicle",
]
