"""The walls that this kernel offers, measured in a process that builds them."""

from __future__ import annotations

import os
from contextlib import closing

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError
from lingjing.processes.fork_client import ForkServer, ForkServerClient
from lingjing.processes.walls.report import WallReport

_REPORT = "lingjing.processes.walls.entering:report_walls"


def offered_walls(client: ForkServerClient | None = None) -> WallReport:
    """Return the report of a process that `client`, or a new fork server with walls, starts for this.

    Raises `InfrastructureError` if that process ends without a report.
    """
    if client is None:
        with ForkServer((), walls=True) as server, closing(server.client()) as own:
            return offered_walls(own)
    reading, writing = os.pipe2(os.O_CLOEXEC)
    with os.fdopen(reading, "rb") as answer:
        try:
            process = client.start_function(_REPORT, (writing,), writing, here=False)
        finally:
            os.close(writing)
        text = answer.read()
    process.close()
    try:
        return from_json(text, WallReport)
    except msgspec.DecodeError as error:
        raise InfrastructureError(
            f"the walls cannot be built: {text.decode(errors='replace').strip()[-300:] or 'no report'}",
            hint="`ulimit -a` shows limits of this shell",
        ) from error


def check_strict(report: WallReport) -> None:
    """Raise `InfrastructureError` if walls break a promise."""
    if report.broken:
        refused = "; ".join(f"{guard}: {reason}" for guard, reason in report.refused.items())
        raise InfrastructureError(
            f"this kernel does not promise: {', '.join(report.broken)}{f' ({refused})' if refused else ''}",
            hint="leave out --strict to play without these promises; `lingjing doctor` lists them",
        )


__all__ = ["check_strict", "offered_walls"]
