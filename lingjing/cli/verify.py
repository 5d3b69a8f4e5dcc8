"""`lingjing verify TRACE...`: check that traces are as they were written, or name the first wrong record."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.trace.verification import Verification


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 all traces are ok, 1 a trace is wrong or cut, 2 a file is no trace or cannot be read"
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap or trace.mcap.part")
    parser.add_argument("--key", metavar="KEYFILE", help="the key that `run --sign` signed them with")
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print a line, or an object, for each trace in the order of the command line."""
    from lingjing.trace.seals import read_key

    key = read_key(args.key) if args.key else None
    results = []
    for path in args.traces:
        results.append(_verified(path, key))
        if args.output_format == "text":
            print(f"{path}: {results[-1].state}: {results[-1].said}", flush=True)
    if args.output_format == "json":
        import msgspec

        print(json.dumps(msgspec.to_builtins(results), indent=2))
    states = {result.state for result in results}
    if states <= {"ok"}:
        return ExitCode.OK
    return ExitCode.USAGE if states <= {"ok", "unreadable"} else ExitCode.MISSION


def _verified(path: str, key: bytes | None) -> Verification:
    from lingjing.trace.verification import Verification, verify_file

    try:
        return verify_file(path, key)
    except UsageError as error:
        return Verification(path=path, state="unreadable", said=str(error))
