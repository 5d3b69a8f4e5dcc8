"""`lingjing value TRACE...`: what each message of an episode was worth: the score without it, found by branches."""

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
    parser.epilog = "exit codes: 0 all traces were tried, 2 one cannot be branched, 3 an engine failed"
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap of an episode that ended by itself")
    parser.add_argument(
        "--unsaid", action="store_true", help="messages are never sent: then no adjudicator hears a report either"
    )
    parser.add_argument("--branches", metavar="N", default="200", help="how many messages of a trace (default 200)")
    add_branch_options(parser, referenced=False)


def handler(args: argparse.Namespace) -> int:
    """Try the traces one after the other; one that cannot be branched does not keep the others from it."""
    found: list[EpisodeValues] = []
    failed: list[LingjingError] = []
    most = int(parse_amount("--branches", args.branches, whole=True) or 1)
    for path in args.traces:
        try:
            trace = read_trace(path)
            with BranchProgress("starting") as progress:
                options = branch_options(args, trace)
                found.append(message_values(trace, options, unsaid=args.unsaid, most=most, progress=progress))
        except LingjingError as error:
            failed.append(error)
            say_error(error)
    if args.output_format == "json":
        whole = {"episodes": found, "kinds": by_kind(found), "modes": by_mode(found)}
        sys.stdout.write(msgspec.json.encode(whole).decode() + "\n")
    elif found:
        print(value_text(found))
    return failed[0].exit_code if failed else ExitCode.OK
