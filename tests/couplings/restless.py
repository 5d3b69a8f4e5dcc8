"""A policy for the mixed world: every free body moves a little further, and sometimes looks around."""

from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation


class Restless:
    """Moves each body with a verb that it has; decisions depend only on the observations."""

    async def reset(self, brief: Brief) -> None:
        self.body = brief.resources[0]
        self.verbs = {verb.name for verb in self.body.verbs}

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        mine = next((seen for seen in observation.entities if seen.id == self.body.id), None)
        if mine is None or mine.busy or mine.position is None:
            return Decision()
        x, y, _ = mine.position
        step = 60.0 if observation.tick % 4 < 2 else -60.0
        if "takePhoto" in self.verbs and observation.tick % 2:
            return Decision(command=Action(verb="takePhoto"))
        if "takeoff" in self.verbs and mine.status == "grounded":
            return Decision(command=Action(verb="takeoff"))
        if "forward" in self.verbs and "setDestination" not in self.verbs:
            return Decision(command=Action(verb="forward", arguments={"distance": 5.0}))
        if "moveTo" in self.verbs:
            return Decision(command=Action(verb="moveTo", arguments={"x": x + step, "y": y}))
        if "setDestination" in self.verbs:
            height = {} if "left" in self.verbs else {"z": 60.0 if "takeoff" in self.verbs else 250.0}
            return Decision(command=Action(verb="setDestination", arguments={"x": x, "y": y + step, **height}))
        return Decision()
