"""Functions and a module for `test_templates` and `test_idle_processes`, called by name in forked processes."""

import json
import os
import socket
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from lingjing.processes.fork_client import ForkServerClient
from lingjing.processes.fork_requests import Function
from lingjing.processes.idle_processes import ReuseEnd


def source(_argument: bytes, key: bytes) -> Callable[[], Function] | None:
    """Return the preparation of a template; None for the key `none`. That of `broken` fails."""
    if key == b"none":
        return None

    def make() -> Function:
        if key == b"broken":
            raise ValueError("it cannot be prepared")
        template = os.getpid()

        def report_template(argument: bytes, ends: tuple[int, ...]) -> None:
            _write_report(ends, template, argument)
            if key == b"linger":
                threading.Event().wait()

        return report_template

    return make


def report(argument: bytes, ends: tuple[int, ...]) -> None:
    """Report a process that has no template."""
    _write_report(ends, 0, argument)


def _write_report(ends: tuple[int, ...], template: int, argument: bytes) -> None:
    seen = {"template": template, "pid": os.getpid(), "parent": os.getppid(), "argument": argument.decode()}
    os.write(ends[0], json.dumps(seen).encode())


def serve_users(argument: bytes, ends: tuple[int, ...]) -> None:
    """Send each user the process id, and become idle when the user shuts its socket down.

    `argument`: the path of a file to create after the first report of idleness; empty for none. The socket is closed
    after the report: a user that reads its end knows that the server can read the report.
    """
    reuse = ReuseEnd(ends[-1])
    following: tuple[int, ...] | None = ends
    while following is not None:
        with socket.socket(fileno=following[0]) as user:
            user.sendall(str(os.getpid()).encode())
            user.recv(1)
            reuse.report_idle()
        if argument:
            Path(os.fsdecode(argument)).touch()
        following = reuse.wait_for_next()


def stay_busy(_argument: bytes, ends: tuple[int, ...]) -> None:
    """Never become idle."""
    with socket.socket(fileno=ends[0]) as user:
        user.sendall(str(os.getpid()).encode())
        threading.Event().wait()


def use() -> None:
    """As a module of a fork server: use a process (its function and argument are arguments) and wait for a signal."""
    function, argument = sys.argv[1:3]
    ours, theirs = socket.socketpair()
    client = ForkServerClient(int(sys.argv[-1]))
    client.start_function(function, (theirs.fileno(),), 2, argument=argument.encode(), here=False, reuse=True)
    theirs.close()
    print(ours.recv(64).decode(), flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    use()
