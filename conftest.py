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
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import settings

from lingjing.numerics import pin

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

pin()  # as the command line does, before anything loads numpy

for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

# Examples follow the test alone. Hypothesis would also take them from the constants of all modules that are imported at
# the time, which differ with the tests that ran before, and would read 1,100 modules for it (10 s in a fresh clone
# on a busy machine).
with contextlib.suppress(ImportError):  # an earlier hypothesis takes none
    from hypothesis.internal.conjecture import providers
    from hypothesis.internal.constants_ast import Constants

    providers._get_local_constants = Constants

settings.register_profile("lingjing", deadline=None, derandomize=True, print_blob=True)
settings.load_profile("lingjing")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files in which a test is marked `slow` first, otherwise in their order."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


_OUTCOMES = (pytest.skip.Exception, pytest.fail.Exception, pytest.xfail.Exception)
"""Exceptions of pytest that a module may raise as it is imported. They are no subclasses of `Exception`."""


def pytest_collection(session: pytest.Session) -> None:
    """Collect no garbage while tests are collected: almost all objects remain, and walking them takes 1.5 s.

    In a fresh clone pytest compiles 600 modules of tests, in 14 s on a busy machine. Each worker begins with other
    modules and reads later what the others have compiled.
    """
    gc.disable()
    number = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    if number.isdigit() and session.config.args == session.config.getini("testpaths"):
        share = int(number) / int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        _import_tests(session.config.rootpath, session.config.args, share)


def _import_tests(root: Path, folders: list[str], first: float) -> None:
    """Import the modules of tests in folders, beginning at a share of them. Collection reports those that fail."""
    modules = sorted(path for folder in folders for path in (root / folder).rglob("test_*.py"))
    begin = int(len(modules) * first)
    for path in (*modules[begin:], *modules[:begin]):
        if not (path.parent / "__init__.py").exists():  # pytest names modules of packages otherwise
            with contextlib.suppress(Exception, *_OUTCOMES):
                import_module(".".join(path.relative_to(root).with_suffix("").parts))


def pytest_collection_finish() -> None:
    """Keep the collected tests out of garbage collections. They are half a million objects, and a collection that walks
    them takes a quarter of a second. Afterwards collect at every ten thousandth object: at every 700th, as Python does,
    collections took a tenth of the processor time of tests that compile and play (measured).
    """
    gc.enable()
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
