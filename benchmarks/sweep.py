"""A policy for `episode.py` that flies over its cells; with `pictures=yes` it photographs each, else it waits
instead.
"""

from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation

ALTITUDE_M = 100.0


class SweepPolicy:
    """A policy that flies the same way with and without pictures."""

    def __init__(self, pictures: str = "yes") -> None:
        self.pictures = pictures == "yes"

    async def reset(self, brief: Brief) -> None:
        """Plan every third cell, from the agent's index on, repeatedly."""
        self.body = brief.resources[0].id if brief.resources else ""
        verbs = {verb.name for resource in brief.resources[:1] for verb in resource.verbs}
        self.flies = {"takeoff", "takePhoto"} <= verbs
        self.cells = [cell.centre for cell in brief.cells][brief.index - 1 :: 3] if self.flies else []
        self.leg = -1

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Take off, then fly and photograph in turn."""
        busy = any(entity.busy for entity in observation.entities if entity.id == self.body)
        if not self.cells or busy:
            return Decision()
        self.leg += 1
        if self.leg == 0:
            return Decision(command=Action(verb="takeoff"))
        if self.leg % 2 == 0:
            return Decision(command=Action(verb="takePhoto")) if self.pictures else Decision()
        east, north = self.cells[self.leg // 2 % len(self.cells)]
        return Decision(command=Action(verb="setDestination", arguments={"x": east, "y": north, "z": ALTITUDE_M}))
