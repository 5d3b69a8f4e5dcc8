"""The preparation of the process from which the policies are forked, once for all of them.

No foreign code may run in that process, so only this project's plug-ins are considered (`PolicyPlugin.imports`). Every
other policy imports its modules in its own process.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable
from importlib import import_module

from lingjing.installed_plugins.discovery import LoadablePlugin
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import options_model
from lingjing.plugins.policy import PolicyPlugin

PRELOAD = "lingjing.play.policy_processes.preloading:preload"
"""The function that the fork server calls."""
SERVES = ("lingjing.play.policy_processes.host", "lingjing.plugins.options", "numpy.random")
"""Modules that the process imports from which policies are forked."""

_SHIPPED = ("lingjing_agents",)
"""Packages of this project with policies, found by their entry points."""

_prepared: dict[frozenset[str], PluginHost] = {}
"""Hosts of this project's plug-ins, by their names. A host takes 5 ms to build, in each process of a policy."""


def preload(names: str) -> None:
    """Import the modules of the named policies (a JSON list), and build the models of their options.

    A failure is left to the policy's own process.
    """
    points = [point for point in find_entries(PLUGINS).points if point.module.partition(".")[0] in _SHIPPED]
    host = PluginHost(entry_points=False, extra=[point.load() for point in points])
    for plugins in (frozenset[str](), *(frozenset((point.name,)) for point in points)):
        _prepared[plugins] = policy_host(plugins)
    for name in json.loads(names):
        if name in host.policies:
            _preload(host.policies[name], host)


def _preload(policy: PolicyPlugin, host: PluginHost) -> None:
    for module in policy.imports:
        with contextlib.suppress(Exception):
            import_module(module)
    with contextlib.suppress(Exception):
        options_model(policy)
    if policy.calls:
        with contextlib.suppress(Exception):
            _ = host.models  # reads the shipped list, which the module of the hook then keeps


def policy_host(names: Iterable[str]) -> PluginHost:
    """Return a host with the installed plug-ins of these names only: the prepared one, if there is one."""
    wanted = frozenset(names)
    if wanted in _prepared:
        return _prepared[wanted]
    points = {point.value: point for point in find_entries(PLUGINS).points if point.name in wanted} if wanted else {}
    return PluginHost(entry_points=False, only=[LoadablePlugin(point) for point in points.values()])
