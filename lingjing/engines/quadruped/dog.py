"""One dog: its commands, its posture, its collisions and its battery.

A fallen dog lies for `DOWN_S` and is then set upright at its place if nothing is in the way. A dog in the water or with
an empty battery takes no more commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from lingjing.engines.battery import Battery
from lingjing.engines.quadruped.dog_model import DogModel, DogState
from lingjing.engines.quadruped.gait import PERIOD_S
from lingjing.engines.quadruped.ground_ahead import GroundAhead
from lingjing.engines.quadruped.physics import Touch
from lingjing.engines.quadruped.tasks import DogStatus, DogTask, HaltTask, TurnTask, Velocity, WalkTask, stopping
from lingjing.mission.instance import Entity, Vector
from lingjing.mission.kinds import builtin_engines
from lingjing.mission.kinds_format import TopSpeed
from lingjing.mission.vocabulary import BATTERY_EMPTY, COLLIDED, DROWNED, FELL
from lingjing.plugins.requests import STOP, Refusal, number_at_least
from lingjing.plugins.stock import Stock
from lingjing.scene.outlines import compass
from lingjing.trace.records import DEAD, FALLEN, BodyState, Command

SPEED_MPS = 1.5
"""Walking speed of an entity without the property `speed_mps`, m/s (chosen)."""

ENDURANCE_S = 5400.0
"""Time of walking of an entity without the property `endurance_s`, seconds (chosen)."""

KIND = builtin_engines()["quadruped"]
"""The declared kind of this engine."""
_SPEED = KIND.top_speed or TopSpeed(property="speed_mps")

ELECTRONICS_W = 25.0
"""Constant power of computers and sensors, watts (chosen). The motors' power follows from torques and speeds."""

WALKING_W = 410.0
"""Power of motors and electronics at 1.5 m/s on flat ground, watts, measured in this model. The capacity of a battery
follows from it."""

DOWN_S = 3.0
"""Time that a fallen dog lies, seconds (chosen)."""
CAREFUL_MPS = 0.7
"""Speed over kerbs, stairs and steep slopes, m/s.

Measured in this model at this speed. Five steps of 12 cm, eleven headings, ten distances at treads of 40 cm and five at
30 cm: 165 of 165 walks reached the top without a fall. Higher steps: 54 of 55 at 13.2 cm, 33 of 33 at 14 cm, 31 of 33
at 15 cm, 21 of 33 at 16 cm. Slopes: 33 of 33 at 20 degrees, 21 of 33 at 25 degrees. At 1.2 m/s, 141 of 147 walks over
the steps of 12 cm succeeded.
"""

HARD_MPS = 0.5
"""Closing speed from which a contact of the trunk is a collision, m/s (chosen)."""

PAYLOAD_KG = 8.0
"""Payload of a Go2 by its data sheet, kg. A load of this size reduces the speed by the share `_SLOWED`."""

_SLOWED = 0.4
"""Reduction of the speed at full payload, as a share (chosen)."""

_FALLEN = 0.4
"""Uprightness (1 on its feet, -1 on its back) below which a dog is falling (chosen)."""

_FALLEN_S = 0.2
"""Time below `_FALLEN` after which a dog has fallen, seconds (chosen)."""

_SHOVED_MPS, _LEANING = 0.35, 0.9
"""Speed (m/s) and uprightness at which a standing dog balances with its legs (chosen)."""

_AGAIN_S = 2.0
"""Time without contact after which a contact with the same thing is a new one, seconds (chosen)."""

_REMEMBERED_S = 5.0
"""Time for which the last contact counts as the reason of a blocked walk, seconds (chosen)."""

_BEYOND_M = 0.6
"""Distance behind a step over which a dog still walks carefully, metres (chosen)."""

_OPPOSED, _BELLY_M = 0.5, 0.08
"""Cosine of the angle to the heading, and height below the trunk's centre (m), from which a contact blocks the way."""

_MOVING_MPS, _PUSHED_MPS, _KNOCK_MPS = 0.3, 0.2, 12.0
"""Speed of a moving thing that pushes dogs, least closing speed of a push, and limit of its effect; m/s (chosen)."""
_LYING_M, _LYING_S, _LYING_PERIODS = 0.14, 2.0, 25
"""Height over the ground (m), time (s) and interval of checks (periods) of a dog that lies (chosen).

The time excludes a trunk that is low only for a moment, when it is pulled over the edge of a step.
"""

