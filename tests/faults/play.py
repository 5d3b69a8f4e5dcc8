"""Plays a command with a planted fault, in a fork of a process that has imported all it needs.

`FaultPlayer` is the process that forks. A fork server that a command starts is a fork of it too, so that nothing is
imported anew. A case takes 0.15 to 1 s of processor time.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import resource
import runpy
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import NoReturn

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "injector"))
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(HERE / "injector"), os.environ.get("PYTHONPATH", "")]))

sys.modules.pop("sitecustomize", None)  # Debian's Python has one of its own, which is loaded by now
import sitecustomize as injector  # noqa: E402 - the folder above

from lingjing import pin  # noqa: E402
from tests.faults.cases import Aftermath, Injection  # noqa: E402

pin()  # before numpy is imported by what plays or judges

LONGEST_S = 600.0
"""Seconds after which a case counts as one that hangs."""

PR_SET_CHILD_SUBREAPER = 36
IMPORTED = (
    "lingjing.cli.bench", "lingjing.bench.running", "lingjing.bench.planning", "lingjing.bench.parquet",
    "lingjing.bench.tables", "lingjing.engines.vessel.engine", "lingjing.play.preparation",
    "lingjing_agents.react.policy", "lingjing_agents.plugin",
)  # fmt: skip


def descendants() -> dict[int, str]:
    """The children of this process, to which orphans are handed, and theirs: pid and command line."""
    parents: dict[int, int] = {}
    for item in Path("/proc").iterdir():
        if item.name.isdigit():
            try:
                words = (item / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if words[0] not in "ZX":
                parents[int(item.name)] = int(words[1])
    pids, fresh = set(), {os.getpid()}
    while fresh:
        fresh = {pid for pid, parent in parents.items() if parent in fresh and pid not in pids}
        pids |= fresh
    shown = {}
    for pid in pids:
        try:
            shown[pid] = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()[:200]
        except OSError:
            continue
    return shown


def reap() -> None:
    """Take the exit statuses of orphans that were handed to this process."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass


def planted(case: Injection) -> str:
    """A case as the injector reads it."""
    if not case.kind:
        return ""
    names = ("kind", "place", "number", "error", "lasting")
    return json.dumps({name: getattr(case, name) for name in names})


def take_streams() -> None:
    """Standard streams on descriptors 0 to 2, and the signals as an interpreter has them at its start."""
    signal.set_wakeup_fd(-1)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGCHLD):
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
    sys.stdin, sys.stdout, sys.stderr = (
        open(number, mode, closefd=False, buffering=1 if number else -1)  # noqa: SIM115 - to the end
        for number, mode in enumerate("rww")
    )
    sys.__stdout__, sys.__stderr__ = sys.stdout, sys.stderr


_fork_exec = subprocess._fork_exec  # type: ignore[attr-defined]
_FORK_SERVER = "lingjing.processes.fork_server"


def fork_server_or_program(*arguments: object) -> int:
    """Start a program in place of `subprocess._fork_exec`. A fork server begins as a fork of this process, which has
    imported all it needs; any other program starts as usual."""
    words = [os.fsdecode(word) for word in arguments[0]]  # type: ignore[attr-defined]
    if _FORK_SERVER not in words:
        return int(_fork_exec(*arguments))
    pid = injector.real_fork()
    if pid == 0:
        _become_fork_server(words, *arguments[3:14])  # type: ignore[arg-type]
    return pid


