"""The engine `remote` without a server: its factory says how a session is connected."""

from __future__ import annotations

from lingjing.errors import InfrastructureError
from lingjing.plugins.engine import Engine


def connect_first() -> Engine:
    """Raise `InfrastructureError`: the bodies of this engine need a session."""
    raise InfrastructureError(
        "no foreign engine is connected", hint="play this mission with `lingjing serve --lj-engine MISSION`"
    )
