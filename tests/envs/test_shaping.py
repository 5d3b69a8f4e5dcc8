"""The potential of the flat preset's shaping."""

from __future__ import annotations

from typing import Any

import pytest

from lingjing.envs import FlatParallelEnv
from lingjing.trace.records import BodyState, Box, CameraPose, FrameInfo, StageChange


@pytest.fixture
def env() -> FlatParallelEnv:
    return FlatParallelEnv("bi", world="inline")


@pytest.fixture
def potential(env: FlatParallelEnv) -> Any:
    return env._potential


def states(east_m: float, height_m: float = 60.0) -> dict[str, BodyState]:
    """Return a drone so far east of the fracture."""
    return {
        "fracture": BodyState(id="fracture", position=(400.0, 30.0, 12.0)),
        "uav": BodyState(id="uav", position=(400.0 + east_m, 30.0, height_m)),
    }


def picture(*shown: str) -> FrameInfo:
    """Return a picture with a box of each of these entities."""
    boxes = tuple(Box(entity=name, cls="bridge_fracture", box=(0.4, 0.4, 0.6, 0.6), pixels=9) for name in shown)
    pose = CameraPose(position=(0.0, 0.0, 60.0), heading_deg=0.0, tilt_deg=90.0)
    return FrameInfo(
        id="f1-uav-nadir", entity="uav", camera="nadir", tick=1, time_s=10.0, pose=pose, channels=(), boxes=boxes
    )


@pytest.mark.parametrize(("share", "expected"), [(0.0, -0.5), (0.2, -0.6), (-0.2, -0.6), (5.0, -1.0)])
def test_half_of_the_potential_is_the_distance_to_the_target(
    env: FlatParallelEnv, potential: Any, share: float, expected: float
) -> None:
    assert potential.of(states(share * env._reach_m), ()) == pytest.approx(expected)


def test_the_height_does_not_change_the_potential(potential: Any) -> None:
    """A drone gains nothing by descending, where its camera sees less."""
    assert potential.of(states(100.0, 20.0), ()) == potential.of(states(100.0, 120.0), ())


def test_half_of_the_potential_is_a_picture_of_the_target(potential: Any) -> None:
    unseen = potential.of(states(40.0), [picture()])
    assert potential.of(states(40.0), [picture("joint[1]")]) == unseen
    assert potential.of(states(40.0), [picture("fracture")]) == pytest.approx(unseen + 0.5)


def test_a_rival_does_not_attract() -> None:
    """At tier 1 joints, patches and plates lie on the bridge; a drone above them gains nothing."""
    hard: Any = FlatParallelEnv("bi", world="inline", tier=1)
    assert hard._potential._targets == ["fracture"]


def test_a_completed_target_has_a_potential_of_zero(potential: Any) -> None:
    potential.note([StageChange(stage="detect", subject="fracture", tick=1, time_s=10.0)])
    assert potential.of(states(100.0), ()) < 0.0
    potential.note([StageChange(stage="execute", subject="fracture", tick=1, time_s=10.0)])
    assert potential.of(states(100.0), ()) == 0.0
    potential.restart()
    assert potential.of(states(100.0), ()) < 0.0
