"""Skinned people: the joints, the poses, and the mesh in a pose.

A figure of `people.npz` is a mesh. Each vertex belongs to one or two joints. A pose gives each joint a rotation
against its parent. The phase of a walk follows from the distance that the body has walked, so feet do not slide.

Frame: x right, y ahead, z up; metres. The lowest point of a figure on foot is at z = 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from math import cos, pi, radians, sin

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.meshes import Mesh
from lingjing.engines.camera.models.stored import LEVELS, UNIT_M, Palette, painted_rows, stored_arrays

Floats = npt.NDArray[np.floating]

PARENTS: dict[str, str] = {
    "pelvis": "", "spine": "pelvis", "head": "spine",
    "arm_right": "spine", "elbow_right": "arm_right", "leg_right": "pelvis", "knee_right": "leg_right",
    "foot_right": "knee_right",
    "arm_left": "spine", "elbow_left": "arm_left", "leg_left": "pelvis", "knee_left": "leg_left",
    "foot_left": "knee_left",
}  # fmt: skip
"""Each joint with its parent, parents first."""
JOINTS = tuple(PARENTS)
"""Joints, in the order of the file."""
WEIGHT_UNIT = 127
"""Stored weight of a vertex that belongs to its first joint alone."""

Turn = tuple[float, float, float]
"""Rotation of a joint, degrees: forward (a hanging limb swings ahead), out (away from the body; for the trunk to the
right), and about the upright axis (the right side ahead)."""

PHASES = 8
"""Pictures of one cycle of a walk, a run, a wave or a stroke."""
KEPT_SKINS = 512
"""Posed figures in memory (chosen). One takes half a megabyte."""


@dataclass(frozen=True)
class Pose:
    """A pose of the whole body."""

    turns: Mapping[str, Turn] = field(default_factory=dict)
    """Rotation of each joint that is turned."""
    place: tuple[float, float, float] | None = None
    """Shift of the pelvis from its height when standing, metres; None: the lowest point comes to z = 0."""


def both(part: str, forward: float, out: float = 0.0) -> dict[str, Turn]:
    """Return one turn for the joints of both sides."""
    return {f"{part}_{side}": (forward, out, 0.0) for side in ("right", "left")}


def standing(variant: int) -> Pose:
    """Return one of three ways to stand: arms down, weight on one leg, a hand before the chest."""
    turns = {**both("arm", 4.0, 3.0), **both("elbow", 12.0)}
    if variant % 3 == 1:
        turns |= {"leg_left": (6.0, 5.0, 0.0), "knee_left": (-12.0, 0.0, 0.0), "spine": (0.0, 2.0, 6.0),
                  "arm_right": (-16.0, 24.0, 0.0), "elbow_right": (44.0, 0.0, 0.0)}  # fmt: skip
    elif variant % 3 == 2:
        turns |= {"arm_right": (8.0, 6.0, 0.0), "elbow_right": (122.0, 0.0, 0.0), "head": (-14.0, 0.0, -8.0),
                  "leg_right": (-3.0, 4.0, 0.0)}  # fmt: skip
    return Pose(turns)


def walking(phase: float, running: bool = False) -> Pose:
    """Return a phase of a walk or run; at phase 0 the right heel strikes."""
    swing, flex = (38.0, 88.0) if running else (25.0, 55.0)
    turns: dict[str, Turn] = {}
    for side, start in (("right", 0.0), ("left", 0.5)):
        at = 2.0 * pi * (phase + start)
        leg = swing * cos(at) + (6.0 if running else 2.0)
        bend = 5.0 + flex * max(0.0, sin(at - 0.94 * pi)) ** 1.4
        turns[f"leg_{side}"] = leg, 0.0, 0.0
        turns[f"knee_{side}"] = -bend, 0.0, 0.0
        turns[f"foot_{side}"] = 0.75 * (bend - leg) - 16.0 * max(0.0, sin(at - 0.7 * pi)), 0.0, 0.0
        arm = -(0.95 if running else 0.85) * swing * cos(at)
        turns[f"arm_{side}"] = arm, 5.0, 0.0
        turns[f"elbow_{side}"] = (88.0 if running else 18.0) + 0.35 * max(arm, 0.0), 0.0, 0.0
    sway = cos(2.0 * pi * phase)
    turns["pelvis"] = (-12.0 if running else -2.0), 0.0, 5.0 * sway
    turns["spine"] = -2.0, 0.0, -10.0 * sway
    turns["head"] = (8.0 if running else 2.0), 0.0, 4.0 * sway
    return Pose(turns)


def swimming(phase: float) -> Pose:
    """Return a phase of treading water: back and shoulders at the waterline, the arms to the sides, one raised in turn.

    The waterline is at z = 0.
    """
    turns: dict[str, Turn] = {"pelvis": (-74.0, 0.0, 0.0), "head": (60.0, 0.0, 0.0)}
    for side, start in (("right", 0.0), ("left", 0.25)):
        at = 2.0 * pi * (phase + start)
        raised = max(0.0, cos(at))
        turns[f"arm_{side}"] = 4.0 - 32.0 * raised, 124.0 + 10.0 * sin(at), 0.0
        turns[f"elbow_{side}"] = 12.0, 0.0, 0.0
        turns[f"leg_{side}"] = 36.0 + 16.0 * sin(at), 10.0, 0.0
        turns[f"knee_{side}"] = -45.0 - 15.0 * cos(at), 0.0, 0.0
        turns[f"foot_{side}"] = -35.0, 0.0, 0.0
    return Pose(turns, (0.0, -0.34, -1.03))


SITTING = Pose({**both("leg", 86.0, 6.0), **both("knee", -84.0), **both("arm", 24.0, 4.0), **both("elbow", 52.0),
                "spine": (3.0, 0.0, 0.0)})  # fmt: skip
LYING = Pose({"pelvis": (90.0, 0.0, 0.0), "leg_left": (22.0, 6.0, 0.0), "knee_left": (-40.0, 0.0, 0.0),
              "arm_right": (0.0, 58.0, 0.0), "elbow_right": (25.0, 0.0, 0.0), "arm_left": (10.0, 24.0, 0.0),
              "elbow_left": (70.0, 0.0, 0.0), "head": (0.0, 0.0, 24.0)})  # fmt: skip
"""The pose of a person lying on the back with one leg drawn up."""
ON_MOTORCYCLE = Pose({"pelvis": (-14.0, 0.0, 0.0), "spine": (-8.0, 0.0, 0.0), "head": (18.0, 0.0, 0.0),
                      **both("leg", 84.0, 13.0), **both("knee", -92.0), **both("foot", 12.0),
                      **both("arm", 66.0, 9.0), **both("elbow", 26.0)})  # fmt: skip
ON_BICYCLE = Pose({"pelvis": (-24.0, 0.0, 0.0), "spine": (-10.0, 0.0, 0.0), "head": (28.0, 0.0, 0.0),
                   "leg_right": (90.0, 3.0, 0.0), "knee_right": (-92.0, 0.0, 0.0), "foot_right": (8.0, 0.0, 0.0),
                   "leg_left": (46.0, 3.0, 0.0), "knee_left": (-36.0, 0.0, 0.0), "foot_left": (-8.0, 0.0, 0.0),
                   **both("arm", 68.0, 4.0), **both("elbow", 24.0)})  # fmt: skip

POSES: dict[str, Pose] = {
    **{f"stand-{k}": standing(k) for k in range(3)},
    **{f"walk-{k}": walking(k / PHASES) for k in range(PHASES)},
    **{f"run-{k}": walking(k / PHASES, running=True) for k in range(PHASES)},
    **{f"swim-{k}": swimming(k / PHASES) for k in range(PHASES)},
    "sit": SITTING,
    "lie": LYING,
    "motorcycle": ON_MOTORCYCLE,
    "bicycle": ON_BICYCLE,
}
"""All poses by name."""

SLOW_MPS, RUN_MPS = 0.25, 2.3
"""Speeds from which a person walks and runs, m/s (chosen)."""


def gait(speed_mps: float, walked_m: float) -> str:
    """Return the pose of a person on foot at a speed, after a walked distance; empty for a person at rest.

    A cycle of two steps is longer at a higher speed: 0.75 m + 0.55 s of the speed, after walking people's 1.5 m at
    1.35 m/s.
    """
    if speed_mps < SLOW_MPS:
        return ""
    cycle_m = 0.75 + 0.55 * min(speed_mps, 4.0)
    return f"{'run' if speed_mps >= RUN_MPS else 'walk'}-{int(walked_m / cycle_m * PHASES) % PHASES}"


@cache
def figures() -> tuple[str, ...]:
    """Return the names of the figures of the file."""
    return tuple(name.split("/")[0] for name in stored_arrays("people") if name.endswith("/joints"))


@lru_cache(maxsize=KEPT_SKINS)
def posed(figure: str, pose: str, palette: Palette) -> tuple[Mesh, ...]:
    """Return the levels of a figure in a pose of `POSES`, the finest first."""
    made, low = [], 0.0
    for level in range(LEVELS):
        points, normals, vertices = skin(figure, POSES[pose], level)
        if level == 0:
            low = float(points[:, 2].min())
        if POSES[pose].place is None:
            points = points - (0.0, 0.0, low)
        index = stored_arrays("people")[f"{figure}/{level}/index"]
        made.append(painted_rows(points, normals, vertices[:, 6], index, palette))
    return tuple(made)


def skin(figure: str, pose: Pose, level: int) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """Return positions and normals of a figure's vertices in a pose, and its stored rows."""
    arrays = stored_arrays("people")
    vertices = arrays[f"{figure}/{level}/vertices"]
    joints = arrays[f"{figure}/joints"] * UNIT_M
    turns, shifts = _bones(joints, pose)
    weight = (vertices[:, 9] / WEIGHT_UNIT)[:, None, None]
    first, second = vertices[:, 7], vertices[:, 8]
    turn = weight * turns[first] + (1.0 - weight) * turns[second]
    shift = weight[..., 0] * shifts[first] + (1.0 - weight[..., 0]) * shifts[second]
    points = np.einsum("nij,nj->ni", turn, vertices[:, :3] * UNIT_M) + shift
    normals = np.einsum("nij,nj->ni", turn, vertices[:, 3:6].astype(float))
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-9), vertices


