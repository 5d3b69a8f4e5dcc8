"""The dogs that are there now in one MuJoCo model, walking among what is near them, one period at a time.

It joins bodies (`physics`), policy (`gait`) and pace. A model lasts as long as its surroundings and its members do; the
next one takes over what each dog remembers (`DogMemory`).
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
"""A dog is at rest when nothing of it moves faster than this (m/s, rad/s)."""

_COPPER_W = 0.05
"""Heat of a motor, watts for each squared newton metre, from the resistance of such motors."""


@dataclass(frozen=True, slots=True)
class StandingPlace:
    """Where a dog that was not there before is to stand: `yaw` in radians anticlockwise from east."""

    position: Vector
    yaw: float


@dataclass(frozen=True, slots=True)
class DogMemory:
    """All that decides how a dog goes on: its body, what the policy answered last, its pace."""

    body: BodyMemory
    walking: bool
    answer: DogRows
    wish: DogRows
    trim: DogRows
    seen: DogRows

    @property
    def place(self) -> Vector:
        """Where the trunk is."""
        x, y, z = self.body.qpos[:3].tolist()
        return x, y, z


class DogState(NamedTuple):
    """A dog now: trunk in the world (metres, m/s, radians; `yaw` anticlockwise from east, pitch nose up, roll right
    side down), `ahead_mps` along its heading, `upright` 1 on its feet to -1 on its back, `stir` its fastest joint
    (rad/s), `watts` what its motors take."""

    position: Vector
    velocity: Vector
    yaw: float
    pitch: float
    roll: float
    ahead_mps: float
    turning: float
    upright: float
    stir: float
    watts: float


class Motion(NamedTuple):
    """A trunk: position and velocity in the world (metres, m/s), angular velocity and the world's up in the body frame
    (rad/s), `yaw` as in `DogState`, and forward, left and turning speed in the heading frame."""

    position: Vector
    velocity: Vector
    turning: Vector
    up: Vector
    yaw: float
    measured: Vector


class DogModel(DogBodies):
    """The dogs of one place, moved by the policy where they walk."""

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
        self.settle()
        for dog, (_, state) in enumerate(members):
            if isinstance(state, StandingPlace):
                self.put(dog, *state.position, state.yaw)

    def remember(self, dog: int) -> DogMemory:
        """What the next model needs to let this dog go on."""
        pace = self._pace
        parts = (row[dog].copy() for row in (self._gait.answer, pace.wish, pace.trim, pace.seen))
        return DogMemory(self.carry(dog), bool(self._walking[dog]), *parts)

    def put(self, dog: int, x: float, y: float, z: float, yaw: float) -> None:
        """Stand a dog on what is below a point, at rest."""
        floor = self.floor(x, y, z + 0.5)
        self.stand(dog, x, y, floor.z if math.isfinite(floor.z) else z, yaw)
        self._motion = None
        self._forget(dog)
        self.settle()

    def walk(self, dog: int, wanted: tuple[float, float, float]) -> None:
        """Let the policy move a dog: forward and left m/s, anticlockwise rad/s."""
        if not self._walking[dog]:
            self.unlock(dog)
            self._walking[dog] = True
        self._wanted[dog] = wanted

    def ease(self, dog: int) -> None:
        """Begin to come to rest: drop what was learnt at speed, which would carry the dog past its goal."""
        self._pace.ease(dog)

    def knock(self, dog: int, change: Vector) -> None:
        """Change a dog's velocity at once."""
        super().knock(dog, change)
        self._motion = None

    def lock(self, dog: int) -> None:
        """Let a dog stand as it stands."""
        super().lock(dog)
        self._forget(dog)

    def limp(self, dog: int) -> None:
        """Take the power from a dog's motors."""
        super().limp(dog)
        self._forget(dog)

    def step(self) -> None:
        """One period."""
        who = np.flatnonzero(self._walking)
        if len(who):
            now = self._now()
            walking = [now[dog] for dog in who.tolist()]
            told = self._pace.command(who, self._wanted[who], np.array([dog.measured for dog in walking]))
            turning, up = np.array([dog.turning for dog in walking]), np.array([dog.up for dog in walking])
            self.aim(who, self._gait.targets(who, turning, -up, told, self.angles[who], self.speeds[who]))
        super().step()
        self._motion = None

    @property
    def quiet(self) -> bool:
        """Whether every dog stands or lies at rest, so that stepping would change nothing."""
        return not self._walking.any() and self.stillness < STILL_MPS

    def senses(self) -> list[DogState]:
        """All dogs as they are now."""
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
        """How the dogs move, computed once a period."""
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
    """From a trunk's place (metres, unit quaternion) and rates (m/s in the world, rad/s in the body frame). In plain
    numbers: for as many dogs as walk together that is several times faster than arrays."""
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
