"""What tests of several packages need: small worlds for engines (an open sea, a quay with a tower), and processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from lingjing.data import data_path
from lingjing.mission.instance import (
    Clock,
    Entity,
    Instance,
    InteractionSpec,
    VerbSpec,
    Weather,
)
from lingjing.plugins.engine import Boundary, Engine, EngineSpec
from lingjing.scene.city import City, Land, Solid, Water
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent
from tests.bare_instance import bare_instance
from tests.declared import declared


def pytest_addoption(parser: pytest.Parser) -> None:
    """One option for all golden files."""
    parser.addoption("--update", action="store_true", help="rewrite the golden files")


LEVEL_M = -3.5
MOVES = ("takeoff", "setDestination", "forward", "backward", "left", "right", "up", "down", "stop")


def square(x: float, y: float, half: float) -> tuple[tuple[float, float], ...]:
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def build_instance(entities: Sequence[Entity], weather: Weather | None = None, sync_s: float = 0.5) -> Instance:
    return bare_instance(entities, clock=Clock(tick_s=10.0, sync_s=sync_s), weather=weather or Weather())


def build_uav(index: int = 1, position: tuple[float, float, float] = (0.0, 0.0, 1.1), **properties: float) -> Entity:
    return declared(
        Entity(
            id=f"uav[{index}]",
            group="uav",
            index=index,
            role="asset",
            type="quadrotor",
            engine="multirotor",
            position=position,
            properties={"cruise_mps": 12.0, "endurance_s": 2100.0, **properties},
            verbs=tuple(VerbSpec(name=name) for name in MOVES),
        )
    )


def build_boat(position: tuple[float, float, float] = (0.0, 0.0, LEVEL_M), heading_deg: float = 0.0) -> Entity:
    return declared(
        Entity(
            id="boat",
            group="boat",
            index=1,
            role="asset",
            type="lifeboat",
            engine="vessel",
            position=position,
            heading_deg=heading_deg,
            properties={"speed_mps": 3.0},
            verbs=(VerbSpec(name="moveTo"), VerbSpec(name="stop")),
        )
    )


def build_victim(index: int = 1, position: tuple[float, float, float] = (0.0, 0.0, LEVEL_M), **more: object) -> Entity:
    return declared(
        Entity(
            id=f"victim[{index}]",
            group="victim",
            index=index,
            role="target",
            type="person_in_water",
            engine="city",
            position=position,
            properties={"drift_mps": 0.1, **more},
            interactions=(InteractionSpec(name="rescue", by="vessel", within_m=50.0, aboard=True),),
            hidden=("position",),
        )
    )


class Player:
    """Drives one engine by macro-steps and keeps what it said."""

    def __init__(self, engine: Engine, instance: Instance, city: City, name: str, seed: int = 1) -> None:
        owned = tuple(entity.id for entity in instance.entities if entity.engine == name)
        self.engine = engine
        self.sync_s = instance.clock.sync_s
        self.boundary: Boundary = engine.reset(EngineSpec(engine=name, instance=instance, owns=owned), city, seed)
        self.history: list[Boundary] = [self.boundary]
        self.receipts: list[Receipt] = []
        self.events: list[TaskEvent] = []
        self.time_s = 0.0
        self._count = 0

    def command(self, resource: str, verb: str, origin: str = "agent", **arguments: object) -> Receipt:
        self._count += 1
        command = Command(
            id=f"c0-{self._count}",
            tick=0,
            sender="test",
            resource=resource,
            verb=verb,
            arguments=arguments,
            origin=origin,
        )
        (receipt,) = self.engine.submit((command,))
        return receipt

    def run(self, seconds: float, mirrors: Sequence[BodyState] = ()) -> Boundary:
        for _ in range(round(seconds / self.sync_s)):
            self.step(mirrors)
        return self.boundary

    def until_ended(self, request: str, limit_s: float = 120.0) -> Receipt:
        while self.time_s < limit_s:
            for receipt in self.step().receipts:
                if receipt.request == request and receipt.status != "running":
                    return receipt
        raise AssertionError(f"{request} did not end within {limit_s} s: {self.boundary.states}")

    def step(self, mirrors: Sequence[BodyState] = ()) -> Boundary:
        self.time_s += self.sync_s
        self.boundary = self.engine.advance(self.time_s, mirrors)
        self.history.append(self.boundary)
        self.receipts += self.boundary.receipts
        self.events += self.boundary.events
        return self.boundary

    @property
    def state(self) -> BodyState:
        return self.boundary.states[0]


@pytest.fixture
def open_sea() -> City:
    water = Water(polygon=square(0.0, 0.0, 5000.0), level_m=LEVEL_M)
    return City(
        id="sea", origin=(31.0, 121.5), bounds=(-5000.0, -5000.0, 5000.0, 5000.0), datum_m=LEVEL_M, waters=(water,)
    )


@pytest.fixture
def quay(open_sea: City) -> City:
    """The sea with a quay (top 0.9 m) of 40 m to each side of the origin and a tower of 60 m, 100 m to the east."""
    tower = Solid(id="tower", polygon=square(100.0, 0.0, 5.0), base_m=LEVEL_M, top_m=60.0)
    land = Land(polygon=square(0.0, 0.0, 40.0), top_m=0.9, surface="concrete")
    return City(
        id="quay",
        origin=open_sea.origin,
        bounds=open_sea.bounds,
        datum_m=LEVEL_M,
        waters=open_sea.waters,
        lands=(land,),
        solids=(tower,),
    )


@pytest.fixture
def instance_of() -> Callable[..., Instance]:
    return build_instance


@pytest.fixture
def uav() -> Callable[..., Entity]:
    return build_uav


@pytest.fixture
def boat() -> Callable[..., Entity]:
    return build_boat


@pytest.fixture
def victim() -> Callable[..., Entity]:
    return build_victim


@pytest.fixture
def player() -> type[Player]:
    return Player


@pytest.fixture(scope="session")
def endless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sea rescue with more ticks than anybody will wait for: it is in the middle whenever it is looked at."""
    text = data_path("scenarios", "ssr.ljs").read_text(encoding="utf-8")
    assert "ticks <= 60," in text
    path = tmp_path_factory.mktemp("endless") / "ssr.ljs"
    path.write_text(text.replace("ticks <= 60,", "ticks <= 1000000,"), encoding="utf-8")
    return path


@pytest.fixture
def descendants() -> Callable[[int], set[int]]:
    """Tells the ids of the processes below one, whoever started them, from /proc."""

    def below(pid: int) -> set[int]:
        children: dict[int, list[int]] = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                except (OSError, ValueError):
                    continue
                children.setdefault(parent, []).append(int(entry.name))
        found: set[int] = set()
        frontier = [pid]
        while frontier:
            frontier = [child for parent in frontier for child in children.get(parent, []) if child not in found]
            found.update(frontier)
        return found

    return below
