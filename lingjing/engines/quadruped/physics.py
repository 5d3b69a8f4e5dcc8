"""The bodies of the dogs in MuJoCo: one model of all dogs, the shapes near them and the boxes that move near them.

Only this module imports `mujoco`. Arrays have one row for each dog and joints in the order of `gait.JOINTS`. A model is
built for one place. `DogBodies.body_memory` and `DogBodies.resume` move the complete state of a dog into the next
model, so a walk continues bit by bit in every process.

Friction, inertia and damping of the joints are fitted to runs of the real robot under this policy (published with the
model's package). The motors are position servos with the policy's gains and the torque limits of the real motors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from lingjing.engines.quadruped.gait import JOINTS, LEGS, PERIOD_S, STANCE, DogRows, Indices
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Vector
from lingjing.scene.shapes import Capsule, OrientedBox, Shape

STEP_S = 0.005
"""Integration step, seconds. Measured: tracking is the same from 2.5 to 10 ms, and falls are rarer up to 5 ms."""

_SUBSTEPS = round(PERIOD_S / STEP_S)

# Fits to runs of the real robot, published with the model's package: kg m^2, N m s/rad, N m; ratios; m.
_ARMATURE, _JOINT_DAMPING, _JOINT_FRICTION = 0.00712, 0.285, 0.365
_TRUNK_MASS, _TRUNK_INERTIA, _TRUNK_SHIFT_M, _LEG_MASS = 0.9412, 0.8601, -0.006845, 1.616
_FOOT_FRICTION, _FOOT_TORSION = 0.786, 0.006134

_FOOT_AXES = 4
"""Dimension of a foot's contact: a normal force, and friction along two axes and about the normal.

The model's rolling friction is left out. Measured: the gait is as fast, straight and safe without it, and a step takes
a seventh less time.
"""

_TOLERANCE = 1e-6
"""Tolerance of the contact solver. The next step's contacts are less accurate than this."""

_MODEL_JOINTS = tuple(f"{leg}_{part}_joint" for leg in ("FL", "FR", "RL", "RR") for part in ("hip", "thigh", "calf"))
"""Joints in the model's own order."""
_STATIC_GROUP, _MOVER_GROUP = 0, 1
"""MuJoCo groups of static shapes and of moving boxes; rays test only the first."""

_FORESIGHT_S = 1.5 * PERIOD_S
"""Time before a contact with a moving box at which it is reported, seconds: longer than a control period."""
_SKIN_M = 0.02
"""Margin of contacts with shapes, metres; shapes lie lower by the same amount.

A foot penetrates up to 3.5 cm at touch-down, which is more than its radius. Without the margin it would be caught in
the seam between two shapes.
"""

_AWAY_M = -1000.0
"""Coordinate of unused boxes, metres: far from every dog."""

_NOTHING = -1
"""Index that stands for the bare ground in tables of things."""


class _Servo(NamedTuple):
    """The gains of a dog's motors."""

    gain: float
    """Stiffness, N m/rad."""
    damping: float
    """Damping, N m s/rad."""


_WALKING, _LOCKED, _LIMP = _Servo(20.0, 0.5), _Servo(100.0, 3.0), _Servo(0.0, 2.0)
"""Gains under the policy, in standing, and without power. Without power the motors only damp, and the trunk sinks
down."""


@dataclass(frozen=True, slots=True)
class MovingBox:
    """A body of another engine as an upright box with a velocity."""

    thing: str
    """Id of the body."""
    base: Vector
    """Middle of its underside at the start of the interval, metres."""
    half: Vector
    """Half length, half width and half height, metres."""
    yaw: float
    """Heading, radians anticlockwise from east."""
    velocity: Vector
    """Velocity, m/s."""


@dataclass(frozen=True, slots=True)
class BodyMemory:
    """The complete state of a dog's body; it can be restored in any model."""

    qpos: DogRows
    """Generalised positions: trunk (7) and joints (12)."""
    qvel: DogRows
    """Generalised velocities: trunk (6) and joints (12)."""
    warmstart: DogRows
    """Warm start of MuJoCo's solver: accelerations, (18,)."""
    ctrl: DogRows
    """Targets of the motors, (12,) rad."""
    servo: _Servo = _WALKING
    """Gains of the motors."""


@dataclass(frozen=True, slots=True)
class Touch:
    """A sideways contact of a dog with a thing."""

    dog: int
    """Index of the dog."""
    thing: str
    """Name of the thing: the id of a body, dog or part of the city."""
    trunk: bool
    """True for the trunk or a hip, False for the rest of a leg."""
    normal: tuple[float, float]
    """Horizontal unit vector from the dog to the thing."""
    z: float = 0.0
    """Elevation of the contact, metres."""
    gap_m: float = 0.0
    """Distance that is left, metres; negative for a penetration."""
    mover: bool = False
    """True for a moving box. Only these are reported before they touch."""


