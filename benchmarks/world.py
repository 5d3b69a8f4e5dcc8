"""A world with all kinds of bodies: a hundred vehicles, three dogs, five UAVs, a boat, a plane, a satellite, by the
sea.

The tables are in processor time of one process with every engine in it, so that a busy machine has little influence.
They show the real-time factor without pictures with the share of each part, the cost of a boundary as one fleet grows,
the memory that many resets leave, and the cost of checking a boundary with very many background movers. All bodies move
all the time. Growth is measured in time, which other processes disturb through shared caches, and in function calls,
which no machine disturbs. `--only factor|growth|resets|movers` prints one table, `--quick` takes fewer ticks and
resets.
"""

from __future__ import annotations

import argparse
import cProfile
import gc
import json
import math
import statistics
import subprocess
import sys
import time
import types
from pathlib import Path

import lingjing.kernel.world.guarded_calls as calling
from lingjing.dsl.loading.load import load_mission
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.step import Kernel
from lingjing.kernel.world.boundary_checks import checked_boundary
from lingjing.kernel.world.contract import World, WorldBoundary
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.engine import Boundary
from lingjing.plugins.host import PluginHost
from lingjing.trace.records import Action, BodyState, Decision, DecisionRecord

HERE = Path(__file__).resolve().parent
MISSION = HERE.parent / "tests" / "couplings" / "mixed.ljs"
WARM_UP = 4
COUNTED = 2
GROWTH = {
    "UAVs": ("uavs", "multirotor", (1, 2, 5, 10, 20, 50)),
    "dogs": ("dogs", "quadruped", (1, 2, 4, 8, 12)),
    "vehicles": ("cars", "road", (10, 30, 100, 300, 1000)),
}
SMALL = {"uavs": 1.0, "dogs": 1.0, "vans": 1.0, "cars": 10.0}


class TimedWorld:
    """A world in the caller that sums up the processor time of its steps."""

    def __init__(self) -> None:
        self.inner: World = InlineWorld(PluginHost())
        self.spent_s = 0.0
        self.reset, self.capture, self.close = self.inner.reset, self.inner.capture, self.inner.close

    def step(self, tick, commands) -> WorldBoundary:
        started = time.process_time()
        boundary = self.inner.step(tick, commands)
        self.spent_s += time.process_time() - started
        return boundary


def by_the_processors_clock() -> None:
    """Make the kernel measure engines in processor time instead of wall-clock time."""
    calling.time = types.SimpleNamespace(perf_counter=time.process_time)


def decisions(instance: Instance, tick: int) -> tuple[DecisionRecord, ...]:
    """Return a command for every body at every boundary; a busy body rejects it and continues."""
    bodies = {entity.id: entity for entity in instance.entities}
    made = []
    for agent in instance.agents:
        action = _action(bodies[agent.controls[0]], tick) if agent.controls else None
        if action is not None:
            made.append(DecisionRecord(agent=agent.id, decision=Decision(command=action)))
    return tuple(made)


def _action(entity: Entity, tick: int) -> Action | None:
    x, y, _ = entity.position
    sign = 1.0 if tick // 6 % 2 == 0 else -1.0
    if entity.engine == "multirotor":
        if tick == 0:
            return Action(verb="takeoff", arguments={"altitude": 60.0 + entity.index})
        where = {"x": x + 100.0 * sign, "y": y, "z": 60.0 + entity.index}
        return Action(verb="setDestination", arguments=where)
    if entity.engine == "quadruped":
        return Action(verb="forward", arguments={"distance": 6.0}) if tick % 2 == 0 else Action(
            verb="left", arguments={"angle": 180.0}
        )  # fmt: skip
    if entity.engine == "road":
        return Action(verb="setDestination", arguments={"x": -400.0 + 200.0 * sign, "y": 200.0 * sign})
    if entity.engine == "vessel":
        return Action(verb="moveTo", arguments={"x": x + 60.0 * sign, "y": y})
    if entity.engine == "plane":
        return Action(verb="setDestination", arguments={"x": 0.0, "y": 600.0 * sign, "z": 250.0})
    return None


