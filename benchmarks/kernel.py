"""Lockstep co-simulation of trivial engines in one process: this kernel against mosaik, side by side.

Every engine owns one body, sees all others where they were at the tick's start (fixed-step Jacobi) and moves. Three
columns of ours: `world` is the coupling alone, what mosaik does; `kernel` adds all that a boundary is: visibility,
adjudication, evaluation, the hash-chained record; `agents` adds three agents that observe all bodies, each of which
commands its body and speaks to the others at every tick. Ticks are counted by seconds of CPU, so that a busy machine
slows both sides alike; rounds alternate, and the best round of each side counts.
"""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from lingjing.kernel.step import Kernel
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.expression import Flag
from lingjing.mission.instance import (
    AgentSpec,
    Budget,
    ChannelSpec,
    Clock,
    CommsSpec,
    Entity,
    Instance,
    MessageSpec,
    SceneSpec,
    VerbSpec,
    Weather,
)
from lingjing.mission.model import Field
from lingjing.plugins.engine import Boundary, EnginePlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.records import Action, BodyState, Decision, DecisionRecord, Outgoing, Receipt

HERE = Path(__file__).resolve().parent
FOREIGN_PYTHON = HERE.parent / ".venv-bench" / "bin" / "python"
CITY = City(id="toy", origin=(31.0, 121.5), bounds=(-100.0, -100.0, 100.0, 100.0))
ROUNDS = 3
SECONDS = 3.0


class Toy:
    """A body that moves a metre per tick and reads the positions of the others."""

    def reset(self, spec, city, seed):
        self.name, self.body, self.east, self.seen = spec.engine, spec.owns[0], 0.0, 0.0
        return self.boundary(0.0)

    def submit(self, commands):
        return tuple(
            Receipt(request=command.id, tick=command.tick, sender=command.sender, resource=command.resource,
                    status="accepted", by=self.name, time_s=self.east)
            for command in commands
        )  # fmt: skip

    def advance(self, until, mirrors):
        self.seen = sum(mirror.position[0] for mirror in mirrors)
        self.east += 1.0
        return self.boundary(until)

    def boundary(self, time_s):
        state = BodyState(id=self.body, position=(self.east, 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
        return Boundary(engine=self.name, time_s=time_s, states=(state,))

    def capture(self, requests):
        return ()

    def close(self):
        return None


class Toys:
    """A plug-in with `count` trivial engines."""

    def __init__(self, count: int) -> None:
        self.names = [f"toy{number}" for number in range(count)]

    @hookimpl
    def lingjing_engines(self):
        return [EnginePlugin(name=name, factory=Toy) for name in self.names]


def instance(count: int, agents: int = 0) -> Instance:
    """Return an instance with one body for each of `count` engines, ticks of one second, and agents for the first
    bodies.
    """
    return Instance(
        mission="toys", title="", goal="", seed=0, settings={}, scene=SceneSpec(kind="toy"),
        clock=Clock(tick_s=1.0, sync_s=1.0), budget=Budget(ticks=10**9, policy_s=60, engine_s=60, capture_s=60),
        weather=Weather(), regions=(), cells=(),
        entities=tuple(
            Entity(id=f"body{n}", group="body", index=n, role="asset", type="toy", engine=f"toy{n}", position=(0, 0, 0),
                   verbs=(VerbSpec(name="stop"),))
            for n in range(count)
        ),
        agents=tuple(
            AgentSpec(id=f"agent{n}", name=f"agent{n}", index=n, role="mover", controls=(f"body{n}",),
                      commands=(f"body{n}",),
                      observes=tuple(ChannelSpec(source="entity", name=f"body{m}") for m in range(count)))
            for n in range(agents)
        ),
        messages=(
            MessageSpec(kind="here", type="here", category="other", fields=(Field(name="east", type="number"),),
                        senders=("all",), recipients=("all",)),
        ) if agents else (),
        comms=CommsSpec(mode="broadcast", hub=None), rules=(), unlocks=(),
        stages=(), relations=(),
        success=Flag(value=False),
    )  # fmt: skip


def world_rate(count: int) -> float:
    """Return the ticks per second of the coupling alone."""
    world = InlineWorld(PluginHost(entry_points=False, extra=[Toys(count)]))
    world.reset(instance(count), CITY)
    try:
        return rate(lambda tick: world.step(tick, ()))
    finally:
        world.close()


def kernel_rate(count: int) -> float:
    """Return the ticks per second of the whole boundary."""
    world = InlineWorld(PluginHost(entry_points=False, extra=[Toys(count)]))
    kernel = Kernel(instance(count), CITY, world)
    kernel.reset()
    try:
        return rate(lambda tick: kernel.step(()))
    finally:
        world.close()


def agents_rate(count: int) -> float:
    """Return the ticks per second of the whole boundary with three agents that command and send messages at each."""
    world = InlineWorld(PluginHost(entry_points=False, extra=[Toys(count)]))
    kernel = Kernel(instance(count, agents=3), CITY, world)
    kernel.reset()
    spoken = Decision(command=Action(verb="stop"), messages=(Outgoing(kind="here", body={"east": 1.0}),))
    made = tuple(DecisionRecord(agent=f"agent{n}", decision=spoken) for n in range(3))
    try:
        return rate(lambda tick: kernel.step(made))
    finally:
        world.close()


def rate(step: Callable[[int], object]) -> float:
    """Call `step(1)`, `step(2)`, … for a few seconds and return the calls per second."""
    tick, started = 0, time.process_time()
    while (elapsed := time.process_time() - started) < SECONDS:
        for _ in range(20):
            tick += 1
            step(tick)
    return tick / elapsed


def mosaik_rate(count: int) -> float:
    """Return the ticks per second of mosaik, from its own environment."""
    command = [str(FOREIGN_PYTHON), str(HERE / "mosaik_side.py"), str(count), str(9000 // count)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main() -> None:
    """Print the table."""
    print("| trivial engines | world, ticks/s | kernel | agents | mosaik | world : mosaik | kernel : mosaik |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for count in (3, 10):
        rounds = [
            (world_rate(count), kernel_rate(count), agents_rate(count), mosaik_rate(count)) for _ in range(ROUNDS)
        ]
        world, kernel, agents, mosaik = (max(side) for side in zip(*rounds, strict=True))
        ratios = f"{world / mosaik:.2f} | {kernel / mosaik:.2f}"
        print(f"| {count} | {world:.0f} | {kernel:.0f} | {agents:.0f} | {mosaik:.0f} | {ratios} |")


if __name__ == "__main__":
    main()
