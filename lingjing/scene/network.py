"""Road networks: made by SUMO's netconvert from plain streets or from OpenStreetMap data, and read back as roads.

Input: nodes and edges in world metres, or a document of streets in OpenStreetMap's XML (`scene.osm.streets` writes it).
Output: a `Network`, which is a `.net.xml` in the project's cache folder, in world coordinates.
`read_roads` turns any such file into `Road`s and `Junction`s with lanes in world metres.

netconvert belongs to the package `eclipse-sumo`. It runs as a separate program, so no part of SUMO is loaded here. Its
output is made independent of date and folder (the header is dropped). The file is named by a hash of its input and is
written to a temporary folder, then renamed, so that concurrent builders of one network leave one complete file.
"""

from __future__ import annotations

import hashlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, iterparse
from xml.sax.saxutils import quoteattr

import msgspec

from lingjing.data import cache_folder, kept_path
from lingjing.errors import InfrastructureError, UsageError
from lingjing.installation import install_line
from lingjing.mission.geometry2d import Vector2, signed_area
from lingjing.mission.instance import Vector
from lingjing.scene.atomic_folder import folder_beside
from lingjing.scene.city import Junction, Lane, Road

FORMAT = "3"
"""Version of the networks' content. It changes whenever the same streets would give another network."""

LANE_WIDTH_M = 3.3
"""Width of a lane of a procedural street (chosen)."""
SUMO_LANE_WIDTH_M = 3.2
"""SUMO's default for a lane that declares no width."""

LAYER_M = 6.0
"""Height of one OSM layer, metres: the elevation of a bridge over a road (chosen)."""

THROUGH_KEY = "through"
"""The parameter of an edge, and the tag of a street. It is `no` where only traffic that begins or ends there may
drive."""

OPEN_TUNNELS = ("", "no", "building_passage", "passage")
"""Values of a way's `tunnel` that leave it on the ground: it has none, or leads through a building."""

SECONDS_MOST = 600.0
"""Time limit of one netconvert run, seconds (chosen)."""
NETWORKS = "networks"
"""Name of the folder of networks in the cache folder."""
_Arguments = Callable[[Path], list[str]]
_STREET_OPTIONS = (
    "--junctions.corner-detail",
    "5",
    "--no-turnarounds.except-deadend",
    "--default.junctions.radius",
    "5",
)
_OSM_OPTIONS = (
    "--geometry.remove", "--ramps.guess", "--junctions.join", "--tls.guess-signals", "--tls.discard-simple",
    "--tls.join", "--no-turnarounds.except-deadend", "--junctions.corner-detail", "5",
    "--keep-edges.by-vclass", "passenger,bus,delivery,private", "--osm.elevation",
    "--output.street-names", "--osm.all-attributes", "--osm.extra-attributes", "bridge,tunnel,layer,through",
)  # fmt: skip

_SIDEWALK_OPTIONS = (
    "--sidewalks.guess", "--sidewalks.guess.max-speed", "17", "--default.sidewalk-width", "2.5", "--crossings.guess"
)  # fmt: skip
"""Sidewalks on streets up to 60 km/h, 2.5 m wide (the least of German guidelines, RASt 06), and crossings."""


_HAS_EDGE = re.compile(rb'<edge id="[^:]')


class StreetNode(msgspec.Struct, frozen=True, kw_only=True):
    """A crossing of streets, or the end of one."""

    id: str
    east: float
    """Metres."""
    north: float
    """Metres."""
    elevation: float = 0.0
    """Metres."""
    control: str = "priority"
    """`priority`, `traffic_light`, `right_before_left` or `dead_end`."""


class StreetEdge(msgspec.Struct, frozen=True, kw_only=True):
    """One direction of a street from node to node; its lanes lie to the right of the line between them."""

    id: str
    start: str
    """Id of the first node."""
    end: str
    """Id of the last node."""
    lanes: int = 1
    """Number of lanes."""
    speed_mps: float = 13.9
    """Permitted speed, m/s."""
    width_m: float = LANE_WIDTH_M
    """Width of a lane, metres."""
    kind: str = "residential"
    """Class of the road: `primary`, `residential`, …"""
    name: str = ""
    priority: int = 1
    """Right of way: traffic on an edge of lower priority waits."""
    shape: tuple[Vector, ...] = ()
    """Points between the two nodes, metres."""
    sidewalk_m: float = 0.0
    """Width of a pedestrian lane on the right, metres; 0 without one."""
    bridge: bool = False
    tunnel: bool = False