def measured(ticks: int, settings: dict[str, float], count: bool = False) -> dict[str, object]:
    """Return the processor seconds of `ticks` ticks after a warm-up: in all, of the world, of each engine.

    With `count` also the calls per tick in the ticks after them: of each engine's own functions and of all.
    """
    by_the_processors_clock()
    world = TimedWorld()
    instance, city = CityBuilder(PluginHost()).place(instantiate(load_mission(MISSION), seed=3, settings=settings))
    kernel = Kernel(instance, city, world)
    kernel.reset()
    gc.freeze()  # as the world's own process does after a reset
    for tick in range(WARM_UP):
        kernel.step(decisions(instance, tick))
    world.spent_s, engines, started = 0.0, {}, time.process_time()
    for tick in range(WARM_UP, WARM_UP + ticks):
        for status in kernel.step(decisions(instance, tick)).record.engines:
            engines[status.engine] = engines.get(status.engine, 0.0) + status.wait_wall_s
    whole_s = time.process_time() - started
    last = kernel.state.registry
    calls = counted(kernel, instance, range(WARM_UP + ticks, WARM_UP + ticks + COUNTED)) if count else {}
    world.close()
    return {
        "ticks": ticks,
        "simulated_s": ticks * instance.clock.tick_s,
        "whole_s": whole_s,
        "world_s": world.spent_s,
        "engines": engines,
        "calls": calls,
        "tick": last.tick,
    }


def counted(kernel: Kernel, instance: Instance, ticks: range) -> dict[str, float]:
    """Return the calls per tick of all functions (``), and of those in the folder of each engine."""
    profile = cProfile.Profile()
    for tick in ticks:
        made = decisions(instance, tick)
        profile.enable()
        kernel.step(made)
        profile.disable()
    calls: dict[str, float] = {"": 0.0}
    for entry in profile.getstats():
        file = "" if isinstance(entry.code, str) else entry.code.co_filename
        folder = Path(file).parent.name if "/engines/" in file else ""
        for name in {"", folder}:
            calls[name] = calls.get(name, 0.0) + entry.callcount / len(ticks)
    return calls


