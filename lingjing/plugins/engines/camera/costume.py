"""What a mission changes about a standing city: broken bridges, painted buildings, and where their entities are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from lingjing.mission.instance import Entity
from lingjing.plugins.engines.camera.classes import FIRST_ENTITY
from lingjing.plugins.engines.camera.effects import Site, dressed, faced, site_of
from lingjing.plugins.engines.terrain import Terrain
from lingjing.scene.city import Pieces
from lingjing.scene.tiles import Key, Tiles

CHANGING = ("bridge_fracture", "reference_building")
SITED = ("bridge_fracture", "pipeline_leak")
REACH_M = 80.0


@dataclass(frozen=True, slots=True)
class Dress:
    """Changed tiles, building id → the id that it is drawn with, entity id → what lies about it."""

    tiles: dict[Key, Pieces] = field(default_factory=dict)
    faced: dict[str, int] = field(default_factory=dict)
    sites: dict[str, Site] = field(default_factory=dict)


def is_one_of(entity: Entity, kinds: tuple[str, ...]) -> bool:
    """Whether an entity is of one of these types or extends one."""
    return entity.type in kinds or any(base in kinds for base in entity.bases)


def dress_of(entities: Sequence[Entity], tiles: Tiles, terrain: Terrain) -> Dress:
    """The dress of a city for the entities of a mission."""
    made = Dress()
    ours: dict[Key, list[Entity]] = {}
    for number, entity in enumerate(entities):
        x, y, _ = entity.position
        if is_one_of(entity, SITED):
            made.sites[entity.id] = site_of(entity, tiles.near(x, y, REACH_M), terrain.surface(x, y))
        if not is_one_of(entity, CHANGING):
            continue
        near = tiles.near(x, y, REACH_M)
        chosen = faced(Pieces(buildings=tuple(b for tile in near for b in tile.buildings)), [entity])
        made.faced.update((building, FIRST_ENTITY + number) for building in chosen)
        for tile in near:
            if not is_one_of(entity, ("reference_building",)) or any(b.id in chosen for b in tile.buildings):
                ours.setdefault(tile.key, []).append(entity)
    made.tiles.update((key, dressed(tiles.load(key), there)) for key, there in sorted(ours.items()))
    return made
