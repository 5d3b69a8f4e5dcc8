"""The engine against `lingjing serve --airsim`, which speaks AirSim's protocol: the conformance kit, and a flight.

A real AirSim needs Unreal. What these tests cannot cover is listed in the README.
"""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

import lingjing
from lingjing.errors import InfrastructureError
from lingjing.plugins.conformance import ENGINE_CHECKS, EngineCase, case_of, check_name
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.policy import Action, Brief, Decision, Inbox, Observation
from lingjing.testing import play

pytest.importorskip("cosysairsim", reason="the client is not installed")

MISSION = Path(__file__).parents[1] / "missions" / "pier.ljs"


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The port of a server with two drones on the pier of the bay."""
    command = [
        sys.executable, "-m", "lingjing.cli.main", "serve", "--airsim", "--scene", "bay", "--drones", "2",
        "--port", "0", "--tick", "250", "--pace", "wait", "--world", "inline",
        "-o", str(tmp_path_factory.mktemp("served") / "run"), "--no-overview",
    ]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        yield int(process.stdout.readline().strip().rpartition(":")[2])
        process.kill()


@pytest.fixture
def plugin() -> Any:
    return import_module("lingjing_airsim.plugin")


@pytest.fixture
def case(plugin: Any, port: int) -> EngineCase:
    flight = ("setDestination", {"x": 306.6, "y": -600.0, "z": 12.0})
    return at_port(case_of(plugin.ENGINE, lingjing.compile(MISSION), {"uav[1]": flight}), port)


def at_port(case: EngineCase, port: int) -> EngineCase:
    """The case with the option that names the server."""
    return dataclasses.replace(case, instance=replace(case.instance, engine_options={"airsim": {"port": port}}))


@pytest.mark.parametrize("check", ENGINE_CHECKS, ids=check_name)
def test_the_engine_conforms_to_the_contract(case: EngineCase, check: Callable[[EngineCase], None]) -> None:
    check(case)


def test_an_aircraft_arrives_at_its_destination(plugin: Any, case: EngineCase) -> None:
    engine = plugin.ENGINE.factory()
    ready = engine.reset(EngineSpec(engine="airsim", instance=case.instance, owns=case.spec.owns), case.city, case.seed)
    assert [state.status for state in ready.states] == ["grounded", "grounded"]
    receipts = engine.submit(case.commands)
    assert [receipt.status for receipt in receipts] == ["accepted"]
    events, statuses = [], []
    for step in range(1, 60):
        boundary = engine.advance(0.5 * step, ())
        events += [event.kind for event in boundary.events]
        statuses += [receipt.status for receipt in boundary.receipts]
    assert events == ["arrived"] and statuses[-1] == "completed"
    assert boundary.states[0].position == pytest.approx((306.6, -600.0, 12.0), abs=1.0)
    engine.close()


def test_a_mission_is_won_with_airsims_vehicles(port: int, tmp_path: Path) -> None:
    episode = play(MISSION, tmp_path, policy=Pilot, engine_args={"airsim.port": port})
    assert episode.report.success, episode.report.reason


def test_an_unreachable_airsim_is_reported_with_its_address(plugin: Any, case: EngineCase) -> None:
    engine = plugin.ENGINE.factory()
    spec = EngineSpec(engine="airsim", instance=at_port(case, 1).instance, owns=case.spec.owns)
    with pytest.raises(InfrastructureError, match=r"AirSim at 127\.0\.0\.1 port 1"):
        engine.reset(spec, case.city, 1)


class Pilot:
    """Sends both UAVs north."""

    async def reset(self, brief: Brief) -> None:
        self.sent = False

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        own = observation.entities[0]
        if self.sent:
            return Decision()
        self.sent = True
        x = 306.6 if own.id == "uav[1]" else 316.6
        goal = {"x": x, "y": -560.0, "z": 15.0}
        return Decision(command=Action(verb="setDestination", arguments=goal, resource=own.id))
