"""Print the page of the site that lists every verb of the command line with its options, as `--help` shows them.

The site's hook `tools/site_hooks.py` runs this with the project's interpreter, so it is always up to date.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator

from lingjing.cli.main import VERBS, complete_parser

HEAD = """# The command line

`lingjing VERB …`: one verb for each step of the work. Exit codes of every verb: 0 done, 1 errors in a mission, 2 wrong
usage, 3 an abort by the infrastructure, 70 a bug, 130 interrupted. `LINGJING_TRACEBACK=1` shows the traceback of an
error.
"""


def parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parsers below this one, each before its own actions."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in {id(below): below for below in action.choices.values()}.values():
                yield below
                yield from parsers(below)


def main() -> None:
    """Print the page."""
    os.environ["COLUMNS"] = "92"
    print(HEAD)
    print("| Verb | |\n| --- | --- |")
    for verb in VERBS:
        print(f"| [`{verb.name}`](#lingjing-{verb.name}) | {verb.summary} |")
    for parser in parsers(complete_parser()):
        words = parser.prog.split()
        print(f"\n{'#' * len(words)} {parser.prog}\n\n```text\n{parser.format_help().strip()}\n```")


if __name__ == "__main__":
    main()
