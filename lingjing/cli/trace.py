"""`lingjing trace export`: write a trace as files of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from lingjing.errors import ExitCode


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    export = actions.add_parser("export", help="write a trace as CSV, Parquet or GeoJSON", description=_export.__doc__)
    export.add_argument("trace", metavar="TRACE", help="a trace.mcap or trace.mcap.part, or its folder")
    export.add_argument("--format", metavar="FORMAT", required=True, help="csv, parquet or geojson")
    export.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        required=True,
        help="for csv and parquet a new folder, with one file for each table; for geojson a file",
    )
    export.set_defaults(handler=_export)


def _export(args: argparse.Namespace) -> int:
    """Write a trace for other programs: its tables as CSV or Parquet, or the ways of bodies and the places of reports
    as GeoJSON in degrees of WGS84."""
    from lingjing.analysis.trace_exports import export_trace
    from lingjing.trace.reader import read_trace

    for file in export_trace(read_trace(args.trace), args.format, Path(args.output)):
        print(file)
    return ExitCode.OK
