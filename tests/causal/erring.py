"""Policies for branches of traces: oracles with one fault, and policies that cannot be run again."""

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
    """The skipper's destinations are off from a boundary on."""

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
    """Does nothing in any process but that in which it took its brief."""

    async def reset(self, brief: Brief) -> None:
        await super().reset(brief)
        self._process = os.getpid()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        made = await super().act(observation, inbox)
        return made if os.getpid() == self._process else Decision()


class Moody(OraclePolicy):
    """Thinks otherwise each time."""

    privileged = True

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        made = await super().act(observation, inbox)
        thought = f"{random.SystemRandom().random()}" if observation.tick == 2 else ""
        return replace(made, thought=thought)


class Threaded(OraclePolicy):
    """Keeps a thread."""

    privileged = True

    async def reset(self, brief: Brief) -> None:
        await super().reset(brief)
        threading.Thread(target=_WAIT.wait, daemon=True).start()


class Unseeing:
    """Sees no truth, and would fail if it were shown it."""

    async def reset(self, brief: Brief) -> None:
        self._brief = brief

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if observation.privileged is not None:
            raise AssertionError("the truth was handed over")
        return Decision()


class Brittle(Unseeing):
    """Fails as soon as its body is on its way, which it never orders."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if any(one.busy for one in observation.entities):
            raise RuntimeError("it moves")
        return Decision()


class Leaving(Unseeing):
    """Ends the process in which it is run again."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if "branch_process" in str(sys.modules["__main__"].__spec__):
            os._exit(7)
        return Decision()


class Vanishing(Unseeing):
    """Ends any process but that in which it took its brief."""

    async def reset(self, brief: Brief) -> None:
        await super().reset(brief)
        self._process = os.getpid()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        if os.getpid() != self._process:
            os._exit(7)
        return Decision()


class Printing(Unseeing):
    """Prints a line at each boundary."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        print(f"{observation.agent} at {observation.tick}")
        return Decision()
