"""The two kinds of servers that start the processes of policies: without walls, and with walls around each process.

Behind walls a process has no variable, no file and no memory of the player (`lingjing.processes.walls`). Its server is
an interpreter of its own, which holds no instance, no city and no result of an examination.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import msgspec

from lingjing.data import data_path
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import GivenOption
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import is_file
from lingjing.processes.fork_client import ForkedProcess, ForkServerClient
from lingjing.processes.walls.entering import Walls
from lingjing.processes.walls.readable import installed_files, modules_of, stays_in

_SERVE = "lingjing.play.policy_processes.host:serve"
"""The function that a process without walls calls."""
_SERVE_WALLED = "lingjing.play.policy_processes.host:serve_walled"
"""The function that builds walls and then serves."""

_BROKER = "lingjing.play.policy_processes.broker:serve"
"""The function of a broker's process."""

CPU_VARIABLE = "LINGJING_POLICY_CPU_S"
"""The environment variable that replaces `CPU_S`."""
CPU_S = 7200
"""The most processor time of one process behind walls, seconds. Chosen: the longest shipped mission has 60 turns of
90 s."""

MEMORY_VARIABLE = "LINGJING_POLICY_MEMORY_GB"
"""The environment variable that replaces `MEMORY_GB`."""
MEMORY_GB = 4.0
"""The memory that a policy may allocate, GiB. Chosen: eight times the use of the shipped policies, and enough for a
small detector on a CPU."""

_MOST_MEMORY_GB = 1e6
"""The highest limit, GiB. Chosen: its bytes fit the 64 bits of a limit of the kernel."""

NO_WALLS = "policies in the player's own process cannot be isolated"
"""The message for walls around policies that have no process of their own."""
WALLS_FROM = "use `lingjing run --isolate` or `lingjing bench` on Linux, with engines in processes"
"""The hint that follows `NO_WALLS`."""


class PolicyServer(Protocol):
    """A server that starts the processes of policies."""

    @property
    def walls(self) -> Walls | None:
        """The walls around each process; None without walls."""
        ...

    def start_policy(self, ends: Sequence[int], output: int) -> ForkedProcess:
        """Start a process with these descriptors, which writes its text to `output`."""
        ...

    def start_broker(self, ends: Sequence[int], output: int, argument: bytes) -> ForkedProcess:
        """Start a broker of model calls, which has the player's environment and no walls."""
        ...

    def keep_result(self, key: bytes, result: bytes) -> None:
        """Keep a result for later episodes, which no process of a policy behind walls can read."""
        ...


class OpenServer:
    """Starts processes that a policy's code cannot leave by accident, and that hold back no attacker."""

    walls = None

    def __init__(self, client: ForkServerClient) -> None:
        memory_limit()  # a wrong one is an error here, and not in each process
        self.client = client

    def start_policy(self, ends: Sequence[int], output: int) -> ForkedProcess:
        """See `PolicyServer.start_policy`."""
        return self.client.start_function(_SERVE, ends, output)

    def start_broker(self, ends: Sequence[int], output: int, argument: bytes) -> ForkedProcess:
        """See `PolicyServer.start_broker`."""
        return self.client.start_function(_BROKER, ends, output, argument=argument)

    def keep_result(self, key: bytes, result: bytes) -> None:
        """See `PolicyServer.keep_result`."""
        self.client.keep_result(key, result)


class WalledServer:
    """Starts processes behind walls.

    `client` leads to a fork server with walls, and `open_client` returns a connection to a server without. `keeper`
    keeps results for the episodes, None if there is only one.
    """

    def __init__(
        self,
        client: ForkServerClient,
        walls: Walls,
        keeper: ForkServerClient | None = None,
        open_client: Callable[[], ForkServerClient] | None = None,
    ) -> None:
        memory_limit()
        self.client = client
        self._open_client = open_client
        self.walls: Walls | None = walls
        self._argument = msgspec.msgpack.encode(walls)
        self._keeper = keeper

    def start_policy(self, ends: Sequence[int], output: int) -> ForkedProcess:
        """See `PolicyServer.start_policy`."""
        return self.client.start_function(_SERVE_WALLED, ends, output, argument=self._argument, here=False)

    def start_broker(self, ends: Sequence[int], output: int, argument: bytes) -> ForkedProcess:
        """See `PolicyServer.start_broker`."""
        if self._open_client is None:
            raise InfrastructureError("there is no process from which a broker of model calls can be started")
        return self._open_client().start_function(_BROKER, ends, output, argument=argument)

    def keep_result(self, key: bytes, result: bytes) -> None:
        """See `PolicyServer.keep_result`."""
        if self._keeper is not None:
            self._keeper.keep_result(key, result)


def walls_of(options: PlayOptions) -> Walls:
    """Return the walls around each policy of these options. Raises `UsageError` for a file that does not exist."""
    own = [path for spec in (options.policy, *options.policies_for.values()) for path in _files_of(spec)]
    own += [os.path.abspath(value) for value in _named_files(options.policy_args.values())]  # noqa: PTH100
    for path in options.policy_files:
        if not Path(path).exists():
            raise UsageError(f"--policy-file: there is no file or folder `{path}`")
        own.append(os.path.abspath(path))  # noqa: PTH100
    data = [str(data_path(kind)) for kind in ("scenarios", "schemas")]
    return Walls(
        readable=installed_files([*data, *own]),
        folder=str(Path.cwd()),
        cpu_s=cpu_limit_s(),
        strict=options.isolate == "strict",
    )


def cpu_limit_s() -> int:
    """Return the most processor time of one process, seconds: `LINGJING_POLICY_CPU_S`, or `CPU_S`.

    Raises `UsageError` if the variable holds no whole number above 0.
    """
    text = os.environ.get(CPU_VARIABLE, str(CPU_S))
    if text.isascii() and text.isdigit() and 0 < int(text) < 2**31:
        return int(text)
    raise UsageError(f"{CPU_VARIABLE}={text}: must be a whole number of seconds above 0")


def memory_limit() -> int:
    """Return the bytes that a policy may allocate: `LINGJING_POLICY_MEMORY_GB`, or `MEMORY_GB`.

    Raises `UsageError` if the variable holds no number of GB.
    """
    text = os.environ.get(MEMORY_VARIABLE, str(MEMORY_GB))
    with suppress(ValueError):
        if 0.0 < float(text) <= _MOST_MEMORY_GB:
            return int(float(text) * 2**30)
    raise UsageError(f"{MEMORY_VARIABLE}={text}: must be a number above 0, at most {_MOST_MEMORY_GB:,.0f}")


def _files_of(spec: str) -> Iterator[str]:
    """Yield the file of a policy, and the modules and packages beside it; nothing for an installed policy."""
    if is_file(spec):
        file = Path(os.path.abspath(spec.partition(":")[0]))  # noqa: PTH100 - a link keeps its place
        yield str(file)
        yield from modules_of(file.parent)


def _named_files(values: Iterable[GivenOption]) -> Iterator[str]:
    """Yield the options that name a file: its path is what the user gave to the policy.

    A link out of its folder is left out, because the folder may be the entrant's.
    """
    for value in values:
        if not isinstance(value, str) or not 0 < len(value) < 4096 or "\0" in value:
            continue
        if Path(value).is_file() and stays_in(Path(value), Path(value).parent):
            yield value


__all__ = [
    "CPU_S", "CPU_VARIABLE", "MEMORY_GB", "MEMORY_VARIABLE", "NO_WALLS", "WALLS_FROM", "OpenServer", "PolicyServer",
    "WalledServer", "cpu_limit_s", "memory_limit", "walls_of",
]  # fmt: skip
