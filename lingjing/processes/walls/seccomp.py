"""The filter of system calls behind walls (seccomp(2), a classic BPF program).

Every call is allowed except those that reach other processes, make processes or sockets, mount, or leave a mark that
another process can read without a file. Several agents can read one file, such as a module of the standard library. A
lock, a lease, a watch, a waiter or a page in memory of it would be a channel between agents which the message bus does
not see. A lock reports success and locks nothing, because no other process uses the scratch folder. Advice about the
pages of a file reports success and does nothing.

A call that is newer than this list does not exist behind walls: `setxattrat` of Linux 6.13 would pass a list of names.
"""

from __future__ import annotations

import ctypes
import errno
import platform
import struct

from lingjing.processes.walls.system_calls import number_of, prctl

_AUDIT_ARCHITECTURE = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}
"""`AUDIT_ARCH_…` of linux/audit.h: seccomp reports it for each call."""

_DENIED = (
    # other processes
    "ptrace", "process_vm_readv", "process_vm_writev", "process_madvise", "process_mrelease", "kcmp", "pidfd_open",
    "pidfd_getfd", "pidfd_send_signal", "tkill", "get_robust_list", "move_pages", "migrate_pages", "setpriority",
    "ioprio_set", "perf_event_open", "userfaultfd", "bpf",
    # namespaces and mounts
    "unshare", "setns", "mount", "umount2", "pivot_root", "chroot", "open_tree", "move_mount", "fsopen", "fsconfig",
    "fsmount", "fspick", "mount_setattr", "name_to_handle_at", "open_by_handle_at", "mknod", "mknodat", "quotactl",
    "quotactl_fd",
    # memory, messages and keys outside of the file system
    "keyctl", "add_key", "request_key", "shmget", "shmat", "shmctl", "semget", "semop", "semtimedop", "semctl",
    "msgget", "msgsnd", "msgrcv", "msgctl", "mq_open", "mq_unlink", "memfd_create", "memfd_secret",
    # sockets: the channels of the process are inherited
    "socket", "bind", "connect", "listen", "accept", "accept4", "io_uring_setup", "io_uring_enter",
    "io_uring_register",
    # watches on files
    "fanotify_init", "fanotify_mark", "inotify_init", "inotify_init1", "inotify_add_watch",
    # the pages of a file in memory
    "mincore", "io_setup",
    # processes and programs
    "fork", "vfork", "execve", "execveat",
    # the kernel
    "modify_ldt", "syslog", "kexec_load", "init_module", "finit_module",
)  # fmt: skip
"""Calls that fail with EPERM."""

_MARKS = (
    "chmod", "fchmod", "fchmodat", "chown", "fchown", "lchown", "fchownat", "utime", "utimes", "futimesat",
    "utimensat", "setxattr", "lsetxattr", "fsetxattr", "removexattr", "lremovexattr", "fremovexattr",
)  # fmt: skip
"""Calls that change a file without writing to it. Landlock does not cover them; read-only mounts do."""

_OWN_PROCESS_ONLY = (
    "kill", "tgkill", "rt_sigqueueinfo", "rt_tgsigqueueinfo", "prlimit64", "sched_setaffinity", "sched_setattr",
    "sched_setscheduler", "sched_setparam",
)  # fmt: skip
"""Calls with a process id as their first argument: 0 and the own one are allowed."""

_CLONE_THREAD = 0x00010000
"""`CLONE_THREAD` of linux/sched.h: clone(2) makes a thread and no process."""

_UNCOUNTED_MEMORY = (0x21, 0x100)
"""`MAP_SHARED | MAP_ANONYMOUS` and `MAP_GROWSDOWN` of mman.h: RLIMIT_DATA does not count such memory (getrlimit(2))."""

_FIRST_UNKNOWN = 450
"""The first call that is newer than `_DENIED`, on both processors: `set_mempolicy_home_node` of Linux 5.17."""

