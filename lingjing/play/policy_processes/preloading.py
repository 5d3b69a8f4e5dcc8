"""`preload`: what the policies of a team need, imported once in the process that they are forked from.

Called in that process, where no code of a stranger may run: plug-ins of this project alone are asked what their
policies need (`PolicyPlugin.imports`). Every other policy imports what it needs in its own process.
"""

from __future__ import annotations

import contextlib
import json
from importlib import import_module

from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.plugins.host import PluginHost

PRELOAD = "lingjing.play.policy_processes.preloading:preload"
SERVES = ("lingjing.play.policy_processes.host", "lingjing.plugins.options", "numpy.random")
"""What the process imports that policies are forked from."""

_SHIPPED = ("lingjing_agents",)
"""Packages of this project that offer policies, found through their entry points."""


def preload(names: str) -> None:
    """Import what the policies of these names (a JSON list) need. What cannot be imported is left to the policy."""
    points = [one for one in find_entries(PLUGINS).points if one.module.partition(".")[0] in _SHIPPED]
    host = PluginHost(entry_points=False, extra=[point.load() for point in points])
    for name in json.loads(names):
        for module in host.policies[name].imports if name in host.policies else ():
            with contextlib.suppress(Exception):
                import_module(module)
