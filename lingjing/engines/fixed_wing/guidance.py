"""Where to fly: from a place to a course, a bank angle and a climb rate. Pure functions; angles in radians.

On the way an aircraft points its track at the destination; one that is too close on one side to turn to it flies
straight on until it can. Around a place it follows a vector field onto a clockwise circle (Nelson et al., "Vector field
path following for miniature air vehicles", 2007), with the bank that the circle needs fed forward.
"""

from __future__ import annotations

import math

from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Vector
from lingjing.scene.outlines import wrapped

MAX_BANK = math.radians(35.0)
CIRCLE_BANK = math.radians(25.0)
"""The bank in a circle in still air."""

CLIMB_MPS = 2.5
SINK_MPS = 3.0

_COURSE_GAIN = 1.2
_FIELD_GAIN = 2.0
_CLIMB_GAIN = 0.15
_TURN_BANK = math.radians(28.0)


def circle_radius(airspeed: float) -> float:
    """Radius of the circle that is flown around a place, metres."""
    return airspeed * airspeed / (GRAVITY * math.tan(CIRCLE_BANK))


def bearing(here: tuple[float, ...], there: tuple[float, ...]) -> float:
    """Course from one place to another."""
    return math.atan2(there[0] - here[0], there[1] - here[1])


def reachable(position: Vector, course: float, speed: float, goal: Vector) -> bool:
    """Whether turning towards `goal` leads over it: it lies outside of the turning circles on both sides."""
    radius = speed * speed / (GRAVITY * math.tan(_TURN_BANK))
    for side in (1.0, -1.0):
        centre = (position[0] + side * radius * math.cos(course), position[1] - side * radius * math.sin(course))
        if math.dist(centre, goal[:2]) < radius:
            return False
    return True


def turn(course: float, wanted: float, feed: float = 0.0) -> float:
    """Bank angle that brings the track from `course` to `wanted`; `feed` is the bank that the path itself needs."""
    return min(max(_COURSE_GAIN * wrapped(wanted - course) + feed, -MAX_BANK), MAX_BANK)


def around(position: Vector, centre: tuple[float, float], radius: float, speed: float) -> tuple[float, float]:
    """Course onto a clockwise circle and the bank to feed forward at ground speed `speed`."""
    away = math.dist(position[:2], centre)
    off = (away - radius) / radius
    course = bearing(centre, position) + math.pi / 2.0 + math.atan(_FIELD_GAIN * off)
    feed = math.atan(speed * speed / (GRAVITY * radius)) if abs(off) < 0.5 else 0.0
    return course, feed


def climb(height_m: float) -> float:
    """Climb rate that makes up for a height still to gain, m/s."""
    return min(max(_CLIMB_GAIN * height_m, -SINK_MPS), CLIMB_MPS)
