"""A policy for `starting.py`: ends its episode when it has started, so that nothing but starting is paid for.

With `until=decision` that is when it is first asked; with `until=picture` it asks for a picture then, where it can, and
ends the episode at the next boundary. A policy lives in a process of its own, so it kills that which writes the trace.
"""

import os
import signal
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation


class Stop:
    """Stops when the episode has started."""

    def __init__(self, until: str = "decision") -> None:
        self.until = until

    async def reset(self, brief: Brief) -> None:
        """Look for something that takes pictures."""
        self.camera = next((one.id for one in brief.resources for verb in one.verbs if verb.name == "takePhoto"), "")

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Stop, or ask for a picture."""
        if self.until == "decision" or observation.tick > 0:
            for pid in _around():
                if _writes_a_trace(pid):
                    os.kill(pid, signal.SIGKILL)
        return Decision(command=Action(verb="takePhoto")) if self.camera else Decision()


def _around() -> Iterator[int]:
    """The processes beside this one, and the one above the process that all are forked from."""
    server = os.getppid()
    yield from map(int, Path(f"/proc/{server}/task/{server}/children").read_text().split())
    yield int(Path(f"/proc/{server}/stat").read_text().rpartition(")")[2].split()[1])


def _writes_a_trace(pid: int) -> bool:
    with suppress(OSError):  # it has ended, or is another user's
        return any("trace.mcap" in os.readlink(one) for one in Path(f"/proc/{pid}/fd").iterdir())  # noqa: PTH115
    return False
