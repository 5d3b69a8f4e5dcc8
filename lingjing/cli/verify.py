"""`lingjing verify TRACE...`: check that traces are as they were written, or name the first wrong record."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.mission.salts import Salt
    from lingjing.trace.verification import Verification


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.epilog = "exit codes: 0 all traces are ok, 1 a trace is wrong or cut, 2 a file is no trace or cannot be read"
    parser.add_argument("traces", metavar="TRACE", nargs="*", help="a trace.mcap or trace.mcap.part")
    parser.add_argument("--key", metavar="KEYFILE", help="the key that `run --sign` signed them with")
    parser.add_argument(
        "--salt",
        metavar="FILE",
        help="the salt of a sealed split: print its hash, and check that it drew the instances",
    )
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print a line, or an object, for each trace in the order of the command line."""
    from lingjing.mission.salts import read_salt
    from lingjing.trace.seals import read_key

    key = read_key(args.key) if args.key else None
    salt = read_salt(args.salt, published=True) if args.salt else None
    if salt is not None and args.output_format == "text":
        print(f"{args.salt}: SHA-256 {salt.sha256}", flush=True)
    if salt is None and not args.traces:
        raise UsageError("no trace is named", hint="lingjing verify TRACE, or --salt FILE for the hash of a salt")
    results = []
    for path in args.traces:
        results.append(_verified(path, key, salt))
        if args.output_format == "text":
            print(f"{path}: {results[-1].state}: {results[-1].said}", flush=True)
    if args.output_format == "json":
        import msgspec

        print(json.dumps(msgspec.to_builtins(results), indent=2))
    states = {result.state for result in results}
    if states <= {"ok"}:
        return ExitCode.OK
    return ExitCode.USAGE if states <= {"ok", "unreadable"} else ExitCode.MISSION


def _verified(path: str, key: bytes | None, salt: Salt | None) -> Verification:
    from lingjing.trace.verification import Verification, check_salt, verify_file

    try:
        result = verify_file(path, key)
        return result if salt is None else check_salt(result, salt)
    except UsageError as error:
        return Verification(path=path, state="unreadable", said=str(error))
