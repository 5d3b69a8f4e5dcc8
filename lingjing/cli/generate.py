"""`lingjing generate --seed N`: compose missions, each with a certificate that it validates and can be won."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import parse_seed, parse_whole, whole_number
from lingjing.cli.process import ending_at_second_interrupt, say
from lingjing.cli.progress import CountProgress
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.authoring.screening import Certificate

MOST = 10_000
"""Most missions of one command (chosen): they take days."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--seed", metavar="N", required=True, help="the seed of the first mission")
    parser.add_argument(
        "--count", metavar="K", default="1", help="the number of missions, with seeds from N (default 1)"
    )
    parser.add_argument("-o", "--output", metavar="DIR", default="generated", help="the folder (default: generated)")
    parser.add_argument("-j", "--jobs", metavar="N", default="1", help="play N episodes at a time")
    parser.add_argument("--print", action="store_true", help="print the text of the mission and run nothing")


def handler(args: argparse.Namespace) -> int:
    """Compose and screen the missions; print a line for each, then the counts. A repeated command continues."""
    from lingjing.authoring.composing import compose

    first = parse_seed(args.seed)
    count, jobs = parse_whole("--count", args.count, MOST), whole_number(args.jobs, 9999) or 0
    if count < 1 or jobs < 1:
        raise UsageError(
            "--count and -j must be at least 1", hint="leave them out for one mission, one episode at a time"
        )
    seeds = range(first, first + count)
    if args.print:
        for seed in seeds:
            print(compose(seed).text, end="")
        return ExitCode.OK
    try:
        Path(args.output).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"cannot write into `{args.output}`: {error.strerror}", hint="name another folder with -o"
        ) from None
    certificates: list[Certificate] = []
    with ending_at_second_interrupt():
        try:
            _screen(seeds, Path(args.output), jobs, certificates)
        except KeyboardInterrupt:
            say("interrupted; the same command continues from here")
            _print_counts(certificates)
            return ExitCode.INTERRUPTED
    _print_counts(certificates)
    return ExitCode.OK


def _screen(seeds: range, folder: Path, jobs: int, certificates: list[Certificate]) -> None:
    from lingjing.authoring.running import CheckRunner
    from lingjing.authoring.screening import generate
    from lingjing.cli.process import results_alone

    with CheckRunner(jobs) as runner:
        for number, seed in enumerate(seeds):
            with CountProgress(f"seed {seed} ({number + 1} of {len(seeds)})") as bar, results_alone():
                runner.on_episode = bar
                certificate = generate(seed, folder, runner)
            certificates.append(certificate)
            reason = f": {certificate.reason}" if certificate.reason else ""
            print(f"{certificate.mission}  {certificate.verdict}{reason}", flush=True)


def _print_counts(certificates: list[Certificate]) -> None:
    counted = Counter(certificate.verdict for certificate in certificates)
    listed = ", ".join(f"{number} {verdict}" for verdict, number in counted.most_common())
    print(f"{len(certificates)} mission{'s' * (len(certificates) != 1)}: {listed or 'none'}")
