"""The `plane` engine: all fixed-wing aircraft of an episode behind the five-method contract."""

from __future__ import annotations

from lingjing.engines.aircraft import AircraftEngine
from lingjing.engines.fixed_wing.aeroplane import Aeroplane


class PlaneEngine(AircraftEngine):
    """A fleet of fixed-wing aircraft."""

    aircraft = Aeroplane
