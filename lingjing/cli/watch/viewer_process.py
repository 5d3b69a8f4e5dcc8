"""`--watch=browser` and `--watch=foxglove`: a process that shows the trace while it is written.

It is `lingjing view --follow` on the run's own file, so the episode never waits for it and knows nothing of it. The
kernel ends it when the run is killed.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from lingjing.cli.process import say
from lingjing.cli.view import open_in_browser
from lingjing.errors import ExitCode, InfrastructureError, LingjingError, UsageError


class ViewerProcess:
    """A context manager; the viewer is there before an episode begins. Raises what the viewer says where it cannot
    begin (no package, no port)."""

    def __init__(self, trace: Path, *, foxglove: bool, truth: bool) -> None:
        command = [sys.executable, "-m", "lingjing.cli.main", "view", "--no-open", "--follow", str(trace)]
        command += ["--foxglove"] * foxglove + ["--truth"] * truth + ["--end-with", str(os.getpid())]
        # a group of its own: Ctrl-C ends the run first, which then ends the viewer
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0
        )
        try:
            self.url = _stream(self._process.stdout).readline().strip()
        except BaseException:
            self._end()
            raise
        if not self.url:
            raise _said(self._process)

    def __enter__(self) -> Self:
        say(f"the episode, for this machine alone, is at {self.url}")
        open_in_browser(self.url)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def stay(self) -> None:
        """Until Ctrl-C, so that one can look around in what has been played."""
        with suppress(KeyboardInterrupt):
            say("the episode is over; its page stays until Ctrl-C")
            self._process.wait()

    def _end(self) -> None:
        with suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGTERM)
        self._process.communicate()


def _said(process: subprocess.Popen[str]) -> LingjingError:
    """Why a viewer ended before it began."""
    _, errors = process.communicate()
    lines = [line for line in errors.splitlines() if line.strip()]
    told = next((line.removeprefix("error: ") for line in lines if line.startswith("error: ")), "")
    hint = next((line.removeprefix("hint: ") for line in lines if line.startswith("hint: ")), "")
    kind = UsageError if process.returncode == ExitCode.USAGE else InfrastructureError
    return kind(told or f"the viewer ended with code {process.returncode}", hint=hint)


def _stream(stream: IO[str] | None) -> IO[str]:
    assert stream is not None
    return stream
