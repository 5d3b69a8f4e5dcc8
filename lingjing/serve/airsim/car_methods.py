"""The methods that drive cars."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import LATER, Context, Later, Method
from lingjing.serve.airsim.driving import Controls
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.vehicles import Vehicle

_VERBS = frozenset({"forward", "left", "right", "stop"})


def _set(context: Context, call: Call, arguments: Arguments) -> Later:
    record = arguments.record("controls")
    vehicle = _car(context, arguments)
    if not vehicle.controlled:
        raise CallError(f"API control of `{vehicle.name}` is off: call `enableApiControl` first")
    missing = _VERBS - {verb.name for verb in vehicle.entity.verbs}
    if missing:
        raise CallError(f"`setCarControls`: the mission gives `{vehicle.name}` no {', '.join(sorted(missing))}")
    numbers = Arguments("setCarControls", [record.get(name, 0.0) for name in ("throttle", "steering", "brake")])
    throttle, steering, brake = (numbers.number(name) for name in ("throttle", "steering", "brake"))
    gear = record.get("manual_gear")
    controls = Controls(
        throttle=throttle,
        steering=steering,
        brake=brake,
        handbrake=record.get("handbrake") is True,
        is_manual_gear=record.get("is_manual_gear") is True,
        manual_gear=gear if type(gear) is int else 0,
        gear_immediate=record.get("gear_immediate") is not False,
    )
    if controls.reverses:
        raise CallError("`setCarControls`: cars follow their lanes here, and do not reverse")
    vehicle.driver.steer(controls, call)
    if context.paused:
        vehicle.driver.release()
    return LATER


def _get(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    return asdict(_car(context, arguments).driver.controls)


def _car(context: Context, arguments: Arguments) -> Vehicle:
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    if vehicle.flies:
        raise CallError(f"`{vehicle.name}` is no car")
    return vehicle


CARS: dict[str, Method] = {"setCarControls": _set, "getCarControls": _get}
"""The methods by name."""
