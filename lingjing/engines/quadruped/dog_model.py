"""The present dogs in one MuJoCo model, with the walking policy, one control period at a time.

The class joins the bodies (`physics`), the policy (`gait`) and the correction of the velocity (`velocity_command`). A
model lasts until the shapes near the dogs or the set of dogs change. The next model continues from each dog's
`DogMemory`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lingjing.engines.quadruped.assets import Assets
from lingjing.engines.quadruped.gait import DogRows, Gait
from lingjing.engines.quadruped.physics import BodyMemory, DogBodies
from lingjing.engines.quadruped.velocity_command import VelocityCommand
from lingjing.mission.instance import Vector
from lingjing.scene.shapes import Shape

STILL_MPS = 0.01
"""Speed of the trunk and of all joints below which a dog is at rest, m/s and rad/s (chosen)."""

_COPPER_W = 0.05
"""Heat of a motor per squared torque, W/(N m)^2, from the winding resistance of such motors."""


@dataclass(frozen=True, slots=True)
class StandingPlace:
    """The place of a dog that enters the model for the first time."""

    position: Vector
    """Position, metres."""
    yaw: float
    """Heading, radians anticlockwise from east."""


@dataclass(frozen=True, slots=True)
class DogMemory:
    """The complete state of a dog, from which another model continues its walk exactly."""

    body: BodyMemory
    """State of the body."""
    walking: bool
    """True if the walking policy moves it."""
    answer: DogRows
    """Last output of the policy."""
    wish: DogRows
    """Rate-limited velocity demand."""
    trim: DogRows
    """Integral of the velocity error."""
    seen: DogRows
    """Filtered measured velocity."""

    @property
    def place(self) -> Vector:
        """Position of the trunk, metres."""
        x, y, z = self.body.qpos[:3].tolist()
        return x, y, z


class DogState(NamedTuple):
    """The state of a dog; the trunk is in world coordinates."""

    position: Vector
    """Position, metres."""
    velocity: Vector
    """Velocity, m/s."""
    yaw: float
    """Heading, radians anticlockwise from east."""
    pitch: float
    """Pitch, rad; positive: nose up."""
    roll: float
    """Roll, rad; positive: right side down."""
    ahead_mps: float
    """Speed along its heading, m/s."""
    turning: float
    """Turning speed, rad/s anticlockwise."""
    upright: float
    """Uprightness: 1 on its feet, -1 on its back."""
    stir: float
    """Speed of the fastest joint, rad/s."""
    watts: float
    """Power of the motors, watts."""


class Motion(NamedTuple):
    """The motion of a trunk."""

    position: Vector
    """Position in the world, metres."""
    velocity: Vector
    """Velocity in the world, m/s."""
    turning: Vector
    """Angular velocity in the body frame, rad/s."""
    up: Vector
    """Unit vector of the world's up in the body frame."""
    yaw: float
    """Heading, radians anticlockwise from east."""
    measured: Vector
    """Forward, left (m/s) and turning speed (rad/s) in the frame of the heading."""


