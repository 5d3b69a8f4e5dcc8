"""`lingjing replay TRACE...`: run recorded decisions on fresh engines; confirm the digest or name the first
difference.
"""

from __future__ import annotations

import argparse
import json

from lingjing.causal.replay import Replay, replay
from lingjing.cli.files import NO_OUTCOME
from lingjing.cli.process import say_error
from lingjing.errors import ExitCode, LingjingError
from lingjing.trace.reader import read_trace


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 all traces are confirmed, 1 a trace differs, 2 a trace cannot be run again here"
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "--pictures", action="store_true", help="render the pictures again (default: use the boxes in the trace)"
    )
    parser.add_argument("--world", choices=("process", "inline"), default="process", help="where the engines run")
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Replay the traces in order; the others are replayed also if one cannot be."""
    replays, failed = [], []
    for path in args.traces:
        try:
            replayed = replay(read_trace(path), world=args.world, draw=args.pictures)
        except LingjingError as error:
            failed.append(error)
            say_error(error)
            continue
        replays.append(replayed)
        if args.output_format == "text":
            print(sentence(replayed), flush=True)
    if args.output_format == "json":
        import msgspec

        print(json.dumps(msgspec.to_builtins(replays), indent=2))
    if any(replayed.difference for replayed in replays):
        return ExitCode.MISSION
    return failed[0].exit_code if failed else ExitCode.OK


def sentence(result: Replay) -> str:
    """Return the result of a replay as one line, or as a few lines if something differs."""
    pictures = "pictures rendered again" if result.drawn else "boxes of pictures from the trace"
    if result.difference is None:
        text = f"{result.path}: confirmed: {result.boundaries} boundaries, digest {result.digest[:16]}, {pictures}"
        text += "" if result.ends else f"\n  the rest is not confirmed: the file has no outcome; {NO_OUTCOME}"
        text += (
            f"\n  pixels differ within the tolerance of two renderers, first in {result.pixels}"
            if result.pixels
            else ""
        )
        return text + (
            f"\n  confirmed, although recorded with other libraries: {', '.join(result.versions)}"
            if result.versions
            else ""
        )
    difference = result.difference
    held = f"{result.confirmed} of {result.boundaries} confirmed, {pictures}"
    lines = [f"{result.path}: differs at boundary {difference.boundary} ({held})"]
    if difference.field:
        lines += [
            f"  {difference.engine}: {difference.field}",
            f"  recorded: {difference.recorded}",
            f"  replayed: {difference.replayed}",
        ]
    else:
        lines += [f"  {difference.replayed}"]
    if result.versions:
        lines.append(f"  recorded with other libraries, for which digests may differ: {', '.join(result.versions)}")
    return "\n".join(lines)
