"""Guidance: course, bank angle and climb rate towards a destination. Pure functions; angles in radians.

On the way an aircraft points its track at the destination. If the destination lies inside a turning circle, the
aircraft flies straight on until it does not. Around a place it follows a vector field onto a clockwise circle (Nelson
et al., "Vector field path following for miniature air vehicles", 2007). The bank that the circle needs is fed forward.
"""

from __future__ import annotations

import math

from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Vector
from lingjing.scene.outlines import wrapped

MAX_BANK = math.radians(35.0)
"""Limit of the bank angle, rad (chosen)."""
CIRCLE_BANK = math.radians(25.0)
"""Bank angle in a circle in still air, rad (chosen)."""

CLIMB_MPS = 2.5
"""Largest climb rate, m/s (chosen)."""

SINK_MPS = 3.0
"""Largest sink rate, m/s (chosen)."""

_COURSE_GAIN = 1.2
"""Bank per error of the course, rad/rad (chosen)."""

_FIELD_GAIN = 2.0
"""Steepness of the vector field per relative distance from the circle (chosen)."""

_CLIMB_GAIN = 0.15
"""Climb rate per height to gain, 1/s (chosen)."""

_TURN_BANK = math.radians(28.0)
"""Bank angle that `reachable` assumes in a turn, rad; less than `MAX_BANK` for a margin (chosen)."""


def circle_radius(airspeed: float) -> float:
    """Return the radius of the circle around a place at an airspeed (m/s), metres."""
    return airspeed * airspeed / (GRAVITY * math.tan(CIRCLE_BANK))


def bearing(here: tuple[float, ...], there: tuple[float, ...]) -> float:
    """Return the course from one place to another, rad clockwise from north."""
    return math.atan2(there[0] - here[0], there[1] - here[1])


def reachable(position: Vector, course: float, speed: float, goal: Vector) -> bool:
    """Return whether a turn towards `goal` leads over it: it lies outside of the turning circles on both sides."""
    radius = speed * speed / (GRAVITY * math.tan(_TURN_BANK))
    for side in (1.0, -1.0):
        centre = (position[0] + side * radius * math.cos(course), position[1] - side * radius * math.sin(course))
        if math.dist(centre, goal[:2]) < radius:
            return False
    return True


def turn(course: float, wanted: float, feed: float = 0.0) -> float:
    """Return the bank angle that turns the track from `course` to `wanted`; `feed` is the bank that the path needs."""
    return min(max(_COURSE_GAIN * wrapped(wanted - course) + feed, -MAX_BANK), MAX_BANK)


def around(position: Vector, centre: tuple[float, float], radius: float, speed: float) -> tuple[float, float]:
    """Return the course onto a clockwise circle, and the bank to feed forward at ground speed `speed`."""
    away = math.dist(position[:2], centre)
    off = (away - radius) / radius
    course = bearing(centre, position) + math.pi / 2.0 + math.atan(_FIELD_GAIN * off)
    feed = math.atan(speed * speed / (GRAVITY * radius)) if abs(off) < 0.5 else 0.0
    return course, feed


def climb(height_m: float) -> float:
    """Return the climb rate for a height still to gain, m/s."""
    return min(max(_CLIMB_GAIN * height_m, -SINK_MPS), CLIMB_MPS)
