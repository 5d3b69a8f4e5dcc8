"""Tests of the system calls, which only `lingjing.processes` may make."""

import ast
import os
import random
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from lingjing.processes.linux import SeveralThreadsError, fork, run_in_fork, thread_count

ROOT = Path(__file__).parents[2]
PROCESSES = ROOT / "lingjing" / "processes"

ALONE = {"fork", "forkpty", "prctl", "sendmsg", "recvmsg", "recv_fds", "send_fds", "waitstatus_to_exitcode"}
"""Calls that start a process without an interpreter, set what the kernel does at the end of one, or frame messages."""


def calls(path: Path) -> Iterator[str]:
    """The names of the calls in a module, and the texts that may be code of another interpreter."""
    text = path.read_text(encoding="utf-8")
    if not any(name in text for name in ALONE):
        return
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Call(func=ast.Attribute(value=ast.Name(id="os" | "socket"), attr=name)):
                yield name
            case ast.Call(func=ast.Attribute(attr=("prctl" | "sendmsg" | "recvmsg") as name)):
                yield name
            case ast.Constant(value="prctl"):  # looked up in the C library
                yield "prctl"
            case ast.Constant(value=str(code)) if "os.fork(" in code:
                yield "fork"


def test_only_one_package_forks_and_frames_messages() -> None:
    files = [file for tree in ("lingjing", "agents/lingjing_agents") for file in (ROOT / tree).rglob("*.py")]
    elsewhere = {
        f"{file.relative_to(ROOT)}: {name}"
        for file in files
        if not file.is_relative_to(PROCESSES)
        for name in calls(file)
        if name in ALONE
    }
    assert elsewhere == set()
    assert {name for file in PROCESSES.glob("*.py") for name in calls(file)} >= {"fork", "prctl", "sendmsg", "recv_fds"}


def test_a_process_with_a_second_thread_is_not_forked() -> None:
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        with pytest.raises(SeveralThreadsError, match=r"has \d+ threads and cannot be forked") as caught:
            fork()
    finally:
        done.set()
        thread.join()
    assert caught.value.count >= 2


def test_run_in_fork_returns_bytes_or_empty_bytes_after_an_exception() -> None:
    assert run_in_fork(lambda: b"answer") == b"answer"
    assert run_in_fork(lambda: bytes([1 // 0])) == b""


def test_a_fork_continues_the_random_stream_only_if_requested() -> None:
    def drawn(keep: bool) -> bytes:
        assert thread_count() == 1  # a fork has the calling thread alone
        state = random.getstate()
        expected = random.random()
        random.setstate(state)

        def in_second_fork() -> bytes:
            reading, writing = os.pipe()
            if fork(keep_random=keep) == 0:
                os.write(writing, b"same" if random.random() == expected else b"other")
                os._exit(0)
            os.close(writing)
            return os.read(reading, 16)

        return in_second_fork()

    assert run_in_fork(lambda: drawn(True)) == b"same"
    assert run_in_fork(lambda: drawn(False)) == b"other"
