"""`lingjing validate`: report every error of mission files, in one run each."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING

from lingjing.errors import ExitCode, MissionError, UsageError

if TYPE_CHECKING:
    from lingjing.mission.diagnostics import Diagnostic


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options."""
    parser = subparsers.add_parser("validate", help="report every error of mission files", description=__doc__)
    parser.add_argument("files", metavar="FILE", nargs="+", help="a .ljs or .json file; - reads standard input")
    parser.add_argument("--output-format", choices=("text", "json"), default="text")
    parser.set_defaults(handler=handler)


def handler(args: argparse.Namespace) -> int:
    """Check the files: 0 all are good, 1 one has errors, 2 one cannot be read (the others are still checked)."""
    from lingjing.dsl.render import render_json, summary

    found: list[Diagnostic] = []
    unreadable = wrong = 0
    for path in args.files:
        try:
            faults, shown = _check(path, as_json=args.output_format == "json")
        except UsageError as error:
            unreadable += 1
            _say_error(error)
            continue
        except MissionError as error:
            wrong += 1
            _say_error(error)
            continue
        found.extend(faults)
        sys.stdout.write(shown)
    if args.output_format == "json":
        sys.stdout.write(render_json(found))
    elif total := summary(found):
        print(total)
    elif sys.stdout.isatty() and not unreadable and not wrong:
        print("no errors")
    if unreadable:
        return ExitCode.USAGE
    return ExitCode.MISSION if wrong or summary(found) else ExitCode.OK


def _check(path: str, *, as_json: bool) -> tuple[tuple[Diagnostic, ...], str]:
    from lingjing.dsl import compile_source
    from lingjing.dsl.load import is_document, read_document, source_of
    from lingjing.dsl.render import render_text

    source = source_of(path)
    if is_document(source):
        _, notes = read_document(source)
        return (), "" if as_json else "".join(f"{source.path}: note: {note}\n" for note in notes)
    compilation = compile_source(source)
    if as_json:
        return compilation.diagnostics, ""
    color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    return compilation.diagnostics, render_text(compilation.diagnostics, source, color=color)


def _say_error(error: UsageError | MissionError) -> None:
    print(f"error: {error}", file=sys.stderr)
    if error.hint:
        print(f"hint: {error.hint}", file=sys.stderr)
