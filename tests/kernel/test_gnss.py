"""Satellite navigation receivers: size and course of the errors, and what agents, pictures and the trace carry."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lingjing.kernel.gnss import RECEIVERS, GnssErrors
from lingjing.testing import compile_text, compiled, instantiate, play
from lingjing.trace.records import BodyState, BoundaryRecord

MISSION = """
ljs 2
use std.air { quadrotor }
use std.sensors { nadir_hd }

mission noisy "By its receiver" {
  goal "Fly to the yard."
  scene residential { extent = 300 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 3 }
  region yard = box((90 m, 90 m), (120 m, 120 m))
  asset uav : quadrotor {
    position = (0 m, -60 m, 60 m), gnss = m8, camera nadir : nadir_hd { size = 192 by 108, capture = each_tick }
  }
  agent pilot as pilot controls uav { observes OBSERVED, uav.status, uav.nadir, events }
  success when uav in yard
}
"""


def mission(tmp_path: Path, observed: str = "uav.gnss") -> Path:
    file = tmp_path / "noisy.ljs"
    file.write_text(MISSION.replace("OBSERVED", observed), encoding="utf-8")
    return file


def uav_of(boundary: BoundaryRecord) -> BodyState:
    return next(state for state in boundary.snapshots[-1].states if state.id == "uav")


@pytest.mark.parametrize(("word", "cep_m"), [("m8", 2.5), ("f9p", 0.01)])
def test_half_of_the_fixes_lie_within_the_cep_of_the_data_sheet(tmp_path: Path, word: str, cep_m: float) -> None:
    file = mission(tmp_path)
    file.write_text(file.read_text(encoding="utf-8").replace("m8", word), encoding="utf-8")
    far = []
    for seed in range(200):
        instance = instantiate(compiled(file), seed=seed)
        errors = GnssErrors(instance)
        far += [math.hypot(*errors.at(instance.entities[0], tick).position[:2]) for tick in (0, 40)]
    assert 0.42 < np.mean(np.array(far) < cep_m) < 0.58


def test_the_error_drifts_within_minutes_and_depends_on_seed_and_tick_alone(tmp_path: Path) -> None:
    instance = instantiate(compiled(mission(tmp_path)), seed=3)
    uav = instance.entities[0]
    forwards, late = GnssErrors(instance), GnssErrors(instance)
    course = [forwards.at(uav, tick) for tick in range(400)]
    assert late.at(uav, 300) == course[300] and late.at(uav, 10) == course[10]
    assert GnssErrors(instantiate(compiled(mission(tmp_path)), seed=4)).at(uav, 10) != course[10]
    east = np.array([error.position[0] for error in course])
    assert np.corrcoef(east[:-1], east[1:])[0, 1] == pytest.approx(math.exp(-10.0 / 60.0), abs=0.1)
    assert abs(np.corrcoef(east[:-30], east[30:])[0, 1]) < 0.4
    speed = np.array([error.velocity[0] for error in course])
    assert np.median(np.abs(speed)) == pytest.approx(0.05, abs=0.012) and set(RECEIVERS) == {"m8", "f9p"}


def test_agents_and_the_trace_have_the_measured_position_and_the_frame_the_true_pose(tmp_path: Path) -> None:
    trace = play(mission(tmp_path), tmp_path / "noisy", policy="idle", seed=1).trace
    errors = GnssErrors(trace.header.instance)
    uav = trace.header.instance.entities[0]
    for boundary in trace.boundaries:
        state = uav_of(boundary)
        (view,) = boundary.observations[0].entities
        error = errors.at(uav, boundary.tick)
        assert view.position is not None and view.velocity is not None
        assert np.subtract(view.position, state.position) == pytest.approx(error.position)
        assert np.subtract(view.velocity, state.velocity) == pytest.approx(error.velocity)
        assert math.dist(boundary.frames[0].pose.position, state.position) < 1.0  # the recorded truth


def test_without_the_channel_the_true_position_is_observed(tmp_path: Path) -> None:
    trace = play(mission(tmp_path, "uav.position"), tmp_path / "true", policy="idle", seed=1).trace
    boundary = trace.boundaries[1]
    assert boundary.observations[0].entities[0].position == uav_of(boundary).position


LOOKER = """
from lingjing.plugins.policy import Decision

class Looker:
    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        (picture,) = observation.pictures
        (view,) = observation.entities
        x, y, z = (a - b for a, b in zip(picture.pose.position, view.position))
        return Decision(thought=f"{x:.6f} {y:.6f} {z:.6f}")
"""


def test_pictures_carry_the_measured_pose(tmp_path: Path) -> None:
    """The camera is fixed to its body: its pose minus the position is the same with the receiver and without it."""
    (tmp_path / "looker.py").write_text(LOOKER, encoding="utf-8")
    offsets = []
    for observed in ("uav.gnss", "uav.position"):
        folder = tmp_path / observed
        trace = play(mission(tmp_path, observed), folder, policy=f"{tmp_path / 'looker.py'}:Looker", seed=1).trace
        offsets.append([boundary.decisions[0].decision.thought for boundary in trace.boundaries if boundary.decisions])
        assert len(offsets[-1]) == 3 and all(offsets[-1])
    assert offsets[0] == offsets[1]


@pytest.mark.parametrize(
    ("line", "other", "message"),
    [
        ("gnss = m8, ", "", "`uav` carries no receiver, so it shows no `gnss`"),
        ("gnss = m8", "gnss = m9", "`gnss` cannot be `m9`"),
        ("uav.nadir", "uav.nadir, yards.gnss", "`yards` carries no receiver, so it shows no `gnss`"),
        ("  agent", "  asset eye : satellite { gnss = f9p }\n  agent", "cannot carry `gnss`"),
    ],
)
def test_an_invalid_receiver_declaration_is_reported(tmp_path: Path, line: str, other: str, message: str) -> None:
    text = MISSION.replace("OBSERVED", "uav.gnss").replace(line, other, 1)
    text = text.replace("std.air { quadrotor }", "std.air { quadrotor }\nuse std.orbit { satellite }")
    text = text.replace("  agent", "  target yards : destination { position = (90 m, 90 m) }\n  agent", 1)
    text = text.replace("std.air { quadrotor }", "std.air { quadrotor }\nuse std.traffic { destination }", 1)
    messages = [diagnostic.message for diagnostic in compile_text(text).diagnostics if diagnostic.severity == "error"]
    assert any(message in each for each in messages), messages
