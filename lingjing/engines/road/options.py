"""What a mission's scene options ask of the road engine."""

from __future__ import annotations

from lingjing.mission.instance import Instance


def traffic(instance: Instance) -> int:
    """How many background vehicles the scene's option `traffic` asks for; they drive also when no car is anybody's."""
    value = instance.scene.options.get("traffic", 0.0)
    return int(value) if isinstance(value, int | float) else 0
