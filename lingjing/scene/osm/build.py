"""A map file → a city in a folder, built once and then found by its content.

The key of a build covers the file's bytes, the options, this project's modules and the versions of the libraries that
decide the result. If the caller gives no folder, the city is stored in `cities` of the project's cache folder.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from html import unescape
from importlib import metadata
from itertools import chain
from pathlib import Path

import msgspec

from lingjing.data import CACHE_OFF, cache_is_off, kept_path
from lingjing.errors import UsageError
from lingjing.installation import CORE, version_of
from lingjing.scene.city import City, Junction, Pieces, Road
from lingjing.scene.osm import buildings, ground, read, structures, trees, water
from lingjing.scene.osm.buildings import HeightCounts, footprints
from lingjing.scene.osm.doors import with_doors
from lingjing.scene.osm.features import Features, collect
from lingjing.scene.osm.footbridges import footbridges
from lingjing.scene.osm.frame import MapFrame, choose
from lingjing.scene.osm.furniture import Obstruction, furniture
from lingjing.scene.osm.map_data import DegreeBox, MapData
from lingjing.scene.osm.passages import with_passages
from lingjing.scene.osm.streets import streets
from lingjing.scene.osm.summary import ATTRIBUTION, SUMMARY_FILE, MapSource, Summary, counts, encode, read_summary
from lingjing.scene.store import check_free, cities_folder, code_sha256, copy_store, intact_city, write_store

TILE_M = 250.0
"""Side of a tile, metres (chosen)."""
MOST_LEVELS = 100
"""Most storeys that `default_levels` may have (chosen)."""
PhaseListener = Callable[[str], None]
"""Function that receives the name of each phase."""


@dataclass(frozen=True, slots=True)
class Options:
    """Options of a build."""

    box: DegreeBox | None = None
    """Part of the map, degrees; None for all of it."""
    seed: int = 0
    """Seed of the details that the map leaves open."""
    water_m: float = water.LEVEL_M
    """Elevation of the waters, metres."""
    default_levels: int | None = None
    """Storeys of buildings without tagged height, 1..`MOST_LEVELS`; None to estimate them from their surroundings."""
    furniture: bool = False
    """True with lamps, benches, bus stops and parked cars of the map."""


@dataclass(frozen=True, slots=True)
class Built:
    """The result of a build."""

    city: City
    folder: Path
    """The city's folder."""
    summary: Summary
    cached: bool
    """True if the city was found in a folder and not built now."""


def build(
    path: Path, options: Options, folder: Path | None = None, on_phase: PhaseListener = lambda phase: None
) -> Built:
    """Build the city of a map file in `folder`, or in the cache. `on_phase` receives the name of each phase.

    Raises `UsageError` for a file that is no map or gives no city, and for a folder that cannot be written;
    `InfrastructureError` if netconvert is missing or crashes. A failed build leaves no folder.
    """
    if not -100.0 <= options.water_m <= -0.3:
        raise UsageError(
            f"waters at {options.water_m:g} m: the ground is at 0", hint="give a level from -100 to -0.3 m"
        )
    if options.default_levels is not None and not 1 <= options.default_levels <= MOST_LEVELS:
        raise UsageError(
            f"buildings of {options.default_levels} storeys by default", hint=f"give a number from 1 to {MOST_LEVELS}"
        )
    read.check(path)
    if folder is not None:
        check_free(folder)
    on_phase("looking at the map")
    source = MapSource(name=_readable(path.name), sha256=read.digest(path), bytes=path.stat().st_size)
    versions = _versions()
    key = _key(source, options, versions)
    cached = None if cache_is_off() else cities_folder() / key[:40]
    target = folder or cached
    if target is None:
        raise UsageError(
            f"the cache is off ({CACHE_OFF}), so the city needs a folder",
            hint="build it with: lingjing scene build -o DIR",
        )
    for kept in (target, cached, None if cached is None else Path(kept_path("cities", cached.name))):
        stored = None if kept is None or cache_is_off() else _kept(kept, key)
        if stored is not None and kept is not None:
            city, summary = stored
            if kept != target and folder is not None:
                city = copy_store(kept, target)
            return Built(city, folder or kept, summary, cached=True)
    on_phase("reading the map")
    data = read.read(path)
    frame = choose(data, options.box)
    pieces, light, heights, skipped, notes = _assemble(path, data, frame, options, on_phase)
    notes[:0] = (*data.notes, *frame.notes)
    summary = Summary(
        key=key,
        city=light.id,
        attribution=ATTRIBUTION,
        source=source,
        box=frame.box,
        box_is=frame.because,
        origin=frame.origin,
        bounds_m=frame.bounds,
        options={
            "bbox": _text(options.box),
            "seed": options.seed,
            "water_level_m": options.water_m,
            "default_levels": options.default_levels,
            **({"furniture": True} if options.furniture else {}),
        },
        counts=counts(pieces, frame),
        heights=heights,
        skipped=skipped,
        notes=tuple(notes),
        versions=versions,
    )
    on_phase("writing the city")
    city = write_store(cached or target, light, pieces, {SUMMARY_FILE: encode(summary)})
    if cached is not None and cached != target:
        city = copy_store(cached, target)  # the city in the cache serves later builds into any folder
    return Built(city, target, summary, cached=False)


