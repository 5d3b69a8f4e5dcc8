"""A policy for `starting.py`: ends its process when the episode has started, so that nothing but starting is paid for.

With `until=decision` that is when it is first asked; with `until=picture` it asks for a picture then, where it can, and
ends its process at the next boundary.
"""

import os

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
            os._exit(0)
        return Decision(command=Action(verb="takePhoto")) if self.camera else Decision()
