"""The root of a process behind walls: read-only mounts of some files and folders, and a scratch folder in memory.

Every mount keeps its place, so that the paths of the outside are valid inside. Nothing else of the outside has a name.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from lingjing.processes.walls.system_calls import call

NEW_MOUNTS = 0x00020000
"""`CLONE_NEWNS` of linux/sched.h."""

SCRATCH = "/tmp"  # noqa: S108 - a file system of its own
"""The scratch folder inside of the walls."""
SCRATCH_BYTES = 256 << 20
"""The size of the scratch folder, bytes. Chosen: many times what the shipped policies write."""
SCRATCH_FILES = 4096
"""The most files of the scratch folder. Chosen."""

_RECURSIVE, _PRIVATE = 0x4000, 0x40000
_NO_SET_USER_ID, _NO_DEVICES = 0x2, 0x4
"""`MS_…` of linux/mount.h."""
_DETACH = 0x2
"""`MNT_DETACH` of umount2(2)."""

_READ_ONLY, _NO_USER_ID, _FILES_ONLY = 0x1, 0x2, 0x2 | 0x4
"""`MOUNT_ATTR_RDONLY`; `MOUNT_ATTR_NOSUID`; `MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV` of linux/mount.h."""
_WITHOUT_PATH, _WHOLE_TREE, _CLONE, _FROM_DESCRIPTOR = 0x1000, 0x8000, 0x1, 0x4
"""`AT_EMPTY_PATH`, `AT_RECURSIVE`, `OPEN_TREE_CLONE`, `MOVE_MOUNT_F_EMPTY_PATH`."""
_HERE = -100
"""`AT_FDCWD`."""

_DEVICES = ("/dev/null", "/dev/urandom", "/dev/random")
"""The devices inside of the walls. `/dev/zero` is missing, because shared memory can be made of it."""

_PROCESSOR_FILES = (
    "/proc/cpuinfo", *(f"/sys/devices/system/cpu/{name}" for name in ("online", "possible", "present")),
)  # fmt: skip
"""The files of the kernel that describe the processor."""

_PLACE = "/tmp"  # noqa: S108 - a folder that exists everywhere, on which the new root is mounted
"""The folder on which the new root is built."""


class _MountAttributes(ctypes.Structure):
    _fields_ = (
        ("set", ctypes.c_uint64),
        ("clear", ctypes.c_uint64),
        ("propagation", ctypes.c_uint64),
        ("users", ctypes.c_uint64),
    )


def enter_own_root(readable: Iterable[str], folder: str) -> None:
    """Replace the root of this process by one with only these files and folders, read-only, and the scratch folder.

    `folder` becomes the working folder; it is empty unless it lies in a readable one. The process needs the
    capabilities of its user namespace. Raises `OSError`.
    """
    call("unshare", NEW_MOUNTS)
    _mount(None, "/", None, _RECURSIVE | _PRIVATE)
    named = [(path, os.path.realpath(path)) for path in map(os.path.abspath, readable)]
    trees = [(path, _copied(path, _READ_ONLY | _FILES_ONLY)) for path in outermost(real for _, real in named)]
    # A device is none on a mount without devices. It can be written to on a read-only one, and keeps its times there.
    trees += [(path, _copied(path, _READ_ONLY | _NO_USER_ID)) for path in _DEVICES]
    processor = dict(_processor_files())
    _mount("lingjing", _PLACE, "tmpfs", _NO_SET_USER_ID | _NO_DEVICES, "size=4m,mode=755")
    os.chdir(_PLACE)
    os.makedirs(SCRATCH[1:], exist_ok=True)  # noqa: PTH103 - relative to a root that is not entered yet
    limits = f"size={SCRATCH_BYTES},nr_inodes={SCRATCH_FILES},mode=1777"
    _mount("scratch", SCRATCH[1:], "tmpfs", _NO_SET_USER_ID | _NO_DEVICES, limits)
    for path, tree in trees:  # after the scratch folder, in which some of them may lie
        _make_place(path[1:], is_folder=_is_folder(tree))
        call("move_mount", tree, b"", _HERE, path[1:].encode(), _FROM_DESCRIPTOR)
        os.close(tree)
    for path, real in named:
        if path != real:
            _link(path[1:], real)
    # No `/proc` but this: a process's `pagemap` and `io` tell it which files other agents, and earlier ones, have read.
    for path, text in processor.items():
        _make_place(path[1:], is_folder=False)
        Path(path[1:]).write_text(text)
    with contextlib.suppress(OSError):
        os.makedirs(folder.lstrip("/"), exist_ok=True)  # noqa: PTH103
    call("pivot_root", b".", b".")
    call("umount2", b".", _DETACH)
    os.chdir("/")
    _set_attributes(_HERE, b"/", 0, _READ_ONLY)
    os.chdir(folder)


def _processor_files() -> Iterator[tuple[str, str]]:
    """Yield the files from which libraries such as cpuinfo (PyTorch, ONNX Runtime) choose their kernels, as constants:
    without the frequencies, which change.
    """
    for path in _PROCESSOR_FILES:
        with contextlib.suppress(OSError):
            lines = Path(path).read_text().splitlines(keepends=True)
            yield path, "".join(line for line in lines if "MHz" not in line)


def outermost(paths: Iterable[str]) -> Iterator[str]:
    """Yield the absolute paths that exist and lie in no other one, shorter ones first."""
    kept: list[str] = []
    for path in sorted(set(paths), key=lambda path: (len(path), path)):
        if os.path.exists(path) and not any(path.startswith(f"{other}/") for other in kept):  # noqa: PTH110
            kept.append(path)
            yield path


def _copied(path: str, attributes: int) -> int:
    """Return the descriptor of a copy of the mounts at a path, with these attributes."""
    tree = call("open_tree", _HERE, path.encode(), _CLONE | os.O_CLOEXEC | _WHOLE_TREE)
    _set_attributes(tree, b"", _WITHOUT_PATH | _WHOLE_TREE, attributes)
    return tree


def _set_attributes(tree: int, path: bytes, flags: int, attributes: int) -> None:
    wanted = _MountAttributes(attributes, 0, 0, 0)
    call("mount_setattr", tree, path, flags, ctypes.byref(wanted), ctypes.sizeof(wanted))


def _mount(source: str | None, target: str, kind: str | None, flags: int, options: str | None = None) -> None:
    call("mount", *(text and text.encode() for text in (source, target, kind)), flags, options and options.encode())


def _is_folder(tree: int) -> bool:
    return os.path.isdir(f"/proc/self/fd/{tree}")  # noqa: PTH112


def _make_place(path: str, *, is_folder: bool) -> None:
    """Make the folders above a mount, and the folder or the file on which it is mounted."""
    above = path if is_folder else os.path.dirname(path)  # noqa: PTH120
    if above:
        os.makedirs(above, exist_ok=True)  # noqa: PTH103
    if not is_folder:
        os.close(os.open(path, os.O_CREAT | os.O_WRONLY | os.O_CLOEXEC, 0o644))


def _link(path: str, target: str) -> None:
    """Make a symbolic link, unless its place is taken: it then lies in a mounted folder, or leads there."""
    with contextlib.suppress(OSError):
        os.makedirs(os.path.dirname(path) or ".", exist_ok=True)  # noqa: PTH103, PTH120
        Path(path).symlink_to(target)


__all__ = ["SCRATCH", "SCRATCH_BYTES", "enter_own_root", "outermost"]
