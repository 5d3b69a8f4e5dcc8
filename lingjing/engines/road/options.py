"""The scene options of a mission that configure the road engine."""

from __future__ import annotations

from lingjing.mission.instance import Instance

_WANTING = ("traffic", "pedestrians", "cyclists", "signals")
"""The options that need the road engine although the mission has no vehicle."""


def amount(instance: Instance, option: str) -> int:
    """Return the number in an option of the scene, 0 without it; it does not depend on the mission's cars."""
    value = instance.scene.options.get(option, 0.0)
    return int(value) if isinstance(value, int | float) else 0


def street_life(instance: Instance) -> bool:
    """Return whether the scene's options ask for background traffic, people or signals."""
    return any(amount(instance, option) > 0 for option in _WANTING)
