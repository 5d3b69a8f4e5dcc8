"""The scene options of a mission that configure the road engine."""

from __future__ import annotations

from lingjing.mission.instance import Instance


def traffic(instance: Instance) -> int:
    """Return the number of background vehicles in the scene's option `traffic`; it does not depend on the mission's
    cars."""
    value = instance.scene.options.get("traffic", 0.0)
    return int(value) if isinstance(value, int | float) else 0
