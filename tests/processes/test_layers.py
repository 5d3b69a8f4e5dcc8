"""Layers of a fork server: forks of it that have imported more, and start processes in its place."""

import json
import os
import signal
from collections.abc import Iterator
from contextlib import closing, suppress
from typing import Any

import pytest

from lingjing.errors import InfrastructureError
from lingjing.processes.fork_client import ForkedProcess, ForkServer, ForkServerClient
from tests.kernel.test_world_process import ROOT, await_gone, is_running

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

FUNCTIONS = "tests.processes.layer_functions"
MORE = "xml.dom.minidom"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ForkServer]:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([FUNCTIONS], {"more": [MORE]}) as server:
        yield server


def started(client: ForkServerClient, function: str, layer: str = "") -> tuple[ForkedProcess, dict[str, Any]]:
    reading, writing = os.pipe()
    process = client.start_function(f"{FUNCTIONS}:{function}", (writing,), 2, layer=layer)
    os.close(writing)
    seen = json.loads(os.read(reading, 65_536))
    os.close(reading)
    return process, seen


def test_a_process_of_a_layer_has_the_modules_that_the_layer_imported(server: ForkServer) -> None:
    with closing(server.client()) as client:
        seen = [started(client, "report", layer)[1] for layer in ("", "more", "more", "unknown")]
    assert [each["has_more"] for each in seen] == [False, True, True, False]
    assert seen[0]["parent"] == seen[3]["parent"] == server.pid
    assert seen[1]["parent"] == seen[2]["parent"] != server.pid


def test_a_layer_has_the_effects_of_earlier_calls_and_of_calls_in_layers(server: ForkServer) -> None:
    server.call(f"{FUNCTIONS}:note", "before")
    with closing(server.client()) as client:
        assert started(client, "report", "more")[1]["called"] == ["before"]
        server.call(f"{FUNCTIONS}:note", "here")
        server.call(f"{FUNCTIONS}:note", "everywhere", in_layers=True)
        assert started(client, "report", "more")[1]["called"] == ["before", "everywhere"]
        assert started(client, "report")[1]["called"] == ["before", "here", "everywhere"]


def test_a_killed_layer_ends_its_processes_and_is_replaced(server: ForkServer) -> None:
    with closing(server.client()) as client:
        process, first = started(client, "linger", "more")
        os.kill(first["parent"], signal.SIGKILL)
        await_gone([first["pid"]])
        assert process.wait(600) == ForkedProcess.LOST
        _, again = started(client, "report", "more")
    assert again["has_more"] and again["parent"] != first["parent"]
    assert is_running(server.pid)


def test_layers_end_with_a_killed_server(server: ForkServer) -> None:
    with closing(server.client()) as client:
        _, seen = started(client, "linger", "more")
    os.kill(server.pid, signal.SIGKILL)
    await_gone([seen["parent"], seen["pid"]])


def test_the_server_starts_the_processes_of_a_layer_that_cannot_be_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([FUNCTIONS], {"more": ["no_such_module"]}) as server, closing(server.client()) as client:
        with suppress(InfrastructureError):  # a request that the layer takes along
            started(client, "report", "more")
        assert not started(client, "report", "more")[1]["has_more"]
