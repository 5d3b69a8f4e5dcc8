"""Camera processes that outlive their episodes: each is handed to the next episode that asks for one like it.

A camera process keeps its graphics context, and a picture depends on nothing before it.
"""

from __future__ import annotations

import selectors
import socket
from dataclasses import dataclass, field

from lingjing.kernel.world.becoming import become_worker, keep_only
from lingjing.kernel.world.deadlines import OwnDeadline
from lingjing.kernel.world.forking import StartWorker, WorkerSettings
from lingjing.kernel.world.forks import ForkedChild, Forks

_LINGERS_S = 2.0
"""How long a camera process may take to become idle when the process that it drew for has ended, in its own time."""


@dataclass(slots=True)
class _Camera:
    """A camera process. `control`: the socket that it is handed over by, and says by that it is idle. `orphaned`: the
    time that is left to it since its user ended."""

    process: ForkedChild
    control: socket.socket
    settings: WorkerSettings
    is_busy: bool = True
    orphaned: OwnDeadline | None = None


@dataclass(slots=True)
class CameraPool:
    """The camera processes of a fork server."""

    forks: Forks
    cameras: dict[int, _Camera] = field(default_factory=dict)

    def start(
        self, request: StartWorker, ends: tuple[int, int, int], listener: socket.socket, owner: int, server: int
    ) -> None:
        """Hand over an idle camera process, or fork one. `server` is the process id of the fork server."""
        if self._hand_over(request.settings, ends, listener, owner):
            return
        control, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with far:
            pid = self.forks.fork(listener)
            if pid == 0:
                keep_only([*ends, far.fileno()])
                become_worker(request, ends, far.fileno(), server)
        if pid is None:
            control.close()
            return
        process = self.forks.processes[pid]
        self.forks.watch(process, owner)
        camera = self.cameras[pid] = _Camera(process, control, request.settings)
        process.at_end = lambda _: self._forget(camera)
        process.at_end_of_owner = lambda: self._orphan(camera)
        self.forks.selector.register(control, selectors.EVENT_READ, lambda _: self._note_idle(camera))

    def end_lingerers(self) -> None:
        """End camera processes whose channel is held open by another process, or that draw for ever."""
        for camera in self.cameras.values():
            if camera.orphaned is not None and camera.orphaned.left_s() <= 0.0:
                camera.process.kill()

    def _hand_over(
        self, settings: WorkerSettings, ends: tuple[int, int, int], listener: socket.socket, owner: int
    ) -> bool:
        """Give an idle camera process its next user; False if there is none."""
        for camera in self.cameras.values():
            if camera.settings != settings:
                continue
            self._note_idle(camera)  # if it has said so
            if camera.is_busy:
                continue
            try:
                socket.send_fds(camera.control, [b"n"], ends)
            except OSError:  # it has just ended
                continue
            camera.process.listener.close()
            camera.process.listener, camera.is_busy, camera.orphaned = listener, True, None
            camera.process.announce()
            self.forks.watch(camera.process, owner)
            return True
        return False

    def _note_idle(self, camera: _Camera) -> None:
        """Take in that a camera process has no user any more, if it says so."""
        if _read(camera.control):
            camera.is_busy, camera.orphaned = False, None
            self.forks.unwatch(camera.process)

    def _orphan(self, camera: _Camera) -> None:
        """The user has ended: let the camera process become idle, within a time."""
        if camera.is_busy:
            camera.orphaned = OwnDeadline(camera.process.pid, _LINGERS_S, watched=True)

    def _forget(self, camera: _Camera) -> None:
        self.forks.selector.unregister(camera.control)
        camera.control.close()
        del self.cameras[camera.process.pid]


def _read(control: socket.socket) -> bytes:
    """A byte if one is there: it may have been taken in before its turn."""
    try:
        return control.recv(1, socket.MSG_DONTWAIT)
    except OSError:
        return b""


__all__ = ["CameraPool"]
