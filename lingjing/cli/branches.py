"""Options of the verbs that play branches of traces, and parsing of faculties."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import get_args

from lingjing.causal.faculties import faculties_of
from lingjing.causal.redriven import BranchOptions
from lingjing.cli.arguments import parse_amount, parse_pairs
from lingjing.errors import UsageError
from lingjing.mission.instance import Instance
from lingjing.suggest import nearest_or
from lingjing.trace.reader import Trace
from lingjing.trace.records import Faculty

FACULTY_NAMES: tuple[Faculty, ...] = get_args(Faculty)
"""The faculties that `--substitute` accepts."""


def add_branch_options(parser: argparse.ArgumentParser, *, referenced: bool = True) -> None:
    """Declare the options. `referenced`: with `--reference`, for verbs that replace decisions by those of a privileged
    policy.
    """
    parser.add_argument(
        "--policy", metavar="FILE.py:CLASS", action="append", default=[],
        help="the file of a policy that the trace names by its file",
    )  # fmt: skip
    parser.add_argument(
        "--policy-for", metavar="ROLE_OR_AGENT=NAME", action="append", default=[],
        help="the policy of this role or agent, in place of the trace's",
    )  # fmt: skip
    parser.add_argument(
        "--calls", choices=("replay", "live"), default="replay",
        help="replay: use recorded answers only (default); live: call chat models after the branch point",
    )  # fmt: skip
    parser.set_defaults(reference="oracle")
    if referenced:
        parser.add_argument(
            "--reference", metavar="NAME",
            help="the privileged policy whose decisions replace others (default oracle)",
        )  # fmt: skip
    parser.add_argument("-j", "--jobs", metavar="N", default="2", help="play N branches at a time (default 2)")
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def branch_options(args: argparse.Namespace, trace: Trace, referenced: tuple[str, ...] | None = None) -> BranchOptions:
    """Return the options of the command line. Raises `UsageError`."""
    for spec in args.policy:
        path, _, _ = spec.partition(":")
        if not Path(path).is_file():
            raise UsageError(
                f"--policy {spec}: there is no file `{path}`", hint="for example: --policy ./mine.py:Scout"
            )
    return BranchOptions(
        trace=str(trace.path),
        files=tuple(args.policy),
        policies=parse_pairs("--policy-for", args.policy_for),
        calls=args.calls,
        reference=args.reference,
        referenced=referenced,
        jobs=int(parse_amount("--jobs", args.jobs, whole=True) or 1),
    )


def parse_faculty(text: str, instance: Instance) -> tuple[tuple[Faculty, str], ...]:
    """Parse `FACULTY:AGENT`, or `FACULTY` for every agent that has it, as pairs. Raises `UsageError`."""
    name, colon, agent = text.partition(":")
    faculty = next((candidate for candidate in FACULTY_NAMES if candidate == name), None)
    if faculty is None:
        hint = nearest_or(name, FACULTY_NAMES, f"there are: {', '.join(FACULTY_NAMES)}")
        raise UsageError(f"--substitute {text}: no faculty is called `{name}`", hint=hint)
    if colon:
        return ((faculty, agent),)
    having = tuple(
        (faculty, candidate.id) for candidate in instance.agents if faculty in faculties_of(instance, candidate)
    )
    if not having:
        raise UsageError(f"--substitute {text}: no agent of {instance.mission} has {faculty}")
    return having
