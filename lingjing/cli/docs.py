"""`lingjing docs`: a Markdown page about a mission or a library, or the language on one card."""

from __future__ import annotations

import argparse
from pathlib import Path

from lingjing.cli.files import read_mission, write_output
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.model import Mission


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "file", metavar="MISSION", nargs="?",
        help="a .ljs or .json file, a shipped mission, or a library such as std.air; - reads input",
    )  # fmt: skip
    parser.add_argument("--card", action="store_true", help="the whole language on one card, for people and models")
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
    text = _page_of_language(args)
    if text is not None:
        write_output(text, args.output, [])
        return ExitCode.OK
    if args.results and args.file == "-":
        raise UsageError("the version of a mission from standard input is not known", hint="name its file")
    mission = read_mission(args.file)
    if args.trace or args.results:
        _illustrated(args, mission)
    else:
        from lingjing.dsl.pages.page import page

        write_output(page(mission), args.output, [args.file])
    return ExitCode.OK


def _page_of_language(args: argparse.Namespace) -> str | None:
    """The card, or the page of a library; None for a mission."""
    if args.card:
        if args.file or args.trace or args.results:
            raise UsageError("`--card` is about the language alone", hint="lingjing docs --card")
        from lingjing.dsl.pages.card import language_card

        return language_card()
    if args.file is None:
        raise UsageError("a mission or a library is missing", hint="lingjing docs ssr, docs std.air, or docs --card")
    if not _is_library(args.file):
        return None
    if args.trace or args.results:
        raise UsageError("a library has no traces and no results", hint=f"lingjing docs {args.file}")
    from lingjing.dsl.pages.library import library_page

    return library_page(args.file)


def _is_library(name: str) -> bool:
    """True for `std.air` or a plug-in's `acme.rotors`, unless a file has that name."""
    first, dot, rest = name.partition(".")
    named = bool(dot) and all(word.isidentifier() for word in name.split("."))
    if not named or rest in ("ljs", "json") or Path(name).exists():
        return False
    from lingjing.dsl.checking.library import find_file

    return first == "std" or find_file(tuple(name.split("."))) is not None


def _illustrated(args: argparse.Namespace, mission: Mission) -> None:
    from lingjing.numerics import pin

    pin()  # pictures of unused cameras are rendered here
    from lingjing.cli.missionpage import rows_of, write_page
    from lingjing.dsl.loading.shipped import find_mission

    if args.output in (None, "-"):
        raise UsageError("a page with pictures needs a folder", hint="name one: -o DIR")
    rows = rows_of(mission, find_mission(args.file), Path(args.results)) if args.results else []
    print(write_page(mission, [Path(trace) for trace in args.trace], rows, Path(args.output)))
