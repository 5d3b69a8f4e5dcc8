"""An executor on the workers of a Ray cluster. Rows equal those of other executors.

Each episode is one task of one CPU, tried once: a worker that dies costs only its current episode. The suite's folder
must be on storage shared by all nodes, and every node must have the same version of the code. Ray is imported when an
executor is made.
"""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from lingjing.bench.rows import code_sha256
from lingjing.data import data_path
from lingjing.decoding import from_json
from lingjing.errors import AbortCause, InfrastructureError, LingjingError, UsageError, error_of, hint_of
from lingjing.installation import AGENTS, CORE, install_line, name_of
from lingjing.installed_plugins.discovery import TRUSTED, trusting
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart, without_result
from lingjing.play.report import EpisodeReport

_POLL_S = 1.0
"""Seconds between checks of the number of CPUs. Chosen."""

_REACH_S = 10.0
"""Seconds to wait for a connection to the cluster. Chosen."""


class RayTask(msgspec.Struct, frozen=True):
    """The message to a worker."""

    options: PlayOptions
    """The options of the episode."""
    folder: str
    """The folder of the episode."""
    lock: str
    """The lock file of the suite's folder."""
    code: str
    """The SHA-256 that the worker's code must have."""
    trusted: str | None = None
    """The foreign plug-ins that may run beside the scores (`discovery.TRUSTED`); None for all."""


class _RayAnswer(msgspec.Struct, frozen=True):
    """The message from a worker: a report, or an error that all episodes would share."""

    report: EpisodeReport | None = None
    """The report of the episode; None if there is an error."""
    code: int = 0
    """The exit code of the error."""
    message: str = ""
    hint: str = ""
    cause: AbortCause = ""
    """The cause of an `InfrastructureError`."""


class RayExecutor:
    """An executor on the cluster at `address` (`auto`: the cluster of this machine).

    `lock` is a file in the suite's folder; a worker checks that it can see it. Raises `UsageError` without Ray or a
    cluster.
    """

    def __init__(self, lock: Path, address: str = "auto") -> None:
        self._ray = _connected(address)
        self._lock = lock.resolve()
        self._code = code_sha256(())
        self._play: Any = self._ray.remote(num_cpus=1, max_retries=0)(play_on_node)

    @property
    def jobs(self) -> int:
        """The current number of CPUs of the cluster."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        """Play the tasks, one per CPU at a time."""
        waiting = iter(tasks)
        running: dict[Any, EpisodeTask] = {}
        try:
            while True:
                while len(running) < self.jobs and (task := next(waiting, None)) is not None:
                    running[self._play.remote(self._sent(task))] = task
                if not running:
                    return
                done, _ = self._ray.wait(list(running), num_returns=1, timeout=_POLL_S)
                for reference in done:
                    task = running.pop(reference)
                    yield task, self._answer(reference, task)
        finally:
            for reference in running:
                self._ray.cancel(reference, force=True)

    def _sent(self, task: EpisodeTask) -> bytes:
        """Return the encoded task. A shipped mission is sent by name, because its path may differ on the worker."""
        path = Path(task.options.mission)
        shipped = path.parent == data_path("scenarios")
        options = msgspec.structs.replace(task.options, mission=path.stem if shipped else str(path.resolve()))
        return msgspec.json.encode(
            RayTask(options, str(task.folder.resolve()), str(self._lock), self._code, os.environ.get(TRUSTED))
        )

    def _answer(self, reference: object, task: EpisodeTask) -> EpisodeReport:
        try:
            answer = from_json(self._ray.get(reference), _RayAnswer)
        except self._ray.exceptions.RayError as error:  # the worker, its node or its memory was lost
            reason = " ".join(str(error).split())[:200]
            return without_result(task, f"its Ray worker was lost: {type(error).__name__}: {reason}", "episode-process")
        if answer.report is None:
            raise error_of(answer.code, answer.message, answer.hint, answer.cause)
        return answer.report


def play_on_node(sent: bytes) -> bytes:
    """Play one episode on the worker; decode a `RayTask` and encode a `_RayAnswer`."""
    return msgspec.json.encode(_played(from_json(sent, RayTask)))


def _played(task: RayTask) -> _RayAnswer:
    node = os.uname().nodename
    if not Path(task.lock).is_file():
        return _RayAnswer(
            code=UsageError.exit_code,
            message=f"the node {node} cannot read `{Path(task.lock).parent}`",
            hint="name a folder with -o that all nodes of the cluster share",
        )
    if _code_here() != task.code:
        return _RayAnswer(
            code=UsageError.exit_code,
            message=f"the node {node} has other code ({_code_here()[:12]}, this machine {task.code[:12]})",
            hint=f"install the same version of {name_of(CORE)} and {name_of(AGENTS)} on every node",
        )
    names = None if task.trusted is None else task.trusted.split(",")
    try:
        with trusting(names):
            ((_, report),) = play_apart([EpisodeTask(task.options, Path(task.folder), reports_failure=True)], 1)
    except LingjingError as error:
        cause = error.cause if isinstance(error, InfrastructureError) else ""
        return _RayAnswer(code=error.exit_code, message=str(error), hint=hint_of(error), cause=cause)
    return _RayAnswer(report)


@cache
def _code_here() -> str:
    return code_sha256(())


def _connected(address: str) -> Any:
    try:
        import ray
    except ImportError as error:
        raise UsageError("suites on a cluster need Ray", hint=install_line("ray")) from error
    if not ray.is_initialized():
        ending = signal.getsignal(signal.SIGTERM)
        try:
            _check_reachable(address)
            connect: Callable[..., object] = ray.init
            connect(address=address, log_to_driver=False, logging_level="ERROR", configure_logging=False)
        except (OSError, ValueError) as error:
            reason = (str(error).splitlines() or [type(error).__name__])[0]
            raise UsageError(
                f"there is no Ray cluster at `{address}`: {reason}",
                hint="start one with `ray start --head`, or name one with --ray-address",
            ) from error
        signal.signal(signal.SIGTERM, ending)  # Ray replaces the handler by one that ends the command silently
    return ray


def _check_reachable(address: str) -> None:
    """Raise `OSError` if no server listens at `host:port`. Ray would retry for minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdecimal():
        socket.create_connection((host, int(port)), _REACH_S).close()


__all__ = ["RayExecutor", "RayTask", "play_on_node"]