class Network(msgspec.Struct, frozen=True, kw_only=True):
    """A finished network."""

    path: str
    """Path of the `.net.xml`."""
    sha256: str
    """SHA-256 (hex) of the `.net.xml`."""


def build_network(
    nodes: Sequence[StreetNode], edges: Sequence[StreetEdge], *, origin: tuple[float, float] = (31.0, 121.5)
) -> Network:
    """Return the network of these streets, from the cache if it is there.

    Raises `UsageError` for streets that give no network, `InfrastructureError` if netconvert is not installed or
    crashes.
    """
    if not edges:
        raise UsageError("the road network has no streets", hint="give at least one edge")
    node_file, edge_file = _node_xml(nodes), _edge_xml(nodes, edges)
    key = _digest("streets", repr(origin), node_file, edge_file, *_STREET_OPTIONS)

    def arguments(folder: Path) -> list[str]:
        (folder / "n.nod.xml").write_text(node_file, encoding="utf-8")
        (folder / "e.edg.xml").write_text(edge_file, encoding="utf-8")
        return ["--node-files", str(folder / "n.nod.xml"), "--edge-files", str(folder / "e.edg.xml"), *_STREET_OPTIONS]

    return _cached(key, origin, arguments, "the streets")


def moved_streets(
    nodes: Sequence[StreetNode], edges: Sequence[StreetEdge], by: Vector2
) -> tuple[Sequence[StreetNode], Sequence[StreetEdge]]:
    """Return the streets, translated by `by` metres (east, north)."""
    if by == (0.0, 0.0):
        return nodes, edges
    east, north = by
    return (
        [msgspec.structs.replace(node, east=node.east + east, north=node.north + north) for node in nodes],
        [
            msgspec.structs.replace(edge, shape=tuple((x + east, y + north, z) for x, y, z in edge.shape))
            for edge in edges
        ],
    )


def network_from_osm(
    document: str, origin: tuple[float, float], bbox: tuple[float, float, float, float] | None = None,
    variants: Mapping[str, str] | None = None, what: str = "the map",
) -> Network:  # fmt: skip
    """Return the network of the streets in an OpenStreetMap document, in metres about `origin` (latitude, longitude).

    `bbox`: west, south, east, north in degrees; streets outside it are dropped. Elevations are the nodes' tag `ele`.
    `variants`: additional kinds of streets and the vehicle classes that each permits; `residential|closed` is otherwise
    like `residential`. `what`: name of the source in error messages. Raises `UsageError` for a document without streets
    or one that netconvert rejects.
    """
    options = list(_OSM_OPTIONS)
    if bbox is not None:
        options += ["--keep-edges.in-geo-boundary", ",".join(f"{value:.7f}" for value in bbox)]
    types = _variant_types(variants or {})
    key = _digest("osm", repr(origin), document, types, *options)

    def arguments(folder: Path) -> list[str]:
        (folder / "streets.osm").write_text(document, encoding="utf-8")
        (folder / "variants.typ.xml").write_text(types, encoding="utf-8")
        files = [str(file) for file in (_typemap(), folder / "variants.typ.xml") if file.is_file()]
        inputs = ["--osm-files", str(folder / "streets.osm"), "--proj", projection(origin)]
        return [*inputs, *options, "--type-files", ",".join(files)]

    return _cached(key, origin, arguments, what)


def with_sidewalks(path: str) -> Network:
    """Return a network with sidewalks and crossings in addition, from the cache if it is there.

    Edges keep their ids, and their lanes for vehicles keep their lines up to the junctions, which grow by the
    crossings. Raises `UsageError` for a file that is no network.
    """
    key = _digest("sidewalks", file_sha256(Path(path)), *_SIDEWALK_OPTIONS)
    return _cached(key, (0.0, 0.0), lambda folder: ["--sumo-net-file", path, *_SIDEWALK_OPTIONS], f"the network {path}")


