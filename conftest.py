"""Settings for every test. Hypothesis tries the same examples everywhere and without a time limit, because a loaded
machine is slow without being wrong. Signals are delivered, even in tests that a shell runs in its background or under
`nohup`, where its children ignore them. Numerical libraries are pinned before anything loads them.
Compiled modules are kept: the suite starts a thousand interpreters, and without its `.pyc` files each compiles 400
modules, one second of CPU.

Processes that this project starts are forks of one that has imported it, except in tests of processes.

Files with slow tests come first, so that no worker is left with one when the others have nothing more to do.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

from lingjing.numerics import pin

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

pin()  # as the command line does, before anything loads numpy

for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

settings.register_profile("lingjing", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("lingjing")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files in which a test is marked `slow` first, otherwise in their order."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection() -> None:
    """Collect no garbage while tests are collected: almost all objects remain, and walking them takes 1.5 s."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Keep the collected tests out of garbage collections. They are half a million objects, and a collection that walks
    them takes a quarter of a second. Afterwards collect at every ten thousandth object: at every 700th, as Python does,
    collections took a tenth of the processor time of tests that compile and play (measured).
    """
    gc.enable()
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)


@pytest.fixture(scope="session", autouse=True)
def entry_points_are_read_once() -> None:
    """Read the installed plug-ins once. Each of thousands of hosts would read the metadata of all distributions, which
    takes 6 ms. A test that installs a plug-in changes Python's path, and then they are read again.
    """
    from lingjing.installed_plugins.entry_points import hold_entries

    hold_entries()


@pytest.fixture(scope="session", autouse=True)
def workers_are_forks() -> Iterator[None]:
    """Fork the processes of worlds, policies and branches that tests start in this process, on Linux."""
    from tools.python_forks import forked_starts

    with forked_starts() if sys.platform == "linux" else contextlib.nullcontext():
        yield


@pytest.fixture(scope="module")
def workers_are_interpreters() -> Iterator[None]:
    """Start the processes of worlds, policies and branches as a user does, for tests of their start and end."""
    from tools.python_forks import true_starts

    with true_starts():
        yield


@pytest.fixture
def workers_are_interpreters_once(workers_are_forks: None) -> Iterator[None]:
    """Do the same for one test."""
    from tools.python_forks import true_starts

    with true_starts():
        yield
