"""A policy for `starting.py`: ends the player when the episode has started, so that nothing but starting is paid for.

With `until=decision` that is when it is first asked; with `until=picture` it asks for a picture then, where it can, and
ends the player at the next boundary. The player is the process that made the socket which the policy's process answers
through (`SO_PEERCRED`, unix(7)).
"""

import os
import signal
import socket
import stat
import struct

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
            os.kill(player(), signal.SIGKILL)
        return Decision(command=Action(verb="takePhoto")) if self.camera else Decision()


def player() -> int:
    """The process id of the player."""
    for descriptor in range(3, 64):
        try:
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                with socket.socket(fileno=os.dup(descriptor)) as end:
                    return int(struct.unpack("3i", end.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0])
        except OSError:
            continue
    raise OSError("this is no process of a policy")
