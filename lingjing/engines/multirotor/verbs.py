"""From a command to a task: the points to fly to, in order, or a refusal with its reason.

Moves are metres in the heading's frame; destinations are world metres. A grounded vehicle that is given a destination
climbs first. Whether a path is free is not promised: flying into a wall is the pilot's mistake to make.
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
"""Height above the take-off point that `takeoff` reaches by default and a destination from the ground passes."""

_FACING_M = 3.0
_ROUNDING_M = 1e-6
"""A body at the lowest point over a roof is in touch with it by no more than this."""
_BEST_MPS = 21.0
_BEST_POWER_SHARE = 0.6
_DIRECTIONS = {"forward": 0.0, "right": 90.0, "backward": 180.0, "left": 270.0}


@dataclass(frozen=True, slots=True)
class FlightTask:
    """Points to fly to, in order; `face_rad` is the heading to turn to, None to keep it. `arrives` if reaching the
    last one is worth an event."""

    legs: tuple[Vector, ...]
    face_rad: float | None = None
    arrives: bool = True


@dataclass(frozen=True, slots=True)
class Situation:
    """What planning needs to know of a vehicle."""

    position: Vector
    heading_rad: float
    grounded: bool
    left_wh: float


KIND = builtin_engines()["multirotor"]


def plan(command: Command, here: Situation, terrain: Terrain, floor: FlightFloor) -> FlightTask:
    """The task of a command other than `stop`, or `Refusal`: `unknown_verb`, `bad_argument`, `grounded`, `airborne`,
    `unreachable`, `battery`."""
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


def _takeoff(command: Command, here: Situation) -> FlightTask:
    if not here.grounded:
        raise Refusal("airborne", f"`{command.resource}` is flying already")
    is_given = optional_number(command, "altitude") is not None
    altitude = number_at_least(command, "altitude", KIND) if is_given else TAKEOFF_M
    return FlightTask(legs=(_raised(here.position, altitude),), arrives=False)


def _destination(command: Command, here: Situation) -> FlightTask:
    goal = number(command, "x"), number(command, "y"), number(command, "z")
    east, north = goal[0] - here.position[0], goal[1] - here.position[1]
    face = math.atan2(east, north) if math.hypot(east, north) > _FACING_M else None
    if not here.grounded:
        return FlightTask(legs=(goal,), face_rad=face)
    climb = min(max(goal[2] - here.position[2], 2.0), TAKEOFF_M)
    return FlightTask(legs=(_raised(here.position, climb), goal), face_rad=face)


def _move(command: Command, here: Situation) -> FlightTask:
    distance = number_at_least(command, "distance", KIND)
    if here.grounded and command.verb != "up":
        raise Refusal(GROUNDED, f"`{command.resource}` is on the ground: `takeoff` or `setDestination` first")
    if command.verb in ("up", "down"):
        return FlightTask(legs=(_raised(here.position, distance if command.verb == "up" else -distance),))
    course = here.heading_rad + math.radians(_DIRECTIONS[command.verb])
    x, y, z = here.position
    return FlightTask(legs=((x + distance * math.sin(course), y + distance * math.cos(course), z),))


def _raised(position: Vector, height: float) -> Vector:
    return position[0], position[1], position[2] + height


def _over_floor(command: Command, task: FlightTask, here: Situation, floor: FlightFloor) -> FlightTask:
    """The task with its end at the floor where it lies less than the swing of a hovering body below that; `Refusal`
    where it lies deeper."""
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


def _check_range(task: FlightTask, here: Situation) -> None:
    # A lower bound (top speed at the least power), so that nothing possible is refused.
    length = path_length(here.position, task.legs)
    least = length / _BEST_MPS * _BEST_POWER_SHARE * hover_power() / 3600.0
    if least > here.left_wh:
        raise Refusal("battery", f"{length:.0f} m need at least {least:.1f} Wh, {here.left_wh:.1f} Wh are left")
