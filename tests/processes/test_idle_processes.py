"""Processes that are used again: handed over when they are idle, ended when they do not become idle."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from lingjing.processes.fork_client import ForkServer, ForkServerClient
from tests.kernel.test_world_process import ROOT, await_gone, is_running

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

FUNCTIONS = "tests.processes.prepared_functions"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ForkServer]:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([FUNCTIONS]) as server:
        yield server


@pytest.fixture
def client(server: ForkServer) -> Iterator[ForkServerClient]:
    with closing(server.client()) as client:
        yield client


def opened(client: ForkServerClient, argument: str = "") -> tuple[int, socket.socket]:
    """Request a process. Returns its process id and the user's end of the socket."""
    ours, theirs = socket.socketpair()
    with theirs:
        client.start_function(
            f"{FUNCTIONS}:serve_users", (theirs.fileno(),), 2, argument=argument.encode(), here=False, reuse=True
        )
    return int(ours.recv(64)), ours


def released(user: socket.socket) -> None:
    """End the use of a process, and wait until it has reported that it is idle."""
    with user:
        user.shutdown(socket.SHUT_WR)
        assert user.recv(1) == b""


def used(client: ForkServerClient, argument: str = "") -> int:
    """Use a process once. Returns its process id."""
    pid, user = opened(client, argument)
    released(user)
    return pid


def module(server: ForkServer, folder: Path, function: str, argument: str = "") -> tuple[int, int]:
    """Start a module that uses a process. Returns the process ids of the module and of that process."""
    output = folder / "output"
    with output.open("w") as written:
        streams = (0, written.fileno(), 2)
        process = server.run_module(FUNCTIONS, [f"{FUNCTIONS}:{function}", argument], streams)
    while not output.read_text().endswith("\n"):
        assert process.poll() is None
        time.sleep(0.02)
    return process.pid, int(output.read_text())


def test_an_idle_process_serves_the_next_equal_request(client: ForkServerClient, tmp_path: Path) -> None:
    first = used(client)
    assert used(client) == used(client) == first
    assert used(client, str(tmp_path / "mark")) != first
    assert used(client) == first


def test_a_busy_process_is_not_handed_over(client: ForkServerClient) -> None:
    first, user = opened(client)
    second, other = opened(client)
    assert first != second
    released(user)
    assert used(client) == first
    released(other)
    both = [opened(client) for _ in range(2)]
    assert {pid for pid, _ in both} == {first, second}


def test_a_killed_idle_process_is_replaced(client: ForkServerClient) -> None:
    first = used(client)
    os.kill(first, signal.SIGKILL)
    await_gone([first])
    second = used(client)
    assert second != first and used(client) == second


def test_a_process_outlives_its_user_if_it_becomes_idle(
    server: ForkServer, client: ForkServerClient, tmp_path: Path
) -> None:
    mark = tmp_path / "mark"
    user, pid = module(server, tmp_path, "serve_users", str(mark))
    os.kill(user, signal.SIGKILL)
    while not mark.exists():
        assert is_running(pid)
        time.sleep(0.02)
    assert used(client, str(mark)) == pid


def test_a_process_that_does_not_become_idle_ends_after_its_user(server: ForkServer, tmp_path: Path) -> None:
    user, pid = module(server, tmp_path, "stay_busy")
    assert is_running(pid)
    os.kill(user, signal.SIGKILL)
    await_gone([user, pid])


def test_idle_and_busy_processes_end_with_a_killed_server(server: ForkServer, client: ForkServerClient) -> None:
    idle, user = opened(client)
    busy, _user = opened(client)
    released(user)
    os.kill(server.pid, signal.SIGKILL)
    await_gone([idle, busy])


def test_idle_processes_end_with_a_closed_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([FUNCTIONS]) as server, closing(server.client()) as client:
        idle = used(client)
    await_gone([idle])
