"""What the installed plug-ins offer, for those who check missions: looked up only when it is asked for."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lingjing.dsl.feasibility.absent import Offered


def offers(kind: Offered) -> tuple[str, ...]:
    """Names of the installed scenes or engines, sorted. `PluginError` if a plug-in cannot be loaded."""
    return _offers()[kind]


@cache
def _offers() -> dict[Offered, tuple[str, ...]]:
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    return {"scene": tuple(sorted(host.scenes)), "engine": tuple(sorted(host.engines))}
