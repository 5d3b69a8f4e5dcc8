"""The plug-in that declares the built-in engines and scenes; every factory imports what it needs when it is called."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Instance, SceneSpec
from lingjing.plugins.engine import Engine, EnginePlugin
from lingjing.plugins.hookspecs import ScenePlugin, hookimpl
from lingjing.scene.city import City


def _multirotor() -> Engine:
    from lingjing.engines.multirotor.engine import MultirotorEngine

    return MultirotorEngine()


def _plane() -> Engine:
    from lingjing.engines.fixed_wing.engine import PlaneEngine

    return PlaneEngine()


def _satellite() -> Engine:
    from lingjing.engines.satellite.engine import SatelliteEngine

    return SatelliteEngine()


def _vessel() -> Engine:
    from lingjing.engines.vessel.engine import VesselEngine

    return VesselEngine()


def _road() -> Engine:
    with _extra("road", "libsumo"):
        from lingjing.engines.road.engine import RoadEngine

    return RoadEngine()


def _quadruped() -> Engine:
    with _extra("quadruped", "mujoco"):
        from lingjing.engines.quadruped.engine import QuadrupedEngine

    return QuadrupedEngine()


def _city() -> Engine:
    from lingjing.engines.city.engine import CityEngine

    return CityEngine()


def _camera() -> Engine:
    from lingjing.engines.camera.engine import CameraEngine

    return CameraEngine()


def _bay(spec: SceneSpec) -> City:
    from lingjing.scene.bay import build

    return build(spec)


def _district(spec: SceneSpec) -> City:
    from lingjing.scene.districts import build

    return build(spec)


def _has_traffic(instance: Instance) -> bool:
    """Whether the scene asks for traffic: it is there also when no car is anybody's."""
    traffic = instance.scene.options.get("traffic", 0.0)
    return isinstance(traffic, int | float) and traffic > 0


def _has_radio(instance: Instance) -> bool:
    """Whether messages have a range, which is the city's to work out."""
    return instance.comms.range_m is not None


DISTRICTS = {
    "residential": "Dwellings on a street grid: slabs, houses, towers, and a walled compound (`inside`).",
    "industrial": "Halls, tanks and yards, a walled factory (`inside`) or a pipeline area (`pipeline`).",
    "commercial": "Office towers on podiums with shops, plazas and parks between avenues.",
    "campus": "Lecture halls around lawns, dormitories, sports grounds.",
    "logistics": "Warehouses with docks, container yards and shops around a central depot.",
    "coastal": "A town by the sea (`shore`) with promenade, harbour and a long bridge (`bridge`).",
    "city": "All districts together as a city of wide blocks by the sea, up to 12 km, streamed from tiles.",
}
"""The procedural scenes by name."""


def _map(spec: SceneSpec) -> City:
    from lingjing.scene.osm.provider import city_of

    with _extra("maps", "osmium"):
        return city_of(spec)


@contextmanager
def _extra(name: str, package: str) -> Iterator[None]:
    """Say how to install what an extra brings, where it is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        command = f"pip install 'lingjing[{name}]'"
        raise InfrastructureError(f"the package `{package}` is not installed", hint=f"`{command}`") from error


@hookimpl
def lingjing_engines() -> Iterable[EnginePlugin]:
    """The engines that come with the project."""
    return (
        EnginePlugin(
            name="multirotor",
            factory=_multirotor,
            native_dt_s=0.02,
            summary="Multirotors: JSBSim at 100 Hz under a 50 Hz position controller, with wind and battery.",
        ),
        EnginePlugin(
            name="plane",
            factory=_plane,
            native_dt_s=0.02,
            summary="Fixed-wing aircraft: JSBSim at 100 Hz under an autopilot; straight there, then in a circle.",
        ),
        EnginePlugin(
            name="satellite",
            factory=_satellite,
            native_dt_s=1.0,
            summary="Satellites: SGP4 from two-line elements, passes over the region, what is in view.",
        ),
        EnginePlugin(
            name="vessel",
            factory=_vessel,
            native_dt_s=0.1,
            summary="Surface vessels: 3-DOF surge, sway and yaw at 10 Hz in waves, current and wind.",
        ),
        EnginePlugin(
            name="road",
            factory=_road,
            native_dt_s=0.1,
            wanted=_has_traffic,
            summary="Road vehicles, background traffic and queues: SUMO at 10 Hz, braking for whoever crosses.",
        ),
        EnginePlugin(
            name="quadruped",
            factory=_quadruped,
            native_dt_s=0.02,
            summary="Robot dogs: Unitree Go2 on its legs in MuJoCo at 200 Hz under a 50 Hz walking policy.",
        ),
        EnginePlugin(
            name="city",
            factory=_city,
            native_dt_s=0.1,
            wanted=_has_radio,
            summary="Targets, what may be done to them, goods and queues; the reach of radio.",
        ),
        EnginePlugin(
            name="camera",
            factory=_camera,
            place="camera",
            sensor=True,
            summary="Rendered pictures of the city: RGB, depth and class ids with exact ground-truth boxes.",
        ),
    )


@hookimpl
def lingjing_scenes() -> Iterable[ScenePlugin]:
    """The scenes that come with the project."""
    return (
        ScenePlugin(name="bay", build=_bay, summary="A bay with a pier: open water, shore, buoys and debris."),
        *(ScenePlugin(name=name, build=_district, summary=summary) for name, summary in DISTRICTS.items()),
        ScenePlugin(name="map", build=_map, summary="A real city from OpenStreetMap data: a built folder or a file."),
    )
