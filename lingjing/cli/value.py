"""`lingjing value TRACE...`: measure the value of each message of an episode: the score without it, by branches."""

from __future__ import annotations

import argparse
import sys

import msgspec

from lingjing.causal.message_value import EpisodeValues, by_kind, by_mode, message_values
from lingjing.causal.result_texts import value_text
from lingjing.cli.arguments import parse_amount
from lingjing.cli.branches import add_branch_options, branch_options
from lingjing.cli.process import say_error
from lingjing.cli.progress import BranchProgress
from lingjing.errors import ExitCode, LingjingError
from lingjing.trace.reader import read_trace


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 all traces were measured, 2 a trace cannot be branched, 3 an engine failed"
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap of an episode that ended by itself")
    parser.add_argument(
        "--unsaid", action="store_true", help="messages are not sent, so no adjudicator receives a report either"
    )
    parser.add_argument(
        "--branches", metavar="N", default="200", help="the greatest number of messages per trace (default 200)"
    )
    add_branch_options(parser, referenced=False)


def handler(args: argparse.Namespace) -> int:
    """Measure the traces in order; the others are measured also if one cannot be."""
    values: list[EpisodeValues] = []
    failed: list[LingjingError] = []
    most = int(parse_amount("--branches", args.branches, whole=True) or 1)
    for path in args.traces:
        try:
            trace = read_trace(path)
            with BranchProgress("starting") as progress:
                options = branch_options(args, trace)
                values.append(message_values(trace, options, unsaid=args.unsaid, most=most, progress=progress))
        except LingjingError as error:
            failed.append(error)
            say_error(error)
    if args.output_format == "json":
        whole = {"episodes": values, "kinds": by_kind(values), "modes": by_mode(values)}
        sys.stdout.write(msgspec.json.encode(whole).decode() + "\n")
    elif values:
        print(value_text(values))
    return failed[0].exit_code if failed else ExitCode.OK
