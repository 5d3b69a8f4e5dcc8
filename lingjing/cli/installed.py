"""Names of the installed plug-ins for the check of a mission, and warnings about broken ones."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from lingjing.cli.process import say

if TYPE_CHECKING:
    from lingjing.dsl.feasibility.providers import Offered


def offers(kind: Offered) -> tuple[str, ...]:
    """Return the names of the installed scenes or engines, sorted. Raises `PluginError` if a plug-in cannot be
    loaded.
    """
    return _offers()[kind]


def warn_of_broken_plugins() -> None:
    """Print a warning for each installed plug-in that does not load. Episodes that do not use it are played."""
    from lingjing.installed_plugins.discovery import installed_plugins

    for fault in installed_plugins().faults:
        if fault.traceback:
            say(fault.traceback.rstrip())
        say(f"warning: {fault}; it is left out")
        if fault.hint:
            say(f"hint: {fault.hint}")


@cache
def _offers() -> dict[Offered, tuple[str, ...]]:
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    for fault in host.faults:
        say(f"warning: {fault}; its scenes and engines are unknown")
    return {"scene": tuple(sorted(host.scenes)), "engine": tuple(sorted(host.engines))}
