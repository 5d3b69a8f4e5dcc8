"""What holds for every test: hypotheses are tried with the same examples everywhere and without a clock, for what a
loaded machine takes longer for is not wrong; and signals are heard, even in tests that a shell runs in its background
or under `nohup`, where its children ignore them. Numerical libraries are pinned before anything loads them.
Compiled modules are kept: the suite starts a thousand interpreters, and without its `.pyc` files each compiles 400
modules, one second of CPU.

Files with slow tests come first, so that no worker is left with one when the others have nothing more to do.
"""

from __future__ import annotations

import os
import signal
import sys

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
