"""`lingjing bench adversaries`: play the adversaries of the matrix, and test that each column defeats the worst."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import check_counts
from lingjing.cli.files import tell_aside
from lingjing.cli.parser import ArgumentParser
from lingjing.cli.process import ending_at_second_interrupt, say
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.bench.adversaries import AdversaryMatrix, AdversaryRun
    from lingjing.bench.planning import Isolation
    from lingjing.bench.rows import SuiteRow


def add_adversaries(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="the results folder; an existing one is continued"
    )
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N episodes at a time (default 1)")
    parser.add_argument("--columns", metavar="NAME", nargs="+", help="only these columns, such as bi-single")
    parser.add_argument("--adversaries", metavar="NAME", nargs="+", help="only these adversaries")
    parser.add_argument(
        "--select", metavar="N", type=int, default=3, help="seeds on which the worst one is chosen (default 3)"
    )
    parser.add_argument("--quick", action="store_true", help="one seed for each pair, and no test of the worst")
    parser.add_argument("--strict", action="store_true", help="refuse a kernel that lacks a wall")
    parser.add_argument("--keep", action="store_true", help="keep every trace")
    parser.add_argument("--other-code", action="store_true", help="continue a folder of another version of the code")
    parser.add_argument(
        "--replay-changed", action="store_true", help="put rows of changed missions aside, and play them again"
    )
    parser.add_argument("--check", action="store_true", help="print the pairs and the hours, and stop")
    parser.set_defaults(handler=play_adversaries)


def play_adversaries(args: argparse.Namespace) -> int:
    """Choose the worst adversary of each column on a few seeds of a sealed split, and play it on fresh ones until it is
    shown to win less than 5 %, or wins a fourth time. Exit code 0 if every column passed, 1 if one failed, 4 if some
    are undecided. The same command continues in its folder.
    """
    from lingjing.bench.adversaries import FIRST_FRESH, SUITE, AdversaryRun, chosen, make_salt, plan_of, read_matrix
    from lingjing.bench.executors import LocalExecutor
    from lingjing.bench.folder import check_folder, open_results
    from lingjing.bench.playing import default_folder
    from lingjing.bench.rows import code_sha256
    from lingjing.bench.running import SuiteRun
    from lingjing.bench.suite import find_suite
    from lingjing.installed_plugins.discovery import trusting
    from lingjing.plugins.host import PluginHost

    check_counts(("-j", args.jobs), ("--select", args.select))
    if args.select > FIRST_FRESH:
        raise UsageError(f"--select {args.select}: fresh seeds begin at {FIRST_FRESH}", hint="choose fewer seeds")
    check_folder(args.output)
    if args.quick and args.select != 3:
        raise UsageError("--quick and --select contradict each other", hint="remove one of them")
    path = find_suite(SUITE)
    matrix = chosen(read_matrix(path), args.columns or (), args.adversaries or ())
    selection = range(1 if args.quick else args.select)
    _say_size(args, matrix, len(selection))
    if args.check:
        return ExitCode.OK
    isolate: Isolation = "strict" if args.strict else "yes"
    with trusting(()):
        plan = plan_of(matrix, PluginHost(), isolate)
        code = code_sha256(plan.files)
        with open_results(args.output or default_folder(plan, code)) as results:
            salt = make_salt(results.folder, results.rows)
            run = SuiteRun(plan, results, code, LocalExecutor(args.jobs), keep=args.keep, isolate=isolate,
                           salt=str(salt.absolute()))  # fmt: skip
            run.check_split(plan.cells)
            tell_aside(run.check_resumable(other_code=args.other_code, replay_changed=args.replay_changed))
            run.services.tell = say
            results.write("suite.toml", path.read_text(encoding="utf-8"))
            whole = AdversaryRun(run, plan.cells, selection, tell=say, seconds=matrix.seconds)
            run.tell = lambda row, countdown: _tell(row, countdown.left_s if args.quick else whole.left_s())
            with ending_at_second_interrupt():
                return _play(whole, quick=args.quick)


def _play(whole: AdversaryRun, *, quick: bool) -> int:
    """Play, print the table, store it beside the rows, and return the exit code."""
    from lingjing.bench.adversaries import Verdict, result_lines
    from lingjing.cli.bench import duration

    results = whole.run.results
    played = sum(row.standing != "aborted" for row in results.rows)
    left = "" if quick else f", {duration(whole.left_s())} to the next look of every column"
    say(f"{played} episodes done{left}; results in {results.folder}")
    try:
        whole.select()
        if not quick:
            whole.test()
    except KeyboardInterrupt:
        say("interrupted; the same command continues from here")
        raise
    results.compact()
    columns = whole.results()
    text = "\n".join(result_lines(columns)) + "\n"
    results.write("adversaries.md", text)
    print(text, end="")
    verdicts = {result.verdict for result in columns}
    if Verdict.FAILED in verdicts:
        return ExitCode.MISSION
    return ExitCode.UNDECIDED if Verdict.OPEN in verdicts else ExitCode.OK


def _say_size(args: argparse.Namespace, matrix: AdversaryMatrix, selection: int) -> None:
    from lingjing.bench.adversaries import PLAN, hours

    pairs = [column for each in matrix.adversaries for column in each.columns]
    first, least, most = hours(matrix, PLAN, selection, args.jobs)
    columns = len(set(pairs))
    say(
        f"{len(pairs)} pair{'s' * (len(pairs) > 1)} in {columns} column{'s' * (columns > 1)}, "
        f"{selection} seed{'s' * (selection > 1)} each: about {first:.1f} h"
    )
    if not args.quick:
        say(f"then {PLAN[0].played} to {PLAN[-1].played} fresh seeds a column: {least:.0f} to {most:.0f} h")


def _tell(row: SuiteRow, left_s: float) -> None:
    """Print a row, with the time to the next look of every column."""
    from lingjing.cli.bench import duration

    report = row.report
    say(
        f"{duration(left_s)} left: {row.entrant}, {row.column}, seed {row.seed}: "
        f"{'WON' if report.success else report.reason}, SCR {report.scr:.2f}, {row.wall_s:.0f} s"
    )
