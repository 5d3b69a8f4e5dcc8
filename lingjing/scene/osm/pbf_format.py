"""Read OpenStreetMap PBF into a `MapCollector`. This is the only module that imports osmium."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata
from typing import Any, NamedTuple

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.scene.osm.map_data import LARGEST_ID, DegreeBox, LatLon, MapCollector, Member
from lingjing.scene.osm.source import HINT, MapFile, bomb

FEW = 100_000
"""Number of objects, tags and references that any file may hold, however small it is (chosen)."""

_NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
"""Characters that XML cannot hold. They are removed, because netconvert reads XML."""


class _PbfItem(NamedTuple):
    """An object of osmium, converted to Python's own types."""

    kind: str
    """`n`, `w` or `r`."""
    id: int
    version: int
    deleted: bool
    """True if the object is deleted."""
    tags: dict[str, str]
    place: LatLon | None
    """Place of a node; None without one."""
    nodes: tuple[int, ...]
    """Ids of a way's nodes."""
    places: tuple[tuple[int, LatLon], ...]
    """Places that the way itself carries for its nodes (files that `osmium add-locations-to-ways` writes)."""
    members: tuple[Member, ...]
    """Members of a relation."""


def read_pbf(source: MapFile, collector: MapCollector) -> None:
    """Fill the collector.

    Raises `UsageError` if the file is damaged or unpacks to an implausible size, or if osmium is not installed.
    """
    box = _box(source)
    if box is not None:
        collector.add_box(box)
    budget = max(FEW, source.path.stat().st_size)
    for item in _items(source):
        budget -= 1 + len(item.tags) + len(item.nodes) + len(item.members)
        if budget < 0:  # checked before any object is created
            raise bomb(source.path, "it holds more than it has bytes")
        if not -LARGEST_ID <= item.id <= LARGEST_ID:
            collector.skipped["objects without a number"] += 1
        elif item.kind == "n":
            collector.add_node(item.id, item.place, item.tags, item.version, deleted=item.deleted)
        elif item.kind == "w":
            collector.add_way(item.id, item.nodes, item.tags, item.version, deleted=item.deleted)
            for ref, place in item.places:
                collector.draw_node(ref, place)
        else:
            collector.add_relation(item.id, item.members, item.tags, item.version, deleted=item.deleted)


def versions() -> dict[str, str]:
    """Version of the library that reads PBF, found without loading it."""
    try:
        return {"osmium": metadata.version("osmium")}
    except metadata.PackageNotFoundError:
        return {"osmium": "none"}


# -- private


@contextmanager
def _blaming(source: MapFile) -> Iterator[None]:
    """Turn every exception of osmium into a `UsageError` about the file: osmium does not document its exceptions."""
    try:
        yield
    except ImportError:
        raise UsageError("reading .pbf maps needs the package `osmium`", hint=install_line("maps")) from None
    except Exception as error:  # noqa: BLE001 - damaged files raise exceptions that osmium does not document
        raise UsageError(f"`{source.path}` is not OpenStreetMap data: {error}", hint=HINT) from None


def _box(source: MapFile) -> DegreeBox | None:
    with _blaming(source):
        import osmium

        with osmium.io.Reader(osmium.io.File(str(source.path), "pbf")) as reader:
            box = reader.header().box()
        return (box.bottom_left.lon, box.bottom_left.lat, box.top_right.lon, box.top_right.lat) if box.valid() else None


def _items(source: MapFile) -> Iterator[_PbfItem]:
    with _blaming(source):
        import osmium

        for item in osmium.FileProcessor(osmium.io.File(str(source.path), "pbf")):
            if item.is_node() or item.is_way() or item.is_relation():
                yield _item(item)


def _item(item: Any) -> _PbfItem:
    located = item.is_node() and item.location.valid()
    return _PbfItem(
        kind="n" if item.is_node() else "w" if item.is_way() else "r",
        id=item.id,
        version=item.version,
        deleted=item.deleted or not item.visible,
        tags={_text(tag.k): _text(tag.v) for tag in item.tags},
        place=(item.location.lat, item.location.lon) if located else None,
        nodes=tuple(node.ref for node in item.nodes) if item.is_way() else (),
        places=_places(item) if item.is_way() else (),
        members=tuple((m.type, m.ref, _text(m.role)) for m in item.members) if item.is_relation() else (),
    )


def _places(way: Any) -> tuple[tuple[int, LatLon], ...]:
    if not len(way.nodes) or not way.nodes[0].location.valid():
        return ()
    return tuple((node.ref, (node.location.lat, node.location.lon)) for node in way.nodes if node.location.valid())


def _text(text: str) -> str:
    return text if text.isprintable() else _NOT_IN_XML.sub("", text)
