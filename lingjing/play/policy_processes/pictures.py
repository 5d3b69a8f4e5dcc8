"""Pictures in read-only memory that the processes of policies share.

The player copies a picture into a *slot*: a memory that only the player can write to. It sends the slot's descriptor
once to each process. A policy's process maps the slot, and the arrays of a `Picture` are views of it; only the JPEG
file is copied. Every answer lists the slots that the policy still uses. The player fills the others again, because new
memory is slow (4 of the 5 ms of a picture at 1080p, measured). A slot is used again only for the same agents, so no
process sees a picture that its agent has not observed.
"""

from __future__ import annotations

import fcntl
import math
import mmap
import os
import weakref
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.errors import InfrastructureError
from lingjing.plugins.policy import Picture
from lingjing.trace.records import CameraPose

_SEAL_FUTURE_WRITE = 0x0010
"""`F_SEAL_FUTURE_WRITE` of linux/fcntl.h, from Linux 5.1: only mappings that exist already can be written to."""

_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | _SEAL_FUTURE_WRITE | fcntl.F_SEAL_SEAL
"""The size is fixed, and no process can create a writable mapping."""
_ALIGNED_BYTES = 64
"""The alignment of arrays in a slot, bytes. Chosen: a cache line."""

ScalarT = TypeVar("ScalarT", bound=np.generic)


class PicturePart(msgspec.Struct, frozen=True, kw_only=True):
    """A `Picture` without its arrays.

    The arrays and the JPEG file lie in the slot one after the other, each at a multiple of 64 bytes.
    """

    slot: int
    """The number of the slot."""
    is_new: bool
    """True if the slot's descriptor comes with the message."""
    frame: str
    entity: str
    camera: str
    tick: int
    time_s: float
    pose: CameraPose
    rgb: tuple[int, int]
    """Height and width, pixels."""
    depth: tuple[int, int] | None
    """Height and width; None without this array."""
    semantic: tuple[int, int] | None
    """Height and width; None without this array."""
    instance: tuple[int, int] | None
    """Height and width; None without this array."""
    instance_ids: dict[str, int]
    """The numbers of the entities in `instance`."""
    jpeg: int
    """The size of the JPEG file, bytes."""


@dataclass(slots=True)
class PictureSlot:
    """A memory for one picture."""

    number: int
    """The slot's number in messages."""
    descriptor: int
    """The descriptor of the memory."""
    memory: mmap.mmap
    """The writable mapping."""
    viewers: tuple[str, ...]
    """The agents that may see the picture."""
    users: set[str] = field(default_factory=set)
    """The agents that may hold arrays of it now."""
    knowing: set[str] = field(default_factory=set)
    """The agents that have the descriptor in their processes."""

    def fill(self, parts: Iterable[memoryview]) -> None:
        """Copy bytes into the memory, each part at an aligned offset."""
        target, offset = np.frombuffer(self.memory, np.uint8), 0
        for part in parts:
            target[offset : offset + len(part)] = np.frombuffer(part, np.uint8)
            offset = _aligned(offset + len(part))


class PictureSlots:
    """The slots of one episode, in the player's process."""

    def __init__(self) -> None:
        self._slots: list[PictureSlot] = []

    def fill(self, picture: Picture, viewers: tuple[str, ...]) -> PictureSlot:
        """Return a slot with the picture for these agents. Raises `InfrastructureError` without memory or
        descriptors."""
        parts = _parts(picture)
        size = _room(picture, parts)
        free = (old for old in self._slots if old.viewers == viewers and not old.users and len(old.memory) == size)
        slot = next(free, None)
        if slot is None:
            slot = self._new(size, viewers, picture.frame)
        slot.fill(parts)
        slot.users = set(viewers)
        return slot

    def release(self, agent: str, kept: Iterable[int]) -> None:
        """Mark all slots but `kept` as unused by an agent's policy."""
        for slot in self._slots:
            if slot.number not in kept:
                slot.users.discard(agent)

    def forget(self, agent: str) -> None:
        """Remove an agent after the end of its process."""
        for slot in self._slots:
            slot.users.discard(agent)
            slot.knowing.discard(agent)

    def close(self) -> None:
        """Close every slot."""
        while self._slots:
            slot = self._slots.pop()
            slot.memory.close()
            os.close(slot.descriptor)

    def _new(self, size: int, viewers: tuple[str, ...], frame: str) -> PictureSlot:
        try:
            descriptor, memory = _sealed_memory(size)
        except (OSError, ValueError) as error:
            raise InfrastructureError(
                f"the picture `{frame}` cannot be handed to the policies: {error}",
                hint="memory or file descriptors of this machine or container have run out",
                cause="memory",
            ) from error
        slot = PictureSlot(len(self._slots), descriptor, memory, viewers)
        self._slots.append(slot)
        return slot


