"""Fixtures of several packages: small worlds for engines (an open sea, a quay with a tower), and processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from lingjing import testing
from lingjing.mission.instance import Clock, Entity, Instance, InteractionSpec, VerbSpec, Weather
from lingjing.scene.city import City
from lingjing.testing import EngineRun, bare_instance, declared, mission_file
from lingjing.testing.engines import WATER_LEVEL_M


def pytest_addoption(parser: pytest.Parser) -> None:
    """One option for all golden files."""
    parser.addoption("--update", action="store_true", help="rewrite the golden files")


MOVES = ("takeoff", "setDestination", "forward", "backward", "left", "right", "up", "down", "stop")


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


def build_boat(position: tuple[float, float, float] = (0.0, 0.0, WATER_LEVEL_M), heading_deg: float = 0.0) -> Entity:
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


def build_victim(
    index: int = 1, position: tuple[float, float, float] = (0.0, 0.0, WATER_LEVEL_M), **more: object
) -> Entity:
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


@pytest.fixture
def open_sea() -> City:
    return testing.open_sea()


@pytest.fixture
def quay() -> City:
    return testing.quay()


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
def player() -> type[EngineRun]:
    return EngineRun


@pytest.fixture(scope="session")
def endless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a sea rescue with a million ticks: a test ends its episode before they are over."""
    text = mission_file("ssr").read_text(encoding="utf-8")
    assert "ticks <= 60," in text
    path = tmp_path_factory.mktemp("endless") / "ssr.ljs"
    path.write_text(text.replace("ticks <= 60,", "ticks <= 1000000,"), encoding="utf-8")
    return path


@pytest.fixture
def descendants() -> Callable[[int], set[int]]:
    """A function that reads from /proc the ids of all processes below a process: its children, their children, and so
    on.
    """

    def below(pid: int) -> set[int]:
        children: dict[int, list[int]] = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                except (OSError, ValueError):
                    continue
                children.setdefault(parent, []).append(int(entry.name))
        ids: set[int] = set()
        frontier = [pid]
        while frontier:
            frontier = [child for parent in frontier for child in children.get(parent, []) if child not in ids]
            ids.update(frontier)
        return ids

    return below
