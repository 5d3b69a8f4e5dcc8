"""Inertial units: the true motion, the size of the errors, and what agents and the trace have."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lingjing.kernel.imu import InertialUnits, Motion, true_motion
from lingjing.testing import compile_text, compiled, instantiate, play
from lingjing.trace.records import BodyState

MISSION = """
ljs 2
use std.air { quadrotor }

mission inertial "By its inertial unit" {
  goal "Fly to the yard."
  scene residential { extent = 300 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 3 }
  region yard = box((90 m, 90 m), (120 m, 120 m))
  asset uav : quadrotor { position = (0 m, -60 m, 60 m), imu = bmi088 }
  agent pilot as pilot controls uav { observes uav.imu, uav.status, events }
  success when uav in yard
}
"""
G = 9.80665


def body(**changes: object) -> BodyState:
    return BodyState(id="uav", position=(0.0, 0.0, 0.0), **changes)


@pytest.mark.parametrize(
    ("before", "after", "force", "rate"),
    [
        ({}, {}, (0, 0, G), (0, 0, 0)),
        ({"heading_deg": 90}, {"heading_deg": 90, "velocity": (1, 0, 0)}, (2, 0, G), (0, 0, 0)),  # ahead is east
        ({"heading_deg": 90}, {"heading_deg": 90, "velocity": (0, 1, 0)}, (0, 2, G), (0, 0, 0)),  # left is north
        ({"heading_deg": 10}, {"heading_deg": 0}, (0, 0, G), (0, 0, math.radians(20))),  # a turn to the left
        ({"heading_deg": 350}, {"heading_deg": 10}, (0, 0, G), (0, 0, -math.radians(40))),
        ({"pitch_deg": 30}, {"pitch_deg": 30}, (G / 2, 0, G * math.cos(math.pi / 6)), (0, 0, 0)),  # the nose up
        ({"roll_deg": 30}, {"roll_deg": 30}, (0, G / 2, G * math.cos(math.pi / 6)), (0, 0, 0)),  # the left side up
        ({"velocity": (0, 0, 0)}, {"velocity": (0, 0, -G / 2)}, (0, 0, 0), (0, 0, 0)),  # a free fall
    ],
)
def test_the_true_motion_is_in_the_axes_of_the_body(before: dict, after: dict, force: tuple, rate: tuple) -> None:
    specific_force, angular_rate = true_motion(body(**before), body(**after), 0.5)
    assert specific_force == pytest.approx(force, abs=1e-9) and angular_rate == pytest.approx(rate, abs=1e-9)


def test_the_errors_have_the_sizes_of_the_data_sheet_and_depend_on_the_seed_alone(tmp_path: Path) -> None:
    file = tmp_path / "inertial.ljs"
    file.write_text(MISSION, encoding="utf-8")
    states = {"uav": body()}
    still = Motion(states, states, 0.5)
    means, noises = [], []
    for seed in range(120):
        instance = instantiate(compiled(file), seed=seed)
        units, uav = InertialUnits(instance), instance.entities[0]
        read = [units.read(uav, tick, still) for tick in range(40)]
        assert InertialUnits(instance).read(uav, 17, still) == read[17]
        rows = np.array([(*reading.specific_force, *reading.angular_rate) for reading in read]) - (0, 0, G, 0, 0, 0)
        means.append(rows.mean(axis=0))
        noises.append(rows.std(axis=0, ddof=1))
    bias, noise = np.std(means, axis=0), np.sqrt(np.mean(np.square(noises), axis=0))
    assert bias == pytest.approx([0.02 * G] * 3 + [math.radians(1.0)] * 3, rel=0.25)
    densities = [160e-6 * G, 160e-6 * G, 190e-6 * G, *[math.radians(0.014)] * 3]
    assert noise == pytest.approx(densities, rel=0.06)  # over half a second the bandwidth is one hertz


def test_agents_and_the_trace_have_the_readings_of_the_last_macro_step(tmp_path: Path) -> None:
    file = tmp_path / "inertial.ljs"
    file.write_text(MISSION, encoding="utf-8")
    trace = play(file, tmp_path, policy="oracle", seed=2).trace
    units, uav = InertialUnits(trace.header.instance), trace.header.instance.entities[0]
    moved = False
    for boundary in trace.boundaries:
        (view,) = boundary.observations[0].entities
        ends = [{state.id: state for state in snapshot.states} for snapshot in boundary.snapshots[-2:]]
        motion = Motion(ends[0], ends[-1], 0.5 if len(ends) == 2 else 0.0)
        reading = units.read(uav, boundary.tick, motion)
        assert view.specific_force == pytest.approx(reading.specific_force, abs=1e-6)
        assert view.angular_rate == pytest.approx(reading.angular_rate, abs=1e-6)
        assert view.position is None and view.status is not None
        moved |= ends[0]["uav"].velocity != ends[-1]["uav"].velocity
    assert moved


def test_without_the_channel_no_inertial_readings_are_observed(tmp_path: Path) -> None:
    file = tmp_path / "inertial.ljs"
    file.write_text(MISSION.replace("uav.imu", "uav.*"), encoding="utf-8")
    trace = play(file, tmp_path, policy="idle", seed=2).trace
    assert all(item.entities[0].specific_force is None for item in trace.boundaries[1].observations)


@pytest.mark.parametrize(
    ("line", "other", "message"),
    [
        (", imu = bmi088", "", "`uav` carries no inertial unit, so it shows no `imu`"),
        ("bmi088", "bmi99", "`imu` cannot be `bmi99`"),
        ("  agent", "  asset eye : satellite { imu = bmi088 }\n  agent", "`satellite` cannot carry `imu`"),
        ("  agent", "  target yards : destination { position = (90 m, 90 m), imu = bmi088 }\n  agent", "a target"),
    ],
)
def test_an_invalid_unit_declaration_is_reported_once(line: str, other: str, message: str) -> None:
    text = MISSION.replace(line, other, 1).replace(
        "use std", "use std.orbit { satellite }\nuse std.traffic { destination }\nuse std", 1
    )
    messages = [item.message for item in compile_text(text).diagnostics if item.severity == "error"]
    assert [message in each for each in messages].count(True) == 1, messages
