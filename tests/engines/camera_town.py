"""A small town for tests of the camera: fifty buildings by a river, with helpers that take pictures of it."""

import numpy as np

from lingjing.engines.camera import context
from lingjing.engines.camera.classes import CLASSES
from lingjing.engines.camera.engine import CameraEngine
from lingjing.errors import InfrastructureError
from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import (
    CameraSpec,
    Entity,
    EventSpec,
    Instance,
    SceneSpec,
    Weather,
)
from lingjing.plugins.engine import BodyState, CaptureRequest, EngineSpec, Frame
from lingjing.scene.city import Bridge, Building, City, Junction, Lane, PaintedArea, Pieces, Prop, Road, Water
from lingjing.testing import bare_instance, declared


def missing() -> str:
    """Return the reason that no picture can be drawn here, or an empty string."""
    try:
        context.open_context().release()
    except InfrastructureError as error:
        return f"{error}; {error.hint}"
    return ""


WHY_NOT = missing()
SIZE = 480, 270


def box(west: float, south: float, east: float, north: float) -> Polygon:
    return ((west, south), (east, south), (east, north), (west, north))


def lane(name: str, *shape: tuple[float, float, float]) -> Lane:
    return Lane(id=f"{name}_0", shape=shape, width_m=3.5)


def pieces() -> Pieces:
    """Return a city: fifty buildings on both banks of a river, with a street, a bridge and trees."""
    looks = ("punched", "ribbon", "curtain", "industrial", "blank")
    roofs = ("flat", "gabled", "hipped", "pyramidal", "dome")
    buildings = tuple(
        Building(id=f"b{row}-{column}", polygon=box(60 * column - 300, 60 * row + 40, 60 * column - 270, 60 * row + 70),
                 base_m=0.0, top_m=12.0 + 6.0 * ((row * 7 + column) % 5), facade=looks[column % 5],
                 roof=roofs[row % 5], roof_m=0.0 if row % 5 == 0 else 3.0, levels=4, seed=row * 10 + column)
        for row in range(5) for column in range(10)
    )  # fmt: skip
    street = Road(id="s", lanes=(lane("s", (-300.0, 0.0, 0.0), (-8.0, 0.0, 0.0)),), kind="secondary")
    tunnel = Road(id="t", lanes=(lane("t", (-300.0, 8.0, 0.0), (300.0, 8.0, 0.0)),), tunnel=True)
    way = Road(id="w", lanes=(lane("w", (0.0, -8.0, 8.0), (0.0, -170.0, 8.0)),), bridge=True)
    bridge = Bridge(id="bridge", path=((0.0, -8.0, 8.0), (0.0, -170.0, 8.0)), width_m=9.0, pier_spacing_m=50.0)
    return Pieces(
        areas=(PaintedArea(polygon=box(100, -20, 300, 30), surface="grass"), PaintedArea(polygon=box(150, -10, 200, 20),
                                                                            surface="sidewalk")),
        buildings=buildings, roads=(street, tunnel, way), bridges=(bridge,),
        junctions=(Junction(id="j", polygon=box(-8, -8, 8, 8), lights=True),),
        props=tuple(Prop(id=f"t{k}", cls="tree", model="tree", position=(20.0 + 12 * k, 25.0, 0.0)) for k in range(6)),
    )  # fmt: skip


def town(**changes: object) -> City:
    parts = {name: getattr(pieces(), name) for name in Pieces.__struct_fields__}
    river = Water(polygon=box(-500, -160, 500, -40), level_m=-1.5)
    return City(id="town", origin=(31.0, 121.5), bounds=(-500.0, -500.0, 500.0, 500.0), tile_m=125.0,
                **{**parts, "waters": (river,), **changes})  # fmt: skip


def mounts() -> tuple[CameraSpec, ...]:
    return tuple(
        CameraSpec(name=view, view=view, width=SIZE[0], height=SIZE[1], hfov_deg=84.0,
                   channels=("rgb", "depth", "semantic", "instance"), capture="on_request")
        for view in ("nadir", "front", "oblique")
    )  # fmt: skip


def entity(name: str, kind: str, at: tuple[float, float, float], **more: object) -> Entity:
    return declared(Entity(id=name, group=name, index=1, role="asset", type=kind, engine="x", position=at, **more))


def instance(*others: Entity, weather: Weather | None = None, events: tuple[EventSpec, ...] = ()) -> Instance:
    uav = entity("uav", "quadrotor", (0.0, 0.0, 100.0), cameras=mounts())
    scene = SceneSpec(kind="x", seed=3)
    weather = weather or Weather(sun_azimuth_deg=180.0)
    return bare_instance((uav, *others), seed=3, scene=scene, weather=weather, events=events)


def ready(engine: CameraEngine, episode: Instance | None = None, city: City | None = None) -> None:
    engine.reset(EngineSpec(engine="camera", instance=episode or instance(), owns=()), city or town(), 3)


def look(
    engine: CameraEngine,
    at: tuple[float, float, float],
    view: str = "nadir",
    heading: float = 0.0,
    viewer: str = "uav",
    mirrors: tuple[BodyState, ...] = (),
    time_s: float = 10.0,
    **state: object,
) -> Frame:
    engine.advance(time_s, [BodyState(id=viewer, position=at, heading_deg=heading, **state), *mirrors])
    (frame,) = engine.capture([CaptureRequest(frame="f", entity=viewer, camera=view, tick=1, time_s=time_s)])
    return frame


def seen_at(frame: Frame, east: float, north: float, up: float) -> tuple[int, float, np.ndarray]:
    """Return (class, depth, colour) of the pixel of a point, for a camera that looks straight down, north up."""
    x, y, z = frame.info.pose.position
    focal = SIZE[0] / 2 / np.tan(np.radians(42.0))
    column = int(SIZE[0] / 2 + focal * (east - x) / (z - up))
    row = int(SIZE[1] / 2 - focal * (north - y) / (z - up))
    assert frame.semantic is not None and frame.depth is not None
    return int(frame.semantic[row, column]), float(frame.depth[row, column]), frame.rgb[row, column].astype(int)


def share(frame: Frame, name: str) -> float:
    assert frame.semantic is not None
    return float((frame.semantic == CLASSES[name]).mean())