class Floor(NamedTuple):
    """The surface below a point."""

    z: float
    """Elevation, metres; infinite inside a solid, minus infinity without a surface."""
    bare: bool
    """True for the bare ground."""


class DogBodies:
    """The dogs `ids` among `shapes` on flat ground at `ground_m`, with `pool` boxes for moving bodies."""

    def __init__(self, model: Path, ids: Sequence[str], shapes: Sequence[Shape], ground_m: float, pool: int) -> None:
        _silence()
        self.ids = tuple(ids)
        self._model = _build(model, len(self.ids), shapes, ground_m, pool)
        self._data = mujoco.MjData(self._model)
        self._index(shapes, pool)
        self._servos = [_WALKING] * len(self.ids)
        self._movers: tuple[MovingBox, ...] = ()
        self.set_movers(())

    def body_memory(self, dog: int) -> BodyMemory:
        """Return the complete state of a dog."""
        data = self._data
        free, joints, motors = self._free_qpos[dog], self._joint_qpos[dog], self._motors[dog]
        dofs = np.concatenate((self._free_dof[dog], self._joint_dof[dog]))
        return BodyMemory(
            qpos=data.qpos[np.concatenate((free, joints))],
            qvel=data.qvel[dofs],
            warmstart=data.qacc_warmstart[dofs],
            ctrl=data.ctrl[motors],
            servo=self._servos[dog],
        )

    def resume(self, dog: int, memory: BodyMemory) -> None:
        """Restore the state of a dog. Call `update_kinematics` after all dogs are restored."""
        data = self._data
        dofs = np.concatenate((self._free_dof[dog], self._joint_dof[dog]))
        data.qpos[np.concatenate((self._free_qpos[dog], self._joint_qpos[dog]))] = memory.qpos
        data.qvel[dofs], data.qacc_warmstart[dofs] = memory.qvel, memory.warmstart
        data.ctrl[self._motors[dog]] = memory.ctrl
        self._hold(dog, memory.servo)

    def add_velocity(self, dog: int, change: Vector) -> None:
        """Change a dog's velocity at once, m/s."""
        self._data.qvel[self._free_dof[dog, :3]] += change

    def set_load(self, dog: int, load_kg: float) -> None:
        """Put a load on the middle of a dog's back, kg."""
        self._data.xfrc_applied[self._trunks[dog], 2] = load_kg * self._model.opt.gravity[2]

    def push(self, dog: int, east_n: float, north_n: float) -> None:
        """Let a constant force act on the middle of a dog's trunk from now on, newtons."""
        self._data.xfrc_applied[self._trunks[dog], :2] = east_n, north_n

    def update_kinematics(self) -> None:
        """Update the values that MuJoCo derives from positions. Rays and `stand` need them; `step` updates them
        itself."""
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def stand(self, dog: int, x: float, y: float, floor_m: float, yaw: float) -> None:
        """Stand a dog at rest with its feet at the elevation `floor_m`."""
        upright = np.array((x, y, floor_m + _STANDING_M, math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)))
        still = np.zeros(6 + len(JOINTS))
        self.resume(dog, BodyMemory(np.concatenate((upright, STANCE)), still, still, STANCE, _LOCKED))

    def lock(self, dog: int) -> None:
        """Hold the joints stiffly at their present angles, with their present torques: the way a dog stands still."""
        motors = self._motors[dog]
        self._data.ctrl[motors] = self._data.qpos[self._joint_qpos[dog]] + self.torques[dog] / _LOCKED.gain
        self._hold(dog, _LOCKED)

    def unlock(self, dog: int) -> None:
        """Set the gains of the policy."""
        self._hold(dog, _WALKING)

    def cut_power(self, dog: int) -> None:
        """Switch the motors off."""
        self._hold(dog, _LIMP)

    def set_movers(self, movers: Sequence[MovingBox], elapsed_s: float = 0.0) -> None:
        """Set the moving boxes; `elapsed_s` is the time since their mirrors. Boxes beyond the pool are left out."""
        self._movers = tuple(movers[: len(self._boxes)])
        data = self._data
        self._starts = np.full((len(self._boxes), 3), _AWAY_M)
        self._starts[:, 0] = _AWAY_M - 50.0 * np.arange(len(self._boxes))
        self._rates = np.zeros((len(self._boxes), 3))
        for slot, mover in enumerate(self._movers):
            x, y, z = mover.base
            self._starts[slot] = (x, y, z + mover.half[2])
            self._rates[slot] = mover.velocity
            data.mocap_quat[slot] = (math.cos(0.5 * mover.yaw), 0.0, 0.0, math.sin(0.5 * mover.yaw))
            self._resize(slot, mover.half, _FORESIGHT_S * math.hypot(*mover.velocity))
        self.driven_s = elapsed_s
        data.mocap_pos[:] = self._starts + elapsed_s * self._rates

    def set_targets(self, dogs: Indices, targets: DogRows) -> None:
        """Set the joint targets of some dogs, (len(dogs), 12) rad."""
        self._data.ctrl[self._motors[dogs]] = targets

    def step(self) -> None:
        """Advance by one control period. Raises `InfrastructureError` if the physics diverges."""
        model, data = self._model, self._data
        if self._movers:
            for _ in range(_SUBSTEPS):
                self.driven_s += STEP_S
                data.mocap_pos[:] = self._starts + self.driven_s * self._rates
                mujoco.mj_step(model, data)
        else:
            mujoco.mj_step(model, data, _SUBSTEPS)
        if not math.isfinite(float(data.qpos.sum() + data.qvel.sum())):
            raise InfrastructureError("mujoco diverged: a robot dog's state is not a number")

    def pass_time(self) -> None:
        """Let one control period pass without physics; only the boxes move."""
        if self._movers:
            self.driven_s += PERIOD_S
            self._data.mocap_pos[:] = self._starts + self.driven_s * self._rates

    def clearances(self) -> DogRows:
        """Return the distance from each dog's trunk to the nearest moving box, (count,) metres; infinite without
        boxes."""
        if not self._movers:
            return np.full(len(self.ids), math.inf)
        count = len(self._movers)
        away = self.positions[:, None, :] - self._data.mocap_pos[None, :count]
        yaws = np.array([mover.yaw for mover in self._movers])
        along = away[..., 0] * np.cos(yaws) + away[..., 1] * np.sin(yaws)
        across = away[..., 1] * np.cos(yaws) - away[..., 0] * np.sin(yaws)
        halves = np.array([mover.half for mover in self._movers])
        outside = np.maximum(np.abs(np.stack((along, across, away[..., 2]), axis=-1)) - halves, 0.0)
        return np.asarray(np.sqrt((outside * outside).sum(axis=-1)).min(axis=1))

    @property
    def positions(self) -> DogRows:
        """Centres of the trunks, (count, 3) metres."""
        return np.asarray(self._data.qpos[self._free_qpos[:, :3]])

    @property
    def places(self) -> DogRows:
        """Poses of the trunks, (count, 7): centres in metres and quaternions as w, x, y, z."""
        return np.asarray(self._data.qpos[self._free_qpos])

    @property
    def rates(self) -> DogRows:
        """Rates of the trunks, (count, 6): velocities in the world (m/s), angular velocities in the body frame
        (rad/s)."""
        return np.asarray(self._data.qvel[self._free_dof])

    @property
    def angles(self) -> DogRows:
        """Joint angles, (count, 12) rad."""
        return np.asarray(self._data.qpos[self._joint_qpos])

    @property
    def speeds(self) -> DogRows:
        """Joint speeds, (count, 12) rad/s."""
        return np.asarray(self._data.qvel[self._joint_dof])

    @property
    def torques(self) -> DogRows:
        """Torques of the motors in the last step, (count, 12) N m."""
        return np.asarray(self._data.actuator_force[self._motors])

    @property
    def stillness(self) -> float:
        """Largest speed of any trunk or joint, m/s and rad/s mixed."""
        return float(np.abs(self._data.qvel).max(initial=0.0))

    def model_angles(self, dog: int) -> tuple[float, ...]:
        """Return joint angles in the model's own order, rad: FL, FR, RL, RR, each with hip, thigh, calf."""
        return tuple(self._data.qpos[self._joint_qpos[dog][_DRAWN]].tolist())

    def floor(self, x: float, y: float, below_m: float) -> Floor:
        """Return the surface on which a dog would stand at a point, searched downwards from `below_m`."""
        start, down = np.array((x, y, below_m)), np.array((0.0, 0.0, -1.0))
        distance = mujoco.mj_ray(
            self._model, self._data, start, down, _STATIC_ONLY, 1, -1, self._hit_geom, self._normal
        )
        if distance < 0.0:
            return Floor(-math.inf, True)
        if self._normal[2] < 0.0:
            return Floor(math.inf, False)
        bare = bool(self._thing[self._hit_geom[0]] == _NOTHING)
        return Floor(below_m - distance + (0.0 if bare else _SKIN_M), bare)

    def touches(self) -> list[Touch]:
        """Return the present sideways contacts of the dogs. Contacts with the ground below the feet are left out."""
        if self._data.ncon == 0:
            return []
        geoms = self._data.contact.geom
        things = self._thing[geoms]
        sideways = np.abs(self._data.contact.frame[:, 2]) < 0.5
        rows = np.flatnonzero(sideways & (things != _NOTHING).all(axis=1) & (things[:, 0] != things[:, 1]))
        contacts = []
        for row in rows.tolist():
            contact = self._data.contact
            normal, gap_m, z = contact.frame[row, :2].tolist(), float(contact.dist[row]), float(contact.pos[row, 2])
            for side, other, sign in ((0, 1, 1.0), (1, 0, -1.0)):
                dog, thing = int(things[row, side]), int(things[row, other])
                if dog < len(self.ids):
                    trunk = bool(self._trunk[geoms[row, side]])
                    push = sign * normal[0], sign * normal[1]
                    mover = 0 <= thing - len(self.ids) < len(self._boxes)
                    contacts.append(Touch(dog, self._name(thing), trunk, push, z, gap_m, mover))
        return contacts

    def _name(self, thing: int) -> str:
        count = len(self.ids)
        if thing < count:
            return self.ids[thing]
        if thing < count + len(self._boxes):
            return self._movers[thing - count].thing if thing - count < len(self._movers) else ""
        return self._things[thing - count - len(self._boxes)]

    def _index(self, shapes: Sequence[Shape], pool: int) -> None:
        """Collect the addresses of all values that a step reads or writes."""
        model, count = self._model, len(self.ids)
        trunks = [model.body(f"{dog}/base").id for dog in range(count)]
        joints = np.array([[model.joint(f"{dog}/{name}").id for name in JOINTS] for dog in range(count)]).reshape(
            -1, 12
        )
        free = model.body_jntadr[trunks]
        self._trunks = trunks
        motor_of = {int(joint): motor for motor, joint in enumerate(model.actuator_trnid[:, 0])}
        self._free_qpos = model.jnt_qposadr[free][:, None] + np.arange(7)
        self._free_dof = model.jnt_dofadr[free][:, None] + np.arange(6)
        self._joint_qpos, self._joint_dof = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._motors = np.array([[motor_of[joint] for joint in row] for row in joints.tolist()], int).reshape(-1, 12)
        self._boxes = [model.body(f"mover-{slot}").id for slot in range(pool)]
        self._things = tuple(dict.fromkeys(shape.thing for shape in shapes))
        self._hit_geom, self._normal = np.zeros(1, np.int32), np.zeros(3)
        # Each thing has one index: dogs, then the boxes of the pool, then the shapes; the bare ground has `_NOTHING`.
        numbers = {thing: count + pool + number for number, thing in enumerate(self._things)}
        self._thing = np.full(model.ngeom, _NOTHING, np.int64)
        for number, shape in enumerate(shapes):
            self._thing[model.geom(f"shape-{number}").id] = numbers[shape.thing]
        for slot, body in enumerate(self._boxes):
            self._thing[model.body_geomadr[body]] = count + slot
        self._trunk = np.zeros(model.ngeom, bool)
        for dog in range(count):
            of_dog = model.body_rootid[model.geom_bodyid] == trunks[dog]
            self._thing[of_dog] = dog
            hips = [trunks[dog], *(model.body(f"{dog}/{leg}_hip").id for leg in LEGS)]
            self._trunk |= np.isin(model.geom_bodyid, hips)

    def _hold(self, dog: int, servo: _Servo) -> None:
        motors = self._motors[dog]
        self._model.actuator_gainprm[motors, 0] = servo.gain
        self._model.actuator_biasprm[motors, 1] = -servo.gain
        self._model.actuator_biasprm[motors, 2] = -servo.damping
        self._servos[dog] = servo

    def _resize(self, slot: int, half: Vector, foresight_m: float) -> None:
        """Set the size of a box of the pool, with its bounds in MuJoCo's broad phase.

        Contacts with it are reported `foresight_m` before they occur.
        """
        model, body = self._model, self._boxes[slot]
        geom = int(model.body_geomadr[body])
        model.geom_size[geom] = half
        model.geom_margin[geom] = model.geom_gap[geom] = foresight_m
        model.geom_rbound[geom] = math.hypot(*half)
        model.geom_aabb[geom] = (0.0, 0.0, 0.0, *half)
        model.bvh_aabb[int(model.body_bvhadr[body])] = (0.0, 0.0, 0.0, *half)


