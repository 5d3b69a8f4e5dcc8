"""`lingjing shrink TRACE -o SMALL.ljs`: the smallest mission that still fails as the trace did.

Agents, targets, events, kinds of messages and ticks are left out as long as the same policies fail the same way with
the same seeds. What is left is a mission like any other: `lingjing run` plays it.
"""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.causal.candidates import Predicate
    from lingjing.causal.shrink import ShrunkMission
    from lingjing.play.options import PlayOptions
    from lingjing.trace.reader import Trace


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = (
        "interrupted or out of episodes: the best so far is written, and the same command goes on from there"
    )
    parser.add_argument("trace", metavar="TRACE", help="the trace.mcap of a lost episode")
    parser.add_argument("-o", "--output", metavar="SMALL.ljs", type=Path, required=True, help="a new file")
    parser.add_argument("--mission", metavar="FILE", default="", help="the mission's file (default: a shipped name)")
    parser.add_argument(
        "--policy-file", metavar="FILE.py", action="append", default=[], help="where a file of a policy is"
    )
    parser.add_argument(
        "--same", choices=("reason", "clauses", "family"), default="family",
        help="how alike failures must be: the reason; also what success lacked; also the family (default)",
    )  # fmt: skip
    parser.add_argument(
        "--same-if", metavar="FILE.py:FUNCTION", help="a function of a Trace that says whether it is the failure"
    )
    parser.add_argument(
        "--control", metavar="POLICY", default="oracle",
        help="who must win each smaller mission (default oracle; `none` asks nobody)",
    )  # fmt: skip
    parser.add_argument("--budget", metavar="N", type=int, default=200, help="episodes at most (default 200)")
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N at a time (default 1)")
    parser.add_argument("--output-format", choices=("text", "json"), default="text", help="default: text")


def handler(args: argparse.Namespace) -> int:
    """Shrink, telling each step on standard error."""
    from lingjing.causal.shrink import ShrinkOptions, shrink
    from lingjing.trace.reader import read_trace

    if args.budget < 2 or args.jobs < 1:
        raise UsageError("--budget must be 2 or more, -j 1 or more", hint="the first two episodes play it whole")
    options = ShrinkOptions(
        mission=args.mission, policies=tuple(args.policy_file), sameness=args.same,
        predicate=_predicate(args.same_if) if args.same_if else None,
        control="" if args.control == "none" else args.control, episodes=args.budget, jobs=args.jobs,
    )  # fmt: skip
    try:
        found = shrink(read_trace(args.trace), args.output, options, say)
    except KeyboardInterrupt:
        if args.output.is_file():
            say(f"interrupted; the smallest so far is {args.output}, and the same command goes on from there")
        raise
    if args.output_format == "json":
        import msgspec

        print(msgspec.json.format(msgspec.json.encode(found)).decode())
    else:
        print(_told(found))
    return ExitCode.OK


def _told(found: ShrunkMission) -> str:
    proof = "and nothing more can be left out" if found.minimal else "; the episodes were used up before it was minimal"
    lines = [
        f"{found.path}: {len(found.kept)} parts and {found.ticks} of {found.ticks_before} ticks are left {proof}",
        f"fails by: {found.failure}",
        f"removed: {', '.join(found.removed) or 'nothing'}",
        f"kept: {', '.join(found.kept)}",
        f"verified: {run_command(found.options)}",
        f"  digest {found.digest[:16]}" + (f"; `{found.control}` wins it" if found.control else ""),
        f"{found.episodes} episodes were played",
    ]
    return "\n".join([*lines, *(f"note: {note}" for note in found.notes)])


def run_command(options: PlayOptions) -> str:
    """The command line that plays the episode."""
    words = ["lingjing", "run", options.mission, "--mode", str(options.mode), "--seed", str(options.seed)]
    words += ["--policy", options.policy]
    words += ["--policy-seed", str(options.policy_seed)] if options.policy_seed else []
    for name, policy in options.policies_for.items():
        words += ["--policy-for", f"{name}={policy}"]
    given = (("--policy-arg", options.policy_args), ("--engine-arg", options.engine_args),
             ("--evaluator-arg", options.evaluator_args))  # fmt: skip
    for option, values in given:
        for name, value in values.items():
            words += [option, f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    if options.evaluators != ("mission",):
        for name in options.evaluators:
            words += ["--evaluator", name]
    return shlex.join(words)


def _predicate(spec: str) -> Predicate:
    """The function of a file. Raises `UsageError`."""
    from lingjing.play.python_files import function_of
    from lingjing.plugins.loading import one_line

    function = function_of(spec, "predicate", "write --same-if like check.py:is_collision")

    def ask(trace: Trace) -> bool:
        try:
            return bool(function(trace))
        except (Exception, SystemExit) as error:
            raise UsageError(f"--same-if {spec}: {one_line(error)}", hint="it is asked of a trace") from error

    return ask
