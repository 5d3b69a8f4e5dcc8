"""A policy for `starting.py` that ends its episode when it has started, so that only the start is measured.

With `until=decision` it ends at the first call; with `until=picture` it requests a picture then, if possible, and ends
at the next boundary. A policy runs in a process of its own, so it kills the process that writes the trace.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation


class Stop:
    """A policy that stops when the episode has started."""

    def __init__(self, until: str = "decision") -> None:
        self.until = until

    async def reset(self, brief: Brief) -> None:
        """Select a body that takes pictures."""
        bodies = (body.id for body in brief.resources for verb in body.verbs if verb.name == "takePhoto")
        self.camera = next(bodies, "")

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Stop, or request a picture."""
        if self.until == "decision" or observation.tick > 0:
            for pid in _around():
                if _writes_a_trace(pid):
                    os.kill(pid, signal.SIGKILL)
        return Decision(command=Action(verb="takePhoto")) if self.camera else Decision()


def _around() -> Iterator[int]:
    """Return the processes beside this one, and the parent of the process from which all are forked."""
    server = os.getppid()
    yield from map(int, Path(f"/proc/{server}/task/{server}/children").read_text().split())
    yield int(Path(f"/proc/{server}/stat").read_text().rpartition(")")[2].split()[1])


def _writes_a_trace(pid: int) -> bool:
    with suppress(OSError):  # it has ended, or is another user's
        return any("trace.mcap" in os.readlink(link) for link in Path(f"/proc/{pid}/fd").iterdir())  # noqa: PTH115
    return False