def _become_fork_server(
    words: list[str], passed: Iterable[int], _folder: object, variables: list[bytes], *pipes: int
) -> NoReturn:
    code = 1
    try:
        injector.become("server")
        os.setpgid(0, 0)
        for number, descriptor in ((0, pipes[0]), (1, pipes[3]), (2, pipes[5])):
            if descriptor >= 0:
                os.dup2(descriptor, number)
        first = 3
        for descriptor in sorted(set(passed) - {pipes[-1]}):  # the last one reports a failed `exec`
            os.closerange(first, descriptor)
            first = descriptor + 1
        os.closerange(first, 1024)
        os.environ.clear()
        os.environb.update(variable.split(b"=", 1) for variable in variables)
        take_streams()
        at = words.index(_FORK_SERVER)
        sys.argv = words[at:]
        runpy.run_module(_FORK_SERVER, run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as left:
        if isinstance(left.code, str):
            print(left.code, file=sys.stderr)
        code = left.code if isinstance(left.code, int) else 1
    finally:
        with contextlib.suppress(OSError):
            sys.stderr.flush()
        os._exit(code)


class FaultPlayer:
    """Forks a process for each case. Everything that a case may write lies in a folder of its own."""

    def __init__(self, spared: tuple[int, ...] = ()) -> None:
        self._spared = spared
        from lingjing.play.parallel import ENGINE_MODULES, PLAYED_WITH
        from lingjing.play.policy_processes.preloading import SERVES
        from lingjing.play.sharing import share

        for module in (*PLAYED_WITH, *SERVES, *ENGINE_MODULES, *IMPORTED):
            import_module(module)
        share(json.dumps({"options": {"mission": str(HERE / "trip.ljs")}, "repeated": False}))
        import_module("lingjing.bench.version").benchmark_version()  # each suite would compute both, in 1 s
        import_module("lingjing.bench.rows").code_sha256(())
        gc.collect()
        gc.freeze()
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
        subprocess._fork_exec = fork_server_or_program  # type: ignore[attr-defined]
        injector.install()

    def play(self, case: Injection, arguments: list[str], cache: Path) -> tuple[Aftermath, Path]:
        """Play a command line with the fault planted; the folder it ran in is the caller's to remove."""
        folder = Path(tempfile.mkdtemp(prefix="lingjing-faults-"))
        for name in ("work", "tmp"):
            (folder / name).mkdir()
        (folder / "count").write_bytes(bytes(injector.SLOT.size))
        (folder / "log").touch()
        shutil.copytree(cache, folder / "cache")
        pid = os.fork()
        if pid == 0:
            self._become(case, arguments, folder)
        code = self._wait(pid)
        orphans = self._end_orphans()
        written = (item for name in ("work", "tmp", "cache") for item in (folder / name).rglob("*"))
        return Aftermath(
            code=code,
            output=(folder / "out").read_text(errors="replace"),
            errors=(folder / "err").read_text(errors="replace"),
            calls=(folder / "log").read_text(errors="replace").splitlines(),
            orphans=orphans,
            left=sorted(str(item.relative_to(folder)) for item in written),
        ), folder

    def _become(self, case: Injection, arguments: list[str], folder: Path) -> None:
        code = 97
        try:
            os.setsid()
            for number, name in ((1, "out"), (2, "err")):
                descriptor = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
                os.dup2(descriptor, number)
                os.close(descriptor)
            null = os.open(os.devnull, os.O_RDONLY)
            os.dup2(null, 0)
            os.closerange(3, 1024)
            os.chdir(folder / "work")
            take_streams()
            tempfile.tempdir = None
            os.environ.update(
                XDG_CACHE_HOME=str(folder / "cache"), TMPDIR=str(folder / "tmp"), HOME=str(folder / "tmp"),
                XDG_RUNTIME_DIR=str(folder / "tmp"), LINGJING_FAULT=planted(case),
                LINGJING_FAULT_COUNT=str(folder / "count"), LINGJING_FAULT_LOG=str(folder / "log"),
            )  # fmt: skip
            sys.argv = ["lingjing", *arguments]
            from lingjing.cli.main import main

            injector.become("command")
            injector.arm(dict(os.environ))
            code = main()
        except SystemExit as left:
            code = left.code if isinstance(left.code, int) else 1
        except BaseException:
            import traceback

            traceback.print_exc()
            code = 98
        finally:
            for stream in (sys.stdout, sys.stderr):
                try:
                    stream.flush()
                except (OSError, ValueError):
                    code = code or 99
            os._exit(code)

    def _wait(self, pid: int) -> int:
        end = time.monotonic() + LONGEST_S
        while time.monotonic() < end:
            done, status = os.waitpid(pid, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.01)
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        return -1000

    def _end_orphans(self) -> list[str]:
        """The processes that run on a minute after the command; they are killed."""
        for _ in range(3000):
            reap()
            if not (alive := {pid: line for pid, line in descendants().items() if pid not in self._spared}):
                return []
            time.sleep(0.02)
        for pid in alive:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        reap()
        return list(alive.values())


def processor_s() -> float:
    """Processor seconds of this process and all that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in used)
