"""Mirrored bodies as obstacles: their dimensions, and contact with them.

Background traffic, assets and targets with declared dimensions are solid (`bodies.mirror_size`). A fire, a leak or a
delivery point is not. A mirror is the state at the start of an interval; its position is extrapolated at constant
velocity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.engines.bodies import is_absent, is_inside_shape, mirror_size, shape_of
from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.plugins.bodies import solid_size, sunk_m
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import BodyState

_LONGEST_S = 1.0
"""Shortest horizon of a search for bodies within reach, seconds (chosen)."""

_Positions = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SolidMirror:
    """The solid body of a mirror."""

    size: Size
    """Dimensions."""
    sunk_m: float
    """Depth of its underside below its position, metres."""
    shape: str
    """Shape inside the box of its dimensions: `box`, `cylinder`, `sphere` or `cone`."""


def solid_mirror(state: BodyState, entity: Entity | None) -> SolidMirror | None:
    """Return the solid body of a mirror, or None if there is nothing to touch."""
    size = mirror_size(state, entity)
    if size is None or is_absent(state, entity):
        return None
    body = None if state.kind else entity
    return SolidMirror(size, sunk_m(body), shape_of(body))


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A solid body of another engine at `time_s`."""

    id: str
    """Id of the body."""
    position: Vector
    """Position (east, north, up), metres."""
    velocity: Vector
    """Velocity (east, north, up), m/s."""
    along: tuple[float, float]
    """Unit vector of its heading (east, north)."""
    half_length_m: float
    """Half its length, metres."""
    half_width_m: float
    """Half its width, metres."""
    low_m: float
    """Height of its underside relative to its position, metres."""
    high_m: float
    """Height of its top relative to its position, metres."""
    time_s: float
    """Simulated time of position and velocity, seconds."""
    shape: str = "box"
    """Shape inside its box: `box`, `cylinder`, `sphere` or `cone`."""

    def touches(self, position: Vector, radius_m: float, half_height_m: float, now_s: float) -> bool:
        """Return whether an upright cylinder at `position` touches the body at `now_s`.

        The body's shape is enlarged by the cylinder's radius and half height.
        """
        passed = now_s - self.time_s
        up = position[2] - self.position[2] - passed * self.velocity[2]
        if not (self.low_m - half_height_m < up < self.high_m + half_height_m):
            return False
        east = position[0] - self.position[0] - passed * self.velocity[0]
        north = position[1] - self.position[1] - passed * self.velocity[1]
        ahead = east * self.along[0] + north * self.along[1]
        abeam = east * self.along[1] - north * self.along[0]
        half_m = (self.high_m - self.low_m) / 2.0 + half_height_m
        return is_inside_shape(
            self.shape,
            ahead / (self.half_length_m + radius_m),
            abeam / (self.half_width_m + radius_m),
            (up - (self.high_m + self.low_m) / 2.0) / half_m,
        )


class Neighbours:
    """All mirrors of an interval; `near` returns those that a body could meet within it."""

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        sizes = (size for size in map(solid_size, instance.entities) if size is not None)
        self._reach_m = max(max(size.length_m, size.width_m, size.height_m) for size in (*SIZES.values(), *sizes))
        """Upper bound of the distance from a body's position to its surface, metres."""
        self._horizon_s = max(instance.clock.sync_s, _LONGEST_S)
        self._states: tuple[BodyState, ...] = ()
        self._places: _Positions | None = None
        self._time_s = 0.0

    def look(self, mirrors: Iterable[BodyState], time_s: float) -> None:
        """Take over the mirrors of the interval that starts at `time_s`."""
        self._states = tuple(mirrors)
        self._places = None
        self._time_s = time_s

    def near(self, position: Vector, speed_mps: float, radius_m: float) -> tuple[Neighbour, ...]:
        """Return the solid bodies that a body of `radius_m` at `position` could reach before the next mirrors.

        `speed_mps` is the greatest speed of that body.
        """
        if not self._states:
            return ()
        if self._places is None:  # built once for the whole fleet: there are many mirrors and many aircraft
            self._places = np.array([state.position for state in self._states])
            rates = np.abs(np.array([state.velocity for state in self._states]))
            self._ways = self._horizon_s * rates.sum(axis=1) + self._reach_m
        away = np.abs(self._places - position).max(axis=1)
        close = np.flatnonzero(away < self._ways + (speed_mps * self._horizon_s + radius_m + 10.0))
        met = (self._neighbour(self._states[number]) for number in close.tolist())
        return tuple(neighbour for neighbour in met if neighbour is not None)

    def _neighbour(self, state: BodyState) -> Neighbour | None:
        solid = solid_mirror(state, self._entities.get(state.id))
        if solid is None:
            return None
        size, sunk = solid.size, solid.sunk_m
        heading = math.radians(state.heading_deg)
        return Neighbour(
            id=state.id,
            position=state.position,
            velocity=state.velocity,
            along=(math.sin(heading), math.cos(heading)),
            half_length_m=size.length_m / 2.0,
            half_width_m=size.width_m / 2.0,
            low_m=-sunk,
            high_m=size.height_m - sunk,
            time_s=self._time_s,
            shape=solid.shape,
        )


__all__ = ["Neighbour", "Neighbours", "SolidMirror", "solid_mirror"]
