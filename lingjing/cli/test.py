"""`lingjing test FILE…`: run the expectations of missions, the lines of their block `expect`."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from lingjing.cli.arguments import whole_number
from lingjing.cli.files import check_output, read_mission, write_whole
from lingjing.cli.installed import warn_of_broken_plugins
from lingjing.cli.process import ending_at_second_interrupt, say, say_error
from lingjing.cli.progress import CountProgress
from lingjing.errors import ExitCode, MissionError, UsageError

if TYPE_CHECKING:
    from lingjing.authoring.checks import MissionCheck
    from lingjing.authoring.running import CheckResult

_WIDTH = 78
"""Columns of the rules in the report (chosen, for terminals of 80)."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("files", metavar="FILE", nargs="+", help="a mission's file, or a shipped mission such as ssr")
    parser.add_argument("-k", metavar="WORDS", default="", help="only checks with these words: 'oracle and not star'")
    parser.add_argument("-x", "--exitfirst", action="store_true", help="stop after the first check that fails")
    parser.add_argument("-j", "--jobs", metavar="N", default="1", help="play N episodes at a time")
    parser.add_argument("-q", "--quiet", action="store_true", help="print the failed checks and the last line alone")
    parser.add_argument("--list", action="store_true", help="list the checks and run none")
    parser.add_argument("--junit-xml", metavar="FILE", help="write the results as JUnit XML")


def handler(args: argparse.Namespace) -> int:
    """Run the checks in order and print each result. Exit codes: 0 all passed, 1 a check failed or cannot be evaluated,
    or a mission has errors, 2 usage or no check, 3 an episode was aborted or a plug-in is broken, 130 interrupted.
    """
    from lingjing.authoring.checks import checks_of, selected
    from lingjing.dsl.loading.shipped import find_mission

    jobs = whole_number(args.jobs, 9999) or 0
    if jobs < 1:
        raise UsageError(
            f"-j {args.jobs}: must be a whole number of at least 1", hint="leave -j out to play one at a time"
        )
    if args.junit_xml:
        check_output(args.junit_xml, reads=args.files)
    if "-" in args.files:
        raise UsageError("a mission from standard input cannot be played", hint="write it to a file")
    warn_of_broken_plugins()
    checks: list[MissionCheck] = []
    broken: list[tuple[str, str]] = []
    for file in dict.fromkeys(args.files):
        path = find_mission(file)
        try:
            mission = read_mission(str(path))
        except MissionError as error:
            say_error(error)
            broken.append((file, str(error)))
            continue
        if not mission.expectations:
            say(f"note: {file} has no block `expect`")
        checks += checks_of(file, path, mission)
    chosen = selected(checks, args.k)
    if args.list:
        for check in chosen:
            print(check.name)
        return ExitCode.MISSION if broken else ExitCode.OK
    if not chosen and not broken:
        selection = f"-k {args.k} selects none of {len(checks)} checks" if checks else "no file has an expectation"
        raise UsageError(selection, hint="write `expect { oracle wins }` into a mission; --list shows the checks")
    return _TestRun(args, jobs, broken, left_out=len(checks) - len(chosen)).run(chosen)


class _TestRun:
    """One run over the chosen checks, with its report."""

    def __init__(self, args: argparse.Namespace, jobs: int, broken: Sequence[tuple[str, str]], left_out: int) -> None:
        self.args = args
        self.jobs = jobs
        self.broken = broken
        self.left_out = left_out
        self.results: list[CheckResult] = []
        self.is_interrupted = False

    def run(self, checks: Sequence[MissionCheck]) -> int:
        """Run the checks, print the report and return the exit code."""
        begun = time.monotonic()
        stops_at_once = self.args.exitfirst and self.broken
        with ending_at_second_interrupt():
            try:
                if not stops_at_once:
                    self._run_all(checks)
            except KeyboardInterrupt:
                self.is_interrupted = True
        self._print_failures()
        print(f"{self._counts()} in {time.monotonic() - begun:.1f} s")
        if self.args.junit_xml:
            from lingjing.authoring.junit import junit_xml

            not_run = checks[len(self.results) :]
            write_whole(self.args.junit_xml, junit_xml(self.results, not_run, self.broken))
        return self._exit_code()

    def _run_all(self, checks: Sequence[MissionCheck]) -> None:
        from lingjing.authoring.running import CheckRunner
        from lingjing.cli.process import results_alone

        with CheckRunner(self.jobs) as runner:
            for number, check in enumerate(checks, start=1):
                with CountProgress(check.name) as bar, results_alone():
                    runner.on_episode = bar
                    result = runner.run(check)
                self.results.append(result)
                self._print(result, f"{100 * number // len(checks):3d}%")
                if self.args.exitfirst and result.state != "passed":
                    return

    def _print(self, result: CheckResult, share: str) -> None:
        if not self.args.quiet:
            print(f"{result.state.upper():7} {result.check.name}  ({result.summary}; {result.wall_s:.1f} s) [{share}]")
            sys.stdout.flush()

    def _print_failures(self) -> None:
        failed = [result for result in self.results if result.state != "passed"]
        if failed:
            print(" FAILURES ".center(_WIDTH, "="))
        for result in failed:
            print(f"{result.check.name}\n  {result.state}: {result.summary}")
            for line in result.details:
                print(f"  {line}")

    def _counts(self) -> str:
        counted: Counter[str] = Counter(result.state for result in self.results)
        counted["error"] += len(self.broken)
        errors = "error" if counted["error"] == 1 else "errors"
        names = {"failed": "failed", "error": errors, "aborted": "aborted", "passed": "passed"}
        parts = [f"{counted[state]} {name}" for state, name in names.items() if counted[state]]
        parts += [f"{self.left_out} deselected"] if self.left_out else []
        parts += ["interrupted"] if self.is_interrupted else []
        return ", ".join(parts) or "nothing was run"

    def _exit_code(self) -> ExitCode:
        states = {result.state for result in self.results}
        if self.is_interrupted:
            return ExitCode.INTERRUPTED
        if "aborted" in states:
            return ExitCode.INFRASTRUCTURE
        return ExitCode.MISSION if self.broken or states - {"passed"} else ExitCode.OK