_CACHED_ONLY = 0x8
"""`RWF_NOWAIT` of linux/fs.h: read only pages that are in memory."""

_WAITS = (0, 6, 8, 9, 11, 13)
"""`FUTEX_WAIT`, `FUTEX_LOCK_PI`, `FUTEX_TRYLOCK_PI`, `FUTEX_WAIT_BITSET`, `FUTEX_WAIT_REQUEUE_PI`, `FUTEX_LOCK_PI2` of
linux/futex.h without `FUTEX_PRIVATE_FLAG`. Such a waiter can wait at a page of a file, where another process finds it.
The C library so waits for the end of a thread, and asks again after EAGAIN (`pthread_join`)."""
_FUTEX_OPERATION = 0xFF
"""The bits of a futex operation with its flag of privacy, without that of the clock."""

_PRETENDED_FCNTL = (6, 7, 37, 38)
"""`F_SETLK`, `F_SETLKW`, `F_OFD_SETLK`, `F_OFD_SETLKW` of fcntl.h."""
_DENIED_FCNTL = (8, 10, 15, 1024, 1026, 1036, 1038)
"""`F_SETOWN`, `F_SETSIG`, `F_SETOWN_EX` of fcntl.h, which send signals, and `F_SETLEASE`, `F_NOTIFY`, `F_SET_RW_HINT`,
`F_SET_FILE_RW_HINT` of linux/fcntl.h, which mark a file."""

_DENIED_IOCTL = (0x5412, 0x8901, 0x8902)
"""`TIOCSTI`, which types into a terminal, and `FIOSETOWN`, `SIOCSPGRP`, which send signals (asm-generic/ioctls.h,
sockios.h)."""

_LOAD, _EQUAL, _GREATER_OR_EQUAL, _AND, _RETURN = 0x20, 0x15, 0x35, 0x54, 0x06
"""`BPF_LD|BPF_W|BPF_ABS`, `BPF_JMP|BPF_JEQ|BPF_K`, `BPF_JMP|BPF_JGE|BPF_K`, `BPF_ALU|BPF_AND|BPF_K`, `BPF_RET|BPF_K`
of linux/bpf_common.h."""

_ALLOW, _ERROR, _KILL = 0x7FFF0000, 0x00050000, 0x80000000
"""`SECCOMP_RET_ALLOW`, `SECCOMP_RET_ERRNO` and `SECCOMP_RET_KILL_PROCESS` of linux/seccomp.h."""

_NUMBER_AT, _ARCHITECTURE_AT, _ARGUMENTS_AT = 0, 4, 16
"""Offsets in `struct seccomp_data`, bytes. The low half of an argument comes first on both processors."""

_PR_SET_SECCOMP, _MODE_FILTER = 22, 2
"""From linux/prctl.h and linux/seccomp.h."""

_INSTRUCTION = struct.Struct("=HBBI")
"""`struct sock_filter`: code, jump if true, jump if false, operand."""

Instruction = tuple[int, int, int, int]
"""The fields of `_INSTRUCTION`."""


