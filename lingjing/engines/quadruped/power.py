"""What walking costs: the dog's battery, sized by how long it lasts at a walk.

The motors' power is computed from torques and speeds (`pack.Sense.watts`), so slopes, stairs, pushing and turning cost
what they take; computers and sensors draw `ELECTRONICS_W` all the time.
"""

from __future__ import annotations

from dataclasses import dataclass

ELECTRONICS_W = 25.0

WALKING_W = 410.0
"""Motors and electronics of a dog at 1.5 m/s on flat ground, as measured in this model."""


@dataclass(slots=True)
class Battery:
    """Energy left, watt-hours."""

    capacity_wh: float
    left_wh: float

    @classmethod
    def lasting(cls, endurance_s: float) -> Battery:
        """A full battery that carries a dog for `endurance_s` seconds at 1.5 m/s on flat ground."""
        capacity = WALKING_W * endurance_s / 3600.0
        return cls(capacity_wh=capacity, left_wh=capacity)

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return self.left_wh <= 0.0

    @property
    def share(self) -> float:
        """What is left, 0..1."""
        return self.left_wh / self.capacity_wh

    def drain(self, motors_w: float, dt_s: float) -> None:
        """Pay for `dt_s` seconds."""
        self.left_wh = max(0.0, self.left_wh - (motors_w + ELECTRONICS_W) * dt_s / 3600.0)
