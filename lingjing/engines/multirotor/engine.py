"""The multirotor engine: all multirotors of an episode behind the five-method contract."""

from __future__ import annotations

from lingjing.engines.aircraft import AircraftEngine
from lingjing.engines.multirotor.drone import Drone


class MultirotorEngine(AircraftEngine):
    """A fleet of multirotors."""

    aircraft = Drone
