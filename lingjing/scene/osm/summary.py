"""`scene.json`: what a built city came from and what is in it, for people and for the cache."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from lingjing.scene.city import Pieces
from lingjing.scene.osm.buildings import HeightCounts
from lingjing.scene.osm.frame import MapFrame

SUMMARY_FILE = "scene.json"
ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0"


class MapSource(msgspec.Struct, frozen=True, kw_only=True):
    """The map file: its name without folders, and what identifies its content."""

    name: str
    sha256: str
    bytes: int


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """`key` identifies source, options and versions together: equal keys mean equal cities.

    `box` is west, south, east, north in degrees, `origin` latitude and longitude, `bounds_m` west, south, east, north
    about it. `heights` counts the buildings by the source of their heights, None in a folder that was built before it
    was counted. `skipped` counts what the map holds and the city does not, by reason; `notes` are for the reader.
    """

    format: Literal["lingjing-scene/1"] = "lingjing-scene/1"
    key: str
    city: str
    attribution: str
    source: MapSource
    box: tuple[float, float, float, float]
    box_is: str
    origin: tuple[float, float]
    bounds_m: tuple[float, float, float, float]
    options: dict[str, float | str | None]
    counts: dict[str, int]
    heights: HeightCounts | None = None
    skipped: dict[str, int]
    notes: tuple[str, ...]
    versions: dict[str, str]


def encode(summary: Summary) -> bytes:
    """The file's bytes, ending in a newline."""
    return msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n"


def read_summary(folder: Path) -> Summary | None:
    """The summary in a city's folder; None if there is none (not every city comes from a map)."""
    try:
        return msgspec.json.decode((folder / SUMMARY_FILE).read_bytes(), type=Summary)
    except (OSError, msgspec.DecodeError, msgspec.ValidationError):
        return None


_ONE = {"that do not": "that does not", "straight lines": "a straight line", "missing nodes": "a missing node"}


def reason_text(count: int, reason: str) -> str:
    """A line of `skipped` in words: the reasons are in the plural, one of a kind is not."""
    if count != 1:
        return f"{count} {reason}"
    things, *rest = reason.split(" ")
    told = " ".join((things.removesuffix("s"), *rest))
    for many, one in _ONE.items():
        told = told.replace(many, one)
    return f"1 {told}"


def heights_text(heights: HeightCounts) -> str:
    """The number of buildings by the source of their heights, in words."""
    inferred = f"{heights.inferred} inferred from neighbours"
    if heights.inferred:
        inferred += f" (largest {heights.tallest_inferred_m:g} m)"
    drawn = f"{heights.drawn} drawn" + (f" (largest {heights.tallest_drawn_m:g} m)" if heights.drawn else "")
    asked = f", {heights.default} by --default-levels" if heights.default else ""
    return f"{heights.tagged} tagged, {inferred}, {drawn}{asked}"


def counts(pieces: Pieces, frame: MapFrame) -> dict[str, int]:
    """How much there is of each kind; lanes in metres, areas in square metres."""
    west, south, east, north = frame.bounds
    return {
        "buildings": len(pieces.buildings),
        "tallest_m": round(max((building.top_m for building in pieces.buildings), default=0.0)),
        "roads": len(pieces.roads),
        "junctions": len(pieces.junctions),
        "bridges": len(pieces.bridges),
        "waters": len(pieces.waters),
        "areas": len(pieces.areas),
        "solids": len(pieces.solids),
        "trees": sum(prop.cls == "tree" for prop in pieces.props),
        "square_metres": round((east - west) * (north - south)),
    }