def read_roads(path: str | Path) -> tuple[tuple[Road, ...], tuple[Junction, ...]]:
    """Return the streets and junctions of a network, in the order of the file, without the edges inside junctions.

    Raises `UsageError` for a file that is no network.
    """
    roads: list[Road] = []
    junctions: list[Junction] = []
    try:
        for element in elements_of(Path(path), ("edge", "junction")):
            if element.tag == "edge" and element.get("function", "normal") == "normal":
                roads.append(_road(element))
            elif element.tag == "junction" and element.get("type") != "internal":
                junctions.extend(_junction(element))
    except (OSError, ParseError, ValueError) as error:
        raise UsageError(f"{path} is no road network: {error}", hint="give a .net.xml that netconvert wrote") from error
    return tuple(roads), tuple(junctions)


def projection(origin: tuple[float, float]) -> str:
    """The PROJ string of the world frame: transverse Mercator about the origin, on the ellipsoid of WGS84."""
    return f"+proj=tmerc +lat_0={origin[0]:.9g} +lon_0={origin[1]:.9g} +k=1 +ellps=WGS84"


def network_folder() -> Path:
    """The folder of networks: `networks` in the project's cache folder (`$XDG_CACHE_HOME/lingjing`)."""
    return Path(cache_folder(), NETWORKS)


def file_sha256(path: Path) -> str:
    """SHA-256 of a file's bytes. Raises `UsageError` if the file cannot be read."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while block := file.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from error
    return digest.hexdigest()


@cache
def netconvert() -> Path:
    """Path of the program. Raises `InfrastructureError` with the command that installs it if it is missing."""
    for folder in (_home() / "bin", Path(sys.executable).parent):
        for name in ("netconvert", "netconvert.exe"):
            if (folder / name).is_file():
                return folder / name
    raise InfrastructureError("netconvert, which makes road networks, is not installed", hint=_install_hint())


# -- private


def _install_hint() -> str:
    return f"install it with: {install_line('road')}"


def _home() -> Path:
    """The folder of the package `sumo`, located without importing it."""
    spec = find_spec("sumo")
    places = list(spec.submodule_search_locations or ()) if spec is not None else []
    if places:
        return Path(places[0])
    return Path(os.environ.get("SUMO_HOME", "/nonexistent"))


def _typemap() -> Path:
    """Path of SUMO's table of OpenStreetMap's kinds of streets."""
    return _home() / "data" / "typemap" / "osmNetconvert.typ.xml"


def _variant_types(variants: Mapping[str, str]) -> str:
    """A file of edge types: SUMO's types, each with the permissions of the variant."""
    try:
        known = {element.get("id", ""): dict(element.attrib) for _, element in iterparse(_typemap())}  # noqa: S314 - SUMO's
    except (OSError, ParseError):
        known = {}
    lines = ["<types>"]
    for name, allowed in sorted(variants.items()):
        attributes = known.get(f"highway.{name.partition('|')[0]}", {})
        attributes.pop("disallow", "")
        attributes |= {"id": f"highway.{name}", "allow": allowed}
        lines.append(f"<type {' '.join(f'{key}={quoteattr(value)}' for key, value in attributes.items())}/>")
    return "\n".join((*lines, "</types>\n"))


@cache
def _version() -> str:
    run = subprocess.run([str(netconvert()), "--version"], capture_output=True, text=True, check=False)
    return (run.stdout.splitlines() or [""])[0]


def _digest(*parts: str) -> str:
    digest = hashlib.sha256()
    for part in (FORMAT, _version(), *parts):
        data = part.encode()
        digest.update(b"%d\0" % len(data) + data)
    return digest.hexdigest()


