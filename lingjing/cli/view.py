"""`lingjing view TRACE`: show an episode in the browser, as one HTML file, in Foxglove or in Rerun."""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import tempfile
import webbrowser
from pathlib import Path
from typing import Protocol

from lingjing.cli.arguments import parse_whole
from lingjing.cli.files import check_output, say_if_cut, say_written, write_output
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError
from lingjing.processes.linux import set_parent_death_signal
from lingjing.trace.reader import Trace


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("trace", metavar="TRACE", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "--truth", action="store_true", help="show hidden targets, true boxes and the full explanation of the outcome"
    )
    parser.add_argument("--follow", action="store_true", help="show an episode while it is played, as its trace grows")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--foxglove", action="store_true", help="show it in Foxglove; -o FILE.json writes the layout")
    where.add_argument("--rerun", action="store_true", help="show it in Rerun; -o FILE.rrd writes the recording")
    parser.add_argument("-o", "--output", metavar="FILE", help="write one file (.html needs no network), and stop")
    parser.add_argument(
        "--pictures",
        metavar="MB",
        default="12",
        help="the greatest size of all pictures of an HTML file (default 12)",
    )
    parser.add_argument("--port", metavar="N", default="0", help="the server's port (default: a free one)")
    parser.add_argument("--no-open", action="store_true", help="print the address and open no browser")
    parser.add_argument("--end-with", metavar="PID", type=int, help=argparse.SUPPRESS)  # set by `run --watch`


def handler(args: argparse.Namespace) -> int:
    """Write the file, or show the episode until an interrupt."""
    if args.end_with is not None and not set_parent_death_signal(args.end_with, signal.SIGTERM):
        return ExitCode.INTERRUPTED
    budget, port = parse_whole("--pictures", args.pictures, 2000), parse_whole("--port", args.port, 65535)
    if args.follow:
        return _follow(args, port)
    if args.output is not None:
        check_output(args.output, [args.trace])
    from lingjing.trace.reader import read_trace

    trace = read_trace(args.trace)
    say_if_cut(trace)
    if args.rerun:
        return _rerun(trace, args)
    if args.foxglove:
        return _foxglove(trace, args, port)
    if args.output is not None:
        from lingjing.viewer.single import single_file

        _check_suffix(args.output, (".html", ".htm"), "the page is an .html file", "episode.html")
        return _written(single_file(trace, truth=args.truth, budget_bytes=budget * 1_000_000), args.output)
    from lingjing.viewer.server import ViewServer
    from lingjing.viewer.trace_source import TraceSource

    return serve(ViewServer(TraceSource(trace, truth=args.truth), port), no_open=args.no_open)


def _follow(args: argparse.Namespace, port: int) -> int:
    if args.output is not None:
        raise UsageError("--follow shows a running episode; -o writes a finished one", hint="remove one of them")
    if args.rerun:
        raise UsageError("--rerun shows a finished episode", hint="use --follow with the browser or --foxglove")
    if args.foxglove:
        from lingjing.viewer.foxglove_server import FoxgloveServer

        live = FoxgloveServer(Path(args.trace), truth=args.truth, port=port)
        say(f"address of the connection: {live.address}")
        return serve(live, no_open=args.no_open)
    from lingjing.viewer.live import LiveSource
    from lingjing.viewer.server import ViewServer

    followed = LiveSource(Path(args.trace), truth=args.truth)
    return serve(ViewServer(followed, port), no_open=args.no_open)


def _foxglove(trace: Trace, args: argparse.Namespace, port: int) -> int:
    if args.output is not None:
        from lingjing.viewer.foxglove_layout import foxglove_layout

        _check_suffix(args.output, (".json",), "a layout for Foxglove is a .json file", "layout.json")
        return _written(foxglove_layout(trace.header.instance, truth=args.truth), args.output)
    from lingjing.viewer.file_server import TraceFileServer

    server = TraceFileServer(trace.path, port)
    say(f"for the layout: lingjing view {args.trace} --foxglove -o layout.json, then `Import from file` in Foxglove")
    return serve(server, no_open=args.no_open)


def _rerun(trace: Trace, args: argparse.Namespace) -> int:
    from lingjing.viewer.rerun_recording import write_rerun

    if args.output is not None:
        path = Path(args.output)
        write_rerun(trace, path, truth=args.truth)
        say_written(path)
        return ExitCode.OK
    if args.no_open:
        raise UsageError(
            "--rerun and --no-open contradict each other", hint="remove --no-open, or write a file: -o episode.rrd"
        )
    with tempfile.TemporaryDirectory(prefix="lingjing-") as folder:
        path = Path(folder) / "episode.rrd"
        write_rerun(trace, path, truth=args.truth)
        ended = subprocess.run([sys.executable, "-m", "rerun", str(path)], check=False).returncode
    if ended:
        hint = "write the file and open it where there is a screen: -o episode.rrd"
        raise UsageError(f"Rerun's viewer ended with code {ended}", hint=hint)
    return ExitCode.OK


def _check_suffix(output: str, suffixes: tuple[str, ...], rule: str, name: str) -> None:
    """Raise `UsageError` for a file with a suffix of another kind. Standard output and devices are accepted."""
    path = Path(output)
    if output != "-" and path.suffix.lower() not in suffixes and (path.is_file() or not path.exists()):
        raise UsageError(f"cannot write `{output}`: {rule}", hint=f"name it {name}")


def _written(text: str, output: str) -> int:
    write_output(text, output)
    if output != "-":
        say_written(output)
    return ExitCode.OK


class _ShowingServer(Protocol):
    """A server that shows an episode at its `url`."""

    @property
    def url(self) -> str:
        """The address for a browser."""
        ...

    def close(self) -> None:
        """Stop serving."""
        ...


def serve(server: _ShowingServer, *, no_open: bool) -> int:
    """Print the address, open it, and wait for an interrupt."""
    try:
        print(server.url, flush=True)
        say("the episode is shown at this address, for this machine only; Ctrl-C stops the server")
        if not no_open:
            open_in_browser(server.url)
        while True:
            signal.pause()
    except KeyboardInterrupt:
        return ExitCode.OK
    finally:
        server.close()


def open_in_browser(url: str) -> None:
    """Open an address; print a message if no browser can be started."""
    if not webbrowser.open(url):
        say("no browser could be started: open the address by hand")
