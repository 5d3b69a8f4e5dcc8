"""`lingjing why TRACE...`: explain the outcome of episodes, each on one screen."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from lingjing.errors import ExitCode


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap or trace.mcap.part, or its folder")
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print the explanations, with an empty line between two."""
    from lingjing.analysis.ending import why
    from lingjing.trace.reader import read_trace

    endings = [why(read_trace(_trace_in(Path(path)))) for path in args.traces]
    if args.output_format == "json":
        import msgspec

        print(json.dumps(msgspec.to_builtins(endings), indent=2, ensure_ascii=False))
    else:
        print("\n\n".join(ending.text for ending in endings))
    return ExitCode.OK


def _trace_in(path: Path) -> Path:
    """Return the trace in the folder of a run, which may be cut short; `path` itself if it is no such folder."""
    traces = (path / name for name in ("trace.mcap", "trace.mcap.part"))
    return next((trace for trace in traces if trace.is_file()), path)
