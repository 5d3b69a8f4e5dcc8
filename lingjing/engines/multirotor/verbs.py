"""Plans for commands: the points to fly to, in order, or a refusal with its reason.

Moves are metres in the frame of the heading; destinations are world metres. A grounded vehicle climbs before it flies
to a destination. A plan does not check for obstacles on the way: a policy can fly into a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from lingjing.engines.aircraft import path_length
from lingjing.engines.multirotor.power import hover_power
from lingjing.mission.instance import Vector
from lingjing.mission.kinds import builtin_engines
from lingjing.plugins.requests import Refusal, number, number_at_least, optional_number
from lingjing.scene.flight_floor import SWING_M, FlightFloor
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import GROUNDED, Command

TAKEOFF_M = 10.0
"""Height above the take-off point, metres: the default of `takeoff`, and the first climb towards a destination
(chosen)."""

STEER, LAND, ATTITUDE = "steer", "land", "attitude"
"""The verbs of set-points. No mission declares them: a face that flies a vehicle from outside (`lingjing.serve`) adds
them to the vehicles of its episode. They complete when they are admitted.

- `steer(east, north, up, heading)`: fly at this velocity over ground, m/s, until the next command. Without a velocity
  the vehicle brakes and holds its place. `heading` in degrees is optional. A grounded vehicle takes off if `up` > 0.
- `land()`: descend at the present place to the surface below.
- `attitude(roll, pitch, heading | yaw_rate, throttle | height)`: hold a tilt (degrees; right and nose up are positive)
  until the next command, with a heading (degrees) or a yaw rate (degrees a second), and with a share of the largest
  thrust (0 to 1) or at an elevation (metres). A grounded vehicle takes off if the thrust or the elevation lifts it.
"""

_FACING_M = 3.0
"""Distance below which a destination does not change the heading, metres (chosen)."""
_ROUNDING_M = 1e-6
"""Tolerance of contact with a roof for a body at its lowest allowed height, metres: rounding errors are smaller."""
_BEST_MPS = 21.0
"""Speed that no vehicle exceeds, m/s: a bound for refusals (chosen)."""

_BEST_POWER_SHARE = 0.6
"""Least power of any flight as a share of the hovering power: a bound for refusals (chosen)."""
_DIRECTIONS = {"forward": 0.0, "right": 90.0, "backward": 180.0, "left": 270.0}
"""Angle of each move from the heading, degrees clockwise."""


@dataclass(frozen=True, slots=True)
class _FlightTask:
    """The plan of one command."""

    legs: tuple[Vector, ...]
    """Points to fly to, in order, metres."""
    face_rad: float | None = None
    """Heading to turn to, rad; None keeps the heading."""
    arrives: bool = True
    """True if reaching the last point emits an event."""


@dataclass(frozen=True, slots=True)
class Situation:
    """The state of a vehicle that a plan depends on."""

    position: Vector
    """Position, metres."""
    heading_rad: float
    """Heading, rad clockwise from north."""
    grounded: bool
    """True on the ground."""
    left_wh: float
    """Energy left, watt-hours."""
    band_low_m: float = -math.inf
    """The lowest elevation of the vehicle's band, metres; minus infinity without one."""


KIND = builtin_engines()["multirotor"]
"""The declared kind of this engine."""


def plan(command: Command, here: Situation, terrain: Terrain, floor: FlightFloor) -> _FlightTask:
    """Return the task of a command other than `stop`.

    Raises `Refusal` with `unknown_verb`, `bad_argument`, `grounded`, `airborne`, `unreachable` or `battery`.
    """
    if command.verb == "takeoff":
        return _takeoff(command, here)
    if command.verb == "setDestination":
        task = _destination(command, here)
    elif command.verb in _DIRECTIONS or command.verb in ("up", "down"):
        task = _move(command, here)
    else:
        raise Refusal("unknown_verb", f"a multirotor has no verb `{command.verb}`")
    task = _over_floor(command, task, here, floor)
    _check_free(task.legs[-1], terrain, floor)
    _check_range(task, here)
    return task


def _takeoff(command: Command, here: Situation) -> _FlightTask:
    if not here.grounded:
        raise Refusal("airborne", f"`{command.resource}` is flying already")
    has_altitude = optional_number(command, "altitude") is not None
    usual = max(TAKEOFF_M, here.band_low_m - here.position[2])  # a default must not leave it below its band
    altitude = number_at_least(command, "altitude", KIND) if has_altitude else usual
    return _FlightTask(legs=(_raised(here.position, altitude),), arrives=False)


def _destination(command: Command, here: Situation) -> _FlightTask:
    goal = number(command, "x"), number(command, "y"), number(command, "z")
    east, north = goal[0] - here.position[0], goal[1] - here.position[1]
    face = math.atan2(east, north) if math.hypot(east, north) > _FACING_M else None
    if not here.grounded:
        return _FlightTask(legs=(goal,), face_rad=face)
    climb = min(max(goal[2] - here.position[2], 2.0), TAKEOFF_M)
    return _FlightTask(legs=(_raised(here.position, climb), goal), face_rad=face)


def _move(command: Command, here: Situation) -> _FlightTask:
    distance = number_at_least(command, "distance", KIND)
    if here.grounded and command.verb != "up":
        raise Refusal(GROUNDED, f"`{command.resource}` is on the ground: `takeoff` or `setDestination` first")
    if command.verb in ("up", "down"):
        return _FlightTask(legs=(_raised(here.position, distance if command.verb == "up" else -distance),))
    course = here.heading_rad + math.radians(_DIRECTIONS[command.verb])
    x, y, z = here.position
    return _FlightTask(legs=((x + distance * math.sin(course), y + distance * math.cos(course), z),))


def _raised(position: Vector, height: float) -> Vector:
    return position[0], position[1], position[2] + height


def _over_floor(command: Command, task: _FlightTask, here: Situation, floor: FlightFloor) -> _FlightTask:
    """Return the task with its end raised to the floor if the end lies less than `SWING_M` below it.

    `SWING_M` is how far a hovering body moves up and down. Raises `Refusal` if the end lies deeper.
    """
    x, y, z = task.legs[-1]
    lowest = floor.beneath(x, y, here.position[2] if command.verb == "down" else z)
    if z >= lowest:
        return task
    if z < lowest - SWING_M:
        place = f"({x:.1f}, {y:.1f}, {z:.1f})"
        raise Refusal("unreachable", f"{place} is under the surface or too close to it: at least z = {lowest:.1f} m")
    return replace(task, legs=(*task.legs[:-1], (x, y, lowest)))


def _check_free(goal: Vector, terrain: Terrain, floor: FlightFloor) -> None:
    x, y, z = goal
    free = floor.clearance_m - _ROUNDING_M
    for solid in terrain.solids_at(x, y, z - free, z + free, floor.margin_m):
        place, top = f"({x:.1f}, {y:.1f}, {z:.1f})", solid.top_at(x, y)
        raise Refusal("unreachable", f"{place} is inside `{solid.id}`, or too close to it; its top is at {top:.1f} m")


def _check_range(task: _FlightTask, here: Situation) -> None:
    # A lower bound (top speed, least power): no destination that can be reached is refused.
    length = path_length(here.position, task.legs)
    least = length / _BEST_MPS * _BEST_POWER_SHARE * hover_power() / 3600.0
    if least > here.left_wh:
        raise Refusal("battery", f"{length:.0f} m need at least {least:.1f} Wh, {here.left_wh:.1f} Wh are left")