class MappedSlots:
    """The slots that a policy's process has mapped."""

    def __init__(self) -> None:
        self._memories: dict[int, mmap.mmap] = {}
        self._held: dict[int, weakref.ref[npt.NDArray[np.uint8]]] = {}

    def kept(self) -> tuple[int, ...]:
        """Return the numbers of slots with arrays in use."""
        self._held = {number: root for number, root in self._held.items() if root() is not None}
        return tuple(self._held)

    def pictures(self, parts: Sequence[PicturePart], descriptors: Sequence[int]) -> tuple[Picture, ...]:
        """Return the pictures with read-only arrays. Closes the descriptors."""
        new = iter(descriptors)
        for part in parts:
            if part.is_new:
                descriptor = next(new)
                self._memories[part.slot] = mmap.mmap(descriptor, 0, prot=mmap.PROT_READ)
                os.close(descriptor)
        return tuple(map(self._picture, parts))

    def _picture(self, part: PicturePart) -> Picture:
        memory = self._memories[part.slot]
        root = np.frombuffer(memory, np.uint8)  # the base of all arrays and their views
        self._held[part.slot] = weakref.ref(root)
        offsets = _offsets(part)
        height, width = part.rgb
        rgb = _array(root, next(offsets), np.uint8, (height, width, 3))
        depth = None if part.depth is None else _array(root, next(offsets), np.float32, part.depth)
        semantic = None if part.semantic is None else _array(root, next(offsets), np.uint8, part.semantic)
        instance = None if part.instance is None else _array(root, next(offsets), np.uint16, part.instance)
        at = next(offsets)
        return Picture(
            frame=part.frame,
            entity=part.entity,
            camera=part.camera,
            tick=part.tick,
            time_s=part.time_s,
            pose=part.pose,
            rgb=rgb,
            depth=depth,
            semantic=semantic,
            instance=instance,
            instance_ids=part.instance_ids,
            jpeg=memory[at : at + part.jpeg],
        )


def part_of(picture: Picture, slot: PictureSlot, agent: str) -> PicturePart:
    """Return the description of a picture in a slot, and note that the agent has the slot's descriptor."""
    is_new = agent not in slot.knowing
    slot.knowing.add(agent)
    return PicturePart(
        slot=slot.number,
        is_new=is_new,
        frame=picture.frame,
        entity=picture.entity,
        camera=picture.camera,
        tick=picture.tick,
        time_s=picture.time_s,
        pose=picture.pose,
        rgb=(picture.rgb.shape[0], picture.rgb.shape[1]),
        depth=_shape(picture.depth),
        semantic=_shape(picture.semantic),
        instance=_shape(picture.instance),
        instance_ids=dict(picture.instance_ids),
        jpeg=len(picture.jpeg),
    )


def _sealed_memory(size: int) -> tuple[int, mmap.mmap]:
    """Return the descriptor and the mapping of a memory that only this process can write to."""
    descriptor = os.memfd_create("lingjing-picture", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    try:
        # Allocated now: without memory this call fails, instead of SIGBUS at the first write.
        os.posix_fallocate(descriptor, 0, size)
        memory = mmap.mmap(descriptor, size)
        fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, _SEALS)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor, memory


def _parts(picture: Picture) -> list[memoryview]:
    arrays = [picture.rgb, picture.depth, picture.semantic, picture.instance]
    parts = [np.ascontiguousarray(array).data.cast("B") for array in arrays if array is not None]
    return [*parts, memoryview(picture.jpeg)]


def _room(picture: Picture, parts: Sequence[memoryview]) -> int:
    """Return the size of a slot for pictures like this one, bytes.

    The sizes of JPEG files differ, so at least an eighth of the pixels' size is reserved for them.
    """
    usual = picture.rgb.nbytes // 8
    jpeg = max(usual, 1 << len(picture.jpeg).bit_length())
    return sum(_aligned(len(part)) for part in parts[:-1]) + _aligned(jpeg)


def _offsets(part: PicturePart) -> Iterator[int]:
    sizes = [3 * part.rgb[0] * part.rgb[1]]
    sizes += [4 * part.depth[0] * part.depth[1]] if part.depth is not None else []
    sizes += [part.semantic[0] * part.semantic[1]] if part.semantic is not None else []
    sizes += [2 * part.instance[0] * part.instance[1]] if part.instance is not None else []
    offset = 0
    for size in (*sizes, 0):
        yield offset
        offset = _aligned(offset + size)


def _array(
    root: npt.NDArray[np.uint8], offset: int, kind: type[ScalarT], shape: tuple[int, ...]
) -> npt.NDArray[ScalarT]:
    size = math.prod(shape) * np.dtype(kind).itemsize
    return root[offset : offset + size].view(kind).reshape(shape)


def _aligned(offset: int) -> int:
    return -(-offset // _ALIGNED_BYTES) * _ALIGNED_BYTES


def _shape(array: npt.NDArray[np.generic] | None) -> tuple[int, int] | None:
    return None if array is None else (array.shape[0], array.shape[1])
