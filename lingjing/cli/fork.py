"""`lingjing fork TRACE`: run on from a boundary with something replaced by the truth, or a message changed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from lingjing.causal.branch_host import BranchHost
from lingjing.causal.interventions import BranchPlan, boundary_of, check, check_trace
from lingjing.causal.result_texts import branch_text
from lingjing.cli.arguments import parse_amount, whole_number
from lingjing.cli.branches import add_branch_options, branch_options, parse_faculty
from lingjing.cli.progress import BranchProgress
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.instance import Datum
from lingjing.play.folders import claim_folder, release_if_empty
from lingjing.trace.reader import read_trace
from lingjing.trace.records import MessageChange, Substitution

_LATER = "by so many boundaries (default 1)"
_FARTHEST = 2**63 - 1
"""No number of a boundary is greater."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 the branch was played, whatever came of it; 2 it cannot be; 3 its engines failed"
    parser.description = f"{__doc__} Without a change nothing may differ: a null fork."
    parser.add_argument("trace", metavar="TRACE", help="a trace.mcap or trace.mcap.part")
    parser.add_argument("--at", metavar="T", help="the boundary whose decisions are the first to be replaced")
    parser.add_argument(
        "--until", metavar="T", help="the last boundary where a faculty is replaced (default: to the end)"
    )
    parser.add_argument(
        "--substitute", metavar="FACULTY[:AGENT][@T[-T]]", action="append", default=[],
        help="perception, localisation, waypoint, routing, handoff or execution, as the truth would have it; @ says at "
        "which boundaries, if not from --at until --until: at 3 (@3), from 3 to 9 (@3-9), or from 3 on (@3-)",
    )  # fmt: skip
    for act, what in (
        ("drop", "arrives at nobody"),
        ("withhold", "is never sent, so that no adjudicator hears it either"),
        ("delay", f"arrives later, {_LATER}"),
        ("repeat", f"arrives a second time, {_LATER}"),
    ):
        spelled = "MESSAGE[=TICKS]" if _LATER in what else "MESSAGE"
        parser.add_argument(f"--{act}", metavar=spelled, action="append", default=[], help=f"the message {what}")
    parser.add_argument(
        "--forge",
        metavar="MESSAGE=JSON",
        action="append",
        default=[],
        help="the message arrives with these fields changed",
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="a new or empty folder for the branch as a trace")
    add_branch_options(parser)


def handler(args: argparse.Namespace) -> int:
    """Play the branch and say what came of it."""
    trace = read_trace(args.trace)
    check_trace(trace)
    messages = _changes(args)
    sent = [boundary_of(trace, one.message) for one in messages]
    asked = [(text, *_window(text)) for text in args.substitute]
    begins = [first for _, _, first, _ in asked if first is not None]
    at = _boundary("--at", args.at) if args.at is not None else min(sent + begins, default=None)
    if at is None:
        raise UsageError("nothing says where to branch", hint="--at T, or a message that is changed")
    early = [one.message for one, boundary in zip(messages, sent, strict=True) if boundary < at]
    if early:
        raise UsageError(f"`{early[0]}` was sent before boundary {at}", hint="leave --at away, or branch earlier")
    sooner = [text for text, _, first, _ in asked if first is not None and first < at]
    if sooner:
        raise UsageError(f"--substitute {sooner[0]}: the branch leaves at boundary {at}", hint="leave --at away")
    until = _boundary("--until", args.until) if args.until is not None else None
    if until is not None and (until < at or len(begins) == len(asked)):
        raise UsageError(
            f"--until {until}: no faculty is replaced there",
            hint=f"it says where what --substitute replaces from boundary {at} on ends",
        )
    windows = [(text, at, until) if first is None else (text, first, last) for _, text, first, last in asked]
    substitutions = tuple(
        Substitution(faculty=what, agent=who, first=first, last=last)
        for text, first, last in windows
        for what, who in parse_faculty(text, trace.header.instance)
    )
    plan = BranchPlan(
        at=at, substitutions=tuple(dict.fromkeys(substitutions)), messages=messages, out=args.output or ""
    )
    check(plan, trace)
    options = branch_options(args, trace, tuple(dict.fromkeys(one.agent for one in substitutions)))
    with _claimed(args.output), BranchProgress("starting") as progress, BranchHost(trace, options, progress) as host:
        (result,) = host.play([plan])
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode({"plan": plan, "branch": result}).decode() + "\n")
    else:
        print(branch_text(trace, plan, result))
    return ExitCode.OK


@contextmanager
def _claimed(output: str | None) -> Iterator[None]:
    """The folder of the branch's trace, told before anything is played if it cannot be had; none is left empty."""
    if output is None:
        yield
        return
    folder = claim_folder(Path(output))
    try:
        yield
    finally:
        release_if_empty(folder)


def _changes(args: argparse.Namespace) -> tuple[MessageChange, ...]:
    found = [MessageChange(message=name, act=act) for act in ("drop", "withhold") for name in getattr(args, act)]
    for act in ("delay", "repeat"):
        for text in getattr(args, act):
            name, _, ticks = text.partition("=")
            amount = int(parse_amount(f"--{act}", ticks or "1", whole=True) or 1)
            found.append(MessageChange(message=name, act=act, ticks=amount))
    found += [_forged(text) for text in args.forge]
    return tuple(found)


def _forged(text: str) -> MessageChange:
    name, equals, body = text.partition("=")
    hint = """for example: --forge 'm5-1={"position": [10, 20, 0]}'"""
    if not equals:
        raise UsageError(f"--forge {text}: what it is to say is missing", hint=hint)
    try:
        return MessageChange(message=name, act="forge", body=msgspec.json.decode(body, type=dict[str, Datum]))
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
        raise UsageError(f"--forge {name}: {error}", hint=hint) from error


def _window(text: str) -> tuple[str, int | None, int | None]:
    """What is substituted, and its first and last boundary where a window follows; the last is None for the end."""
    what, at, window = text.partition("@")
    begin, dash, end = window.partition("-")
    first, last = whole_number(begin, _FARTHEST), whole_number(end or begin, _FARTHEST)
    if at and (first is None or last is None or last < first):
        raise UsageError(f"--substitute {text}: no boundaries are `{window}`", hint=f"for example {what}@3-9")
    return what, first, None if dash and not end else last


def _boundary(option: str, text: str) -> int:
    number = whole_number(text, _FARTHEST)
    if number is None:
        raise UsageError(f"{option} {text}: a boundary is a whole number from 0")
    return number