def _cached(key: str, origin: tuple[float, float], arguments: _Arguments, what: str) -> Network:
    target = network_folder() / f"{key[:40]}.net.xml"
    known = target.with_suffix(".sha256")
    kept = Path(kept_path(NETWORKS, target.name))
    if kept.is_file() and kept.with_suffix(".sha256").is_file():
        sha256 = kept.with_suffix(".sha256").read_text(encoding="ascii", errors="replace")
        if file_sha256(kept) == sha256:
            return Network(path=str(kept), sha256=sha256)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with folder_beside(target) as folder:
            made = folder / "made.net.xml"
            _run([*arguments(folder), "--offset.disable-normalization", "-o", str(made)], what)
            data = _plain(made.read_bytes(), origin)
            if not _HAS_EDGE.search(data):
                raise UsageError(f"{what}: there is no road for vehicles in it", hint="choose a part with streets")
            sha256 = hashlib.sha256(data).hexdigest()
            made.write_bytes(data)
            (folder / "sha256").write_text(sha256, encoding="ascii")
            made.replace(target)
            (folder / "sha256").replace(known)
    except OSError as error:
        raise InfrastructureError(
            f"cannot keep the road network in {target.parent}: {error.strerror or error}",
            hint="make room there, or set XDG_CACHE_HOME to a folder that can be written",
        ) from error
    return Network(path=str(target), sha256=sha256)


def _run(arguments: list[str], what: str) -> None:
    """Run netconvert. Its error output goes into the exception."""
    command = [str(netconvert()), *arguments, "--no-warnings", "--xml-validation", "never"]
    environment = {**os.environ, "SUMO_HOME": str(_home()), "OMP_NUM_THREADS": "1"}
    proj = _home() / "data" / "proj"
    if proj.is_dir():
        environment |= {"PROJ_LIB": str(proj), "PROJ_DATA": str(proj)}
    try:
        run = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=SECONDS_MOST, env=environment,
            stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise InfrastructureError(f"netconvert took longer than {SECONDS_MOST:g} s over {what}") from error
    except OSError as error:
        raise InfrastructureError(f"netconvert cannot be run: {error}", hint=_install_hint()) from error
    if run.returncode == 0:
        return
    complaints = [line.removeprefix("Error: ") for line in run.stderr.splitlines() if line.strip()]
    complaints = [line for line in complaints if line != "Quitting (on error)."] or [f"exit code {run.returncode}"]
    if run.returncode < 0:
        hint = "raise the limit on the size of files (`ulimit -f`)" if -run.returncode == signal.SIGXFSZ else ""
        raise InfrastructureError(f"netconvert was ended by signal {-run.returncode} over {what}", hint=hint)
    raise UsageError(f"netconvert made no road network of {what}: {' '.join(complaints)}")


def _plain(data: bytes, origin: tuple[float, float]) -> bytes:
    """The network without its dated header, and with the projection of its coordinates."""
    data = re.sub(rb"<!--.*?-->\s*", b"", data, count=1, flags=re.DOTALL)
    return data.replace(b'projParameter="!"', f'projParameter="{projection(origin)}"'.encode(), 1)


def _node_xml(nodes: Iterable[StreetNode]) -> str:
    lines = [
        f"<node id={quoteattr(node.id)} x=\"{node.east:.3f}\" y=\"{node.north:.3f}\" z=\"{node.elevation:.3f}\" "
        f"type={quoteattr(node.control)}/>"
        for node in nodes
    ]  # fmt: skip
    return "\n".join(("<nodes>", *lines, "</nodes>\n"))


def _edge_xml(nodes: Iterable[StreetNode], edges: Iterable[StreetEdge]) -> str:
    places = {node.id: (node.east, node.north, node.elevation) for node in nodes}
    return "\n".join(("<edges>", *(line for edge in edges for line in _edge_lines(edge, places)), "</edges>\n"))


