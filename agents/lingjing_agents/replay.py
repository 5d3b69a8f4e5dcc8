"""`scripted`: replays decisions from a JSON file, for tests, demonstrations and counterfactuals.

The file maps an agent to a map from tick to decision: `{"scout[1]": {"0": {"command": {"verb": "takeoff"}}}}`. A
decision has the fields of `lingjing.plugins.policy.Decision`, all optional. A tick that is not listed is a no-op.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.options import Field, PluginOptions
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, UsageError

Script = dict[str, dict[int, Decision]]
"""Decisions by agent and tick."""


def _load_script(path: Path) -> Script:
    """Return the script in a file. Raises `UsageError` if the file cannot be read or is not a script."""
    try:
        return from_json(path.read_bytes(), Script)
    except OSError as error:
        raise UsageError(f"cannot read the script {path}: {error.strerror}", hint="give script=PATH") from error
    except msgspec.DecodeError as error:
        raise UsageError(
            f"{path} is not a script: {error}",
            hint='expected {"agent": {"tick": {"command": {"verb": …}, "messages": […]}}}',
        ) from error


class ScriptOptions(PluginOptions):
    """The options of `scripted`."""

    script: Path = Field(description="the JSON file with the decisions")


class ScriptedPolicy:
    """Returns at each tick the decision of the script for its agent."""

    def __init__(self, options: ScriptOptions) -> None:
        self._script = _load_script(options.script)
        self._lines: dict[int, Decision] = {}

    async def reset(self, brief: Brief) -> None:
        """Select the decisions of this agent."""
        self._lines = self._script.get(brief.agent, {})

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of this tick, or a no-op."""
        return self._lines.get(observation.tick, Decision())
