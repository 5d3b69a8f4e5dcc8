"""A policy that takes a picture each tick where it has a camera, and does nothing else."""

from lingjing.plugins.policy import Action, Decision


class Sail:
    async def reset(self, brief):
        self.command = Action(verb="takePhoto") if brief.resources[0].id == "uav" else None

    async def act(self, observation, inbox):
        return Decision(command=self.command)
