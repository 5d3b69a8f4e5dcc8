"""`lingjing replay TRACE...`: run recorded decisions on fresh engines; confirm the digest or name what differs."""

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
    parser.epilog = "exit codes: 0 all are confirmed, 1 one differs, 2 one cannot be run again here"
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "--pictures", action="store_true", help="draw the pictures anew; else their boxes are the trace's"
    )
    parser.add_argument("--world", choices=("process", "inline"), default="process", help="where the engines run")
    parser.add_argument("--output-format", choices=("text", "json"), default="text", help="default: text")


def handler(args: argparse.Namespace) -> int:
    """Replay the traces one after the other; one that cannot be run again does not keep the others from it."""
    found, failed = [], []
    for path in args.traces:
        try:
            told = replay(read_trace(path), world=args.world, draw=args.pictures)
        except LingjingError as error:
            failed.append(error)
            say_error(error)
            continue
        found.append(told)
        if args.output_format == "text":
            print(sentence(told), flush=True)
    if args.output_format == "json":
        import msgspec

        print(json.dumps(msgspec.to_builtins(found), indent=2))
    if any(one.difference for one in found):
        return ExitCode.MISSION
    return failed[0].exit_code if failed else ExitCode.OK


def sentence(told: Replay) -> str:
    """A replay in a line, or in a few where something differs."""
    pictures = "pictures drawn anew" if told.drawn else "boxes of pictures taken from the trace"
    if told.difference is None:
        text = f"{told.path}: confirmed: {told.boundaries} boundaries, digest {told.digest[:16]}, {pictures}"
        text += "" if told.ends else f"\n  what followed was not: the file has no outcome; {NO_OUTCOME}"
        text += (
            f"\n  pixels differ within the tolerance of two renderers, first in {told.pixels}" if told.pixels else ""
        )
        return text + (
            f"\n  confirmed though made with other libraries: {', '.join(told.versions)}" if told.versions else ""
        )
    other = told.difference
    held = f"{told.confirmed} of {told.boundaries} confirmed, {pictures}"
    lines = [f"{told.path}: differs at boundary {other.boundary} ({held})"]
    if other.field:
        lines += [f"  {other.engine}: {other.field}", f"  recorded: {other.recorded}", f"  replayed: {other.replayed}"]
    else:
        lines += [f"  {other.replayed}"]
    if told.versions:
        lines.append(f"  made with other libraries, for which no digest is promised: {', '.join(told.versions)}")
    return "\n".join(lines)
