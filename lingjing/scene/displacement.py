"""What `anchor` has moved of what a document places: how far, and onto what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import hypot

from lingjing.mission.instance import Instance

NOTED_M = 1.0
"""Moves shorter than this are not told."""


def displacements(before: Instance, after: Instance, places: Mapping[str, str]) -> Iterator[str]:
    """In words, each entity that stands elsewhere than its document says; `places` are JSON paths by entity id."""
    for one, other in zip(before.entities, after.entities, strict=True):
        east, north, up = (b - a for a, b in zip(one.position, other.position, strict=True))
        away, higher = hypot(east, north), abs(up)
        if one.id not in places or max(away, higher) < NOTED_M:
            continue
        ways = [f"{away:.0f} m away"] * (away >= NOTED_M)
        ways += [f"{higher:.0f} m {'higher' if up > 0 else 'lower'}"] * (higher >= NOTED_M)
        on = one.properties.get("on")
        where = f"on the nearest {on} that suits" if isinstance(on, str) else "clear of what stands there"
        yield f"{places[one.id]}: `{one.id}` is put {' and '.join(ways)}, {where}"
