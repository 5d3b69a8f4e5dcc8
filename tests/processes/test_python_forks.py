"""A fork of `tools.python_forks` does what a started interpreter does."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lingjing.processes.fork_client import ForkServer
from tools.python_forks import WORKERS, PipedFork, forked_starts, run_python, true_starts

BOATS = Path(__file__).parents[1] / "cli" / "boats.ljs"
LINGJING = (sys.executable, "-m", "lingjing.cli.main")

CODES = [
    "import sys; print(sys.argv); print(sys.stdin.read())",
    "import sys; sys.exit(7)",
    "import sys; sys.exit()",
    "import sys; sys.exit('a word')",
    "import sys; sys.exit(300)",
    "1 / 0",
    "def broken(:",
    "raise KeyboardInterrupt",
    "import os; os.kill(os.getpid(), 9)",
    "import os; os.abort()",
    "import os; print(os.getcwd(), sorted(os.environ.items()))",
    "import sys; print(sys.path)",
    "import sys; print('out'); print('err', file=sys.stderr); print('é\\udcff', file=sys.stderr)",
    "import sys; print(sys.stdout.isatty(), sys.stdin.isatty(), sys.stdout.encoding, sys.stdout.line_buffering)",
    "import atexit; atexit.register(print, 'last'); print('first')",
    "import threading, time; threading.Thread(target=lambda: (time.sleep(0.1), print('thread'))).start()",
    "import signal; print([signal.getsignal(n) for n in (signal.SIGINT, signal.SIGPIPE, signal.SIGTERM)])",
    "import os; print(sorted(map(int, os.listdir('/proc/self/fd')))[:3])",
    "print(__name__, globals().get('__file__'), __spec__)",
    "import sys; print(sys.modules['__main__'].__dict__ is globals())",
]
"""Codes. Their output and exit code are the same in every interpreter."""


def started(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("flags", [(), ("-P",)], ids=["", "-P"])
def test_a_fork_ends_and_prints_as_an_interpreter(flags: tuple[str, ...], code: str, tmp_path: Path) -> None:
    command = [sys.executable, *flags, "-c", code, "an argument"]
    variables = {**os.environ, "PYTHONPATH": str(tmp_path), "OF_THE_TEST": "1"}
    fork = run_python(command, cwd=tmp_path, env=variables, input="given")
    true = started(command, cwd=tmp_path, env=variables, input="given")
    errors = [re.sub(r"\n {4}.*", "", text) for text in (fork.stderr, true.stderr)]  # Python 3.13 shows lines of `-c`
    assert (fork.returncode, fork.stdout, errors[0]) == (true.returncode, true.stdout, errors[1])


@pytest.mark.parametrize(
    "arguments",
    [("-m", "own", "x"), ("-m", "own.part"), ("-m", "json.tool", "data.json"), ("-m", "lingjing.cli.main", "fmt", "-")],
)
def test_a_module_runs_as_with_an_interpreter(arguments: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "__init__.py").write_text("")
    text = "import sys\nprint(sys.argv, __name__, __file__, __package__, __spec__.name, sys.path[0])\n"
    (tmp_path / "own" / "__main__.py").write_text(text)
    (tmp_path / "own" / "part.py").write_text(text)
    (tmp_path / "data.json").write_text("{}")
    command = [sys.executable, *arguments]
    fork, true = run_python(command, cwd=tmp_path, input="ljs   1\n"), started(command, cwd=tmp_path, input="ljs   1\n")
    assert (fork.returncode, fork.stdout, fork.stderr) == (true.returncode, true.stdout, true.stderr)
    assert fork.stdout


def test_a_module_that_is_missing_is_named() -> None:
    done = run_python([sys.executable, "-m", "no_such_module"])
    assert (done.returncode, done.stderr) == (1, f"{sys.executable}: No module named no_such_module\n")


def test_other_commands_are_refused() -> None:
    for command in (["true"], [sys.executable, "file.py"], [sys.executable, "-P", "file.py"]):
        with pytest.raises(ValueError, match="neither `python -m` nor"):
            run_python(command)
    with pytest.raises(subprocess.CalledProcessError):
        run_python([sys.executable, "-c", "1 / 0"], check=True)


def test_a_fork_beyond_its_time_is_killed(tmp_path: Path) -> None:
    code = f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(3600)"
    with pytest.raises(subprocess.TimeoutExpired):
        run_python([sys.executable, "-c", code], timeout=2.0)
    _wait_for_end(int((tmp_path / "pid").read_text() or 0) if (tmp_path / "pid").exists() else 0)


def test_episodes_have_the_digest_of_an_interpreter(tmp_path: Path) -> None:
    run = [*LINGJING, "run", str(BOATS), "--policy", "random", "--seed", "3", "--no-overview", "--json", "-o"]
    fork, true = run_python([*run, "a"], cwd=tmp_path), started([*run, "b"], cwd=tmp_path)
    assert (fork.returncode, true.returncode) == (0, 0)
    assert json.loads(fork.stdout)["digest"] == json.loads(true.stdout)["digest"]


def test_a_worker_is_a_fork_unless_a_test_requests_an_interpreter() -> None:
    for is_true in (False, True):
        with true_starts() if is_true else forked_starts(), ForkServer(["json"]) as server:
            words = _command_line(server.pid)
            assert (words[-1] == "json") == is_true
            assert words[3] in WORKERS


def _command_line(pid: int) -> list[str]:
    while not (line := Path(f"/proc/{pid}/cmdline").read_text()):  # empty while the system loads the program
        time.sleep(0.01)
    return line.rstrip("\0").split("\0")


def test_a_fork_ends_with_the_process_that_requested_it(tmp_path: Path) -> None:
    code = (
        "import os, sys, time\nfrom tools.python_forks import run_python\n"
        "inner = 'import os, sys, time; print(os.getpid(), file=open(sys.argv[1], \"w\")); time.sleep(3600)'\n"
        "run_python([sys.executable, '-c', inner, sys.argv[1]])\n"
    )
    outer = subprocess.Popen([sys.executable, "-c", code, str(tmp_path / "pid")])
    try:
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text().endswith("\n"):
            assert outer.poll() is None
            time.sleep(0.05)
    finally:
        outer.kill()
        outer.wait()
    _wait_for_end(int((tmp_path / "pid").read_text()))


def _wait_for_end(pid: int) -> None:
    while pid and Path(f"/proc/{pid}").exists():
        time.sleep(0.05)


def test_a_piped_fork_gives_lines_then_both_outputs_and_the_exit_code(tmp_path: Path) -> None:
    long = "x" * 200_000  # more than a pipe holds
    code = f"import sys; print('begun', flush=True); print('{long}'); print('{long}', file=sys.stderr); sys.exit(3)"
    process = PipedFork([sys.executable, "-c", code], cwd=tmp_path)
    assert process.stdout.readline() == "begun\n"
    assert process.communicate(60.0) == (f"{long}\n", f"{long}\n")
    assert process.returncode == process.poll() == 3


def test_a_piped_fork_is_waited_for_and_killed() -> None:
    process = PipedFork([sys.executable, "-c", "import time; time.sleep(600)"])
    with pytest.raises(subprocess.TimeoutExpired):
        process.communicate(0.1)
    assert process.poll() is None
    process.kill()
    assert process.wait(60.0) == -9
