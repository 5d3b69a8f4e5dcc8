"""A battery with a capacity that follows from its endurance at a stated power."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class Battery:
    """A battery and the energy that is left in it."""

    capacity_wh: float
    """Capacity, watt-hours."""
    left_wh: float
    """Energy left, watt-hours, from 0 to the capacity."""

    @classmethod
    def for_endurance(cls, watts: float, endurance_s: float) -> Battery:
        """Return a full battery that supplies `watts` for `endurance_s` seconds."""
        capacity = watts * endurance_s / 3600.0
        return cls(capacity_wh=capacity, left_wh=capacity)

    @property
    def empty(self) -> bool:
        """True if no energy is left."""
        return self.left_wh <= 0.0

    @property
    def resources(self) -> dict[str, float]:
        """Energy left, as a share 0..1 (`battery`) and in watt-hours (`battery_wh`)."""
        return {"battery": self.left_wh / self.capacity_wh, "battery_wh": self.left_wh}

    def drain(self, watts: float, dt_s: float) -> None:
        """Remove the energy of `dt_s` seconds at `watts`."""
        self.left_wh = max(0.0, self.left_wh - watts * dt_s / 3600.0)
