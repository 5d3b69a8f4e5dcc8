"""`lingjing blame TRACE`: find the decisions (faculty, agent, boundaries) that lost an episode, by branches."""

from __future__ import annotations

import argparse
import sys

import msgspec

from lingjing.causal.blame import BlameOptions, blame
from lingjing.causal.result_texts import blame_text
from lingjing.cli.arguments import parse_amount, parse_seed, parse_whole
from lingjing.cli.branches import add_branch_options, branch_options
from lingjing.cli.progress import BranchProgress
from lingjing.errors import ExitCode
from lingjing.trace.reader import read_trace


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 the search ended, with any result; 2 it is not possible; 3 an engine failed"
    parser.add_argument("trace", metavar="TRACE", help="the trace.mcap of an episode that ended by itself")
    parser.add_argument("--branches", metavar="N", default="120", help="the greatest number of branches (default 120)")
    parser.add_argument("--placebos", metavar="N", default="8", help="the number of them that are placebos (default 8)")
    parser.add_argument("--seed", metavar="N", default="0", help="seed of permutations and placebos (default 0)")
    add_branch_options(parser)


def handler(args: argparse.Namespace) -> int:
    """Run the search and print its result."""
    trace = read_trace(args.trace)
    branched = branch_options(args, trace)
    options = BlameOptions(
        branches=int(parse_amount("--branches", args.branches, whole=True) or 1),
        placebos=parse_whole("--placebos", args.placebos, 99_999),
        seed=parse_seed(args.seed),
        jobs=branched.jobs,
        reference=branched.reference,
        files=branched.files,
        policies=branched.policies,
        calls=branched.calls,
    )
    with BranchProgress("starting") as progress:
        result = blame(trace, options, progress)
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode(result).decode() + "\n")
    else:
        print(blame_text(result))
    return ExitCode.OK
