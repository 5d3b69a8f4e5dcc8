"""From a command to velocities: walk a line, turn on the spot, stop, and say how it is going.

A walk holds its heading and comes back to its line; it slows down before its end, and what a dog cannot do slower than
at a slow walk it does by stopping. A dog that pushes against something waits a moment and tries again; a request that
has come no further for `PATIENCE_S` is given up by whoever asks `stuck`. On steps a walk is given up later: the policy
does not see them, a foot that meets a riser stays there, and the way up is to step back and come again. Each time it
steps back by another distance, so that the feet meet the riser in another phase of the gait.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.quadruped.dog_model import DogState
from lingjing.engines.quadruped.gait import PERIOD_S
from lingjing.scene.outlines import wrapped

PATIENCE_S = 4.0
CLIMBING_PATIENCE_S = 24.0
"""How long a walk may come no further on level ground, and on steps: a dozen tries."""

WAIT_S = 1.0

Velocity = tuple[float, float, float]
"""Forward and left in m/s, anticlockwise in rad/s."""

_REST: Velocity = (0.0, 0.0, 0.0)
_BRAKE_MPS2 = 1.2
_COAST_S = 0.05
_SLOWEST_MPS = 0.35
_THERE_M = 0.02
_LINE_GAIN, _LINE_MPS = 1.0, 0.3
_HEADING_GAIN, _HEADING_RADPS = 2.0, 1.0
_CLIMBING_LINE_GAIN, _CLIMBING_HEADING_GAIN = 0.3, 1.0
"""On steps: a dog whose foot is held by a riser is twisted over by stronger ones."""

_TURN_GAIN, _TURN_RADPS, _SLOWEST_RADPS = 2.2, 1.2, 0.3
_TURNED_RAD = math.radians(1.5)
_HELD_GAIN, _HELD_MPS = 1.0, 0.25
_HELD_RADPS = 0.6
_CALM_MPS, _CALM_STIR, _CALM_PERIODS = 0.1, 1.5, 3
_NEAR_M, _STOP_S = 0.13, 0.37
_CALM_RADPS = 0.2
_CALM_LIMIT_S, _LATE_MPS, _PUSHED_S = 2.0, 0.3, 8.0
_RETREAT_MPS = 0.5
_PUSH_S, _RETREATS_S = 1.4, (0.7, 1.0, 0.5, 1.2)
"""A walk that comes no further pushes on for so long, then steps back for the next of these, in turn."""

_GAINED_M, _GAINED_RAD = 0.1, math.radians(5.0)


@dataclass(slots=True, kw_only=True)
class _Way:
    """A distance or an angle of size `whole` that is to be covered, how much of it was at best, and since when no
    more."""

    whole: float = 0.0
    best: float = 0.0
    stalled_s: float = 0.0
    climbing: bool = False
    done: bool = False

    @property
    def share(self) -> float:
        """How much is behind, 0..1."""
        return min(max(self.best / self.whole, 0.0), 1.0) if self.whole > 0.0 else 1.0

    @property
    def stuck(self) -> bool:
        """Whether it has come no further for too long."""
        return self.stalled_s > (CLIMBING_PATIENCE_S if self.climbing else PATIENCE_S)

    def count(self, covered: float, gained: float) -> None:
        """Take what is covered now; once stalled, less than `gained` is no progress."""
        if covered > self.best + gained or (covered > self.best and self.stalled_s <= 0.0):
            self.best, self.stalled_s = covered, 0.0
        else:
            self.stalled_s += PERIOD_S


@dataclass(slots=True)
class WalkTask(_Way):
    """Go `length` metres along `yaw` (radians) from where it begins."""

    x: float
    y: float
    yaw: float
    length: float
    cruise: float
    waiting_s: float = 0.0
    status: str = "walking"

    def __post_init__(self) -> None:
        self.whole = self.length

    def end(self, here: DogState) -> HaltTask:
        """How to stop once the end is reached."""
        goal = self.x + self.length * math.cos(self.yaw), self.y + self.length * math.sin(self.yaw)
        return HaltTask(*goal, self.yaw)

    def bump(self) -> None:
        """Something is in the way: wait before the next try."""
        self.waiting_s = WAIT_S

    def wanted(self, here: DogState) -> Velocity:
        """What to do in the coming period."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        east, north = here.position[0] - self.x, here.position[1] - self.y
        along, left = east * cosine + north * sine, north * cosine - east * sine
        self.count(along, _GAINED_M)
        remaining = self.length - along
        self.done = remaining - _COAST_S * max(here.ahead_mps, 0.0) < _THERE_M
        if self.done:
            return _REST
        if self.waiting_s > 0.0:
            self.waiting_s -= PERIOD_S
            return _REST
        off = wrapped(self.yaw - here.yaw)
        line_gain, heading_gain = _LINE_GAIN, _HEADING_GAIN
        if self.climbing:
            line_gain, heading_gain = _CLIMBING_LINE_GAIN, _CLIMBING_HEADING_GAIN
        if _steps_back(self.stalled_s):
            return -_RETREAT_MPS, 0.0, heading_gain * off
        turn = min(max(heading_gain * off, -_HEADING_RADPS), _HEADING_RADPS)
        side = min(max(-line_gain * left, -_LINE_MPS), _LINE_MPS)
        speed = min(self.cruise, math.sqrt(2.0 * _BRAKE_MPS2 * remaining))
        speed = max(speed, min(self.cruise, _SLOWEST_MPS)) * max(math.cos(off), 0.0)
        return speed, side, turn


