"""The building of the walls, by the process that will be behind them."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
from collections.abc import Callable

import msgspec

from lingjing.processes.linux import set_parent_death_signal
from lingjing.processes.walls.file_system import SCRATCH, SCRATCH_BYTES, enter_own_root
from lingjing.processes.walls.landlock import SCOPES_FROM, no_new_privileges, restrict
from lingjing.processes.walls.namespaces import AS_NOBODY, NEW_USER
from lingjing.processes.walls.report import Guard, WallReport
from lingjing.processes.walls.seccomp import filter_system_calls
from lingjing.processes.walls.system_calls import call, prctl

_NEW_NETWORK, _NEW_IPC, _NEW_NAMES, _NEW_CONTROL_GROUPS = 0x40000000, 0x08000000, 0x04000000, 0x02000000
"""`CLONE_NEWNET`, `CLONE_NEWIPC`, `CLONE_NEWUTS` and `CLONE_NEWCGROUP` of linux/sched.h."""

_MOST_THREADS = 64
"""The most threads of one process. Chosen: numerical libraries use one for each processor."""
_MOST_DESCRIPTORS = 512
"""The most open files. Chosen: pictures need one each for a moment."""

_MOST_STACK = 64 << 20
"""The most memory of the first thread's stack, bytes, which RLIMIT_DATA does not count. Chosen: 8 times the usual."""
_MOST_ADDRESSES = 256 << 30
"""The most address space, bytes. Chosen: the kernel's tables of it are 512 MB at most, and libraries reserve less."""

_SET_DUMPABLE, _DROP_BOUNDING, _AMBIENT, _CLEAR_AMBIENT = 4, 24, 47, 4
"""`PR_SET_DUMPABLE`, `PR_CAPBSET_DROP`, `PR_CAP_AMBIENT`, `PR_CAP_AMBIENT_CLEAR_ALL` of linux/prctl.h."""
_CAPABILITY_VERSION = 0x20080522
"""`_LINUX_CAPABILITY_VERSION_3` of linux/capability.h."""
_MOST_CAPABILITIES = 64
"""The bits of a set of capabilities."""

DETAIL_IN_LANDLOCK_ALONE = "/dev/null"
"""A device that stays readable and writable where Landlock alone limits files."""


class Walls(msgspec.Struct, frozen=True, kw_only=True):
    """The walls of one process."""

    readable: tuple[str, ...]
    """The files and folders that it may read, absolute paths."""
    folder: str
    """Its working folder, absolute."""
    cpu_s: int
    """The most processor time, seconds."""
    strict: bool = False
    """True if the process must not go on with a broken promise."""
    without: tuple[Guard, ...] = ()
    """Guards to leave out, for a test of the others."""


class _Builder:
    """Builds one guard after the other, and notes which of them the system refuses."""

    def __init__(self, without: tuple[Guard, ...]) -> None:
        self.guards: list[Guard] = []
        self.refused: dict[Guard, str] = {}
        self._without = without

    def attempt(self, guard: Guard, build: Callable[[], object]) -> bool:
        """Build a guard. Returns False if it is not there."""
        if guard in self._without:
            return False
        try:
            build()
        except OSError as error:
            self.refused[guard] = str(error)
            return False
        self.guards.append(guard)
        return True


