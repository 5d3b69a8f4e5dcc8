"""The plug-in that declares the built-in engines, scenes and evaluator.

A factory imports its engine when it is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from lingjing.engines.road.options import street_life
from lingjing.errors import InfrastructureError
from lingjing.installation import install_line
from lingjing.mission.instance import Instance, SceneSpec
from lingjing.mission.kinds import builtin_scenes
from lingjing.plugins.engine import Engine, EnginePlugin
from lingjing.plugins.evaluator import Evaluator, EvaluatorPlugin
from lingjing.plugins.hookspecs import ScenePlugin, hookimpl
from lingjing.scene.city import City


def _engine(module: str, name: str, extra: str = "", package: str = "") -> Callable[[], Engine]:
    """Return a factory that imports an engine when it is called. The optional dependency `extra` installs `package`."""

    def make() -> Engine:
        with _extra(extra, package):
            engine: Engine = getattr(import_module(f"lingjing.engines.{module}"), name)()
            return engine

    return make


def _mission_evaluator(instance: Instance) -> Evaluator[Any]:
    from lingjing.kernel.evaluation import MissionEvaluator

    return MissionEvaluator(instance)


def _bay(spec: SceneSpec) -> City:
    from lingjing.scene.bay import build

    return build(spec)


def _district(spec: SceneSpec) -> City:
    from lingjing.scene.districts import build

    return build(spec)


def _map(spec: SceneSpec) -> City:
    from lingjing.scene.osm.provider import city_of

    with _extra("maps", "osmium"):
        return city_of(spec)


@contextmanager
def _extra(name: str, package: str) -> Iterator[None]:
    """Raise `InfrastructureError` with the command that installs the extra `name` if its `package` is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise InfrastructureError(f"the package `{package}` is not installed", hint=install_line(name)) from error


@hookimpl
def lingjing_engines() -> Iterable[EnginePlugin]:
    """Return the built-in engines."""
    return (
        EnginePlugin(
            name="multirotor",
            options="lingjing.engines.motion_options:MotionOptions",
            factory=_engine("multirotor.drone", "MultirotorEngine"),
            native_dt_s=0.02,
            summary="Multirotors: JSBSim at 100 Hz under a 50 Hz position controller, with wind and battery.",
        ),
        EnginePlugin(
            name="plane",
            factory=_engine("fixed_wing.aeroplane", "PlaneEngine"),
            native_dt_s=0.02,
            summary="Fixed-wing aircraft: JSBSim at 100 Hz under an autopilot; circles at its destination.",
        ),
        EnginePlugin(
            name="satellite",
            factory=_engine("satellite.engine", "SatelliteEngine"),
            native_dt_s=1.0,
            summary="Satellites: SGP4 from two-line elements; passes over the region and its visibility.",
        ),
        EnginePlugin(
            name="vessel",
            options="lingjing.engines.motion_options:MotionOptions",
            factory=_engine("vessel.engine", "VesselEngine"),
            native_dt_s=0.1,
            summary="Surface vessels: 3-DOF surge, sway and yaw at 10 Hz in waves, current and wind.",
        ),
        EnginePlugin(
            name="road",
            options="lingjing.engines.motion_options:MotionOptions",
            factory=_engine("road.engine", "RoadEngine", "road", "libsumo"),
            native_dt_s=0.1,
            wanted=street_life,
            summary="Road vehicles, background traffic and queues: SUMO at 10 Hz; drivers brake for crossing bodies.",
        ),
        EnginePlugin(
            name="quadruped",
            factory=_engine("quadruped.engine", "QuadrupedEngine", "quadruped", "mujoco"),
            native_dt_s=0.02,
            summary="Robot dogs: Unitree Go2 on its legs in MuJoCo at 200 Hz under a 50 Hz walking policy.",
        ),
        EnginePlugin(
            name="remote",
            factory=_engine("remote.unconnected", "connect_first"),
            place="remote",
            native_dt_s=0.01,
            summary="Bodies of a foreign engine that dials in: `lingjing serve --lj-engine` (docs/remote-engines.md).",
        ),
        EnginePlugin(
            name="city",
            options="lingjing.engines.motion_options:MotionOptions",
            factory=_engine("city.engine", "CityEngine"),
            native_dt_s=0.1,
            wanted=lambda instance: instance.comms.range_m is not None or any(event.radio for event in instance.events),
            summary="Targets, interactions with them, goods and queues; radio links.",
        ),
        EnginePlugin(
            name="camera",
            factory=_engine("camera.engine", "CameraEngine"),
            options="lingjing.engines.camera.options:CameraOptions",
            place="camera",
            sensor=True,
            summary="Rendered pictures of the city: RGB, depth and class ids with exact ground-truth boxes.",
        ),
    )


@hookimpl
def lingjing_scenes() -> Iterable[ScenePlugin]:
    """Return the built-in scenes."""
    builders = {"bay": _bay, "map": _map}
    return tuple(
        ScenePlugin(name=kind.name, build=builders.get(kind.name, _district), summary=kind.summary)
        for kind in builtin_scenes().values()
    )


@hookimpl
def lingjing_evaluators() -> Iterable[EvaluatorPlugin]:
    """Return the built-in evaluator."""
    yield EvaluatorPlugin(
        name="mission", build=_mission_evaluator, summary="The mission's own success, failure, stages and constraints."
    )