_STANDING_M = 0.33
"""Height of the trunk's centre over the floor in the stance with touching feet, metres (from the model)."""

_STATIC_ONLY = np.array([group == _STATIC_GROUP for group in range(6)], np.uint8)
_DRAWN = np.array([JOINTS.index(name) for name in _MODEL_JOINTS])


def _build(path: Path, count: int, shapes: Sequence[Shape], ground_m: float, pool: int) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP_S
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # stiff servos need implicit damping
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC  # `attach` does not take over the options of the dog's model
    spec.option.impratio = 100.0
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE  # dogs are separate trees, so a dense matrix is mostly 0
    spec.option.tolerance = _TOLERANCE
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    world = spec.worldbody
    world.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 1.0), pos=(0.0, 0.0, ground_m), group=_STATIC_GROUP
    )
    for number, shape in enumerate(shapes):
        _add(spec, f"shape-{number}", shape)
    for slot in range(pool):
        body = world.add_body(name=f"mover-{slot}", mocap=True, pos=(_AWAY_M - 50.0 * slot, _AWAY_M, _AWAY_M))
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.5, 0.5, 0.5), group=_MOVER_GROUP)
    for dog in range(count):
        spec.attach(_dog(path), prefix=f"{dog}/", frame=world.add_frame())
    return spec.compile()


