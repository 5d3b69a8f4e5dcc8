"""What every fleet in the air does the same way: what an aircraft tells its engine, and who flies into whom."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

from lingjing.engines.pairs import close_pairs
from lingjing.mission.instance import Vector


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that happened in a period: `done`, `battery_empty`, `fuel_empty`, or `collided` with `what`."""

    kind: str
    what: str = ""
    speed_mps: float = 0.0


class Aircraft(Protocol):
    """What flies and can be struck."""

    id: str
    position: Vector

    @property
    def flying(self) -> bool:
        """Whether it is in the air and whole."""
        ...

    def strike(self, what: str) -> Notice:
        """It hits something and falls."""
        ...


AircraftT = TypeVar("AircraftT", bound=Aircraft)


def collide(fleet: Iterable[AircraftT], distance_m: float, report: Callable[[AircraftT, Notice], None]) -> None:
    """Aircraft of a fleet that come closer than `distance_m` both crash; each is reported once."""
    flying = [aircraft for aircraft in fleet if aircraft.flying]
    for first, second in close_pairs([aircraft.position for aircraft in flying], distance_m):
        one, other = flying[first], flying[second]
        if one.flying and other.flying:
            report(one, one.strike(other.id))
            report(other, other.strike(one.id))
