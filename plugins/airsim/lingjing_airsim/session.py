"""The connection to AirSim: calls of the engine, with plain results. Only here is `cosysairsim` imported."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from lingjing.errors import InfrastructureError

_POLL_S = 0.002
"""Wall-clock time between two questions whether AirSim has paused again, seconds (chosen)."""
_LONG_S = 3600.0
"""Time-out of a flight command inside AirSim, seconds: the mission ends earlier."""

ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class Telemetry:
    """The state of one vehicle."""

    north: float
    """Metres from the vehicle's start; so are `east` and `down`."""
    east: float
    down: float
    velocity: tuple[float, float, float]
    """North, east, down, m/s."""
    heading_deg: float
    pitch_deg: float
    roll_deg: float
    landed: bool
    collided: str
    """The name of the thing that was hit in the last interval; "" without a collision, "?" without a name."""


class AirsimSession:
    """Calls of one AirSim. Each may raise `InfrastructureError`."""

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        self._where, self._timeout_s = f"{host} port {port}", timeout_s
        self._loop = asyncio.new_event_loop()
        asyncio.set_event_loop(self._loop)  # the client takes the loop of its thread
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import cosysairsim
        self._api: Any = cosysairsim
        self._client: Any = self._called(
            lambda: cosysairsim.MultirotorClient(ip=host, port=port, timeout_value=max(1, math.ceil(timeout_s)))
        )
        self._called(self._client.ping)

    def begin(self, *, resets: bool) -> tuple[str, ...]:
        """Begin an episode, paused. Returns the names of the vehicles."""
        if resets:
            self._called(self._client.reset)
        names = tuple(str(name) for name in self._called(self._client.listVehicles))
        self._called(lambda: self._client.simPause(True))
        return names

    def control(self, vehicle: str) -> None:
        """Take control of a vehicle."""
        self._called(lambda: self._client.enableApiControl(True, vehicle))
        self._called(lambda: self._client.armDisarm(True, vehicle))

    def fly_to(self, vehicle: str, place: tuple[float, float, float], speed_mps: float, *, forward: bool) -> None:
        """Fly to a place (north, east, down from the start). With `forward` the vehicle turns to it."""
        api = self._api
        train = api.DrivetrainType.ForwardOnly if forward else api.DrivetrainType.MaxDegreeOfFreedom
        self._send(
            lambda: self._client.moveToPositionAsync(
                *place, speed_mps, _LONG_S, train, api.YawMode(True, 0.0) if not forward else api.YawMode(False, 0.0),
                -1, 1, vehicle,
            )
        )  # fmt: skip

    def take_off(self, vehicle: str) -> None:
        """Take off to AirSim's own height."""
        self._send(lambda: self._client.takeoffAsync(_LONG_S, vehicle))

    def hold(self, vehicle: str) -> None:
        """Stop and hold the place."""
        self._send(lambda: self._client.hoverAsync(vehicle))

    def advance(self, seconds: float) -> None:
        """Let time pass, and wait until AirSim has paused again."""
        self._called(lambda: self._client.simContinueForTime(seconds))
        latest = time.monotonic() + self._timeout_s
        while not self._called(self._client.simIsPause):
            if time.monotonic() > latest:
                raise InfrastructureError(f"AirSim at {self._where} has not paused within {self._timeout_s:g} s")
            time.sleep(_POLL_S)

    def telemetry(self, vehicle: str) -> Telemetry:
        """Return the state of a vehicle."""
        state = self._called(lambda: self._client.getMultirotorState(vehicle))
        collision = self._called(lambda: self._client.simGetCollisionInfo(vehicle))
        moving = state.kinematics_estimated
        position, velocity, turn = moving.position, moving.linear_velocity, moving.orientation
        roll, pitch, yaw = _angles(turn.w_val, turn.x_val, turn.y_val, turn.z_val)
        return Telemetry(
            north=float(position.x_val),
            east=float(position.y_val),
            down=float(position.z_val),
            velocity=(float(velocity.x_val), float(velocity.y_val), float(velocity.z_val)),
            heading_deg=math.degrees(yaw) % 360.0,
            pitch_deg=math.degrees(pitch),
            roll_deg=math.degrees(roll),
            landed=state.landed_state == self._api.LandedState.Landed,
            collided=(str(collision.object_name) or "?") if collision.has_collided else "",
        )

    def close(self) -> None:
        """Let AirSim run on, and close the connection."""
        with contextlib.suppress(Exception):  # the connection is closed all the same
            self._client.simPause(False)
        self._client.client.close()
        asyncio.set_event_loop(None)
        self._loop.close()

    def _send(self, call: Callable[[], object]) -> None:
        """Send a command whose end is not awaited: its arrival is seen in the telemetry."""
        self._called(call)
        self._called(self._client.ping)  # runs the client's loop, so that the command is on its way

    def _called(self, call: Callable[[], ResultT]) -> ResultT:
        try:
            return call()
        except InfrastructureError:
            raise
        except Exception as error:
            reason = str(error.args[0] if error.args else error)[:200] or type(error).__name__
            hint = "start it first, or set --engine-arg airsim.host and airsim.port"
            raise InfrastructureError(f"AirSim at {self._where}: {reason}", hint=hint) from error


def _angles(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return (roll, pitch, yaw) of a quaternion in radians, turned in the order yaw, pitch, roll."""
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw
