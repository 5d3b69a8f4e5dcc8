"""The list of processes below this one, and their continuation."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing.processes.descendants import children, continue_stopped

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")

PARENT = """
import os, sys
if os.fork() == 0:
    print(os.getpid(), flush=True)
    sys.stdin.read()
    os._exit(0)
os.wait()
"""


def state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]


def test_stopped_descendants_are_continued() -> None:
    with subprocess.Popen([sys.executable, "-c", PARENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        below = int(child.stdout.readline())
        assert child.pid in children() and below not in children()
        for pid in (below, child.pid):
            os.kill(pid, signal.SIGSTOP)
        os.waitpid(child.pid, os.WUNTRACED)
        while state(below) != "T":
            pass
        continue_stopped()
        os.waitpid(child.pid, os.WCONTINUED)
        assert state(child.pid) != "T" and state(below) != "T"


def test_a_process_without_children_continues_nothing() -> None:
    code = "from lingjing.processes.descendants import children, continue_stopped as go; go(); print(children())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
