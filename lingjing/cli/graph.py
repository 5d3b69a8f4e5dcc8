"""`lingjing graph`: draw the mission graph, write it as JSON, or print the conditions of the mission."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import PurePath
from typing import TYPE_CHECKING

from lingjing.cli.files import read_mission, write_output
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.mission.graph import MissionGraph
    from lingjing.mission.model import Mission

FORMATS = ("svg", "mermaid", "dot", "json")
_SUFFIXES = {".svg": "svg", ".mmd": "mermaid", ".mermaid": "mermaid", ".dot": "dot", ".gv": "dot", ".json": "json"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", metavar="MISSION", help="a .ljs or .json file, or a shipped mission; - reads input")
    parser.add_argument("-o", "--output", metavar="OUT", help="where to write (default: standard output)")
    parser.add_argument("--format", choices=FORMATS, help="what to write (default: by OUT's suffix, else mermaid)")
    parser.add_argument(
        "--mode", metavar="MODE", help="only the graph of this mode, such as star or broadcast (default: all)"
    )
    parser.add_argument("--tier", metavar="N", help="the graph of this tier (default 0)")
    parser.add_argument(
        "--conditions",
        action="store_true",
        help="print each condition: its parts, what they read, what changes that, its bounds, and what is hidden",
    )


def handler(args: argparse.Namespace) -> int:
    """Draw and write; the output file is complete or absent."""
    from lingjing.cli.arguments import parse_tier
    from lingjing.mission.alternatives import at_tier
    from lingjing.mission.graph import graph

    tier = parse_tier(args.tier) if args.tier is not None else 0
    if args.conditions:
        return _conditions(args, lambda mission: at_tier(mission, tier) if args.tier is not None else mission)
    chosen = args.format or _format_of(args.output)
    write_output(render(graph(read_mission(args.file), args.mode, tier), chosen), args.output, [args.file])
    return ExitCode.OK


def _conditions(args: argparse.Namespace, at_its_tier: Callable[[Mission], Mission]) -> int:
    from lingjing.cli.conditions import as_json, as_text, print_conditions
    from lingjing.mission.conditions.listing import list_conditions

    named_json = PurePath(args.output or "").suffix.lower() == ".json"
    if args.format not in (None, "json"):
        raise UsageError(
            f"conditions are text or JSON, not {args.format}", hint="remove --format, or choose --format json"
        )
    listed = list_conditions(at_its_tier(read_mission(args.file)), args.mode)
    if args.format == "json" or named_json:
        write_output(as_json(listed), args.output, [args.file])
    elif args.output in (None, "-"):
        print_conditions(listed)
    else:
        write_output(as_text(listed), args.output, [args.file])
    return ExitCode.OK


def _format_of(output: str | None) -> str:
    """Return the format for a file's suffix; Mermaid for standard output and without a suffix. Raises `UsageError` for
    an unknown suffix.
    """
    if output in (None, "-"):
        return "mermaid"
    suffix = PurePath(str(output)).suffix.lower()
    if not suffix:
        return "mermaid"
    if suffix not in _SUFFIXES:
        raise UsageError(
            f"the suffix `{suffix}` belongs to no format",
            hint=f"end the name in {', '.join(_SUFFIXES)}, or add --format",
        )
    return _SUFFIXES[suffix]


def render(shown: MissionGraph, chosen: str) -> str:
    """Return the graph in one of `FORMATS`, ending in a newline."""
    if chosen == "svg":
        from lingjing.mission.draw.svg import svg

        return svg(shown)
    if chosen == "dot":
        from lingjing.mission.draw.dot import dot

        return dot(shown)
    if chosen == "json":
        import msgspec

        return msgspec.json.format(msgspec.json.encode(shown), indent=1).decode() + "\n"
    from lingjing.mission.draw.mermaid import mermaid

    return mermaid(shown)