def filter_system_calls(own_pid: int, *, marks: bool) -> None:
    """Install the filter in the calling thread. `own_pid`: its process id. Raises `OSError`.

    `marks`: allow changes of modes, owners and times, because files outside are mounted read-only.
    """
    architecture = _AUDIT_ARCHITECTURE.get(platform.machine())
    if architecture is None:
        raise OSError(errno.ENOSYS, f"no filter of system calls is written for {platform.machine()}")
    code = b"".join(
        _INSTRUCTION.pack(*instruction) for instruction in _program(architecture, own_pid, () if marks else _MARKS)
    )
    buffer = ctypes.create_string_buffer(code, len(code))

    class Program(ctypes.Structure):
        _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_void_p))

    program = Program(len(code) // _INSTRUCTION.size, ctypes.addressof(buffer))
    prctl(_PR_SET_SECCOMP, _MODE_FILTER, ctypes.byref(program))


def _program(architecture: int, own_pid: int, further: tuple[str, ...]) -> list[Instruction]:
    """Return the program; `further` calls are denied too.

    Each block leaves the number of the call in the accumulator if it does not return.
    """
    program = [
        _load(_ARCHITECTURE_AT),
        (_EQUAL, 1, 0, architecture),
        _return(_KILL),
        _load(_NUMBER_AT),
        (_GREATER_OR_EQUAL, 0, 1, _FIRST_UNKNOWN),  # system calls of x32 too
        _return(_ERROR | errno.ENOSYS),
    ]
    for name in (*_DENIED, *further):
        program += _block(name, [_return(_ERROR | errno.EPERM)])
    for name in ("clone3", "futex_waitv"):  # their flags are in memory, and the C library needs neither
        program += _block(name, [_return(_ERROR | errno.ENOSYS)])
    for name in ("flock", "fadvise64"):
        program += _block(name, [_return(_ERROR)])
    thread = [_load(_ARGUMENTS_AT), (_AND, 0, 0, _CLONE_THREAD), (_EQUAL, 0, 1, _CLONE_THREAD), _return(_ALLOW)]
    program += _block("clone", [*thread, _return(_ERROR | errno.EPERM)])
    program += _block("mmap", [*_by_bits(3, _UNCOUNTED_MEMORY, _ERROR | errno.EPERM), _return(_ALLOW)])
    program += _block("preadv2", [*_by_bits(5, (_CACHED_ONLY,), _ERROR | errno.EOPNOTSUPP), _return(_ALLOW)])
    waits = [part for wait in _WAITS for part in ((_EQUAL, 0, 1, wait), _return(_ERROR | errno.EAGAIN))]
    program += _block("futex", [_load(_argument_at(1)), (_AND, 0, 0, _FUTEX_OPERATION), *waits, _return(_ALLOW)])
    program += _block("fcntl", _by_argument(1, _PRETENDED_FCNTL, _ERROR, _DENIED_FCNTL, _ERROR | errno.EPERM, _ALLOW))
    program += _block("ioctl", _by_argument(1, (), _ALLOW, _DENIED_IOCTL, _ERROR | errno.EPERM, _ALLOW))
    for name in _OWN_PROCESS_ONLY:
        program += _block(name, _by_argument(0, (0, own_pid), _ALLOW, (), _ALLOW, _ERROR | errno.EPERM))
    return [*program, _return(_ALLOW)]


def _block(name: str, body: list[Instruction]) -> list[Instruction]:
    """Return the instructions for one call. `body` always returns."""
    number = number_of(name)
    return [] if number < 0 else [(_EQUAL, 0, len(body), number), *body]


def _by_argument(
    place: int, first: tuple[int, ...], result: int, second: tuple[int, ...], second_result: int, otherwise: int
) -> list[Instruction]:
    """Return a body that compares the argument at `place` with two lists of values."""
    body = [_load(_argument_at(place))]
    for values, value_result in ((first, result), (second, second_result)):
        for value in values:
            body += [(_EQUAL, 0, 1, value), _return(value_result)]
    return [*body, _return(otherwise)]


def _by_bits(place: int, sets: tuple[int, ...], result: int) -> list[Instruction]:
    """Return instructions that return `result` if the argument at `place` has all bits of one of the sets."""
    return [
        part
        for bits in sets
        for part in (_load(_argument_at(place)), (_AND, 0, 0, bits), (_EQUAL, 0, 1, bits), _return(result))
    ]


def _argument_at(place: int) -> int:
    return _ARGUMENTS_AT + 8 * place


def _load(offset: int) -> Instruction:
    return _LOAD, 0, 0, offset


def _return(value: int) -> Instruction:
    return _RETURN, 0, 0, value


__all__ = ["filter_system_calls"]
