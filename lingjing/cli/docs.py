"""`lingjing docs MISSION`: write a Markdown page that describes a mission, with pictures of played episodes."""

from __future__ import annotations

import argparse
from pathlib import Path

from lingjing.cli.files import read_mission, write_output
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.model import Mission


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", metavar="MISSION", help="a .ljs or .json file, or a shipped mission; - reads input")
    parser.add_argument(
        "--trace", metavar="TRACE", nargs="+", default=[],
        help="traces of the mission: adds the first one's map and the best picture of each camera",
    )  # fmt: skip
    parser.add_argument("--results", metavar="RESULTS", help="a suite's folder or .parquet file: adds its table")
    parser.add_argument(
        "-o", "--output", metavar="OUT",
        help="where to write: a file (default: standard output), or with --trace or --results a folder",
    )  # fmt: skip


def handler(args: argparse.Namespace) -> int:
    """Write the page; without pictures the file is complete or absent."""
    mission = read_mission(args.file)
    if args.trace or args.results:
        _illustrated(args, mission)
    else:
        from lingjing.dsl.pages.page import page

        write_output(page(mission), args.output, [args.file])
    return ExitCode.OK


def _illustrated(args: argparse.Namespace, mission: Mission) -> None:
    from lingjing.numerics import pin

    pin()  # pictures of unused cameras are rendered here
    from lingjing.cli.missionpage import write_page

    if args.output in (None, "-"):
        raise UsageError("a page with pictures needs a folder", hint="name one: -o DIR")
    results = Path(args.results) if args.results else None
    print(write_page(mission, [Path(trace) for trace in args.trace], results, Path(args.output)))
