"""A remote engine passes the conformance kit over a real socket, with our engine in another process."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import lingjing
from lingjing.plugins.conformance import ENGINE_CHECKS, EngineCase, case_of, check_name
from lingjing.plugins.engine import Engine, EnginePlugin
from lingjing.serve.lj_engine import episodes, server
from tests.serve.lj_engine.conftest import MISSION, WAIT_S


@pytest.fixture(scope="module")
def plugin() -> Iterator[EnginePlugin]:
    """The multirotor engine of a session; each engine that the kit makes has a link of its own."""
    hub = server.Hub("conformance")
    listening = server.EngineServer(hub, "127.0.0.1", 0)
    url = f"ws://127.0.0.1:{listening.port}/ws/LJ-ENGINE/airsim"
    with subprocess.Popen([sys.executable, "-m", "lingjing.cli.main", "engine", "--connect", url]) as process:
        latest = time.monotonic() + WAIT_S
        while "LJ-ENGINE_airsim" not in hub.open_keys():
            assert time.monotonic() < latest
            time.sleep(0.1)

        def make() -> Engine:
            settings = episodes.RemoteSettings(engine="multirotor", reply_s=60.0)
            return episodes.RemoteEngine(
                settings, hub.link("multirotor", "LJ-ENGINE_airsim", paced=False), lambda instance: {}
            )

        yield EnginePlugin(name="multirotor", factory=make, place="remote", native_dt_s=0.02, summary="A session.")
        listening.close()
        process.terminate()


@pytest.fixture(scope="module")
def case(plugin: EnginePlugin, tmp_path_factory: pytest.TempPathFactory) -> EngineCase:
    path: Path = tmp_path_factory.mktemp("ferry") / "ferry.ljs"
    path.write_text(MISSION.format(uavs=2, ticks=12))
    flight = ("setDestination", {"x": 306.6, "y": -590.0, "z": 12.0})
    return case_of(plugin, lingjing.compile(path), {"uav[1]": flight})


@pytest.mark.parametrize("check", ENGINE_CHECKS, ids=check_name)
def test_a_remote_engine_conforms(case: EngineCase, check: Callable[[EngineCase], None]) -> None:
    check(case)
