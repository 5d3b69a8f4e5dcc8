"""The installed plug-ins, as the check of a mission and the start of a run need them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from lingjing.cli.process import say

if TYPE_CHECKING:
    from lingjing.dsl.feasibility.providers import Offered


def offers(kind: Offered) -> tuple[str, ...]:
    """Names of the installed scenes or engines, sorted. `PluginError` if a plug-in cannot be loaded."""
    return _offers()[kind]


def warn_of_broken_plugins() -> None:
    """Name the installed plug-ins that do not load: an episode that does not use them plays without them."""
    from lingjing.installed_plugins.discovery import installed_plugins

    for fault in installed_plugins().faults:
        say(f"warning: {fault}; it is left out")


@cache
def _offers() -> dict[Offered, tuple[str, ...]]:
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    for fault in host.faults:
        say(f"warning: {fault}; what it offers is not known")
    return {"scene": tuple(sorted(host.scenes)), "engine": tuple(sorted(host.engines))}
