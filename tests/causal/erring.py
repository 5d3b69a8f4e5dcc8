"""Policies for branches of traces: oracles with one fault, and irreproducible policies."""

import os
import random
import sys
import threading
from typing import Any

from lingjing_agents.oracle import OraclePolicy
from msgspec.structs import replace

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation

ASTRAY_M = 400.0
ASTRAY_FROM = 4
_WAIT = threading.Event()


class Astray(OraclePolicy):
    """An oracle with wrong destinations of the skipper from a boundary on."""

    privileged = True

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        made = await super().act(observation, inbox)
        command = made.command
        if observation.agent != "skipper" or observation.tick < ASTRAY_FROM or command is None:
            return made
        arguments: dict[str, Any] = {**command.arguments}
        arguments["x"] = arguments["x"] + ASTRAY_M
        return replace(made, command=replace(command, arguments=arguments))


class Wavering(Astray):
    """A policy that acts only in the process in which it received its brief."""

    async def reset(self, brief: Brief) -> None:
        await super().reset(brief)
        self._process = os.getpid()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        made = await super().act(observation, inbox)
        return made if os.getpid() == self._process else Decision()


class Moody(OraclePolicy):
    """A policy with a different thought in each run."""

    privileged = True

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        made = await super().act(observation, inbox)
        thought = f"{random.SystemRandom().random()}" if observation.tick == 2 else ""
        return replace(made, thought=thought)


class Threaded(OraclePolicy):
    """A policy that runs a thread."""

    privileged = True

    async def reset(self, brief: Brief) -> None:
        await super().reset(brief)
        threading.Thread(target=_WAIT.wait, daemon=True).start()


class Unseeing:
    """A policy without access to the truth; it fails if it receives it."""

    async def reset(self, brief: Brief) -> None:
        self._brief = brief

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if observation.privileged is not None:
            raise AssertionError("the truth was handed over")
        return Decision()


class Brittle(Unseeing):
    """A policy that fails as soon as its body moves, which it never commands."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if any(entity.busy for entity in observation.entities):
            raise RuntimeError("it moves")
        return Decision()


class Leaving(Unseeing):
    """A policy that ends the process in which it runs again."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if "branch_process" in str(sys.modules["__main__"].__spec__):
            os._exit(7)
        return Decision()


class Vanishing(Unseeing):
    """A policy that ends every process other than that in which it received its brief."""

    async def reset(self, brief: Brief) -> None:
        await super().reset(brief)
        self._process = os.getpid()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if os.getpid() != self._process:
            os._exit(7)
        return Decision()


class Printing(Unseeing):
    """A policy that prints a line at each boundary."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        print(f"{observation.agent} at {observation.tick}")
        return Decision()