_LOOK_PERIODS, _DIP_PERIODS = 5, 25
"""Control periods between two checks of the ground ahead, and between two checks for water (chosen)."""


class _DogPhase(Enum):
    """The phase of a dog."""

    STANDING = "standing"
    MOVING = "moving"
    FALLEN = "fallen"
    DEAD = "dead"


DONE, BLOCKED, UNREACHABLE = "done", "blocked", "unreachable"
"""Kinds of notices at the end of a task, beside the events of engines."""


@dataclass(frozen=True, slots=True)
class DogNotice:
    """An event of one control period."""

    kind: str
    """`done`, `collided`, `blocked`, `unreachable`, `fell`, `drowned` or `battery_empty`."""
    what: str = ""
    """The other thing, or the hazard ahead; empty if there is none."""
    speed_mps: float = 0.0
    """Closing speed of a collision, m/s; 0 otherwise."""


class Dog:
    """A robot dog. `row` is its index in the present model; every new model sets it anew."""

    def __init__(self, entity: Entity) -> None:
        self.id = entity.id
        self.row = -1
        self.phase = _DogPhase.STANDING
        self.task: DogTask | None = None
        self.battery = Battery.for_endurance(WALKING_W, entity.number_or("endurance_s", ENDURANCE_S))
        self.stock = Stock(entity)
        self._payload_kg = entity.number_or("payload_kg", PAYLOAD_KG)
        self._speed_mps = _SPEED.held(entity.number_or("speed_mps", SPEED_MPS))
        self._ending: HaltTask | None = None
        self._careful_m = -math.inf
        self._before: Vector = (0.0, 0.0, 0.0)
        self._tilted_s = 0.0
        self._low_s = 0.0
        self._down_s = 0.0
        self._met: dict[str, float] = {}
        self._hit = ("", -math.inf)
        self._time_s = 0.0
        self._period = 0

    @property
    def resources(self) -> dict[str, float]:
        """Energy left (0..1 and watt-hours) and goods on board."""
        return {**self.battery.resources, **self.stock.amounts}

    @property
    def cruise_mps(self) -> float:
        """Walking speed with the present load, m/s."""
        share = min(self.stock.load_kg / self._payload_kg, 1.0) if self._payload_kg > 0.0 else 0.0
        return self._speed_mps * (1.0 - _SLOWED * share)

    @property
    def idle(self) -> bool:
        """True if no part of the dog moves by itself."""
        return self.phase is _DogPhase.STANDING or self.phase is _DogPhase.DEAD

    @property
    def progress(self) -> float:
        """Share of the request that is done, 0..1."""
        return self.task.share if self.task is not None else 0.0

    @property
    def status(self) -> DogStatus:
        """Present status word."""
        if self.phase is _DogPhase.DEAD:
            return DEAD
        if self.phase is _DogPhase.FALLEN:
            return FALLEN
        return self.task.status if self.phase is _DogPhase.MOVING and self.task is not None else "standing"

    def start(self, command: Command, here: DogState, model: DogModel, ground: GroundAhead) -> None:
        """Begin a command.

        Raises `Refusal` with `battery`, `dead`, `fallen`, `unknown_verb`, `bad_argument` or `unreachable`.
        """
        if self.battery.empty:
            raise Refusal("battery", f"the battery of `{self.id}` is empty")
        if self.phase is _DogPhase.DEAD:
            raise Refusal(DEAD, f"`{self.id}` is lost")
        if self.phase is _DogPhase.FALLEN:
            raise Refusal(FALLEN, f"`{self.id}` has fallen and is getting up")
        if command.verb == STOP:
            self.task = stopping(here)
            model.ease(self.row)
        elif command.verb == "forward":
            self.task = self._walk(number_at_least(command, "distance", KIND), here, ground)
        elif command.verb in ("left", "right"):
            angle = math.radians(number_at_least(command, "angle", KIND))
            self.task = TurnTask(here.position[0], here.position[1], angle if command.verb == "left" else -angle)
        else:
            raise Refusal("unknown_verb", f"a robot dog has no verb `{command.verb}`")
        self._careful_m = -math.inf
        self._ending = self.task if isinstance(self.task, HaltTask) else None
        self.phase = _DogPhase.MOVING

    def step(
        self,
        here: DogState,
        touches: Sequence[Touch],
        speeds: Mapping[str, Vector],
        model: DogModel,
        ground: GroundAhead,
    ) -> list[DogNotice]:
        """Decide on the coming period, after the last one ended in the state `here`. Return the events.

        `speeds` are the velocities of the things that may be touched, by name.
        """
        self._time_s += PERIOD_S
        self._period += 1
        self.battery.drain(here.watts + ELECTRONICS_W, PERIOD_S)
        notices = self._bumps(here, touches, speeds, model)
        self._before = here.velocity
        ended = self._mishap(here, model, ground)
        if ended is None and self.phase is _DogPhase.MOVING:
            ended = self._go(here, model, ground)
        elif ended is None and self.phase is _DogPhase.STANDING:
            self._balance(here, model)
        return [*notices, ended] if ended is not None else notices

    def rest(self, watts: float) -> DogNotice | None:
        """Account for a period in which the dog does not move; return a notice if the battery is then empty."""
        self._time_s += PERIOD_S
        self._period += 1
        if self.phase is _DogPhase.DEAD:
            return None
        self.battery.drain(watts + ELECTRONICS_W, PERIOD_S)
        return self._exhausted()

    def rise(self, here: DogState, model: DogModel) -> None:
        """Stand upright at the present place."""
        x, y, z = here.position
        model.put(self.row, x, y, z, here.yaw)
        self.phase, self._tilted_s, self._low_s, self._down_s = _DogPhase.STANDING, 0.0, 0.0, 0.0

    @property
    def rested(self) -> bool:
        """True if a fallen dog has lain for `DOWN_S`."""
        return self.phase is _DogPhase.FALLEN and self._down_s >= DOWN_S

    def state(self, here: DogState, joints: tuple[float, ...], remainder_s: float) -> BodyState:
        """Return the state of the dog `remainder_s` seconds after its last step."""
        x, y, z = (at + remainder_s * rate for at, rate in zip(here.position, here.velocity, strict=True))
        return BodyState(
            id=self.id,
            position=(x, y, z),
            velocity=here.velocity,
            heading_deg=compass(90.0 - math.degrees(here.yaw)),
            pitch_deg=math.degrees(here.pitch),
            roll_deg=math.degrees(here.roll),
            status=self.status,
            resources=self.resources,
            joints=joints,
        )

    def _walk(self, distance: float, here: DogState, ground: GroundAhead) -> WalkTask:
        hazard = ground.look(here, here.yaw, distance).hazard if distance > 0.0 else ""
        if hazard:
            raise Refusal("unreachable", f"`{self.id}` does not go on: {_HAZARDS[hazard]}")
        return WalkTask(here.position[0], here.position[1], here.yaw, distance, self.cruise_mps)

    def _go(self, here: DogState, model: DogModel, ground: GroundAhead) -> DogNotice | None:
        task = self._ending or self.task
        assert task is not None
        if isinstance(task, WalkTask):
            task.climbing = task.best <= self._careful_m
            task.cruise = min(self.cruise_mps, CAREFUL_MPS) if task.climbing else self.cruise_mps
        wanted: Velocity = task.wanted(here)
        if task.done and isinstance(task, HaltTask):
            return self._end(model, DogNotice(DONE))
        if task.done and not isinstance(task, HaltTask):
            self._ending = task.end(here)
            model.ease(self.row)
            wanted = self._ending.wanted(here)
        elif task.stuck:
            what, when = self._hit
            return self._end(model, DogNotice(BLOCKED, what if self._time_s - when < _REMEMBERED_S else ""))
        elif isinstance(task, WalkTask) and self._period % _LOOK_PERIODS == 0:
            view = ground.look(here, task.yaw, task.length - task.best)
            if view.hazard:
                self.task, self._ending = None, stopping(here)
                model.ease(self.row)
                return DogNotice(UNREACHABLE, view.hazard)
            self._careful_m = max(self._careful_m, task.best + view.step_m + _BEYOND_M)
        model.walk(self.row, wanted)
        return None

    def _end(self, model: DogModel, notice: DogNotice) -> DogNotice:
        model.lock(self.row)
        self.phase, self.task, self._ending = _DogPhase.STANDING, None, None
        return notice

    def _mishap(self, here: DogState, model: DogModel, ground: GroundAhead) -> DogNotice | None:
        if self.phase is _DogPhase.DEAD:
            return None
        exhausted = self._exhausted()
        if exhausted is not None:
            return self._drop(model, _DogPhase.DEAD, exhausted)
        if self._period % _DIP_PERIODS == 0 and ground.drowns(here.position):
            return self._drop(model, _DogPhase.DEAD, DogNotice(DROWNED))
        if self.phase is _DogPhase.FALLEN:
            self._down_s += PERIOD_S
            return None
        if self._period % _LYING_PERIODS == 0:
            low = ground.height(here.position) < _LYING_M
            self._low_s = self._low_s + _LYING_PERIODS * PERIOD_S if low else 0.0
        self._tilted_s = self._tilted_s + PERIOD_S if here.upright < _FALLEN else 0.0
        if self._tilted_s >= _FALLEN_S or self._low_s >= _LYING_S:
            return self._drop(model, _DogPhase.FALLEN, DogNotice(FELL))
        return None

    def _drop(self, model: DogModel, phase: _DogPhase, notice: DogNotice) -> DogNotice:
        model.cut_power(self.row)
        self.phase, self.task, self._ending, self._down_s = phase, None, None, 0.0
        return notice

    def _exhausted(self) -> DogNotice | None:
        return DogNotice(BATTERY_EMPTY) if self.battery.empty and self.phase is not _DogPhase.DEAD else None

    def _balance(self, here: DogState, model: DogModel) -> None:
        """Start the walking policy if a standing dog is pushed, so that its legs keep it upright."""
        if math.hypot(*here.velocity) > _SHOVED_MPS or (here.upright < _LEANING and here.stir > 1.0):
            self._ending, self.phase = stopping(here), _DogPhase.MOVING
            model.walk(self.row, (0.0, 0.0, 0.0))

    def _bumps(
        self, here: DogState, touches: Sequence[Touch], speeds: Mapping[str, Vector], model: DogModel
    ) -> list[DogNotice]:
        notices = []
        knocked: set[str] = set()
        for touch in touches:
            other = speeds.get(touch.thing, (0.0, 0.0, 0.0))
            if touch.mover and not _touches_now(touch, here, other):
                continue
            if touch.mover and touch.thing not in knocked and math.hypot(other[0], other[1]) > _MOVING_MPS:
                knocked.add(touch.thing)
                self._give_way(touch, here, other, model)
            if touch.trunk or self._hit[0] != touch.thing:
                self._hit = (touch.thing, self._time_s)
            if not touch.trunk and touch.thing not in knocked:
                continue
            ahead = touch.normal[0] * math.cos(here.yaw) + touch.normal[1] * math.sin(here.yaw)
            high = touch.z > here.position[2] - _BELLY_M  # a lower contact is a step that the dog can climb
            if ahead > _OPPOSED and high and self.task is not None:
                self.task.bump()
            fresh = self._time_s - self._met.get(touch.thing, -math.inf) > _AGAIN_S
            self._met[touch.thing] = self._time_s
            closing = _closing(self._before, other, touch)
            if fresh and closing >= HARD_MPS:
                notices.append(DogNotice(COLLIDED, touch.thing, closing))
        return notices

    def _give_way(self, touch: Touch, here: DogState, other: Vector, model: DogModel) -> None:
        """Add the velocity of a push. Moved boxes have no momentum in MuJoCo, so a contact alone would not push
        enough."""
        closing = min(_closing(here.velocity, other, touch), _KNOCK_MPS)
        if closing > _PUSHED_MPS:
            model.add_velocity(self.row, (-closing * touch.normal[0], -closing * touch.normal[1], 0.0))


def _touches_now(touch: Touch, here: DogState, other: Vector) -> bool:
    """Return whether a moving thing touches in this period; contacts with movers are reported before they occur."""
    return touch.gap_m <= max(_closing(here.velocity, other, touch), 0.0) * PERIOD_S


def _closing(mine: Vector, other: Vector, touch: Touch) -> float:
    """Return the closing speed of dog and thing, m/s."""
    return (mine[0] - other[0]) * touch.normal[0] + (mine[1] - other[1]) * touch.normal[1]


_HAZARDS = {"water": "there is water ahead", "drop": "the ground ends ahead"}
