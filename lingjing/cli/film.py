"""`lingjing film TRACE -o episode.mp4`: write an episode as a film of 20 seconds, MP4 or GIF."""

from __future__ import annotations

import argparse
from pathlib import Path

from lingjing.cli.files import say_if_cut, say_written
from lingjing.cli.process import say
from lingjing.errors import ExitCode


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("trace", metavar="TRACE", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "-o", "--output", metavar="FILE", default="episode.mp4", help="an .mp4 or .gif (default episode.mp4)"
    )
    parser.add_argument(
        "--truth", action="store_true", help="show hidden targets, true boxes and the full explanation of the outcome"
    )


def handler(args: argparse.Namespace) -> int:
    """Write the film."""
    from lingjing.trace.reader import read_trace
    from lingjing.viewer.film import make_film

    path = Path(args.output)
    trace = read_trace(args.trace)
    say_if_cut(trace)
    for note in make_film(trace, path, truth=args.truth):
        say(f"note: {note}")
    say_written(path)
    return ExitCode.OK