class DogModel(DogBodies):
    """The dogs of one place; the walking policy moves those that walk."""

    def __init__(
        self,
        assets: Assets,
        members: Sequence[tuple[str, DogMemory | StandingPlace]],
        shapes: Sequence[Shape],
        ground_m: float,
        pool: int,
    ) -> None:
        super().__init__(assets.model, [name for name, _ in members], shapes, ground_m, pool)
        self._gait = Gait(assets.policy, len(members))
        self._pace = VelocityCommand(len(members))
        self._wanted = np.zeros((len(members), 3))
        self._walking = np.zeros(len(members), bool)
        self._motion: list[Motion] | None = None
        for dog, (_, state) in enumerate(members):
            self._enter(dog, state)
        self.update_kinematics()
        for dog, (_, state) in enumerate(members):
            if isinstance(state, StandingPlace):
                self.put(dog, *state.position, state.yaw)

    def memory_of(self, dog: int) -> DogMemory:
        """Return the state from which the next model continues this dog."""
        pace = self._pace
        parts = (row[dog].copy() for row in (self._gait.answer, pace.wish, pace.trim, pace.seen))
        return DogMemory(self.body_memory(dog), bool(self._walking[dog]), *parts)

    def put(self, dog: int, x: float, y: float, z: float, yaw: float) -> None:
        """Stand a dog at rest on the surface below a point."""
        floor = self.floor(x, y, z + 0.5)
        self.stand(dog, x, y, floor.z if math.isfinite(floor.z) else z, yaw)
        self._motion = None
        self._forget(dog)
        self.update_kinematics()

    def walk(self, dog: int, wanted: tuple[float, float, float]) -> None:
        """Let the policy move a dog with a velocity: forward and left in m/s, anticlockwise in rad/s."""
        if not self._walking[dog]:
            self.unlock(dog)
            self._walking[dog] = True
        self._wanted[dog] = wanted

    def ease(self, dog: int) -> None:
        """Begin to stop: reset the speed integral, which would carry the dog past its goal."""
        self._pace.ease(dog)

    def add_velocity(self, dog: int, change: Vector) -> None:
        """Change a dog's velocity at once."""
        super().add_velocity(dog, change)
        self._motion = None

    def lock(self, dog: int) -> None:
        """Hold a dog in its present posture."""
        super().lock(dog)
        self._forget(dog)

    def cut_power(self, dog: int) -> None:
        """Switch a dog's motors off."""
        super().cut_power(dog)
        self._forget(dog)

    def step(self) -> None:
        """Advance by one control period."""
        dogs = np.flatnonzero(self._walking)
        if len(dogs):
            now = self._now()
            walking = [now[row] for row in dogs.tolist()]
            commands = self._pace.command(dogs, self._wanted[dogs], np.array([dog.measured for dog in walking]))
            turning, up = np.array([dog.turning for dog in walking]), np.array([dog.up for dog in walking])
            self.set_targets(
                dogs, self._gait.targets(dogs, turning, -up, commands, self.angles[dogs], self.speeds[dogs])
            )
        super().step()
        self._motion = None

    @property
    def quiet(self) -> bool:
        """True if every dog stands or lies at rest, so that a step would change nothing."""
        return not self._walking.any() and self.stillness < STILL_MPS

    def dog_states(self) -> list[DogState]:
        """Return the present states of all dogs."""
        torques, speeds = self.torques, self.speeds
        watts = np.maximum(torques * speeds, 0.0).sum(axis=1) + _COPPER_W * (torques * torques).sum(axis=1)
        stirs = np.abs(speeds).max(axis=1)
        return [
            DogState(
                position=dog.position,
                velocity=dog.velocity,
                yaw=dog.yaw,
                pitch=math.asin(min(max(dog.up[0], -1.0), 1.0)),
                roll=math.atan2(dog.up[1], dog.up[2]),
                ahead_mps=dog.measured[0],
                turning=dog.measured[2],
                upright=dog.up[2],
                stir=stir,
                watts=power,
            )
            for dog, stir, power in zip(self._now(), stirs.tolist(), watts.tolist(), strict=True)
        ]

    def _now(self) -> list[Motion]:
        """Return the motions of all trunks; they are computed once a period."""
        if self._motion is None:
            rows = zip(self.places.tolist(), self.rates.tolist(), strict=True)
            self._motion = [_motion(place, rate) for place, rate in rows]
        return self._motion

    def _enter(self, dog: int, state: DogMemory | StandingPlace) -> None:
        if isinstance(state, StandingPlace):
            self.stand(dog, *state.position, state.yaw)
            return
        self.resume(dog, state.body)
        self._walking[dog] = state.walking
        self._gait.answer[dog] = state.answer
        self._pace.wish[dog], self._pace.trim[dog], self._pace.seen[dog] = state.wish, state.trim, state.seen

    def _forget(self, dog: int) -> None:
        self._walking[dog] = False
        self._gait.answer[dog] = 0.0
        self._wanted[dog] = 0.0
        self._pace.rest(dog)


def _motion(place: Sequence[float], rate: Sequence[float]) -> Motion:
    """Return the motion of a trunk from its pose and its rates.

    `place` is the centre (m) and a unit quaternion. `rate` is the velocity in the world (m/s) and the angular velocity
    in the body frame (rad/s). Plain floats are several times faster than arrays for the usual number of dogs.
    """
    x, y, z, qw, qx, qy, qz = place
    east, north, up, rolling, nodding, turning = rate
    nose_east, nose_north = 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz)
    over = 2.0 * (qx * qz - qw * qy), 2.0 * (qy * qz + qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)
    level = max(math.hypot(nose_east, nose_north), 1e-9)
    cosine, sine = nose_east / level, nose_north / level
    return Motion(
        position=(x, y, z),
        velocity=(east, north, up),
        turning=(rolling, nodding, turning),
        up=over,
        yaw=math.atan2(nose_north, nose_east),
        measured=(
            east * cosine + north * sine,
            north * cosine - east * sine,
            over[0] * rolling + over[1] * nodding + over[2] * turning,
        ),
    )
