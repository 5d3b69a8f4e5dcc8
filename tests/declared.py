"""Entities with the bodies that their types declare in `scenarios/std`: measures, look, mounts."""

from __future__ import annotations

from functools import cache

import msgspec

from lingjing.dsl.checking import library
from lingjing.dsl.checking.scope import TypeDecl
from lingjing.dsl.checking.toplevel import load_library
from lingjing.mission.appearance import MODELS, PHYSICAL
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.instance import Entity
from lingjing.mission.instance_entities import datum
from lingjing.scene.sizes import SIZES


@cache
def shipped_types() -> dict[str, TypeDecl]:
    """Every asset and target type of the standard library by name."""
    found: dict[str, TypeDecl] = {}
    for path in library.known_paths("std"):
        file = library.find_file(tuple(path.split(".")))
        assert file is not None
        found.update(load_library(file)[0].types)
    return found


def declared(entity: Entity) -> Entity:
    """The entity with the body that its type declares. One of a kind of the background traffic, which is no type, has
    that kind's look and size."""
    decl = shipped_types().get(entity.type)
    if decl is None:
        return msgspec.structs.replace(entity, properties={**_of_kind(entity.type), **entity.properties})
    said = {prop.name: datum(evaluate(prop.value, Scope()), 0.0) for prop in decl.properties if prop.name in PHYSICAL}
    return msgspec.structs.replace(
        entity,
        properties={**said, **entity.properties},
        mounts=tuple(decl.mounts.values()),
        parts=tuple(decl.parts.values()),
    )


def _of_kind(kind: str) -> dict[str, float | str]:
    size = SIZES.get(kind)
    sizes = {} if size is None else {name: getattr(size, name) for name in ("length_m", "width_m", "height_m")}
    return {**sizes, **({"look": kind} if kind in MODELS else {})}
