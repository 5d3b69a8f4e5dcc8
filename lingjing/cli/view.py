"""`lingjing view TRACE`: an episode in the browser, or as one HTML file."""

from __future__ import annotations

import argparse
import signal
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.files import write_output
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.viewer.server import Served


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options."""
    parser = subparsers.add_parser("view", help="show an episode in the browser", description=__doc__)
    parser.add_argument("trace", metavar="TRACE", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "--truth", action="store_true", help="show hidden targets, true boxes and the whole explanation"
    )
    parser.add_argument("--follow", action="store_true", help="show an episode while it is played, as its trace grows")
    parser.add_argument("-o", "--output", metavar="FILE.html", help="write one file that needs no network, and stop")
    parser.add_argument(
        "--pictures", metavar="MB", default="12", help="what all pictures of the file may take (default 12; 0: none)"
    )
    parser.add_argument("--port", metavar="N", default="0", help="the server's port (default: a free one)")
    parser.add_argument("--no-open", action="store_true", help="print the address, open no browser")
    parser.set_defaults(handler=handler)


def handler(args: argparse.Namespace) -> int:
    """Write the file, or serve until an interrupt."""
    from lingjing.trace.reader import read_trace

    budget, port = _number("--pictures", args.pictures, 2000), _number("--port", args.port, 65535)
    if args.follow:
        if args.output is not None:
            raise UsageError(
                "--follow shows an episode that goes on; -o writes one that is there", hint="leave one out"
            )
        from lingjing.viewer.live import ServedRun

        return _serve(ServedRun(Path(args.trace), truth=args.truth), port, args.no_open)
    trace = read_trace(args.trace)
    if args.output is not None:
        from lingjing.viewer.single import single_file

        write_output(single_file(trace, truth=args.truth, budget_bytes=budget * 1_000_000), args.output)
        if args.output != "-":
            size = Path(args.output).stat().st_size / 1e6
            say(f"wrote {args.output} ({size:.1f} MB)")
        return ExitCode.OK

    from lingjing.viewer.served import ServedTrace

    return _serve(ServedTrace(trace, truth=args.truth), port, args.no_open)


def _serve(served: Served, port: int, no_open: bool) -> int:
    from lingjing.viewer.server import ViewServer

    server = ViewServer(served, port)
    try:
        print(server.url, flush=True)
        say("the episode is at this address, for this machine alone; Ctrl-C ends it")
        if not no_open:
            webbrowser.open(server.url)
        while True:
            signal.pause()
    except KeyboardInterrupt:
        return ExitCode.OK
    finally:
        server.close()


def _number(option: str, text: str, most: int) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= most):
        raise UsageError(f"{option} {text}: a whole number from 0 to {most} is due")
    return int(text)
