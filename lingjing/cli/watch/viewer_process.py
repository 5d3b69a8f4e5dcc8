"""`--watch=browser` and `--watch=foxglove`: a viewer process that shows the trace while it is written.

It runs `lingjing view --follow` on the run's file, so the episode never waits for it. The operating system ends it
when the run is killed.
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
    """A context manager that starts the viewer before an episode begins. Raises the viewer's error if it cannot start
    (missing package, port in use).
    """

    def __init__(self, trace: Path, *, foxglove: bool, truth: bool) -> None:
        command = [sys.executable, "-m", "lingjing.cli.main", "view", "--no-open", "--follow", str(trace)]
        command += ["--foxglove"] * foxglove + ["--truth"] * truth + ["--end-with", str(os.getpid())]
        # a separate process group: Ctrl-C interrupts the run, which then ends the viewer
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0
        )
        try:
            self.url = _stream(self._process.stdout).readline().strip()
        except BaseException:
            self._end()
            raise
        if not self.url:
            raise _start_error(self._process)

    def __enter__(self) -> Self:
        say(f"the episode is shown at {self.url}, for this machine only")
        open_in_browser(self.url)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def stay(self) -> None:
        """Wait until Ctrl-C, so that the user can inspect the episode."""
        with suppress(KeyboardInterrupt):
            say("the episode has ended; its page stays until Ctrl-C")
            self._process.wait()

    def _end(self) -> None:
        with suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGTERM)
        self._process.communicate()


def _start_error(process: subprocess.Popen[str]) -> LingjingError:
    """Return the error of a viewer that ended before it served."""
    _, errors = process.communicate()
    lines = [line for line in errors.splitlines() if line.strip()]
    message = next((line.removeprefix("error: ") for line in lines if line.startswith("error: ")), "")
    hint = next((line.removeprefix("hint: ") for line in lines if line.startswith("hint: ")), "")
    kind = UsageError if process.returncode == ExitCode.USAGE else InfrastructureError
    return kind(message or f"the viewer ended with code {process.returncode}", hint=hint)


def _stream(stream: IO[str] | None) -> IO[str]:
    assert stream is not None
    return stream
