"""The missions of served episodes: a free flight in a city, and the changes of a mission's instance."""

from __future__ import annotations

import math
from pathlib import Path

from msgspec.structs import replace

from lingjing.engines.multirotor.verbs import ATTITUDE, LAND, STEER
from lingjing.errors import UsageError
from lingjing.mission.instance import ArgumentSpec, Budget, Clock, Entity, Instance, VerbSpec
from lingjing.mission.kinds import builtin_scenes
from lingjing.mission.vocabulary import PHOTO
from lingjing.scene.camera_geometry import PLACEMENT_LIMITS
from lingjing.scene.picture_weather import WEATHER_LIMITS

LONGEST_TICK_S = 1.0
"""Longest tick of a served episode, seconds (chosen)."""
_ENGINE_STEP_S = 0.01
"""Step that divides every tick, seconds."""
MOST_DRONES = 20
"""Most drones of `--scene` (chosen: JSBSim flies 20 at 23 times real time)."""
_APART_M = 3.0
"""Distance between the drones at the start, metres (chosen)."""
_BAY_START = (306.6, -620.2, 1.875)
"""A place on the pier of the bay for the middle of a standing drone, metres."""

END = "end"
"""Text of the message with which a free flight ends."""
ENDING = "ending"
"""Kind of that message."""

_STEER = VerbSpec(
    name=STEER,
    doc="flies at a velocity",
    arguments=(
        ArgumentSpec(name="east", unit="m/s"),
        ArgumentSpec(name="north", unit="m/s"),
        ArgumentSpec(name="up", unit="m/s"),
        ArgumentSpec(name="heading", unit="deg", optional=True),
    ),
)
_LAND = VerbSpec(name=LAND, doc="descends to the surface below")
_ATTITUDE = VerbSpec(
    name=ATTITUDE,
    doc="holds a tilt",
    arguments=(
        ArgumentSpec(name="roll", unit="deg"),
        ArgumentSpec(name="pitch", unit="deg"),
        ArgumentSpec(name="heading", unit="deg", optional=True),
        ArgumentSpec(name="yaw_rate", unit="deg/s", optional=True),
        ArgumentSpec(name="throttle", optional=True),
        ArgumentSpec(name="height", unit="m", optional=True),
    ),
)

_PLACEMENT = tuple(
    ArgumentSpec(name=name, unit=unit, minimum=least, maximum=most, optional=True)
    for name, (unit, least, most) in (PLACEMENT_LIMITS | WEATHER_LIMITS).items()
)
"""The arguments of `takePhoto` that move the camera, and those that change the weather of the picture."""


def free_flight(scene: str, drones: int, width: int, height: int, minutes: int) -> str:
    """Return the text of a mission without a task: drones in a city.

    `scene` is a kind of scene, or a map's file or folder. `width` and `height` are those of the cameras, pixels. Raises
    `UsageError` for a city that does not exist.
    """
    place = f"at(i, [{', '.join(_start(scene, number) for number in range(drones))}])"
    picture = (
        f"size = {width} by {height}, hfov = 90 deg, channels = [rgb, depth, semantic, instance], capture = on_request"
    )
    return f"""ljs 2
use std.air {{ quadrotor }}
use std.messages {{ note }}
use std.weather {{ clear }}

mission free_flight "Free flight" {{
  goal "Fly."
  scene {_scene(scene)}
  clock {{ tick = 1 s, sync = 500 ms }}
  budget {{ ticks <= {60 * minutes}, policy <= 90 s, engine <= 60 s, capture <= 60 s }}
  weather clear
  mode broadcast

  asset drone[1..{drones}] : quadrotor {{
    position = {place}, heading = 0 deg, cruise = 15 m/s, band = 0 m..400 m
    camera front {{ {picture} }}
    camera nadir {{ {picture} }}
    actions {{ takeoff, setDestination, stop, takePhoto }}
  }}
  agent pilot[i in 1..{drones}] as pilot controls drone[i] {{ observes drone[i].*, events }}
  agent tower as tower {{ observes events }}

  message ending : note from pilot to all
  adjudicate ended(e: ending) {{ when e.text == "{END}" }}
  success when exists e: ended(e)
}}
"""


def served(instance: Instance, tick_s: float, *, moves_cameras: bool = False) -> Instance:
    """Return an instance with a short tick, the same time, and the verbs of set-points on its multirotors.

    `moves_cameras`: `takePhoto` also takes a placement of the camera and the weather of the picture. A mission that is
    judged has the cameras and the weather that it declares, so this is for free flights.
    """
    seconds = instance.budget.ticks * instance.clock.tick_s
    budget: Budget = replace(instance.budget, ticks=max(1, round(seconds / tick_s)))
    entities = tuple(_steerable(entity) for entity in instance.entities)
    if moves_cameras:
        entities = tuple(_with_placements(entity) for entity in entities)
    return replace(instance, clock=Clock(tick_s=tick_s, sync_s=tick_s), budget=budget, entities=entities)


def checked_tick(milliseconds: int) -> float:
    """Return a tick in seconds. Raises `UsageError`."""
    tick_s = milliseconds / 1000.0
    steps = tick_s / _ENGINE_STEP_S
    if not _ENGINE_STEP_S <= tick_s <= LONGEST_TICK_S or not math.isclose(steps, round(steps)):
        hint = f"a multiple of 10 from 10 to {LONGEST_TICK_S * 1000:g}; the default is 50"
        raise UsageError(f"a tick of {milliseconds} ms is not served", hint=hint)
    return tick_s


def _steerable(entity: Entity) -> Entity:
    if entity.engine != "multirotor" or entity.role != "asset":
        return entity
    return replace(entity, verbs=(*entity.verbs, _STEER, _LAND, _ATTITUDE))


def _with_placements(entity: Entity) -> Entity:
    verbs = (
        replace(verb, arguments=(*verb.arguments, *_PLACEMENT)) if verb.name == PHOTO else verb for verb in entity.verbs
    )
    return replace(entity, verbs=tuple(verbs))


def _scene(scene: str) -> str:
    if scene in builtin_scenes() and scene != "map":
        return scene
    path = Path(scene)
    if not path.exists():
        kinds = ", ".join(kind for kind in builtin_scenes() if kind != "map")
        raise UsageError(f"there is no city `{scene}`", hint=f"name a map's file or folder, or one of {kinds}")
    if '"' in scene or "\\" in scene or not scene.isprintable():
        raise UsageError(f"the name of the map `{scene}` cannot be written in a mission", hint="rename it")
    return f'map {{ {"folder" if path.is_dir() else "file"} = "{path}" }}'


def _start(scene: str, number: int) -> str:
    if scene == "bay":
        x, y, z = _BAY_START
        return f"({x} m, {y + _APART_M * number:g} m, {z} m)"
    return f"({_APART_M * number:g} m, 0 m)"
