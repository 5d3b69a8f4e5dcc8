"""A battery that is sized by how long it lasts at a given power."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Battery:
    """Energy left, watt-hours."""

    capacity_wh: float
    left_wh: float

    @classmethod
    def lasting(cls, watts: float, endurance_s: float) -> Battery:
        """A full battery that gives `watts` for `endurance_s` seconds."""
        capacity = watts * endurance_s / 3600.0
        return cls(capacity_wh=capacity, left_wh=capacity)

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return self.left_wh <= 0.0

    @property
    def resources(self) -> dict[str, float]:
        """What is left, as a share 0..1 and in watt-hours."""
        return {"battery": self.left_wh / self.capacity_wh, "battery_wh": self.left_wh}

    def drain(self, watts: float, dt_s: float) -> None:
        """Pay for `dt_s` seconds."""
        self.left_wh = max(0.0, self.left_wh - watts * dt_s / 3600.0)
