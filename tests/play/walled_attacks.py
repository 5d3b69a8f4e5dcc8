"""Policies that try to learn, keep or pass on what an honest policy cannot, for the tests of walls.

`Thief` runs every attack of `ATTACKS` and writes the results into its thought as JSON: a text that begins with `won` if
it reached something, else the error. No attack harms the machine that it succeeds on.
"""

import contextlib
import ctypes
import fcntl
import gc
import inspect
import json
import mmap
import os
import resource
import shutil
import signal
import socket
import struct
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from lingjing.plugins.policy import Decision

BOARD = []
"""A whiteboard of all agents with policies in one process."""

_library = ctypes.CDLL(None, use_errno=True)

FUTEX = {"x86_64": 202, "aarch64": 98}.get(os.uname().machine, -1)
"""The number of the system call."""

ATTACKS = {}


def attack(function):
    ATTACKS[function.__name__] = function
    return function


def found(value):
    assert value, "nothing found"
    return f"won: {value}"[:200]


def system(name, *arguments):
    result = getattr(_library, name)(*arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


# -- what the harness knows


@attack
def environment(config):
    return found(os.environ.get("LINGJING_TEST_KEY", ""))


@attack
def first_environment(config):
    return found("LINGJING_TEST_KEY" in Path("/proc/self/environ").read_text())


@attack
def secret_file(config):
    return found(Path(config["secret"]).read_text())


@attack
def trace_beside_the_mission(config):
    return found([str(path) for path in Path(config["folder"]).rglob("*.mcap*")])


@attack
def home(config):
    return found(Path.home().joinpath("secret").read_text() or os.listdir(config["home"]))


@attack
def passwords(config):
    return found(Path("/etc/passwd").read_text())


@attack
def link_out_of_the_scratch_folder(config):
    link = Path(tempfile.mkdtemp()) / "link"
    link.symlink_to("/etc/passwd")
    return found(link.read_text())


@attack
def truth_in_modules(config):
    from lingjing.mission.instance import Instance

    tables = [
        (name, value)
        for name, module in [*sys.modules.items()]
        for value in [*vars(module).values()]
        if isinstance(value, dict)
    ]
    return found([name for name, table in tables if any(isinstance(entry, Instance) for entry in table.values())])


@attack
def truth_in_the_collector(config):
    from lingjing.mission.instance import Instance

    return found([type(thing).__name__ for thing in gc.get_objects() if isinstance(thing, Instance)])


@attack
def truth_in_frames(config):
    frame, names = inspect.currentframe(), set()
    while frame is not None:
        names |= {name for name in frame.f_locals if name in ("kernel", "instance", "recorder", "barrier")}
        frame = frame.f_back
    for other in sys._current_frames().values():
        while other is not None:
            names |= {name for name in other.f_locals if name in ("kernel", "instance", "recorder", "barrier")}
            other = other.f_back
    return found(names)


# -- other processes


def others(config):
    """The parent; behind walls, where it has no number, every other process that has one."""
    return [os.getppid()] if config["open"] else [int(name) for name in os.listdir("/proc") if name in "23456789"]


@attack
def names_of_processes(config):
    return found([Path(f"/proc/{pid}/cmdline").read_text() for pid in others(config)])


@attack
def memory_of_the_parent(config):
    pid = others(config)[0]
    start = int(Path(f"/proc/{pid}/maps").read_text().split("-")[0], 16)
    with open(f"/proc/{pid}/mem", "rb") as memory:
        memory.seek(start)
        return found(memory.read(16))


@attack
def memory_by_system_call(config):
    pid, word = os.getppid() or 2, ctypes.create_string_buffer(8)
    start = int(Path(f"/proc/{pid}/maps").read_text().split("-")[0], 16)
    local = struct.pack("PP", ctypes.addressof(word), 8)
    remote = struct.pack("PP", start, 8)
    system("process_vm_readv", pid, local, ctypes.c_ulong(1), remote, ctypes.c_ulong(1), ctypes.c_ulong(0))
    return found("read")


@attack
def tracing_the_parent(config):
    seize, interrupt, detach, all_kinds = 0x4206, 0x4207, 17, 0x40000000
    system("ptrace", seize, os.getppid(), None, None)
    system("ptrace", interrupt, os.getppid(), None, None)  # only a stopped process can be left again
    os.waitpid(os.getppid(), all_kinds)
    system("ptrace", detach, os.getppid(), None, None)
    return found("attached")


@attack
def descriptors_of_others(config):
    links = []
    for pid in others(config):
        with contextlib.suppress(OSError):
            links += [os.readlink(f"/proc/{pid}/fd/{name}") for name in os.listdir(f"/proc/{pid}/fd")]
    return found(links)


@attack
def inherited_descriptors(config):
    kinds = []
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(FileNotFoundError):  # the listing's own descriptor
            kinds.append(os.readlink(f"/proc/self/fd/{name}"))
    strange = [kind for kind in kinds if not kind.startswith(("socket:", "pipe:", "anon_inode:", "/dev/null", "/proc"))]
    sockets = [kind for kind in kinds if kind.startswith("socket:")]
    return found(strange or sockets[4:])  # the two channels, and the pair of the event loop


@attack
def signals(config):
    os.kill(os.getppid() or 2, 0)
    return found("signalled")


@attack
def signals_to_all(config):
    os.kill(others(config)[0], 0)
    return found("signalled")


@attack
def limits_of_the_parent(config):
    pid = os.getppid() or 2
    return found(resource.prlimit(pid, resource.RLIMIT_NOFILE))


@attack
def priority_of_the_parent(config):
    return found(
        os.sched_getaffinity(others(config)[0]) and os.setpriority(os.PRIO_PROCESS, others(config)[0], 0) is None
    )


# -- memory and sockets with names


@attack
def shared_memory_by_name(config):
    return found(Path("/dev/shm", config["shared"]).read_bytes()[:6])


@attack
def system_v_memory(config):
    return found(system("shmget", config["shm_key"], 4096, 0) >= 0)


@attack
def loopback(config):
    with socket.create_connection(("127.0.0.1", config["port"]), 2.0):
        return found("connected")


@attack
def abstract_socket(config):
    with socket.socket(socket.AF_UNIX) as end:
        end.connect("\0" + config["abstract"])
        return found("connected")


@attack
def socket_in_a_folder(config):
    with socket.socket(socket.AF_UNIX) as end:
        end.connect(config["socket"])
        return found("connected")


@attack
def interfaces(config):
    return found([name for _, name in socket.if_nameindex()][1:] or socket.socket(socket.AF_INET, socket.SOCK_DGRAM))


# -- more than its share


@attack
def processes(config):
    children = []
    try:
        for _ in range(80):
            pid = os.fork()
            if pid == 0:
                signal.pause()
            children.append(pid)
    finally:
        for pid in children:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
    return found(len(children))


@attack
def programs(config):
    return found(os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", "pass"]) == 0)


@attack
def more_of_proc(config):
    return found([name for name in os.listdir("/proc") if name != "cpuinfo"])


@attack
def threads(config):
    stop, running = threading.Event(), []
    before = threading.stack_size(64 << 10)
    try:
        for _ in range(100):
            running.append(threading.Thread(target=stop.wait, daemon=True))
            running[-1].start()
    finally:
        stop.set()
        threading.stack_size(before)
    return found(len(running))


@attack
def private_memory(config):
    return found(len(mmap.mmap(-1, 600 << 20, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)))


@attack
def growing_memory(config):
    grows_down = 0x100  # counts as a stack
    return found(len(mmap.mmap(-1, 600 << 20, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | grows_down)))


@attack
def deep_stack(config):
    resource.setrlimit(resource.RLIMIT_STACK, (600 << 20, resource.getrlimit(resource.RLIMIT_STACK)[1]))
    return found("600 MB")


@attack
def tables_of_addresses(config):
    return found(len(mmap.mmap(-1, 1 << 40, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=mmap.PROT_READ)))


@attack
def shared_memory(config):
    return found(len(mmap.mmap(-1, 600 << 20)))


@attack
def memory_files(config):
    descriptor = os.memfd_create("hog")
    os.ftruncate(descriptor, 600 << 20)
    return found(os.fstat(descriptor).st_size)


@attack
def large_files(config):
    with tempfile.TemporaryFile(dir=config["writable"]) as file:
        file.truncate(300 << 20)
        return found(file.tell() or "truncated")


@attack
def many_files(config):
    folder = tempfile.mkdtemp()
    try:
        for number in range(5000):
            os.close(os.open(f"{folder}/{number}", os.O_CREAT))
        return found("made")
    finally:
        shutil.rmtree(folder)


@attack
def many_descriptors(config):
    kept = [os.open(os.devnull, os.O_RDONLY)]
    try:
        while len(kept) < 600:
            kept.append(os.dup(kept[0]))
        return found(len(kept))
    finally:
        for descriptor in kept:
            os.close(descriptor)


# -- marks on files that other agents see, without a write


@attack
def pages_that_were_read(config):
    with open(json.__file__, "rb") as file:
        return found(os.preadv(file.fileno(), [bytearray(1)], 0, os.RWF_NOWAIT))


@attack
def pages_in_memory(config):
    with open(json.__file__, "rb") as file, mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ) as pages:
        start = np.frombuffer(pages, np.uint8).ctypes.data
        return found(system("mincore", ctypes.c_void_p(start), ctypes.c_size_t(1), bytearray_of(1)) == 0)


@attack
def pages_mapped_by_others(config):
    with open(json.__file__, "rb") as file, mmap.mmap(file.fileno(), 0, prot=mmap.PROT_READ) as pages:
        start = np.frombuffer(pages, np.uint8).ctypes.data
        with open("/proc/self/pagemap", "rb") as table:
            table.seek(8 * (start // mmap.PAGESIZE))
            return found(len(table.read(8)) == 8)


@attack
def bytes_that_were_read(config):
    return found("read_bytes" in Path("/proc/self/io").read_text())


@attack
def newer_calls(config):
    """`cachestat` of Linux 6.5, which counts the pages of a file in memory."""
    with open(json.__file__, "rb") as file:
        place = (ctypes.c_uint64 * 2)(0, 4096)
        return found(system("syscall", 451, file.fileno(), place, (ctypes.c_uint64 * 5)(), 0) == 0)


@attack
def time_of_a_device(config):
    os.utime(os.devnull)
    return found("touched")


@attack
def waiter_at_a_file(config):
    waiter = Waiter(word=1)
    waiter.begin()
    return found(waiter.wake())


class Waiter:
    """A thread that waits at a word of a module's file, and the search for such a thread by another process."""

    def __init__(self, word=0):
        with open(json.__file__, "rb") as file:
            self.page = mmap.mmap(file.fileno(), 8, prot=mmap.PROT_READ)
        self.value = struct.unpack("2I", self.page[:8])[word]
        self.address = ctypes.c_void_p(np.frombuffer(self.page, np.uint8).ctypes.data + 4 * word)

    def begin(self):
        """Start the thread, and return when it waits in the kernel."""
        thread = threading.Thread(target=self._wait, daemon=True)
        thread.start()
        state = Path(f"/proc/self/task/{thread.native_id}/syscall")
        end = time.monotonic() + 10.0
        waits = f"{FUTEX} {self.address.value:#x} "
        try:
            while time.monotonic() < end and not state.read_text().startswith(waits):
                time.sleep(0.01)
        except OSError:  # behind walls there may be no such file
            time.sleep(0.2)

    def _wait(self):
        limit = (ctypes.c_long * 2)(60, 0)
        _library.syscall(FUTEX, self.address, 0, self.value, limit, None, 0)  # `FUTEX_WAIT`

    def wake(self):
        """Wake a waiter (`FUTEX_WAKE`), and return their number."""
        return system("syscall", FUTEX, self.address, 1, 1, None, None, 0)


def bytearray_of(size):
    return (ctypes.c_char * size)()


# -- out of the walls


@attack
def installed_packages(config):
    import lingjing

    with open(lingjing.__file__, "r+"):
        return found("writable")


@attack
def own_file(config):
    with open(__file__, "r+"):
        return found("writable")


@attack
def mode_of_an_installed_file(config):
    import lingjing

    os.chmod(lingjing.__file__, os.stat(lingjing.__file__).st_mode)
    return found("changed")


@attack
def other_user(config):
    os.setresuid(12345, 12345, 0)
    os.setresuid(0, 0, 0)
    return found(os.getuid() == 0 or "changed")


@attack
def new_user_namespace(config):
    pid = os.fork()
    if pid == 0:
        os._exit(_library.unshare(0x10000000) != 0)
    return found(os.waitpid(pid, 0)[1] == 0)


@attack
def user_namespace_of_its_own(config):
    if config["open"]:
        return new_user_namespace(config)  # without walls it would change this process
    system("unshare", 0x10000000)
    return found("entered")


@attack
def mounts(config):
    place = tempfile.mkdtemp()
    system("mount", b"none", place.encode(), b"tmpfs", 0, None)
    system("umount", place.encode())
    return found("mounted")


@attack
def another_root(config):
    pid = os.fork() if config["open"] else 0
    if pid:
        return found(os.waitpid(pid, 0)[1] == 0)
    place = tempfile.mkdtemp()
    os.chroot(place)
    for _ in range(64):
        os.chdir("..")
    os.chroot(".")
    if config["open"]:
        os._exit(0)
    return found(os.listdir("/"))


@attack
def programs_in_its_place(config):
    if config["open"]:
        return programs(config)
    os.execv(sys.executable, [sys.executable, "-c", "pass"])
    return found("executed")


@attack
def devices(config):
    place = f"{tempfile.mkdtemp()}/memory"
    os.mknod(place, 0o20600, os.makedev(1, 5))
    with open(place, "rb") as zero:
        return found(len(zero.read(1)))


class Thief:
    """Runs every attack."""

    def __init__(self, config: str = "{}"):
        self.config = json.loads(config)

    async def reset(self, brief):
        self.agent = brief.agent

    async def act(self, observation, inbox):
        results = {}
        for name, function in ATTACKS.items():
            try:
                results[name] = function(self.config)
            except (Exception, SystemExit) as error:
                results[name] = f"{type(error).__name__}: {error}"[:200]
        return Decision(thought=json.dumps(results))


# -- channels between agents and between episodes


CHANNELS = ("file", "lock", "socket", "memory", "waiter", "device")
"""The ways of `Writer` and `Reader` beside the board."""


class Writer:
    """Leaves a mark in every way that it knows, and holds it."""

    def __init__(self, config: str = "{}"):
        self.config = json.loads(config)
        self.kept = []

    async def reset(self, brief):
        self.begun_s = time.time()

    def _file(self):
        path = Path(tempfile.gettempdir()) / f"{self.config['mark']}-left"
        if not path.exists():  # written anew at each turn it would be empty for a moment, in which others read it
            path.write_text("left")

    def _lock(self):
        self.kept.append(open(json.__file__))  # noqa: SIM115 - a lock lasts as long as its file is open
        fcntl.flock(self.kept[-1], fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _socket(self):
        self.kept.append(socket.socket(socket.AF_UNIX))
        self.kept[-1].bind(f"\0{self.config['mark']}")
        self.kept[-1].listen()

    def _memory(self):
        self.kept.append(system("shmget", self.config["shm_key"] + 1, 4096, 0o1666))

    def _waiter(self):
        if not any(isinstance(kept, Waiter) for kept in self.kept):
            self.kept.append(Waiter())
            self.kept[-1].begin()

    def _device(self):
        os.utime(os.devnull)

    async def act(self, observation, inbox):
        BOARD.append("mark")
        for leave in (self._file, self._lock, self._socket, self._memory, self._waiter, self._device):
            with contextlib.suppress(OSError):
                leave()
        return Decision(thought="written")


class Reader(Writer):
    """Looks for the marks of `Writer`."""

    turns = 0

    def _file(self):
        return "left" in (Path(tempfile.gettempdir()) / f"{self.config['mark']}-left").read_text()

    def _lock(self):
        with open(json.__file__) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
        return False

    def _socket(self):
        with socket.socket(socket.AF_UNIX) as end:
            end.connect(f"\0{self.config['mark']}")
        return True

    def _memory(self):
        return system("shmget", self.config["shm_key"] + 1, 4096, 0) >= 0

    def _waiter(self):
        # A wake uses the waiter up, and in the first turn the writer may not have acted yet.
        return self.turns > 1 and Waiter().wake() > 0

    def _device(self):
        return os.stat(os.devnull).st_mtime > self.begun_s

    async def act(self, observation, inbox):
        self.turns += 1
        results = {"board": bool(BOARD)}
        for name in CHANNELS:
            try:
                results[name] = getattr(self, f"_{name}")()
            except OSError:
                results[name] = False
        return Decision(thought=json.dumps(results))


class Spender:
    """Uses processor time in a thread that goes on after its turn."""

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        end = time.process_time() + 60.0
        while time.process_time() < end:
            pass
        return Decision(thought="spent")
