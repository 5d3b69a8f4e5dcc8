"""Types are built under one lock, so that threads may use them for the first time together."""

from __future__ import annotations

import os
import subprocess
import sys

import msgspec
import pytest

from lingjing.decoding import converted, from_json, from_msgpack

THREADS = """
import threading
from lingjing.dsl.loading.load import load_mission
together = threading.Barrier(4)
def load():
    together.wait()
    assert load_mission("ssr").name == "ssr"
threads = [threading.Thread(target=load) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_four_threads_load_a_mission_at_once() -> None:
    warm = "from lingjing.dsl.loading.load import load_mission; load_mission('ssr')"  # so that all four read the cache
    subprocess.run([sys.executable, "-c", warm], check=True)
    for _ in range(3):  # without the lock eleven of twelve runs died of a segmentation fault
        done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


class Box(msgspec.Struct, frozen=True):
    width: int
    inner: Box | None = None


def test_values_have_their_types_and_errors_are_those_of_msgspec() -> None:
    box = Box(1, Box(2))
    assert from_json(msgspec.json.encode(box), Box) == box
    assert from_msgpack(msgspec.msgpack.encode(box), Box) == box
    assert converted({"width": 1, "inner": {"width": 2}}, Box) == box
    assert from_json(b"[1]") == [1] and from_json(b'"3"', int, strict=False) == 3
    with pytest.raises(msgspec.ValidationError, match="Expected `int`, got `str`"):
        from_json(b'{"width": "1"}', Box)


def test_a_fork_can_build_types() -> None:
    child = os.fork()
    if child == 0:
        os._exit(0 if from_json(b"[[1]]", tuple[tuple[int, ...], ...]) == ((1,),) else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
