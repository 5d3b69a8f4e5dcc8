"""Templates of a fork server: prepared once, forked often, ended with their server or as the least recently used."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from contextlib import closing, suppress
from typing import TypedDict

import pytest

from lingjing.errors import InfrastructureError
from lingjing.processes.fork_client import ForkedProcess, ForkServer, ForkServerClient
from lingjing.processes.fork_requests import Template
from lingjing.processes.templates import MOST_TEMPLATES
from tests.kernel.test_world_process import ROOT, await_gone, is_running

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

FUNCTIONS = "tests.processes.prepared_functions"


class Report(TypedDict):
    template: int
    pid: int
    parent: int
    argument: str


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ForkServer]:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([FUNCTIONS]) as server:
        yield server


@pytest.fixture
def client(server: ForkServer) -> Iterator[ForkServerClient]:
    with closing(server.client()) as client:
        yield client


def started(client: ForkServerClient, key: str, argument: str = "") -> tuple[ForkedProcess, Report]:
    """Start a process of a template and return it with its report."""
    reading, writing = os.pipe()
    template = Template(f"{FUNCTIONS}:source", key.encode())
    try:
        process = client.start_function(
            f"{FUNCTIONS}:report", (writing,), 2, argument=argument.encode(), here=False, template=template
        )
        os.close(writing)
        writing = -1
        return process, json.loads(os.read(reading, 65_536))
    finally:
        os.close(reading)
        if writing >= 0:
            os.close(writing)


def test_processes_of_one_template_are_forks_of_one_preparation(server: ForkServer, client: ForkServerClient) -> None:
    (first, report), (second, other) = started(client, "a", "x"), started(client, "a", "x")
    assert report["template"] == report["parent"] == other["template"] == other["parent"] != server.pid
    assert report["pid"] != other["pid"] and report["argument"] == "x"
    assert (first.wait(600), second.wait(600)) == (0, 0)
    assert is_running(report["template"])


def test_another_key_or_argument_is_another_template(client: ForkServerClient) -> None:
    templates = {started(client, key, argument)[1]["template"] for key in "ab" for argument in "xy"}
    assert len(templates) == 4


def test_without_a_template_the_server_starts_the_process(server: ForkServer, client: ForkServerClient) -> None:
    _, seen = started(client, "none", "x")
    assert (seen["template"], seen["parent"], seen["argument"]) == (0, server.pid, "x")


def test_a_killed_template_ends_its_processes_and_is_not_recreated(
    server: ForkServer, client: ForkServerClient
) -> None:
    process, seen = started(client, "linger")
    os.kill(seen["template"], signal.SIGKILL)
    await_gone([seen["template"], seen["pid"]])
    assert process.wait(600) == ForkedProcess.LOST
    assert [started(client, "linger")[1]["parent"] for _ in range(2)] == [server.pid] * 2
    assert started(client, "a")[1]["template"]


def test_a_template_that_cannot_be_prepared_is_not_tried_again(server: ForkServer, client: ForkServerClient) -> None:
    with suppress(InfrastructureError):  # a request that the template takes along
        started(client, "broken")
    assert [started(client, "broken")[1]["parent"] for _ in range(2)] == [server.pid] * 2


def test_the_least_recently_used_of_too_many_templates_ends(client: ForkServerClient) -> None:
    templates = [started(client, str(number))[1]["template"] for number in range(MOST_TEMPLATES)]
    assert started(client, "0")[1]["template"] == templates[0]
    started(client, "one more")
    await_gone([templates[1]])
    assert all(map(is_running, [templates[0], *templates[2:]]))
    again = started(client, "1")[1]
    assert again["template"] == again["parent"] != templates[1]


def test_a_template_that_has_to_end_waits_for_its_processes(client: ForkServerClient) -> None:
    process, seen = started(client, "linger")
    for number in range(MOST_TEMPLATES):
        started(client, str(number))
    assert is_running(seen["template"]) and is_running(seen["pid"])
    process.kill()
    assert process.wait(600) == -signal.SIGKILL
    await_gone([seen["template"]])


def test_templates_end_with_a_killed_server(server: ForkServer, client: ForkServerClient) -> None:
    _, seen = started(client, "linger")
    os.kill(server.pid, signal.SIGKILL)
    await_gone([seen["template"], seen["pid"]])


def test_templates_end_with_a_closed_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([FUNCTIONS]) as server, closing(server.client()) as client:
        template = started(client, "a")[1]["template"]
    await_gone([template])
