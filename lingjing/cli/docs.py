"""`lingjing docs MISSION`: a page of Markdown that says what a mission is."""

from __future__ import annotations

import argparse
import sys

from lingjing.errors import ExitCode


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options."""
    parser = subparsers.add_parser("docs", help="write a page that says what a mission is", description=__doc__)
    parser.add_argument("file", metavar="MISSION", help="a .ljs or .json file, or a shipped mission; - reads input")
    parser.add_argument("-o", "--output", metavar="OUT.md", help="where to write (default: standard output)")
    parser.set_defaults(handler=handler)


def handler(args: argparse.Namespace) -> int:
    """Write the page; it appears whole or not at all."""
    from lingjing.dsl.load import load_noted
    from lingjing.dsl.page import page

    mission, notes = load_noted(args.file)
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    text = page(mission)
    if args.output in (None, "-"):
        sys.stdout.write(text)
    else:
        from lingjing.cli.compile import write_whole

        write_whole(args.output, text)
    return ExitCode.OK
