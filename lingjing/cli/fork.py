"""`lingjing fork TRACE`: run a trace on from a boundary with decisions replaced by the truth, or with messages
changed.
"""

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
from lingjing.decoding import from_json
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.instance import Datum
from lingjing.play.folders import claim_folder, release_if_empty
from lingjing.trace.reader import read_trace
from lingjing.trace.records import MessageChange, Substitution

_LATER = "by TICKS boundaries (default 1)"
_FARTHEST = 2**63 - 1
"""The greatest number of a boundary."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 the branch was played, with any outcome; 2 it is not possible; 3 an engine failed"
    parser.description = f"{__doc__} Without a change the branch must equal the trace (a null fork)."
    parser.add_argument("trace", metavar="TRACE", help="a trace.mcap or trace.mcap.part")
    parser.add_argument("--at", metavar="T", help="the first boundary whose decisions are replaced")
    parser.add_argument(
        "--until", metavar="T", help="the last boundary where a faculty is replaced (default: to the end)"
    )
    parser.add_argument(
        "--substitute", metavar="FACULTY[:AGENT][@T[-T]]", action="append", default=[],
        help="replace perception, localisation, waypoint, routing, handoff or execution by the reference policy's; "
        "@ names boundaries in place of --at and --until: 3 alone (@3), 3 to 9 (@3-9), or from 3 on (@3-)",
    )  # fmt: skip
    for act, effect in (
        ("drop", "is sent, and is not delivered"),
        ("withhold", "is not sent, so no adjudicator receives it either"),
        ("delay", f"arrives later, {_LATER}"),
        ("repeat", f"arrives a second time, later {_LATER}"),
    ):
        spelled = "MESSAGE[=TICKS]" if _LATER in effect else "MESSAGE"
        parser.add_argument(f"--{act}", metavar=spelled, action="append", default=[], help=f"the message {effect}")
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
    """Play the branch and print its outcome."""
    trace = read_trace(args.trace)
    check_trace(trace)
    messages = _changes(args)
    sent = [boundary_of(trace, change.message) for change in messages]
    requested = [(text, *_window(text)) for text in args.substitute]
    begins = [first for _, _, first, _ in requested if first is not None]
    at = _boundary("--at", args.at) if args.at is not None else min(sent + begins, default=None)
    if at is None:
        raise UsageError("the boundary of the branch is missing", hint="name it with --at T, or change a message")
    early = [change.message for change, boundary in zip(messages, sent, strict=True) if boundary < at]
    if early:
        raise UsageError(f"`{early[0]}` was sent before boundary {at}", hint="remove --at, or branch earlier")
    sooner = [text for text, _, first, _ in requested if first is not None and first < at]
    if sooner:
        raise UsageError(f"--substitute {sooner[0]}: the branch begins at boundary {at}", hint="remove --at")
    until = _boundary("--until", args.until) if args.until is not None else None
    if until is not None and (until < at or len(begins) == len(requested)):
        raise UsageError(
            f"--until {until}: no faculty is replaced there",
            hint=f"--until ends the replacement of --substitute, which begins at boundary {at}",
        )
    windows = [(text, at, until) if first is None else (text, first, last) for _, text, first, last in requested]
    substitutions = tuple(
        Substitution(faculty=faculty, agent=agent, first=first, last=last)
        for text, first, last in windows
        for faculty, agent in parse_faculty(text, trace.header.instance)
    )
    plan = BranchPlan(
        at=at, substitutions=tuple(dict.fromkeys(substitutions)), messages=messages, out=args.output or ""
    )
    check(plan, trace)
    options = branch_options(args, trace, tuple(dict.fromkeys(change.agent for change in substitutions)))
    with _claimed(args.output), BranchProgress("starting") as progress, BranchHost(trace, options, progress) as host:
        (result,) = host.play([plan])
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode({"plan": plan, "branch": result}).decode() + "\n")
    else:
        print(branch_text(trace, plan, result))
    return ExitCode.OK


@contextmanager
def _claimed(output: str | None) -> Iterator[None]:
    """Claim the folder of the branch's trace before anything is played, and remove it again if it stays empty."""
    if output is None:
        yield
        return
    folder = claim_folder(Path(output))
    try:
        yield
    finally:
        release_if_empty(folder)


def _changes(args: argparse.Namespace) -> tuple[MessageChange, ...]:
    changes = [MessageChange(message=name, act=act) for act in ("drop", "withhold") for name in getattr(args, act)]
    for act in ("delay", "repeat"):
        for text in getattr(args, act):
            name, _, ticks = text.partition("=")
            amount = int(parse_amount(f"--{act}", ticks or "1", whole=True) or 1)
            changes.append(MessageChange(message=name, act=act, ticks=amount))
    changes += [_forged(text) for text in args.forge]
    return tuple(changes)


def _forged(text: str) -> MessageChange:
    name, equals, body = text.partition("=")
    hint = """for example: --forge 'm5-1={"position": [10, 20, 0]}'"""
    if not equals:
        raise UsageError(f"--forge {text}: the new fields of the message are missing", hint=hint)
    try:
        return MessageChange(message=name, act="forge", body=from_json(body, dict[str, Datum]))
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
        raise UsageError(f"--forge {name}: {error}", hint=hint) from error


def _window(text: str) -> tuple[str, int | None, int | None]:
    """Split `FACULTY[@T[-T]]` into the faculty and its first and last boundary. None: no window, or an open end."""
    faculty, at, window = text.partition("@")
    begin, dash, end = window.partition("-")
    first, last = whole_number(begin, _FARTHEST), whole_number(end or begin, _FARTHEST)
    if at and (first is None or last is None or last < first):
        raise UsageError(
            f"--substitute {text}: `{window}` is not a range of boundaries", hint=f"for example {faculty}@3-9"
        )
    return faculty, first, None if dash and not end else last


def _boundary(option: str, text: str) -> int:
    number = whole_number(text, _FARTHEST)
    if number is None:
        raise UsageError(f"{option} {text}: a boundary is a whole number from 0")
    return number