def resets(count: int) -> dict[str, object]:
    """Return the megabytes held after the first 20 resets, each with a tick, and after all of them."""
    instance, city = CityBuilder(PluginHost()).place(instantiate(load_mission(MISSION), seed=3))
    world = InlineWorld(PluginHost())
    held = {}
    for number in range(1, count + 1):
        world.reset(instance, city)
        if number % 10 == 0:
            world.step(1, ())
        if number in (20, count // 4, count // 2, count):
            gc.collect()
            held[number] = memory_mb()
    world.close()
    return {"held": held}


def memory_mb() -> float:
    """Return the resident memory of this process in MB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    raise RuntimeError("the memory of a process cannot be read on this system")


def in_a_process(job: str, **arguments: object) -> dict:
    """Run a measurement in a process of its own."""
    command = [sys.executable, str(HERE / "world.py"), "--job", json.dumps([job, arguments])]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()[-1])


def factor(ticks: int) -> None:
    """Print the real-time factor and the share of each part."""
    runs = [in_a_process("measured", ticks=ticks, settings={}) for _ in range(3)]
    best = min(runs, key=lambda run: run["whole_s"])
    engines = sum(best["engines"].values())
    over = sorted(run["world_s"] / sum(run["engines"].values()) - 1.0 for run in runs)
    print("| everybody, without pictures | CPU s | real-time factor |")
    print("| --- | --- | --- |")
    print(f"| {best['simulated_s']:.0f} s of simulated time | {best['whole_s']:.2f} | "
          f"{best['simulated_s'] / best['whole_s']:.1f} |\n")  # fmt: skip
    print("| of it | CPU s | share |")
    print("| --- | --- | --- |")
    rows = {**best["engines"], "world host": best["world_s"] - engines, "kernel": best["whole_s"] - best["world_s"]}
    for name, spent in sorted(rows.items(), key=lambda row: -row[1]):
        print(f"| {name} | {spent:.2f} | {100 * spent / best['whole_s']:.1f} % |")
    print(f"\nworld host over the engines' own time: {', '.join(f'{100 * part:.1f} %' for part in over)}\n")


def growth(ticks: int) -> None:
    """Print the cost of a tick as one fleet grows and the others stay small, with the exponent of a power law."""
    for fleet, (name, engine, sizes) in GROWTH.items():
        print(f"| {fleet} | {engine}, CPU ms a tick | a head | its calls a tick | the world, CPU ms a tick | calls |")
        print("| --- | --- | --- | --- | --- | --- |")
        columns: tuple[list[float], ...] = ([], [], [], [])
        for size in sizes:
            few = max(3, ticks // 2 if size >= 300 else ticks)
            run = in_a_process("measured", ticks=few, settings={**SMALL, name: float(size)}, count=True)
            took, whole = 1e3 * run["engines"][engine] / few, 1e3 * run["whole_s"] / few
            calls, all_calls = run["calls"][engine], run["calls"][""]
            print(
                f"| {size} | {took:.1f} | {took / size:.2f} | {calls:.0f} | {whole:.1f} | {all_calls:.0f} |", flush=True
            )
            for column, value in zip(columns, (took, calls, whole, all_calls), strict=True):
                column.append(value)
        print("\n| exponent | of the engine's time | of its calls | of the world's time | of all calls |")
        print("| --- | --- | --- | --- | --- |")
        for part, since in (("all sizes", 0), ("upper half", -3)):
            slopes = (slope(sizes[since:], column[since:]) for column in columns)
            print(f"| {part} | {' | '.join(f'{slope:.2f}' for slope in slopes)} |")
        print()


def slope(sizes: tuple[int, ...], times: list[float]) -> float:
    """Return the exponent of a power law: least squares in logarithms."""
    x, y = [math.log(size) for size in sizes], [math.log(took) for took in times]
    return statistics.linear_regression(x, y).slope


def print_resets(count: int) -> None:
    """Print the memory that resets leave."""
    held = in_a_process("resets", count=count)["held"]
    print("| resets of everybody | MB held |")
    print("| --- | --- |")
    for number, held_mb in held.items():
        print(f"| {number} | {held_mb:.0f} |")
    print()


def movers(count: int) -> dict[str, object]:
    """Return the seconds for checking a boundary with this number of background movers, the least of ten runs."""
    crowd = tuple(
        BodyState(id=f"traffic/{n}", kind="car", position=(float(n), 0.0, 0.0), velocity=(1.0, 0.0, 0.0))
        for n in range(count)
    )
    report = Boundary(engine="road", time_s=0.5, ambient=crowd)
    entities, took = frozenset(("ant", "bee")), []
    for _ in range(10):
        started = time.process_time()
        checked_boundary("road", "advance", report, 0.5, (), entities)
        took.append(time.process_time() - started)
    return {"took_s": min(took)}


def print_movers(counts: tuple[int, ...]) -> None:
    """Print the cost of background movers for the world host, as a share of SUMO's time to move them."""
    print("| background movers | CPU ms to look over a boundary | of a car's 5 steps at 16 us |")
    print("| --- | --- | --- |")
    for count in counts:
        took = in_a_process("movers", count=count)["took_s"]
        print(f"| {count} | {1e3 * took:.2f} | {100 * took / (count * 5 * 16e-6):.1f} % |")
    print()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("factor", "growth", "resets", "movers"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--resets", type=int, default=500)
    parser.add_argument("--job", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.job:
        job, values = json.loads(arguments.job)
        print(json.dumps({"measured": measured, "resets": resets, "movers": movers}[job](**values)))
        return
    ticks = 6 if arguments.quick else 12
    tables = {
        "factor": lambda: factor(ticks),
        "growth": lambda: growth(ticks),
        "resets": lambda: print_resets(60 if arguments.quick else arguments.resets),
        "movers": lambda: print_movers((10, 100, 1000)),
    }
    for name, table in tables.items():
        if arguments.only in (None, name):
            table()


if __name__ == "__main__":
    main()