def enter(walls: Walls, *, has_namespaces: bool) -> WallReport:
    """Build the walls around this process, which has one thread. `has_namespaces`: its fork server has entered some.

    What the system refuses is left out and stands in the report.
    """
    builder, version = _Builder(walls.without), 0
    process = os.open("/proc/self", os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        if has_namespaces:
            builder.guards += ["user-namespace", "pid-namespace"]
            _enter_namespaces(walls, builder)
            builder.attempt("own-user", lambda: _become_own_user(process))
    finally:
        os.close(process)
    _limit(walls, threads="own-user" in builder.guards)
    _drop_capabilities()
    no_new_privileges()
    has_root = "mounts" in builder.guards

    def restrict_files() -> None:
        nonlocal version
        readable = ("/",) if has_root else (*walls.readable, "/dev/urandom", "/dev/random")
        version = restrict(readable, (SCRATCH, "/dev/null") if has_root else (DETAIL_IN_LANDLOCK_ALONE,))

    if builder.attempt("landlock", restrict_files) and version >= SCOPES_FROM:
        builder.guards.append("landlock-scopes")
    builder.attempt("seccomp", lambda: filter_system_calls(os.getpid(), marks=has_root))
    return WallReport(guards=tuple(builder.guards), landlock=version, refused=builder.refused)


def report_walls(argument: bytes, ends: tuple[int, ...]) -> None:
    """Build walls around this process and write the report as JSON into `ends`: the function of `offered_walls`."""
    walls = Walls(readable=(), folder="/", cpu_s=60)
    report = enter(walls, has_namespaces=os.getpid() == 1)
    os.write(ends[0], msgspec.json.encode(report))


def _enter_namespaces(walls: Walls, builder: _Builder) -> None:
    builder.attempt("network-namespace", lambda: call("unshare", _NEW_NETWORK))
    builder.attempt("ipc-namespace", lambda: call("unshare", _NEW_IPC))
    with contextlib.suppress(OSError):
        call("unshare", _NEW_NAMES | _NEW_CONTROL_GROUPS)
    builder.attempt("mounts", lambda: enter_own_root(walls.readable, walls.folder))


def _become_own_user(process: int) -> None:
    """Give up root if this process is root outside, and enter a user namespace in which threads are counted alone."""
    if os.getuid() == 0 and _is_mapped(process, AS_NOBODY):
        with contextlib.suppress(OSError):
            os.setgroups([])
        os.setresgid(AS_NOBODY, AS_NOBODY, AS_NOBODY)
        os.setresuid(AS_NOBODY, AS_NOBODY, AS_NOBODY)
        prctl(_SET_DUMPABLE, 1)  # else the files of this process in `/proc` belong to root
        set_parent_death_signal(0, signal.SIGKILL)  # a change of the user has cleared it
    user, group = os.getuid(), os.getgid()
    call("unshare", NEW_USER)
    for name, text in (("setgroups", "deny"), ("uid_map", f"0 {user} 1\n"), ("gid_map", f"0 {group} 1\n")):
        descriptor = os.open(name, os.O_WRONLY | os.O_CLOEXEC, dir_fd=process)
        try:
            os.write(descriptor, text.encode())
        finally:
            os.close(descriptor)


def _is_mapped(process: int, user: int) -> bool:
    """True if the user namespace of this process has a user with this number."""
    descriptor = os.open("uid_map", os.O_RDONLY | os.O_CLOEXEC, dir_fd=process)
    try:
        lines = os.read(descriptor, 4096).splitlines()
    finally:
        os.close(descriptor)
    ranges = [tuple(map(int, line.split())) for line in lines]
    return any(first <= user < first + count for first, _, count in ranges)


def _limit(walls: Walls, *, threads: bool) -> None:
    """Limit the resources that RLIMIT_DATA does not cover. `threads`: the threads of this process alone are counted."""
    limits = {
        resource.RLIMIT_CPU: walls.cpu_s,
        resource.RLIMIT_FSIZE: SCRATCH_BYTES,
        resource.RLIMIT_NOFILE: _MOST_DESCRIPTORS,
        resource.RLIMIT_MEMLOCK: 0,
        resource.RLIMIT_MSGQUEUE: 0,
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_STACK: _MOST_STACK,
        resource.RLIMIT_AS: _MOST_ADDRESSES,
    }
    if threads:
        limits[resource.RLIMIT_NPROC] = _MOST_THREADS
    for kind, value in limits.items():
        usual, most = resource.getrlimit(kind)
        value = value if most == resource.RLIM_INFINITY else min(value, most)
        is_lower = kind == resource.RLIMIT_STACK and 0 <= usual < value
        resource.setrlimit(kind, (usual if is_lower else value, value))


def _drop_capabilities() -> None:
    """Drop all capabilities, those of later programs included. Ones that the process lacks are no error."""
    with contextlib.suppress(OSError):
        prctl(_AMBIENT, _CLEAR_AMBIENT)
    for number in range(_MOST_CAPABILITIES):
        with contextlib.suppress(OSError):
            prctl(_DROP_BOUNDING, number)
    header = (ctypes.c_uint32 * 2)(_CAPABILITY_VERSION, 0)
    call("capset", ctypes.byref(header), ctypes.byref((ctypes.c_uint32 * 6)()))


__all__ = ["Walls", "enter", "report_walls"]
