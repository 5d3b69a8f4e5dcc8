"""`lingjing shrink TRACE -o SMALL.ljs`: find the smallest mission that still fails as the trace did.

Agents, targets, events, message kinds and ticks are removed as long as the same policies fail in the same way with the
same seeds. `lingjing run` plays the result like any other mission.
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
        "an interrupt or the end of the budget leaves the smallest mission so far; the same command continues"
    )
    parser.add_argument("trace", metavar="TRACE", help="the trace.mcap of a lost episode")
    parser.add_argument("-o", "--output", metavar="SMALL.ljs", type=Path, required=True, help="a new file")
    parser.add_argument("--mission", metavar="FILE", default="", help="the mission's file (default: a shipped name)")
    parser.add_argument(
        "--policy-file",
        metavar="FILE.py",
        action="append",
        default=[],
        help="the file of a policy that the trace names by its file",
    )
    parser.add_argument(
        "--same", choices=("reason", "clauses", "family"), default="family",
        help="what failures must share: reason; clauses: also the unmet conditions; family: also the family (default)",
    )  # fmt: skip
    parser.add_argument(
        "--same-if",
        metavar="FILE.py:FUNCTION",
        help="a function that takes a Trace and returns True if it is the same failure",
    )
    parser.add_argument(
        "--control", metavar="POLICY", default="oracle",
        help="the policy that must win each smaller mission (default oracle; `none`: no check)",
    )  # fmt: skip
    parser.add_argument(
        "--budget", metavar="N", type=int, default=200, help="the greatest number of episodes (default 200)"
    )
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N at a time (default 1)")
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Shrink the mission; each step is printed on standard error."""
    from lingjing.causal.shrink import ShrinkOptions, shrink
    from lingjing.trace.reader import read_trace

    if args.budget < 2 or args.jobs < 1:
        raise UsageError(
            "--budget must be 2 or more, -j 1 or more", hint="the first two episodes play the unchanged mission"
        )
    options = ShrinkOptions(
        mission=args.mission, policies=tuple(args.policy_file), sameness=args.same,
        predicate=_predicate(args.same_if) if args.same_if else None,
        control="" if args.control == "none" else args.control, episodes=args.budget, jobs=args.jobs,
    )  # fmt: skip
    try:
        result = shrink(read_trace(args.trace), args.output, options, say)
    except KeyboardInterrupt:
        if args.output.is_file():
            say(f"interrupted; the smallest mission so far is {args.output}; the same command continues from there")
        raise
    if args.output_format == "json":
        import msgspec

        print(msgspec.json.format(msgspec.json.encode(result)).decode())
    else:
        print(_summary(result))
    return ExitCode.OK


def _summary(result: ShrunkMission) -> str:
    proof = (
        "and nothing more can be removed" if result.minimal else "; the budget of episodes ended before it was minimal"
    )
    lines = [
        f"{result.path}: {len(result.kept)} parts and {result.ticks} of {result.ticks_before} ticks are left {proof}",
        f"fails by: {result.failure}",
        f"removed: {', '.join(result.removed) or 'nothing'}",
        f"kept: {', '.join(result.kept)}",
        f"verified: {run_command(result.options)}",
        f"  digest {result.digest[:16]}" + (f"; `{result.control}` wins it" if result.control else ""),
        f"{result.episodes} episodes were played",
    ]
    return "\n".join([*lines, *(f"note: {note}" for note in result.notes)])


def run_command(options: PlayOptions) -> str:
    """Return the command line that plays the episode."""
    words = ["lingjing", "run", options.mission, "--mode", str(options.mode), "--seed", str(options.seed)]
    words += ["--policy", options.policy]
    words += ["--policy-seed", str(options.policy_seed)] if options.policy_seed else []
    for name, policy in options.policies_for.items():
        words += ["--policy-for", f"{name}={policy}"]
    groups = (("--policy-arg", options.policy_args), ("--engine-arg", options.engine_args),
             ("--evaluator-arg", options.evaluator_args))  # fmt: skip
    for option, values in groups:
        for name, value in values.items():
            words += [option, f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    if options.evaluators != ("mission",):
        for name in options.evaluators:
            words += ["--evaluator", name]
    return shlex.join(words)


def _predicate(spec: str) -> Predicate:
    """Return the function of a file as a predicate of traces. Raises `UsageError`."""
    from lingjing.play.python_files import function_of
    from lingjing.plugins.foreign_errors import one_line

    function = function_of(spec, "predicate", "write --same-if like check.py:is_collision")

    def holds(trace: Trace) -> bool:
        try:
            return bool(function(trace))
        except (Exception, SystemExit) as error:
            raise UsageError(
                f"--same-if {spec}: {one_line(error)}", hint="the function is called with a Trace"
            ) from error

    return holds
