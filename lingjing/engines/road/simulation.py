"""The interface to libsumo: a simulation that is started once, advanced by steps of 0.1 s and closed.

libsumo keeps its simulation in global state of the process: a second `start` would silently replace the first, so a
second `Simulation` raises. The domains (`vehicle`, `lane`, …) are libsumo's own, without wrappers. A call takes a
microsecond; a wrapper would double the time of reading a thousand vehicles.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_PROJ = ("PROJ_LIB", "PROJ_DATA")
_BEFORE = {name: os.environ.get(name) for name in (*_PROJ, "LIBSUMO_AS_TRACI")}
os.environ["LIBSUMO_AS_TRACI"] = "quiet"  # otherwise the import prints a message about the version of pyarrow

import libsumo  # type: ignore[import-untyped,unused-ignore]  # noqa: E402 - the import changes the environment

_OWN = {name: os.environ.get(name) for name in _PROJ}

from lingjing.errors import InfrastructureError  # noqa: E402

STEP_S = 0.1
"""Step of the simulation, seconds: short enough for cars to react to dogs and people."""

COARSE_STEP_S = 0.5
"""Step with coarse motion, seconds: half of the headway that drivers keep."""

FOREVER_S = 1e7
"""Duration of a stop that only a command ends, seconds."""

SumoError = libsumo.TraCIException
"""The exception of a call that SUMO rejects."""

_MOST_SEED = 2**31 - 1
"""Largest seed that SUMO accepts."""

_running: list[Simulation] = []


class Simulation:
    """A running simulation of one network. `vehicle`, `person`, `lane`, `edge`, … are libsumo's domains."""

    def __init__(self, network: str, seed: int, step_s: float = STEP_S) -> None:
        """Start the simulation, which advances by `step_s` seconds at a time.

        Raises `InfrastructureError` if one is running in this process or if SUMO cannot read the network.
        """
        if _running:
            raise InfrastructureError(
                "a second traffic simulation in one process: SUMO can hold only one",
                hint="close the first episode, or run each in a world process of its own (`--world process`)",
            )
        if not Path(network).is_file():
            raise InfrastructureError(
                f"the road network {network} does not exist",
                hint="build the scene again: its cached files were removed",
            )
        try:
            with _environment(_OWN):
                libsumo.start(_arguments(network, seed, step_s))
        except (SumoError, libsumo.FatalTraCIError) as fault:
            raise InfrastructureError(f"SUMO cannot load the road network {network}: {fault}") from fault
        _running.append(self)
        self._entries = 0
        self.step_s = step_s
        """Step, seconds."""
        self.level = False
        """True if all roads have the same elevation; slopes are not read then."""
        self.vehicle: Any = libsumo.vehicle
        self.vehicletype: Any = libsumo.vehicletype
        self.person: Any = libsumo.person
        self.route: Any = libsumo.route
        self.lane: Any = libsumo.lane
        self.edge: Any = libsumo.edge
        self.trafficlight: Any = libsumo.trafficlight
        self.simulation: Any = libsumo.simulation
        self.step: Any = libsumo.simulationStep

    def enter(self, name: str, edges: Sequence[str], kind: str, lane: int, front_m: float) -> None:
        """Put a vehicle on a lane of the first edge, with speed 0 and its front at `front_m`, from the next step on."""
        self._entries += 1
        route = f"route/{name}/{self._entries}"
        self.route.add(route, list(edges))
        self.vehicle.add(name, route, kind, departLane=str(lane), departPos=str(front_m), departSpeed="0")

    def close(self) -> None:
        """End the simulation; a second call has no effect."""
        if self in _running:
            _running.remove(self)
            libsumo.close()


def _set(values: Mapping[str, str | None]) -> None:
    for name, value in values.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


@contextmanager
def _environment(values: Mapping[str, str | None]) -> Iterator[None]:
    """Set the variables of PROJ for libsumo and restore them: other copies of PROJ in the process need other
    databases."""
    before = {name: os.environ.get(name) for name in values}
    _set(values)
    try:
        yield
    finally:
        _set(before)


_set(_BEFORE)


def _arguments(network: str, seed: int, step_s: float) -> list[str]:
    options = {
        "--net-file": network,
        "--step-length": str(step_s),
        "--seed": str(seed % _MOST_SEED),
        "--no-step-log": "true",
        "--no-warnings": "true",
        "--time-to-teleport": "-1",  # a stuck vehicle stays visible instead of jumping
        "--collision.action": "warn",
        "--collision.check-junctions": "true",
        "--collision.mingap-factor": "0",  # only contact is a collision
        "--insertion-checks": "none",  # a vehicle starts exactly at its declared place
        "--default.speeddev": "0",
        "--xml-validation": "never",
        "--xml-validation.net": "never",
    }
    return ["sumo", *(word for pair in options.items() for word in pair)]