@dataclass(slots=True)
class TurnTask(_Way):
    """Turn by `left` radians anticlockwise on the spot; whole turns count."""

    x: float
    y: float
    left: float
    last_yaw: float | None = None
    status: str = "turning"

    def __post_init__(self) -> None:
        self.whole = abs(self.left)

    def end(self, here: DogState) -> HaltTask:
        """How to stop once the turn is done."""
        return HaltTask(self.x, self.y, wrapped(here.yaw + self.left))

    def bump(self) -> None:
        """Turning goes on: what is touched on the way is pushed along."""

    def wanted(self, here: DogState) -> Velocity:
        """What to do in the coming period."""
        if self.last_yaw is not None:
            self.left -= wrapped(here.yaw - self.last_yaw)
        self.last_yaw = here.yaw
        self.count(self.whole - abs(self.left), _GAINED_RAD)
        self.done = abs(self.left) < _TURNED_RAD
        if self.done:
            return _REST
        rate = min(max(abs(_TURN_GAIN * self.left), _SLOWEST_RADPS), _TURN_RADPS)
        return (*_hold(self.x, self.y, here), math.copysign(rate, self.left))


@dataclass(slots=True)
class HaltTask:
    """Come to rest at a place, facing `yaw` (radians)."""

    x: float
    y: float
    yaw: float
    calm: int = 0
    spent_s: float = 0.0
    share: float = 1.0
    stuck: bool = False
    done: bool = False
    status: str = "standing"

    def bump(self) -> None:
        """Nothing to wait for."""

    def wanted(self, here: DogState) -> Velocity:
        """What to do in the coming period; `done` once the dog has been calm for a moment."""
        off = wrapped(self.yaw - here.yaw)
        away = math.dist((self.x, self.y), here.position[:2])
        still = abs(here.ahead_mps) < _CALM_MPS and here.stir < _CALM_STIR and abs(here.turning) < _CALM_RADPS
        self.calm = self.calm + 1 if still and abs(off) < _TURNED_RAD and away < _NEAR_M else 0
        self.spent_s += PERIOD_S
        late = (self.spent_s > _CALM_LIMIT_S and math.hypot(*here.velocity) < _LATE_MPS) or self.spent_s > _PUSHED_S
        self.done = self.calm >= _CALM_PERIODS or late
        ahead, side = _hold(self.x, self.y, here)
        return ahead, side, min(max(_HEADING_GAIN * off, -_HELD_RADPS), _HELD_RADPS)


def _steps_back(stalled_s: float) -> bool:
    """Whether a walk that has come no further for so long is stepping back just now."""
    left = stalled_s % sum(_PUSH_S + retreat for retreat in _RETREATS_S)
    for retreat in _RETREATS_S:
        if left < _PUSH_S + retreat:
            return left > _PUSH_S
        left -= _PUSH_S + retreat
    return False


def stopping(here: DogState) -> HaltTask:
    """Come to rest from any speed, as soon as legs can."""
    x, y = (at + _STOP_S * rate for at, rate in zip(here.position[:2], here.velocity[:2], strict=True))
    return HaltTask(x, y, here.yaw)


def _hold(x: float, y: float, here: DogState) -> tuple[float, float]:
    """Forward and left speed towards a place that should not be left."""
    east, north = x - here.position[0], y - here.position[1]
    cosine, sine = math.cos(here.yaw), math.sin(here.yaw)
    ahead, side = east * cosine + north * sine, north * cosine - east * sine
    return min(max(_HELD_GAIN * ahead, -_HELD_MPS), _HELD_MPS), min(max(_HELD_GAIN * side, -_HELD_MPS), _HELD_MPS)


DogTask = WalkTask | TurnTask | HaltTask
