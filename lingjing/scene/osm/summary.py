"""`scene.json`: source and content of a built city, for users and for the cache."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from lingjing.decoding import from_json
from lingjing.scene.city import Pieces
from lingjing.scene.osm.buildings import HeightCounts
from lingjing.scene.osm.frame import MapFrame

SUMMARY_FILE = "scene.json"
"""Name of the file in a city's folder."""
ATTRIBUTION = "© OpenStreetMap contributors, ODbL 1.0"


class MapSource(msgspec.Struct, frozen=True, kw_only=True):
    """The map file."""

    name: str
    """Name without folders."""
    sha256: str
    """SHA-256 of the bytes."""
    bytes: int
    """Size."""


class Summary(msgspec.Struct, frozen=True, kw_only=True):
    """The content of `scene.json`."""

    format: Literal["lingjing-scene/1"] = "lingjing-scene/1"
    key: str
    """Hash of source, options and versions: equal keys mean equal cities."""
    city: str
    """The city's id."""
    attribution: str
    source: MapSource
    box: tuple[float, float, float, float]
    """West, south, east, north; degrees."""
    box_is: str
    """Reason why this part of the map was chosen."""
    origin: tuple[float, float]
    """Latitude and longitude, degrees."""
    bounds_m: tuple[float, float, float, float]
    """West, south, east, north about the origin; metres."""
    options: dict[str, float | str | None]
    """Options of the build."""
    counts: dict[str, int]
    """Number of pieces of each kind; see `counts`."""
    heights: HeightCounts | None = None
    """Number of buildings by the source of their heights; None in a folder that was built before this was counted."""
    skipped: dict[str, int]
    """Number of the map's objects that are not in the city, by reason."""
    notes: tuple[str, ...]
    """Remarks for the user."""
    versions: dict[str, str]
    """Versions of this project and of the libraries that decide the result."""


def encode(summary: Summary) -> bytes:
    """Return the file's bytes. They end in a newline."""
    return msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n"


def read_summary(folder: Path) -> Summary | None:
    """Read the summary in a city's folder; None if there is none, since not every city comes from a map."""
    try:
        return from_json((folder / SUMMARY_FILE).read_bytes(), Summary)
    except (OSError, msgspec.DecodeError, msgspec.ValidationError):
        return None


_ONE = {"that do not": "that does not", "straight lines": "a straight line", "missing nodes": "a missing node"}
"""Plural → singular, for reasons in `skipped`."""


def reason_text(count: int, reason: str) -> str:
    """A line of `skipped` in words. Reasons are stored in the plural."""
    if count != 1:
        return f"{count} {reason}"
    things, *rest = reason.split(" ")
    text = " ".join((things.removesuffix("s"), *rest))
    for plural, singular in _ONE.items():
        text = text.replace(plural, singular)
    return f"1 {text}"


def heights_text(heights: HeightCounts) -> str:
    """The number of buildings by the source of their heights, in words."""
    inferred = f"{heights.inferred} inferred from neighbours"
    if heights.inferred:
        inferred += f" (largest {heights.tallest_inferred_m:g} m)"
    drawn = f"{heights.drawn} drawn" + (f" (largest {heights.tallest_drawn_m:g} m)" if heights.drawn else "")
    by_default = f", {heights.default} by --default-levels" if heights.default else ""
    return f"{heights.tagged} tagged, {inferred}, {drawn}{by_default}"


def counts(pieces: Pieces, frame: MapFrame) -> dict[str, int]:
    """The number of pieces of each kind, the tallest building in metres, and the area in square metres."""
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
