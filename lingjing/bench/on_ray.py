"""A suite's episodes on the workers of a Ray cluster: the same rows as anywhere else, on more machines.

Each episode is one task of one CPU, tried once: a worker that dies costs the episode that it was playing and nothing
else. The suite's folder must be on storage that all nodes see; every node has this version of the code installed. Only
here is Ray imported, when an executor is made.
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
from lingjing.errors import InfrastructureError, LingjingError, UsageError
from lingjing.installation import AGENTS, CORE, install_line, name_of
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart, without_result
from lingjing.play.report import EpisodeReport

_POLL_S = 1.0
_REACH_S = 10.0
_KINDS: dict[str, type[LingjingError]] = {"UsageError": UsageError, "InfrastructureError": InfrastructureError}


class RayTask(msgspec.Struct, frozen=True):
    """What is sent to a worker: the options and the folder of an episode, the lock of the suite's folder, and the
    SHA-256 that the code must have there."""

    options: PlayOptions
    folder: str
    lock: str
    code: str


class RayAnswer(msgspec.Struct, frozen=True):
    """What comes back: a report, or the kind, words and hint of the error that all episodes would have."""

    report: EpisodeReport | None = None
    error: str = ""
    message: str = ""
    hint: str = ""


class RayExecutor:
    """Plays on the cluster at `address` (`auto`: the one that this machine is in).

    `lock` is a file in the suite's folder, by which a worker knows that it sees the folder. Raises `UsageError` without
    Ray or a cluster.
    """

    def __init__(self, lock: Path, address: str = "auto") -> None:
        self._ray = _connected(address)
        self._lock = lock.resolve()
        self._code = code_sha256(())
        self._play: Any = self._ray.remote(num_cpus=1, max_retries=0)(play_on_node)

    @property
    def jobs(self) -> int:
        """How many CPUs the cluster has now."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        """Play the tasks, as many at a time as there are CPUs."""
        waiting = iter(tasks)
        running: dict[Any, EpisodeTask] = {}
        try:
            while True:
                while len(running) < self.jobs and (task := next(waiting, None)) is not None:
                    running[self._play.remote(self._sent(task))] = task
                if not running:
                    return
                done, _ = self._ray.wait(list(running), num_returns=1, timeout=_POLL_S)
                for one in done:
                    task = running.pop(one)
                    yield task, self._answer(one, task)
        finally:
            for one in running:
                self._ray.cancel(one, force=True)

    def _sent(self, task: EpisodeTask) -> bytes:
        """The task for a machine on which the shipped missions may lie elsewhere."""
        path = Path(task.options.mission)
        shipped = path.parent == data_path("scenarios")
        options = msgspec.structs.replace(task.options, mission=path.stem if shipped else str(path.resolve()))
        return msgspec.json.encode(RayTask(options, str(task.folder.resolve()), str(self._lock), self._code))

    def _answer(self, reference: object, task: EpisodeTask) -> EpisodeReport:
        try:
            answer = msgspec.json.decode(self._ray.get(reference), type=RayAnswer)
        except self._ray.exceptions.RayError as error:  # the worker, its node or its memory is gone
            said = " ".join(str(error).split())[:200]
            return without_result(task, f"its Ray worker was lost: {type(error).__name__}: {said}")
        if answer.report is None:
            raise _KINDS.get(answer.error, LingjingError)(answer.message, hint=answer.hint)
        return answer.report


def play_on_node(sent: bytes) -> bytes:
    """Play one episode, on the worker: a `RayTask` in, a `RayAnswer` out."""
    return msgspec.json.encode(_played(msgspec.json.decode(sent, type=RayTask)))


def _played(task: RayTask) -> RayAnswer:
    node = os.uname().nodename
    if not Path(task.lock).is_file():
        return RayAnswer(
            error="UsageError",
            message=f"the node {node} does not see `{Path(task.lock).parent}`",
            hint="name a folder with -o that all nodes of the cluster see",
        )
    if _code_here() != task.code:
        return RayAnswer(
            error="UsageError",
            message=f"the node {node} has other code ({_code_here()[:12]}, here it is {task.code[:12]})",
            hint=f"install the same version of {name_of(CORE)} and {name_of(AGENTS)} on every node",
        )
    try:
        ((_, report),) = play_apart([EpisodeTask(task.options, Path(task.folder), reports_failure=True)], 1)
    except LingjingError as error:
        return RayAnswer(error=type(error).__name__, message=str(error), hint=error.hint)
    return RayAnswer(report)


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
            said = (str(error).splitlines() or [type(error).__name__])[0]
            raise UsageError(
                f"there is no Ray cluster at `{address}`: {said}",
                hint="start one with `ray start --head`, or name one with --ray-address",
            ) from error
        signal.signal(signal.SIGTERM, ending)  # Ray puts one of its own there, which ends a command without a word
    return ray


def _check_reachable(address: str) -> None:
    """Raise `OSError` where nobody listens at `host:port`: Ray itself would go on trying for minutes."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdecimal():
        socket.create_connection((host, int(port)), _REACH_S).close()


__all__ = ["RayAnswer", "RayExecutor", "RayTask", "play_on_node"]