def _edge_lines(edge: StreetEdge, places: Mapping[str, Vector]) -> Iterator[str]:
    extra = f' sidewalkWidth="{edge.sidewalk_m:.2f}"' if edge.sidewalk_m > 0 else ""
    if edge.shape and edge.start in places and edge.end in places:
        line = (places[edge.start], *edge.shape, places[edge.end])
        extra += ' shape="' + " ".join(",".join(f"{value:.3f}" for value in point) for point in line) + '"'
    if edge.name:
        extra += f" name={quoteattr(edge.name)}"
    yield (
        f"<edge id={quoteattr(edge.id)} from={quoteattr(edge.start)} to={quoteattr(edge.end)} "
        f'numLanes="{edge.lanes}" speed="{edge.speed_mps:.2f}" width="{edge.width_m:.2f}" '
        f'type={quoteattr(edge.kind)} priority="{edge.priority}"{extra}>'
    )
    for name, holds in (("bridge", edge.bridge), ("tunnel", edge.tunnel)):
        if holds:
            yield f'<param key="{name}" value="yes"/>'
    yield "</edge>"


def elements_of(path: Path, tags: Sequence[str]) -> Iterator[Element]:
    """Yield the elements of a network file that have these tags.

    Elements are dropped after use, so that a large file needs little memory.
    """
    with path.open("rb") as file:
        events = iterparse(file, events=("start", "end"))  # noqa: S314 - written by netconvert
        _, root = next(events)
        if root.tag != "net":
            raise ValueError(f"it begins with <{root.tag}>")
        for event, element in events:
            if event == "end" and element.tag in tags:
                yield element
                root.clear()


def _road(element: Element) -> Road:
    lanes = element.findall("lane")
    parameters = {item.get("key", ""): item.get("value", "") for item in element.findall("param")}
    return Road(
        id=element.get("id", ""),
        lanes=tuple(_lane(lane) for lane in lanes),
        name=element.get("name", ""),
        kind=element.get("type", "residential").removeprefix("highway.").split("|")[0],
        speed_mps=max(float(lane.get("speed", "13.9")) for lane in lanes),
        bridge=parameters.get("bridge", "no") not in ("no", ""),
        tunnel=parameters.get("tunnel", "no") not in OPEN_TUNNELS,
    )


def _lane(element: Element) -> Lane:
    return Lane(
        id=element.get("id", ""),
        shape=_points(element.get("shape", "")),
        width_m=float(element.get("width", SUMO_LANE_WIDTH_M)),
        kind=_lane_kind(element.get("allow"), element.get("disallow", "")),
    )


def car_lanes(edge: Element) -> list[tuple[tuple[Vector, ...], float, float]]:
    """Shape, length (m) and permitted speed (m/s) of an edge's lanes that are open to cars, from right to left."""
    return [
        (_points(lane.get("shape", "")), float(lane.get("length", "0")), float(lane.get("speed", "13.9")))
        for lane in edge.findall("lane")
        if _lane_kind(lane.get("allow"), lane.get("disallow", "")) == "car"
    ]


def _lane_kind(allow: str | None, disallow: str) -> str:
    if allow is None:
        return "foot" if disallow == "all" else "car"
    allowed = set(allow.split())
    if allowed & {"passenger", "all"}:  # the road engine drives passenger cars
        return "car"
    kinds = {"bus": "bus", "delivery": "closed", "truck": "closed", "private": "closed", "bicycle": "bicycle"}
    return next((kind for name, kind in kinds.items() if name in allowed), "foot")


def _junction(element: Element) -> Iterator[Junction]:
    shape = _points(element.get("shape", ""))
    outline = tuple((x, y) for x, y, _ in shape)
    if len(outline) > 1 and outline[0] == outline[-1]:
        outline = outline[:-1]
    if len(outline) >= 3:
        yield Junction(
            id=element.get("id", ""),
            polygon=outline if signed_area(outline) >= 0.0 else outline[::-1],
            elevation_m=float(element.get("z", "0")),
            lights=element.get("type", "").startswith("traffic_light"),
        )


def _points(text: str) -> tuple[Vector, ...]:
    points: list[Vector] = []
    for item in text.split():
        parts = item.split(",")
        point = float(parts[0]), float(parts[1]), float(parts[2]) if len(parts) > 2 else 0.0
        if not points or points[-1] != point:
            points.append(point)
    return tuple(points)
