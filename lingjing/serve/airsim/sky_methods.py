"""The methods of the weather and of the time of day."""

from __future__ import annotations

from datetime import UTC, datetime

from lingjing.mission.vocabulary import PHOTO
from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import Context, Method
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.skies import FOG, SunClock, local_time

_FASTEST = 1e5
"""Fastest clock of the sun, seconds for each second of mission time (chosen: a year in five minutes)."""


def _enable(context: Context, call: Call, arguments: Arguments) -> None:
    on = arguments.flag("enable")
    arguments.end()
    _check_free(context)
    context.skies.enabled = on


def _set(context: Context, call: Call, arguments: Arguments) -> None:
    parameter, level = arguments.number("param"), arguments.number("val")
    arguments.end()
    _check_free(context)
    if parameter not in range(FOG + 1):
        raise CallError(f"`param` is a WeatherParameter from 0 (Rain) to {FOG} (Fog), not {parameter:g}")
    if not 0.0 <= level <= 1.0:
        raise CallError(f"`val` is a level from 0 to 1, not {level:g}")
    context.skies.levels[int(parameter)] = level


def _time_of_day(context: Context, call: Call, arguments: Arguments) -> None:
    on, text = arguments.flag("is_enabled"), arguments.text("start_datetime")
    summer, speed = arguments.flag("is_start_datetime_dst"), arguments.number("celestial_clock_speed")
    step, moves = arguments.seconds("update_interval_secs"), arguments.flag("move_sun")
    arguments.end()
    _check_free(context)
    if not 0.0 <= speed <= _FASTEST:
        raise CallError(f"`celestial_clock_speed` is a number from 0 to {_FASTEST:g}, not {speed:g}")
    if not text:  # AirSim's default: the present time. The arguments of each picture have the sun's angles.
        start = datetime.now(UTC)
    else:
        start = local_time(text, context.instance.scene.origin[1], summer=summer)
    context.skies.clock = SunClock(start, context.time_s, speed, step) if on and moves else None


def _check_free(context: Context) -> None:
    """Raise `CallError` in a mission: it declares its weather."""
    names = (
        argument.name
        for vehicle in context.fleet.vehicles
        for verb in vehicle.entity.verbs
        if verb.name == PHOTO
        for argument in verb.arguments
    )
    if "visibility" not in names:
        raise CallError("the mission declares its weather and its sun: a free flight (--scene) can change them")


SKIES: dict[str, Method] = {
    "simEnableWeather": _enable,
    "simSetWeatherParameter": _set,
    "simSetTimeOfDay": _time_of_day,
}
"""The methods by name."""