def _dog(path: Path) -> mujoco.MjSpec:
    """Return one Go2 without visual meshes, with the fitted parameters and with servos as motors."""
    spec = mujoco.MjSpec.from_file(str(path))
    looks = [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
    for part in (*looks, *spec.meshes, *spec.materials, *spec.keys):
        spec.delete(part)
    for name in JOINTS:
        joint = spec.joint(name)
        joint.armature, joint.frictionloss, joint.damping = _ARMATURE, _JOINT_FRICTION, (_JOINT_DAMPING, 0.0, 0.0)
    trunk = spec.body("base")
    trunk.mass, trunk.inertia = trunk.mass * _TRUNK_MASS, np.asarray(trunk.inertia) * _TRUNK_INERTIA
    trunk.ipos = np.asarray(trunk.ipos) + np.array((_TRUNK_SHIFT_M, 0.0, 0.0))
    for leg in LEGS:
        for part in ("thigh", "calf"):
            body = spec.body(f"{leg}_{part}")
            body.mass, body.inertia = body.mass * _LEG_MASS, np.asarray(body.inertia) * _LEG_MASS
        foot = spec.geom(leg)
        foot.condim = _FOOT_AXES
        foot.friction = (_FOOT_FRICTION, _FOOT_TORSION, foot.friction[2])
    for motor in spec.actuators:
        _servo(motor)
    return spec


def _servo(motor: mujoco.MjsActuator) -> None:
    limit = float(motor.ctrlrange[1])
    motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    gain, damping = _WALKING
    motor.gainprm = (gain, *(0.0,) * 9)
    motor.biasprm = (0.0, -gain, -damping, *(0.0,) * 7)
    motor.ctrllimited, motor.forcelimited, motor.forcerange = False, True, (-limit, limit)


def _add(spec: mujoco.MjSpec, name: str, shape: Shape) -> None:
    """Add a shape. It lies lower by `_SKIN_M` and has a contact margin of the same size."""
    if isinstance(shape, OrientedBox):
        x, y, z = shape.centre
        form = {
            "type": mujoco.mjtGeom.mjGEOM_BOX,
            "size": shape.half,
            "pos": (x, y, z - _SKIN_M),
            "quat": (math.cos(0.5 * shape.yaw), 0.0, 0.0, math.sin(0.5 * shape.yaw)),
        }
    elif isinstance(shape, Capsule):
        form = {
            "type": mujoco.mjtGeom.mjGEOM_CAPSULE,
            "size": (max(shape.radius_m - _SKIN_M, 0.5 * _SKIN_M), 0.0, 0.0),
            "fromto": (*shape.start, *shape.end),
        }
    else:
        # Meshes hold 32-bit floats: far from the origin only coordinates relative to the mesh are exact enough.
        corners = np.asarray(shape.corners)
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        mesh = spec.add_mesh(name=name, uservert=(corners - centre).ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        form = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": name, "pos": centre - np.array((0.0, 0.0, _SKIN_M))}
    spec.worldbody.add_geom(name=name, group=_STATIC_GROUP, margin=_SKIN_M, **form)


def _silence() -> None:
    """Suppress MuJoCo's warnings. An unstable step raises `InfrastructureError`; MuJoCo would also write a log file."""
    mujoco.set_mju_user_warning(lambda message: None)
