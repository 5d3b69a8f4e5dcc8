"""`lingjing fmt`: format mission files, and upgrade them to the newest version of the language.

Comments, units and the digits of numbers are kept.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from lingjing.cli.files import write_whole
from lingjing.cli.process import say, say_error
from lingjing.errors import ExitCode, UsageError
from lingjing.terminal import write_data, write_styled


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="a .ljs file, a folder of them, or - to read standard input and write standard output",
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 if a file would change")
    parser.add_argument(
        "--diff", action="store_true", help="write nothing; print the changes, and exit with 1 if there are any"
    )
    parser.add_argument(
        "--upgrade", action="store_true", help="rewrite files of an earlier version of the language in the newest one"
    )


def handler(args: argparse.Namespace) -> int:
    """Format the files. Exit codes: 0 done, 1 syntax errors or a file would change, 2 a file cannot be read (others
    are formatted).
    """
    names = [name for word in args.files for name in _files(word)]
    codes = [_file(name, check=args.check, diff=args.diff, upgrade=args.upgrade) for name in names]
    return max(codes, default=ExitCode.OK)


def _files(word: str) -> list[str]:
    """Return the file itself, or the `.ljs` files below a folder, sorted."""
    path = Path(word)
    if path.suffix.lower() == ".json":
        raise UsageError(f"`{word}` is JSON", hint="fmt formats .ljs files")
    if word == "-" or not path.is_dir():
        return [word]
    files = sorted(str(file) for file in path.rglob("*.ljs"))
    if not files:
        raise UsageError(f"`{word}` holds no .ljs file")
    return files


def _file(name: str, *, check: bool, diff: bool, upgrade: bool) -> int:
    from lingjing.dsl.diagnostics.fixes import unified_diff
    from lingjing.dsl.diagnostics.render import render_text, summary
    from lingjing.dsl.formatting.formatter import format_source
    from lingjing.dsl.loading.load import source_of
    from lingjing.dsl.upgrade import upgrade_source

    try:
        source = source_of(name)
    except UsageError as error:
        say_error(error)
        return ExitCode.USAGE
    formatted = upgrade_source(source) if upgrade else format_source(source)
    if formatted.text is None:
        color = sys.stderr.isatty() and "NO_COLOR" not in os.environ
        write_styled(sys.stderr, render_text(formatted.diagnostics, source, color=color))
        say(f"{name}: not {'upgraded' if upgrade else 'formatted'}: {summary(formatted.diagnostics)}")
        return ExitCode.MISSION
    changes = name != "-" and formatted.text.encode() != Path(name).read_bytes()
    if diff:
        write_data(unified_diff(source.text, formatted.text, source.path))
    elif name == "-" and not check:
        write_data(formatted.text)
    elif check and (changes or formatted.text != source.text):
        print(f"would reformat {name}")
    elif changes:
        write_whole(os.path.realpath(name), formatted.text)
        print(f"reformatted {name}")
    wrong = (check or diff) and (changes or formatted.text != source.text)
    return ExitCode.MISSION if wrong else ExitCode.OK
