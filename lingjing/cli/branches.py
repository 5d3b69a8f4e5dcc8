"""What the verbs that play branches of traces share: options, and how a substitution is spelled."""

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


def add_branch_options(parser: argparse.ArgumentParser, *, referenced: bool = True) -> None:
    """Declare them; `--reference` only where something is replaced by the truth."""
    parser.add_argument(
        "--policy", metavar="FILE.py:CLASS", action="append", default=[],
        help="where a policy lies that the trace calls by its file's name",
    )  # fmt: skip
    parser.add_argument(
        "--policy-for", metavar="ROLE_OR_AGENT=NAME", action="append", default=[],
        help="who plays this role or agent, if not whom the trace names",
    )  # fmt: skip
    parser.add_argument(
        "--calls", choices=("replay", "live"), default="replay",
        help="whether chat models may be asked beyond the branch (default: no)",
    )  # fmt: skip
    parser.set_defaults(reference="oracle")
    if referenced:
        parser.add_argument(
            "--reference", metavar="NAME",
            help="the privileged policy that knows what would have been right (default oracle)",
        )  # fmt: skip
    parser.add_argument("-j", "--jobs", metavar="N", default="2", help="branches at a time (default 2)")
    parser.add_argument("--output-format", choices=("text", "json"), default="text", help="default: text")


def branch_options(args: argparse.Namespace, trace: Trace, referenced: tuple[str, ...] | None = None) -> BranchOptions:
    """The options as given. Raises `UsageError`."""
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
    """`FACULTY:AGENT`, or `FACULTY` for every agent that has it. Raises `UsageError`."""
    name, colon, agent = text.partition(":")
    faculty = next((one for one in FACULTY_NAMES if one == name), None)
    if faculty is None:
        known = nearest_or(name, FACULTY_NAMES, f"there are: {', '.join(FACULTY_NAMES)}")
        raise UsageError(f"--substitute {text}: no faculty is called `{name}`", hint=known)
    if colon:
        return ((faculty, agent),)
    having = tuple((faculty, one.id) for one in instance.agents if faculty in faculties_of(instance, one))
    if not having:
        raise UsageError(f"--substitute {text}: no agent of {instance.mission} has {faculty}")
    return having
