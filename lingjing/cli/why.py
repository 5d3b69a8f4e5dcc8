"""`lingjing why TRACE...`: explain the outcome of episodes, each on one screen."""

from __future__ import annotations

import argparse
import json

from lingjing.errors import ExitCode


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print the explanations, with an empty line between two."""
    from lingjing.analysis.ending import why
    from lingjing.trace.reader import read_trace

    endings = [why(read_trace(path)) for path in args.traces]
    if args.output_format == "json":
        import msgspec

        print(json.dumps(msgspec.to_builtins(endings), indent=2, ensure_ascii=False))
    else:
        print("\n\n".join(ending.text for ending in endings))
    return ExitCode.OK