# -- what the map gives


def _assemble(
    path: Path, data: MapData, frame: MapFrame, options: Options, on_phase: PhaseListener
) -> tuple[Pieces, City, HeightCounts, dict[str, int], list[str]]:
    on_phase("finding shapes")
    features = collect(data, frame)
    on_phase("raising buildings")
    raised = buildings.buildings(features, options.seed, options.default_levels)
    on_phase("making the road network")
    network, roads, junctions, notes = _network(data, features)
    on_phase("laying out ground and water")
    built = with_passages(raised.buildings, roads)
    wet, on_piles = water.with_banks(water.wet(features), built)
    built = with_doors(built, features, roads, wet)
    areas = ground.areas(features, wet)
    on_phase("planting trees")
    pavement = trees.pavement(roads)
    occupied = trees.occupied_area(wet, built, pavement)
    planted = tuple(trees.trees(features, areas, occupied, options.seed))
    if options.furniture:
        blocked = Obstruction(pavement, occupied)
        planted += tuple(furniture(features, blocked, options.seed))
    pieces = Pieces(
        waters=water.waters(wet, options.water_m),
        areas=areas,
        solids=tuple(
            chain(
                structures.piers(features, options.water_m),
                structures.platforms(on_piles, options.water_m),
                structures.walls(features, pavement),
            )
        ),
        buildings=built,
        roads=roads,
        junctions=junctions,
        bridges=tuple(chain(structures.decks(roads), footbridges(features, roads))),
        pipes=tuple(structures.pipelines(features, pavement, footprints(built))),
        props=planted,
    )
    if not built:
        notes.append("no buildings in this part of the map")
    if not any(getattr(pieces, name) for name in Pieces.__struct_fields__):
        raise UsageError(f"`{path}` holds nothing to build a city from", hint="choose a part with streets or buildings")
    light = City(
        id=f"map-{_readable(path.name).split('.')[0]}",
        origin=frame.origin,
        bounds=frame.bounds,
        datum_m=0.0,
        attribution=ATTRIBUTION,
        network=network,
        tile_m=TILE_M,
    )
    return pieces, light, raised.counts(), dict(sorted((features.skipped + data.skipped).items())), notes


def _network(data: MapData, features: Features) -> tuple[str, tuple[Road, ...], tuple[Junction, ...], list[str]]:
    """Build the road network; return its file, the visible roads and junctions, and notes. Without roads the path is
    "".
    """
    from lingjing.scene.network import network_from_osm, read_roads

    frame = features.frame
    map_streets = streets(data, features)
    if not map_streets.document:
        return "", (), (), ["no roads in this part of the map: a city without traffic"]
    try:
        made = network_from_osm(map_streets.document, frame.origin, frame.box, map_streets.variants)
    except UsageError as error:
        return "", (), (), [f"no road network, a city without traffic: {error}"]
    roads, junctions = read_roads(made.path)
    near = (structures.clip_road(road, frame.bounds) for road in roads if structures.is_visible(road))
    # netconvert escapes names twice
    shown = (structures.overlap_lanes(road) for road in near if road is not None)
    seen = tuple(msgspec.structs.replace(road, name=unescape(road.name)) for road in shown)
    crossings = (junction for junction in junctions if structures.is_open(junction))
    return made.path, seen, tuple(item for item in crossings if structures.is_inside(item, frame.bounds)), []


# -- knowing a build again


def _key(source: MapSource, options: Options, versions: dict[str, str]) -> str:
    made_of = [source.name, source.sha256, repr(options), versions, code_sha256(Path(__file__).parent)]
    return hashlib.sha256(msgspec.json.encode(made_of)).hexdigest()


def _versions() -> dict[str, str]:
    import numpy as np  # before shapely, which turns an interrupt during its import of numpy into an ImportError
    import shapely

    try:
        sumo = metadata.version("eclipse-sumo")
    except metadata.PackageNotFoundError:
        sumo = "none"
    return {
        "lingjing": version_of(CORE),
        **read.versions(),
        "numpy": np.__version__,
        "shapely": shapely.__version__,
        "geos": shapely.geos_version_string,
        "eclipse-sumo": sumo,
    }


def _kept(folder: Path, key: str) -> tuple[City, Summary] | None:
    """The city and summary of a folder if it is intact and has that key, else None."""
    summary = read_summary(folder)
    if summary is None or summary.key != key:
        return None
    city = intact_city(folder)
    return None if city is None else (city, summary)


def _readable(name: str) -> str:
    """A file's name as printable text. A name that is not UTF-8 could not be encoded in a city."""
    text = os.fsencode(name).decode("utf-8", "replace")
    return "".join(character if character.isprintable() else "\ufffd" for character in text)


def _text(box: DegreeBox | None) -> str | None:
    return None if box is None else ",".join(f"{value:.7g}" for value in box)
