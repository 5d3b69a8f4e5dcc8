"""A world with everything in it, for tests of the world host: streets with traffic, dogs, aircraft, a boat, a fire."""

from __future__ import annotations

from lingjing.mission.instance import (
    AgentSpec,
    Budget,
    Clock,
    CommsSpec,
    Entity,
    Instance,
    InteractionSpec,
    SceneSpec,
    StateSpec,
    VerbSpec,
    Weather,
)
from lingjing.scene.city import Building, City, Water
from lingjing.scene.network import StreetEdge, StreetNode, build_network
from lingjing.testing import bare_instance, declared
from lingjing.trace.records import Command

SPAN_M = 200.0
VERBS = ("takeoff", "setDestination", "forward", "left", "right", "stop", "moveTo")


def city(side: int = 5) -> City:
    """Return streets every 200 m from (0, 0) in both directions, a house in each block, and open water in the south."""
    corners = [(column, row) for column in range(side) for row in range(side)]
    nodes = [StreetNode(id=f"{c}{r}", east=c * SPAN_M, north=r * SPAN_M, control="priority") for c, r in corners]
    edges = [
        StreetEdge(id=f"{a[0]}{a[1]}-{b[0]}{b[1]}", start=f"{a[0]}{a[1]}", end=f"{b[0]}{b[1]}", lanes=1)
        for c, r in corners
        for other in ((c + 1, r), (c, r + 1))
        if max(other) < side
        for a, b in (((c, r), other), (other, (c, r)))
    ]
    network = build_network(nodes, edges)
    reach = (side - 1) * SPAN_M
    sea = ((-500.0, -1500.0), (reach + 500.0, -1500.0), (reach + 500.0, -50.0), (-500.0, -50.0))
    return City(
        id="mixed",
        origin=(31.0, 121.5),
        bounds=(-500.0, -1500.0, reach + 500.0, reach + 500.0),
        network=network.path,
        sha256=network.sha256,
        waters=(Water(polygon=sea, level_m=-2.0),),
        buildings=tuple(_house(c, r) for c in range(side - 1) for r in range(side - 1)),
    )


def _house(column: int, row: int) -> Building:
    x, y = (column + 0.5) * SPAN_M, (row + 0.5) * SPAN_M
    corners = ((x - 30, y - 30), (x + 30, y - 30), (x + 30, y + 30), (x - 30, y + 30))
    return Building(id=f"house-{column}-{row}", polygon=corners, base_m=0.0, top_m=25.0)


HEAT, LOAD, DEMAND = StateSpec(name="heat"), StateSpec(name="load", unit="kg"), StateSpec(name="demand", unit="kg")
EXTINGUISH = InteractionSpec(name="extinguish", by="road", within_m=30.0)
DELIVER = InteractionSpec(name="deliver", by="road", within_m=30.0, takes="demand", source="load")


def entity(
    name: str,
    kind: str,
    engine: str,
    position: tuple[float, float, float],
    acts: tuple[InteractionSpec, ...] = (),
    **properties: object,
) -> Entity:
    group, _, number = name.partition("[")
    return declared(
        Entity(
            id=name,
            group=group,
            index=int(number.rstrip("]") or 0) if number else 0,
            role="target" if engine == "city" else "asset",
            type=kind,
            engine=engine,
            position=position,
            properties=properties,
            verbs=() if engine == "city" else tuple(VerbSpec(name=verb) for verb in VERBS),
            interactions=acts,
            state=tuple(spec for spec in (HEAT, LOAD, DEMAND) if spec.field in properties),
        )
    )


def instance(uavs: int = 2, dogs: int = 1, vans: int = 1, traffic: int = 20, sync_s: float = 0.1) -> Instance:
    """Return an instance with these numbers of bodies, a boat, a fire for the vans, an order, and radio of 600 m."""
    fleet = [
        *[
            entity(f"uav[{n}]", "quadrotor", "multirotor", (60.0 * n, 30.0, 0.2), cruise_mps=12.0, endurance_s=2100.0)
            for n in range(1, uavs + 1)
        ],
        *[entity(f"dog[{n}]", "robot_dog", "quadruped", (20.0 + 15.0 * n, 20.0, 0.0)) for n in range(1, dogs + 1)],
        *[
            entity(f"van[{n}]", "delivery_van", "road", (40.0 + 30 * n, -1.65, 0.0), load_kg=200.0, payload_kg=200.0)
            for n in range(1, vans + 1)
        ],
        entity("boat", "lifeboat", "vessel", (100.0, -300.0, -2.0), speed_mps=3.0),
    ]
    targets = [
        entity("fire", "building_fire", "city", (70.0, 20.0, 0.0), heat=1.0, acts=(EXTINGUISH,)),
        entity(
            "point",
            "delivery_point",
            "city",
            (400.0, 0.0, 0.0),
            demand_kg=250.0,
            acts=(DELIVER,),
        ),
    ]
    agents = tuple(
        AgentSpec(id=f"a-{e.id}", name="a", index=0, role="r", controls=(e.id,), commands=(e.id,), observes=())
        for e in fleet
    )
    return bare_instance(
        (*targets, *fleet),
        mission="mixed",
        seed=5,
        scene=SceneSpec(kind="mixed", options={"traffic": float(traffic)}),
        clock=Clock(tick_s=5.0, sync_s=sync_s),
        budget=Budget(ticks=100, policy_s=60.0, engine_s=300.0, capture_s=60.0),
        weather=Weather(wind_mps=3.0, wind_from_deg=200.0, turbulence=0.1, wave_height_m=0.4, visibility_m=10_000.0),
        agents=agents,
        comms=CommsSpec(mode="broadcast", hub=None, range_m=600.0),
        won=False,
    )


def orders(tick: int, played: Instance) -> list[Command]:
    """At the first tick every body is sent somewhere, and the city's interactions are unlocked."""
    if tick != 1:
        return []
    out = []
    for number, target in enumerate(played.entities, 1):
        verb, arguments = _order(target)
        sender, origin = ("kernel", "kernel") if target.engine == "city" else (f"a-{target.id}", "agent")
        out.append(
            Command(
                id=f"c1-{number}",
                tick=1,
                sender=sender,
                resource=target.id,
                verb=verb,
                arguments=arguments,
                origin=origin,
            )
        )
    return out


def _order(target: Entity) -> tuple[str, dict[str, float]]:
    x = target.position[0]
    return {
        "multirotor": ("setDestination", {"x": x + 300.0, "y": 250.0, "z": 60.0}),
        "quadruped": ("forward", {"distance": 20.0}),
        "road": ("setDestination", {"x": 600.0, "y": 400.0}),
        "vessel": ("moveTo", {"x": 600.0, "y": -500.0}),
        "city": (f"unlock.{target.interactions[0].name}" if target.interactions else "unlock.", {}),
    }[target.engine]
