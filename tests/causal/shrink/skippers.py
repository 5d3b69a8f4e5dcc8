"""Skippers for the tests of `lingjing shrink`."""

from lingjing.plugins.policy import Action, Decision


class Timid:
    """A policy that sails to one place and approaches no target."""

    async def reset(self, brief):
        self.boat = brief.resources[0].id if brief.resources else None

    async def act(self, observation, inbox):
        if observation.tick or self.boat is None:
            return Decision()
        return Decision(command=Action(verb="moveTo", arguments={"x": 190.0, "y": -1390.0}, resource=self.boat))


class Broken(Timid):
    """A policy that raises from the fourth tick on."""

    async def act(self, observation, inbox):
        if observation.tick >= 4:
            raise ZeroDivisionError("no wind")
        return await super().act(observation, inbox)
