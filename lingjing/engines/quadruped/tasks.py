"""Tasks of a dog: the velocity demand that carries out a walk, a turn or a halt, and its progress.

A walk keeps its heading and returns to its line. It slows down before its end; below a slow walk a dog can only stop. A
dog that pushes against something waits a moment and tries again. A task without progress for `PATIENCE_S` is `stuck`.

On steps a walk has more patience. The policy does not perceive steps, and a foot that meets a riser stays there. The
way up is to step back and try again. Each step back has another length, so that the feet meet the riser in another
phase of the gait.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from lingjing.engines.quadruped.dog_model import DogState
from lingjing.engines.quadruped.gait import PERIOD_S
from lingjing.scene.outlines import wrapped

PATIENCE_S = 4.0
"""Time without progress after which a walk on level ground is stuck, seconds (chosen)."""

CLIMBING_PATIENCE_S = 24.0
"""Time without progress after which a walk on steps is stuck, seconds: enough for a dozen tries (chosen)."""

WAIT_S = 1.0
"""Time that a walk waits after a contact ahead, seconds (chosen)."""

DogStatus = Literal["standing", "walking", "turning", "fallen", "dead"]
"""The status words of a dog; `kinds.json` lists them for the checker."""

Velocity = tuple[float, float, float]
"""Forward and left speed in m/s, anticlockwise turning speed in rad/s."""

_REST: Velocity = (0.0, 0.0, 0.0)

# The following constants were tuned in walks in this model (chosen). Gains are 1/s.
_BRAKE_MPS2 = 1.2
"""Deceleration before the end of a walk, m/s^2."""

_COAST_S = 0.05
"""Time that a dog runs on after the demand ends, seconds."""

_SLOWEST_MPS = 0.35
"""Slowest speed of a walk, m/s."""

_THERE_M = 0.02
"""Distance from the end at which a walk is done, metres."""

_LINE_GAIN, _LINE_MPS = 1.0, 0.3
"""Gain and limit (m/s) of the return to the line."""

_HEADING_GAIN, _HEADING_RADPS = 2.0, 1.0
"""Gain and limit (rad/s) of the return to the heading."""

_CLIMBING_LINE_GAIN, _CLIMBING_HEADING_GAIN = 0.3, 1.0
"""Gains on steps. Higher gains turn over a dog with a foot that is held by a riser."""

_TURN_GAIN, _TURN_RADPS, _SLOWEST_RADPS = 2.2, 1.2, 0.3
"""Gain, largest and smallest speed (rad/s) of a turn on the spot."""

_TURNED_RAD = math.radians(1.5)
"""Angle at which a turn is done, rad."""

_HELD_GAIN, _HELD_MPS = 1.0, 0.25
"""Gain and limit (m/s) of the speed towards a place that a dog holds."""

_HELD_RADPS = 0.6
"""Limit of the turning speed in a halt, rad/s."""

_CALM_MPS, _CALM_STIR, _CALM_PERIODS = 0.1, 1.5, 3
"""Speed (m/s), joint speed (rad/s) and number of periods at which a halt is complete."""

_NEAR_M, _STOP_S = 0.13, 0.37
"""Distance from its place at which a halt may be complete (m), and time that a dog takes to stop (s)."""

_CALM_RADPS = 0.2
"""Turning speed at which a halt is complete, rad/s."""

_CALM_LIMIT_S, _LATE_MPS, _PUSHED_S = 2.0, 0.3, 8.0
"""Time after which a halt at less than a speed (m/s) is complete anyway, and time after which any halt is; seconds."""

_RETREAT_MPS = 0.5
"""Speed of a step back, m/s."""

_PUSH_S, _RETREATS_S = 1.4, (0.7, 1.0, 0.5, 1.2)
"""Time for which a walk without progress pushes on, and times of the steps back that follow in turn; seconds."""

_GAINED_M, _GAINED_RAD = 0.1, math.radians(5.0)
"""Least progress that ends a stall, metres and rad."""


@dataclass(slots=True, kw_only=True)
class _Way:
    """A distance or an angle to cover, with the progress so far."""

    whole: float = 0.0
    """Size, metres or radians."""
    best: float = 0.0
    """Largest part covered so far."""
    stalled_s: float = 0.0
    """Time without progress, seconds."""
    climbing: bool = False
    """True on steps."""
    done: bool = False
    """True once the end is reached."""

    @property
    def share(self) -> float:
        """Share that is covered, 0..1."""
        return min(max(self.best / self.whole, 0.0), 1.0) if self.whole > 0.0 else 1.0

    @property
    def stuck(self) -> bool:
        """True if there has been no progress for too long."""
        return self.stalled_s > (CLIMBING_PATIENCE_S if self.climbing else PATIENCE_S)

    def count(self, covered: float, gained: float) -> None:
        """Take over the covered part. After a stall only a gain of more than `gained` is progress."""
        if covered > self.best + gained or (covered > self.best and self.stalled_s <= 0.0):
            self.best, self.stalled_s = covered, 0.0
        else:
            self.stalled_s += PERIOD_S


@dataclass(slots=True)
class WalkTask(_Way):
    """Walk a line."""

    x: float
    """East coordinate of the start, metres."""
    y: float
    """North coordinate of the start, metres."""
    yaw: float
    """Direction, radians anticlockwise from east."""
    length: float
    """Length, metres."""
    cruise: float
    """Speed, m/s."""
    waiting_s: float = 0.0
    """Time still to wait after a contact, seconds."""
    status: DogStatus = "walking"
    """Status word of the dog."""

    def __post_init__(self) -> None:
        self.whole = self.length

    def end(self, here: DogState) -> HaltTask:
        """Return the halt at the end of the line."""
        goal = self.x + self.length * math.cos(self.yaw), self.y + self.length * math.sin(self.yaw)
        return HaltTask(*goal, self.yaw)

    def bump(self) -> None:
        """Wait before the next try, after a contact ahead."""
        self.waiting_s = WAIT_S

    def wanted(self, here: DogState) -> Velocity:
        """Return the velocity demand of the coming period."""
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
    """Turn on the spot; whole turns count."""

    x: float
    """East coordinate of the place to hold, metres."""
    y: float
    """North coordinate of the place to hold, metres."""
    left: float
    """Angle still to turn, radians anticlockwise."""
    last_yaw: float | None = None
    """Heading in the last period, rad; None before the first."""
    status: DogStatus = "turning"
    """Status word of the dog."""

    def __post_init__(self) -> None:
        self.whole = abs(self.left)

    def end(self, here: DogState) -> HaltTask:
        """Return the halt at the end of the turn."""
        return HaltTask(self.x, self.y, wrapped(here.yaw + self.left))

    def bump(self) -> None:
        """Ignore a contact: the dog pushes along what it touches."""

    def wanted(self, here: DogState) -> Velocity:
        """Return the velocity demand of the coming period."""
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
    """Stop at a place."""

    x: float
    """East coordinate of the place, metres."""
    y: float
    """North coordinate of the place, metres."""
    yaw: float
    """Heading at the place, radians anticlockwise from east."""
    calm: int = 0
    """Number of successive periods at rest."""
    spent_s: float = 0.0
    """Time since the halt began, seconds."""
    share: float = 1.0
    """Share that is covered: a halt counts as complete."""
    stuck: bool = False
    """Always False: a halt ends by itself."""
    done: bool = False
    """True once the dog is at rest, or too late."""
    status: DogStatus = "standing"
    """Status word of the dog."""

    def bump(self) -> None:
        """Ignore a contact."""

    def wanted(self, here: DogState) -> Velocity:
        """Return the velocity demand of the coming period; `done` is set once the dog has been at rest for a moment."""
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
    """Return whether a walk without progress for `stalled_s` is in a step back."""
    left = stalled_s % sum(_PUSH_S + retreat for retreat in _RETREATS_S)
    for retreat in _RETREATS_S:
        if left < _PUSH_S + retreat:
            return left > _PUSH_S
        left -= _PUSH_S + retreat
    return False


def stopping(here: DogState) -> HaltTask:
    """Return the halt from the present speed, at the place where a dog can stop."""
    x, y = (at + _STOP_S * rate for at, rate in zip(here.position[:2], here.velocity[:2], strict=True))
    return HaltTask(x, y, here.yaw)


def _hold(x: float, y: float, here: DogState) -> tuple[float, float]:
    """Return forward and left speed towards a place that the dog holds."""
    east, north = x - here.position[0], y - here.position[1]
    cosine, sine = math.cos(here.yaw), math.sin(here.yaw)
    ahead, side = east * cosine + north * sine, north * cosine - east * sine
    return min(max(_HELD_GAIN * ahead, -_HELD_MPS), _HELD_MPS), min(max(_HELD_GAIN * side, -_HELD_MPS), _HELD_MPS)


DogTask = WalkTask | TurnTask | HaltTask
