"""Inertial measurement units: the noisy specific force and angular rate that an agent observes through `uav.imu`.

A reading is the mean over the last macro-step before the boundary, in the body's frame (ahead, left, up). It has a
constant bias of its body and white noise. Each body has a random stream of its own (`sensor/‹body›/imu`), so the errors
depend on the seed and on the body, and on nothing that is hidden. Vibration, temperature and misalignment are left out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.mission.seeding import generator
from lingjing.trace.records import BodyState

GRAVITY_MPS2 = 9.80665
"""Standard gravity, m/s² (CGPM 1901)."""

_Three = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Motion:
    """The states at the two ends of the last macro-step before a boundary."""

    before: Mapping[str, BodyState]
    after: Mapping[str, BodyState]
    step_s: float
    """Seconds between the two; 0 at boundary 0, which nothing precedes."""


@dataclass(frozen=True, slots=True)
class _Unit:
    """Errors of a unit, for the axes ahead, left and up."""

    force_density: Vector
    """Noise density of the accelerometer, m/s² per root hertz."""
    force_bias_mps2: float
    """Standard deviation of the accelerometer's bias, m/s²."""
    force_most_mps2: float
    """Range of the accelerometer, m/s²."""
    rate_density: float
    """Noise density of the gyroscope, rad/s per root hertz."""
    rate_bias_radps: float
    """Standard deviation of the gyroscope's bias, rad/s."""
    rate_most_radps: float
    """Range of the gyroscope, rad/s."""


UNITS = {
    # Bosch BMI088, data sheet BST-BMI088-DS001. Accelerometer: noise density 160 µg/√Hz (x and y) and 190 µg/√Hz (z),
    # zero-g offset ±20 mg (typical), range ±24 g. Gyroscope: noise density 0.014 °/s/√Hz, zero-rate offset ±1 °/s
    # (typical), range ±2000 °/s. Typical offsets are read as standard deviations (chosen).
    "bmi088": _Unit(
        force_density=(160e-6 * GRAVITY_MPS2, 160e-6 * GRAVITY_MPS2, 190e-6 * GRAVITY_MPS2),
        force_bias_mps2=0.020 * GRAVITY_MPS2,
        force_most_mps2=24.0 * GRAVITY_MPS2,
        rate_density=math.radians(0.014),
        rate_bias_radps=math.radians(1.0),
        rate_most_radps=math.radians(2000.0),
    ),
}
"""Inertial units by the word in `imu = …`."""


@dataclass(frozen=True, slots=True)
class ImuReading:
    """A reading in the body's frame (ahead, left, up)."""

    specific_force: Vector
    """Acceleration less gravity, m/s²: 9.81 upwards at rest."""
    angular_rate: Vector
    """Angular rate about the axes, rad/s."""


class InertialUnits:
    """The inertial units of an instance: errors are a function of seed, body and boundary."""

    def __init__(self, instance: Instance) -> None:
        self._seed, self._sync_s = instance.seed, instance.clock.sync_s
        self._draws: dict[str, list[_Three]] = {}
        self._streams: dict[str, np.random.Generator] = {}

    def read(self, entity: Entity, tick: int, motion: Motion) -> ImuReading:
        """Return the reading of an entity at a boundary. The entity declares `imu`."""
        unit = UNITS[str(entity.properties["imu"])]
        now = motion.after[entity.id]
        force, rate = true_motion(motion.before.get(entity.id, now), now, motion.step_s)
        bias, noise = self._drawn(entity.id, tick)
        mean_s = motion.step_s or self._sync_s
        narrow = 1.0 / math.sqrt(2.0 * mean_s)  # a mean over T has the equivalent noise bandwidth 1/(2T)
        force = force + unit.force_bias_mps2 * bias[:3] + narrow * np.array(unit.force_density) * noise[:3]
        rate = rate + unit.rate_bias_radps * bias[3:] + narrow * unit.rate_density * noise[3:]
        return ImuReading(_clipped(force, unit.force_most_mps2), _clipped(rate, unit.rate_most_radps))

    def _drawn(self, body: str, tick: int) -> tuple[_Three, _Three]:
        """Return the standard normal draws of a body's bias and of its noise at a boundary."""
        stream = self._streams.setdefault(body, generator(self._seed, f"sensor/{body}/imu"))
        known = self._draws.setdefault(body, [])
        while len(known) <= tick + 1:
            known.append(stream.standard_normal(6))
        return known[0], known[tick + 1]


def true_motion(before: BodyState, after: BodyState, step_s: float) -> tuple[_Three, _Three]:
    """Return the mean specific force, m/s², and angular rate, rad/s, between two states, in the body's frame.

    A body without a time between the states is at rest.
    """
    first, last = _axes(before), _axes(after)
    change = np.subtract(after.velocity, before.velocity) / step_s if step_s > 0.0 else np.zeros(3)
    force = change + np.array([0.0, 0.0, GRAVITY_MPS2])
    rate = _rotation_vector(first.T @ last) / step_s if step_s > 0.0 else np.zeros(3)
    return 0.5 * (first.T @ force + last.T @ force), rate


def _axes(state: BodyState) -> _Three:
    """Return the body's axes ahead, left and up in the world, as columns: yaw, then pitch, then roll."""
    angles = math.radians(90.0 - state.heading_deg), math.radians(-state.pitch_deg), math.radians(state.roll_deg)
    (sy, cy), (sp, cp), (sr, cr) = ((math.sin(angle), math.cos(angle)) for angle in angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _rotation_vector(turn: _Three) -> _Three:
    """Return the axis of a rotation times its angle, radians."""
    twice_sine = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    angle = math.atan2(float(np.linalg.norm(twice_sine)), float(np.trace(turn)) - 1.0)
    length = float(np.linalg.norm(twice_sine))
    return twice_sine * (angle / length) if length > 1e-12 else np.zeros(3)


def _clipped(values: _Three, most: float) -> Vector:
    ahead, left, up = np.clip(values, -most, most).tolist()
    return ahead, left, up


__all__ = ["GRAVITY_MPS2", "UNITS", "ImuReading", "InertialUnits", "Motion", "true_motion"]
