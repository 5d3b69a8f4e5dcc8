"""A pack: the dogs that are there now, walking among what is near them, one period at a time.

It joins bodies (`physics`), policy (`gait`) and pace. A pack lasts as long as its surroundings and its members do; the
next one takes over what each dog remembers (`Memory`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lingjing.mission.instance import Vector
from lingjing.plugins.engines.quadruped.assets import Assets
from lingjing.plugins.engines.quadruped.gait import PERIOD_S, Array, Gait
from lingjing.plugins.engines.quadruped.pace import Pace
from lingjing.plugins.engines.quadruped.physics import Carry, Floor, Herd, Mover, Touch
from lingjing.plugins.engines.quadruped.shapes import Shape

STILL_MPS = 0.01
"""A dog is at rest when nothing of it moves faster than this (m/s, rad/s)."""

_COPPER_W = 0.05
"""Heat of a motor, watts for each squared newton metre, from the resistance of such motors."""


@dataclass(frozen=True, slots=True)
class Spot:
    """Where a dog that was not there before is to stand: `yaw` in radians anticlockwise from east."""

    position: Vector
    yaw: float


@dataclass(frozen=True, slots=True)
class Memory:
    """All that decides how a dog goes on: its body, what the policy answered last, its pace."""

    body: Carry
    walking: bool
    answer: Array
    wish: Array
    trim: Array
    seen: Array

    @property
    def place(self) -> Vector:
        """Where the trunk is."""
        x, y, z = self.body.qpos[:3].tolist()
        return x, y, z


@dataclass(frozen=True, slots=True)
class Sense:
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


@dataclass(frozen=True, slots=True)
class Motion:
    """Rotation matrices (count, 3, 3), angular velocities in the body frame (count, 3), joint speeds (count, 12), and
    forward, left and turning speed in the heading frame (count, 3)."""

    attitude: Array
    turning: Array
    speeds: Array
    measured: Array


class Pack:
    """Dogs `ids` in a model of their own."""

    def __init__(
        self,
        assets: Assets,
        members: Sequence[tuple[str, Memory | Spot]],
        shapes: Sequence[Shape],
        ground_m: float,
        pool: int,
    ) -> None:
        self.ids = tuple(name for name, _ in members)
        self._herd = Herd(assets.model, self.ids, shapes, ground_m, pool)
        self._gait = Gait(assets.policy, len(members))
        self._pace = Pace(len(members))
        self._wanted = np.zeros((len(members), 3))
        self._walking = np.zeros(len(members), bool)
        self._motion: Motion | None = None
        for dog, (_, state) in enumerate(members):
            self._enter(dog, state)
        self._herd.settle()
        for dog, (_, state) in enumerate(members):
            if isinstance(state, Spot):
                self.put(dog, *state.position, state.yaw)

    def remember(self, dog: int) -> Memory:
        """What the next pack needs to let this dog go on."""
        pace = self._pace
        parts = (row[dog].copy() for row in (self._gait.answer, pace.wish, pace.trim, pace.seen))
        return Memory(self._herd.carry(dog), bool(self._walking[dog]), *parts)

    def put(self, dog: int, x: float, y: float, z: float, yaw: float) -> None:
        """Stand a dog on what is below a point, at rest."""
        floor = self._herd.floor(x, y, z + 0.5)
        self._herd.stand(dog, x, y, floor.z if math.isfinite(floor.z) else z, yaw)
        self._motion = None
        self._forget(dog)
        self._herd.settle()

    def walk(self, dog: int, wanted: tuple[float, float, float]) -> None:
        """Let the policy move a dog: forward and left m/s, anticlockwise rad/s."""
        if not self._walking[dog]:
            self._herd.unlock(dog)
            self._walking[dog] = True
        self._wanted[dog] = wanted

    def ease(self, dog: int) -> None:
        """Begin to come to rest: drop what was learnt at speed, which would carry the dog past its goal."""
        self._pace.ease(dog)

    def knock(self, dog: int, change: Vector) -> None:
        """See `Herd.knock`."""
        self._herd.knock(dog, change)
        self._motion = None

    def burden(self, dog: int, load_kg: float) -> None:
        """See `Herd.burden`."""
        self._herd.burden(dog, load_kg)

    def lock(self, dog: int) -> None:
        """Let a dog stand as it stands."""
        self._herd.lock(dog)
        self._forget(dog)

    def limp(self, dog: int) -> None:
        """Take the power from a dog's motors."""
        self._forget(dog)
        self._herd.unlock(dog)
        self._herd.aim(np.array([dog]), self._herd.angles[[dog]])

    def step(self) -> None:
        """One period."""
        herd, who = self._herd, np.flatnonzero(self._walking)
        if len(who):
            now = self._now()
            told = self._pace.command(who, self._wanted[who], now.measured[who])
            targets = self._gait.targets(
                who, now.turning[who], -now.attitude[who, 2], told, herd.angles[who], now.speeds[who]
            )
            herd.aim(who, targets)
        herd.step()
        self._motion = None

    def drive(self, movers: Sequence[Mover], elapsed_s: float = 0.0) -> None:
        """Say what moves nearby; where it was `elapsed_s` ago."""
        self._herd.drive(movers, elapsed_s)

    @property
    def driven_s(self) -> float:
        """How long ago the movers were where they were said to be."""
        return self._herd.driven_s

    def clearances(self) -> Array:
        """See `Herd.clearances`."""
        return self._herd.clearances()

    def wait(self) -> None:
        """A period in which no dog stirs."""
        self._herd.pass_time()

    @property
    def quiet(self) -> bool:
        """Whether every dog stands or lies at rest, so that stepping would change nothing."""
        return not self._walking.any() and self._herd.stillness < STILL_MPS

    def floor(self, x: float, y: float, below_m: float) -> Floor:
        """See `Herd.floor`."""
        return self._herd.floor(x, y, below_m)

    def touches(self) -> list[Touch]:
        """See `Herd.touches`."""
        return self._herd.touches()

    def joints(self, dog: int) -> tuple[float, ...]:
        """See `Herd.model_angles`."""
        return self._herd.model_angles(dog)

    def senses(self) -> list[Sense]:
        """All dogs as they are now."""
        herd, now = self._herd, self._now()
        attitude, torques, speeds = now.attitude, herd.torques, now.speeds
        watts = np.maximum(torques * speeds, 0.0).sum(axis=1) + _COPPER_W * (torques * torques).sum(axis=1)
        columns = (
            herd.positions.tolist(),
            herd.velocities.tolist(),
            np.arctan2(attitude[:, 1, 0], attitude[:, 0, 0]).tolist(),
            np.arcsin(np.clip(attitude[:, 2, 0], -1.0, 1.0)).tolist(),
            np.arctan2(attitude[:, 2, 1], attitude[:, 2, 2]).tolist(),
            now.measured[:, 0].tolist(),
            now.measured[:, 2].tolist(),
            attitude[:, 2, 2].tolist(),
            np.abs(speeds).max(axis=1).tolist(),
            watts.tolist(),
        )
        return [Sense(tuple(at), tuple(rate), *rest) for at, rate, *rest in zip(*columns, strict=True)]

    def _now(self) -> Motion:
        """How the dogs move, computed once a period."""
        if self._motion is None:
            herd = self._herd
            attitude, turning = _rotations(herd.quaternions), herd.turning
            self._motion = Motion(attitude, turning, herd.speeds, _in_heading(attitude, herd.velocities, turning))
        return self._motion

    def _enter(self, dog: int, state: Memory | Spot) -> None:
        if isinstance(state, Spot):
            self._herd.stand(dog, *state.position, state.yaw)
            return
        self._herd.resume(dog, state.body)
        self._walking[dog] = state.walking
        self._gait.answer[dog] = state.answer
        self._pace.wish[dog], self._pace.trim[dog], self._pace.seen[dog] = state.wish, state.trim, state.seen

    def _forget(self, dog: int) -> None:
        self._walking[dog] = False
        self._gait.answer[dog] = 0.0
        self._wanted[dog] = 0.0
        self._pace.rest(dog)


def _rotations(quaternions: Array) -> Array:
    """Rotation matrices (count, 3, 3) of unit quaternions (count, 4); row 2 is the world's up in the body frame."""
    w, x, y, z = quaternions.T
    entries = (
        *(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        *(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.array(entries).T.reshape(-1, 3, 3)


def _in_heading(attitude: Array, velocities: Array, turning: Array) -> Array:
    """Forward and left speed in the heading frame and the rate of the heading, (count, 3)."""
    ahead = attitude[:, :2, 0] / np.maximum(np.hypot(attitude[:, 0, 0], attitude[:, 1, 0]), 1e-9)[:, None]
    forward = velocities[:, 0] * ahead[:, 0] + velocities[:, 1] * ahead[:, 1]
    left = velocities[:, 1] * ahead[:, 0] - velocities[:, 0] * ahead[:, 1]
    return np.array((forward, left, (attitude[:, 2] * turning).sum(axis=1))).T


__all__ = ["PERIOD_S", "Memory", "Pack", "Sense", "Spot"]
