"""`lingjing report PLACE... -o report.html`: the paper's figures from your own runs, as one page or as single files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import check_counts
from lingjing.cli.files import check_output, print_columns, say_written, write_output
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.report.evidence import ReportEvidence
    from lingjing.report.figure import FigureKind

TITLE = "Lingjing report"
_SUFFIXES = (".svg", ".png")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "places", metavar="PLACE", nargs="*", type=Path,
        help="traces, folders of runs, results of suites, and folders of prompt searches, probes, frames and twins",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="the page (default report.html), or with --figure an .svg or .png file"
    )
    parser.add_argument("--figure", metavar="NAME", help="write only this figure (default NAME.svg)")
    parser.add_argument("--list", action="store_true", help="list the figures")
    parser.add_argument("--title", metavar="TEXT", default=TITLE, help=f"the page's title (default: {TITLE})")
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="read N traces at a time")
    parser.add_argument("--other-code", action="store_true", help="put rows of several versions of the code together")


def handler(args: argparse.Namespace) -> int:
    """Write the page or the figure; list the figures."""
    from lingjing.report.figure_kinds import FIGURES, figure_named

    if args.list:
        print_columns([(kind.name, kind.title, kind.source) for kind in FIGURES])
        return ExitCode.OK
    if not args.places:
        raise UsageError("no place is named", hint="name traces or folders: lingjing report runs/ -o report.html")
    check_counts(("-j", args.jobs))
    kind = figure_named(args.figure) if args.figure is not None else None
    output = args.output or (f"{kind.name}.svg" if kind is not None else "report.html")
    if kind is not None and output != "-" and Path(output).suffix.lower() not in _SUFFIXES:
        raise UsageError(f"-o {output}: a figure is written as .svg or .png", hint=f"for example: -o {kind.name}.svg")
    check_output(output)
    evidence = _gathered(args)
    content = _page(evidence, args.title) if kind is None else _figure(evidence, kind, output)
    write_output(content, output)
    if output != "-":
        say_written(output)
    return ExitCode.OK


def _gathered(args: argparse.Namespace) -> ReportEvidence:
    from lingjing.cli.progress import CountProgress
    from lingjing.report.gathering import gather

    with CountProgress("reading traces") as tell:
        evidence = gather(args.places, jobs=args.jobs, other_code=args.other_code, tell=tell)
    for note in evidence.left_out:
        say(f"note: {note}")
    return evidence


def _page(evidence: ReportEvidence, title: str) -> str:
    from lingjing.cli.progress import CountProgress
    from lingjing.report.figure_kinds import FIGURES
    from lingjing.report.page import report_page

    made = []
    with CountProgress("drawing figures") as tell:
        for number, kind in enumerate(FIGURES, 1):
            made.append((kind, list(kind.make(evidence))))
            tell(number, len(FIGURES))
    return report_page(evidence, made, title)


def _figure(evidence: ReportEvidence, kind: FigureKind, output: str) -> str | bytes:
    from lingjing.report.painting import boxed_letters, png_file, svg_file
    from lingjing.report.sheet import sheet_of

    sheet = sheet_of(kind, list(kind.make(evidence)))
    if sheet is None:
        raise UsageError(f"the places hold no data for the figure `{kind.name}`", hint=f"run {kind.needs}")
    if not output.lower().endswith(".png"):
        return svg_file(sheet)
    if letters := boxed_letters(sheet):
        say(f"note: no installed font has {letters[:8]!r}: they are drawn as boxes (an .svg uses the viewer's fonts)")
    return png_file(sheet)
