"""The served methods, and the answer to one call."""

from __future__ import annotations

from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.car_methods import CARS
from lingjing.serve.airsim.context import Context, Later, Method
from lingjing.serve.airsim.flight_methods import FLIGHT
from lingjing.serve.airsim.object_methods import OBJECTS
from lingjing.serve.airsim.picture_methods import PICTURES
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.sky_methods import SKIES
from lingjing.serve.airsim.state_methods import STATE
from lingjing.serve.airsim.world_methods import WORLD

METHODS: dict[str, Method] = {**WORLD, **FLIGHT, **STATE, **PICTURES, **OBJECTS, **SKIES, **CARS}
"""The served methods by their names on the wire."""


def answer(context: Context, call: Call) -> None:
    """Answer a call, now or later. A wrong call is answered with an error."""
    method = METHODS.get(call.method)
    if method is None:
        call.fail(f"`{call.method}` is not served: docs/airsim.md lists the methods that are")
        return
    try:
        result = method(context, call, Arguments(call.method, call.arguments))
    except CallError as error:
        call.fail(str(error))
    else:
        if not isinstance(result, Later):
            call.succeed(result)