def _bones(joints: Floats, pose: Pose) -> tuple[Floats, Floats]:
    """Return the rotation (3, 3) and the shift of each joint from the figure at rest."""
    turns, origins = np.zeros((len(JOINTS), 3, 3)), np.zeros((len(JOINTS), 3))
    for k, (name, parent) in enumerate(PARENTS.items()):
        own = rotation(pose.turns.get(name, (0.0, 0.0, 0.0)), left=name.endswith("left"))
        if parent:
            above = JOINTS.index(parent)
            turns[k] = turns[above] @ own
            origins[k] = origins[above] + turns[above] @ (joints[k] - joints[above])
        else:
            turns[k], origins[k] = own, joints[k] + (pose.place or (0.0, 0.0, 0.0))
    return turns, origins - np.einsum("kij,kj->ki", turns, joints)


def rotation(turn: Turn, left: bool = False) -> Floats:
    """Return the matrix of a joint's turn."""
    a, b, c = radians(turn[0]), radians(turn[1] if left else -turn[1]), radians(turn[2])
    forward = np.array([[1.0, 0.0, 0.0], [0.0, cos(a), -sin(a)], [0.0, sin(a), cos(a)]])
    out = np.array([[cos(b), 0.0, sin(b)], [0.0, 1.0, 0.0], [-sin(b), 0.0, cos(b)]])
    about = np.array([[cos(c), -sin(c), 0.0], [sin(c), cos(c), 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about @ out @ forward)
