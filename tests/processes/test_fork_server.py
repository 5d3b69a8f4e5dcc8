"""Modules and workers as forks of one process: each behaves like a new process, and no process is left behind."""

import json
import os
import signal
import socket
import subprocess
import sys
import textwrap
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from lingjing.errors import InfrastructureError
from lingjing.processes import fork_server, kept_results
from lingjing.processes.fork_client import ForkedProcess, ForkServer
from tests.kernel.test_world_process import ROOT, await_gone, is_running, open_descriptors

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

MODULE = "tests.processes.forked_module"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ForkServer]:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer(["numpy.random", "lingjing.kernel.world.inline"]) as server:
        yield server


def started(server: ForkServer, folder: Path, *arguments: str, stdin: str = "") -> tuple[ForkedProcess, Path]:
    output = folder / f"out-{len(list(folder.iterdir()))}"
    (folder / "in").write_text(stdin)
    with (folder / "in").open() as read, output.open("w") as written, (folder / "err").open("w") as errors:
        process = server.run_module(MODULE, arguments, (read.fileno(), written.fileno(), errors.fileno()))
    return process, output


def first_line(output: Path) -> str:
    while "\n" not in output.read_text():
        time.sleep(0.02)
    return output.read_text().splitlines()[0]


def test_a_forked_module_has_the_environment_of_a_new_interpreter(
    server: ForkServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MARK", "set after the server was started")
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.chdir(tmp_path)
    environments = []
    for _ in range(2):
        process, output = started(server, tmp_path, "environment", "-x", "y z", stdin="a line")
        assert process.wait(600) == 7
        assert process.poll() == 7
        process.close()
        environments.append(json.loads(output.read_text()))
        assert (tmp_path / "err").read_text() == "an aside\n"
    first, second = environments
    assert first["arguments"] == ["-x", "y z"]
    assert first["folder"] == str(tmp_path) not in first["path"]  # a file there would hide an installed package
    assert (first["mark"], first["threads_of_openmp"]) == ("set after the server was started", "3")
    assert first["input"] == "a line"
    assert first["descriptors"] == 5  # its streams, the way to the server, and the listing
    assert first["group"]
    assert first["server_played"] == []
    assert not set(first["random"]) & set(second["random"])


def test_worlds_of_forked_workers_are_those_of_started_ones(server: ForkServer, tmp_path: Path) -> None:
    cameras = set()
    for _ in range(2):
        process, output = started(server, tmp_path, "worlds")
        assert process.wait(600) == 0, (tmp_path / "err").read_text()
        process.close()
        for seen in json.loads(output.read_text()):
            assert seen["same"]
            assert set(seen["parents"]) == {server.pid}
            world, camera = seen["workers"]
            await_gone([world])
            cameras.add(camera)
    assert len(cameras) == 1, "a camera process outlives its episode and draws for the next one"
    assert is_running(cameras.pop())


def test_many_episodes_leave_no_process_and_no_descriptor_open(server: ForkServer, tmp_path: Path) -> None:
    def play() -> None:
        process, _ = started(server, tmp_path, "worlds")
        assert process.wait(600) == 0, (tmp_path / "err").read_text()
        process.close()

    play()
    ours = open_descriptors()
    for _ in range(2):
        play()
    assert open_descriptors() == ours
    at_rest = (1, {"[pidfd]": 1, "socket": 3})  # the camera process; its end, the listener of its end, and the caller
    while (counts := held(server.pid)) != at_rest:  # waits until the test's time limit if a descriptor stays open
        assert counts[0] >= 1
        time.sleep(0.02)


def held(pid: int) -> tuple[int, dict[str, int]]:
    """Return the number of child processes, and of descriptors of processes and sockets beside the streams."""
    kinds: Counter[str] = Counter()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        with suppress(OSError):  # closed meanwhile
            kind = str(entry.readlink()).removeprefix("anon_inode:").partition(":")[0]
            kinds[kind] += int(entry.name) > 2 and kind in ("[pidfd]", "socket")
    return len(Path(f"/proc/{pid}/task/{pid}/children").read_text().split()), {k: n for k, n in kinds.items() if n}


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_module_ends_its_world_and_reports_its_signal(
    server: ForkServer, tmp_path: Path, number: signal.Signals
) -> None:
    process, output = started(server, tmp_path, "lingering")
    workers = json.loads(first_line(output))
    os.kill(process.pid, number)
    assert process.wait(600) == -number
    await_gone(workers[:1])
    camera = 0
    while camera != workers[1]:  # handed over as soon as it is idle
        assert is_running(workers[1])
        again, output = started(server, tmp_path, "lingering")
        camera = json.loads(first_line(output))[1]
        again.kill()
        assert again.wait(600) == -signal.SIGKILL


def test_the_end_of_a_killed_world_is_reported_to_its_module(server: ForkServer, tmp_path: Path) -> None:
    process, output = started(server, tmp_path, "lingering")
    os.kill(json.loads(first_line(output))[0], signal.SIGKILL)
    assert process.wait(600) == 3
    assert output.read_text().splitlines()[1].startswith("the world process died (SIGKILL)")


def test_a_stopped_world_ends_with_the_module_that_requested_it(server: ForkServer, tmp_path: Path) -> None:
    """A stopped world cannot see the end of its socket; the server sees the end of the module."""
    process, output = started(server, tmp_path, "lingering")
    world, camera = json.loads(first_line(output))
    for pid in (world, camera):
        os.kill(pid, signal.SIGSTOP)
    process.kill()
    process.wait(600)
    await_gone([world])


def test_all_processes_end_with_a_killed_server(server: ForkServer, tmp_path: Path) -> None:
    process, output = started(server, tmp_path, "lingering")
    workers = json.loads(first_line(output))
    os.kill(server.pid, signal.SIGKILL)
    assert process.wait(600) == ForkedProcess.LOST
    await_gone([*workers, process.pid])
    with pytest.raises(InfrastructureError, match="the process that starts others has ended"):
        started(server, tmp_path, "environment")


def test_no_process_outlives_a_killed_caller(tmp_path: Path) -> None:
    code = f"""
        import sys
        sys.path.insert(0, {ROOT!r})
        from pathlib import Path
        from lingjing.processes.fork_client import ForkServer
        from tests.processes.test_fork_server import first_line, started
        server = ForkServer([])
        process, output = started(server, Path({str(tmp_path)!r}), "lingering")
        print(server.pid, process.pid, *eval(first_line(output)), flush=True)
        process.wait()
    """
    caller = subprocess.Popen([sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, text=True)
    assert caller.stdout is not None
    pids = [int(word) for word in caller.stdout.readline().split()]
    assert len(pids) == 4
    assert all(is_running(pid) for pid in pids)
    caller.kill()
    caller.wait()
    await_gone(pids)


def test_an_interrupt_signal_does_not_end_the_server(server: ForkServer, tmp_path: Path) -> None:
    for _ in range(2):
        process, _ = started(server, tmp_path, "environment")
        assert process.wait(600) == 7
        os.kill(server.pid, signal.SIGINT)


def test_a_server_with_a_second_thread_forks_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "threaded.py").write_text(
        "import threading, time\nthreading.Thread(target=time.sleep, args=(600,)).start()"
    )
    with (
        ForkServer(["threaded"]) as server,
        pytest.raises(InfrastructureError, match="has ended, or cannot start more"),
    ):
        started(server, tmp_path, "environment")


def test_a_server_terminated_during_an_import_ends_without_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: the signal of the caller's end interrupted an import, and a traceback was printed."""
    (tmp_path / "lasting.py").write_text("import signal\nprint('importing', flush=True)\nsignal.pause()\n")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), ROOT]))
    ends = socket.socketpair()
    command = [sys.executable, "-m", "lingjing.processes.fork_server", "--fd", str(ends[1].fileno())]
    server = subprocess.Popen(
        [*command, "--parent", str(os.getpid()), "lasting"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, pass_fds=(ends[1].fileno(),),
    )  # fmt: skip
    assert server.stdout is not None and server.stdout.readline() == "importing\n"
    server.terminate()
    assert server.communicate() == ("", "")
    for end in ends:
        end.close()


def test_a_second_termination_signal_does_not_interrupt_the_shutdown() -> None:
    """Regression: a second signal, or one after the socket was closed, interrupted the end of the forks."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(fork_server._CallerEndedError):
            fork_server._end(signal.SIGTERM, None)
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize(
    ("raised", "last_line"),
    [
        (
            "OSError(5, 'Input/output error', 'a')",
            "this process cannot go on: the system refuses `a`: Input/output error",
        ),
        ("UsageError('no')", "this process cannot go on: no"),
        ("ValueError('no')", "ValueError: no"),
    ],
)
def test_the_error_of_a_fork_that_cannot_begin_is_printed(raised: str, last_line: str) -> None:
    program = f"""
from lingjing.errors import UsageError
from lingjing.processes.becoming import end_after
def work():
    raise {raised}
end_after(work)
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == last_line
    assert ("Traceback" in done.stderr) == raised.startswith("ValueError")


def run_keeping(server: ForkServer, folder: Path, result: str) -> str:
    """Run a module that prints the kept result and keeps another one."""
    process, output = started(server, folder, "keeping", result)
    assert process.wait(600) == 0, (folder / "err").read_text()
    process.close()
    kept: str = json.loads(output.read_text())
    return kept


@pytest.fixture
def no_results(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_results, "_results", {})


@pytest.mark.usefixtures("no_results")
def test_later_modules_find_the_results_of_earlier_ones(server: ForkServer, tmp_path: Path) -> None:
    assert [run_keeping(server, tmp_path, result) for result in ("one", "two", "three")] == ["", "one", "two"]
    assert kept_results.find_result(b"key") is None


@pytest.mark.usefixtures("no_results")
def test_the_caller_keeps_results_for_itself_and_for_its_modules(server: ForkServer, tmp_path: Path) -> None:
    client = server.client()
    client.keep_result(b"key", b"from the caller")
    client.close()
    assert kept_results.find_result(b"key") == b"from the caller"
    assert run_keeping(server, tmp_path, "one") == "from the caller"


@pytest.mark.usefixtures("no_results")
def test_the_number_and_the_size_of_results_are_limited() -> None:
    for number in range(kept_results.MOST_RESULTS + 1):
        kept_results.keep_result(b"%d" % number, b"x")
    assert kept_results.find_result(b"0") is None and kept_results.find_result(b"1") == b"x"
    kept_results.keep_result(b"large", bytes(kept_results.MOST_BYTES))
    assert kept_results.find_result(b"large") is None and kept_results.find_result(b"1") == b"x"
