"""The cost of an episode of every shipped mission in every mode, by part: rendering, physics, kernel, policy.

Every episode is a process of its own with all engines in it, and everything is processor time of that process (all its
threads, the software renderer's too), so that a busy machine does not count; the wall time is this machine's at this
moment. The real-time factor is simulated time by processor time on one core. `physics` are the motion engines,
`kernel` the boundaries without engines and pictures (with the world host and the writing of the trace), `start` the
compiling, the city and the resets. `--policy` (default oracle and heuristic), `--only COLUMN`, `--seed`.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import lingjing
import lingjing.kernel.world.guarded_calls as calling
from lingjing.bench.columns import columns, shipped
from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.step import Kernel
from lingjing.kernel.world.engine_group import EngineGroup
from lingjing.kernel.world.inline import InlineWorld

HERE = Path(__file__).resolve().parent
PARTS = ("rendering", "physics", "kernel", "policy", "start")


class PartClock:
    """Processor time by part of the work. A part that calls another does not count the other's time."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self._stack: list[float] = []

    def over(self, owner: type, method: str, part: str) -> None:
        """Count a method of a class towards a part."""
        inner: Callable[..., Any] = getattr(owner, method)

        @wraps(inner)
        def counted(*arguments: Any, **named: Any) -> Any:
            started = time.process_time()
            self._stack.append(0.0)
            try:
                return inner(*arguments, **named)
            finally:
                whole = time.process_time() - started
                self.spent[part] = self.spent.get(part, 0.0) + whole - self._stack.pop()
                if self._stack:
                    self._stack[-1] += whole

        setattr(owner, method, counted)


def play(path: str, mode: str, policy: str, seed: int) -> dict[str, Any]:
    """Play one episode in this process."""
    clock = PartClock()
    clock.over(EngineGroup, "advance", "physics")
    clock.over(InlineWorld, "capture", "rendering")
    clock.over(InlineWorld, "reset", "start")
    clock.over(Kernel, "step", "kernel")
    clock.over(PolicyBarrier, "act", "policy")
    calling.time = types.SimpleNamespace(perf_counter=time.process_time)
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        result = lingjing.run(
            lingjing.compile(path), policy=policy, seed=seed, mode=mode, world="inline", out=folder, overview=False
        )
    whole = time.process_time() - began
    clock.spent["start"] = whole - sum(clock.spent.get(part, 0.0) for part in PARTS if part != "start")
    return {
        "success": result.success, "reason": result.reason, "detail": result.detail, "ticks": result.ticks,
        "sim_s": result.metrics.sim_s, "wall_s": result.metrics.wall_s, "cpu_s": whole, "spent": clock.spent,
    }  # fmt: skip


def main() -> int:
    """Print a table for each policy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--policy", action="append")
    parser.add_argument("--only", help="names of columns that contain this")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--play", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.play:
        print(json.dumps(play(*json.loads(arguments.play))))
        return 0
    return max(
        table(policy, arguments.only or "", arguments.seed) for policy in arguments.policy or ("oracle", "heuristic")
    )


def table(policy: str, only: str, seed: int) -> int:
    """Print one row for each mission in each of its modes; return 1 if any could not be played."""
    print(f"| {policy} | ticks | ended | simulated, s | CPU, s | real-time factor | wall, s | "
          + " | ".join(PARTS) + " |")  # fmt: skip
    print("| --- " * (7 + len(PARTS)) + "|")
    total, failed = 0.0, 0
    for column in columns(shipped()):
        if only not in column.name:
            continue
        command = json.dumps([str(column.path), column.mode, policy, seed])
        job = [sys.executable, str(HERE / "missions.py"), "--play", command]
        run = subprocess.run(job, capture_output=True, text=True, check=False)
        if run.returncode:
            print(f"| {column.name} | failed: {run.stderr.strip().splitlines()[-1]} |", flush=True)
            failed = 1
            continue
        it = json.loads(run.stdout.splitlines()[-1])
        if it["detail"]:
            print(f"{column.name}: {it['detail']}", file=sys.stderr, flush=True)
        total += it["cpu_s"]
        shares = " | ".join(f"{100 * it['spent'].get(part, 0.0) / it['cpu_s']:.0f} %" for part in PARTS)
        print(f"| {column.name} | {it['ticks']} | {it['reason']} | {it['sim_s']:.0f} | {it['cpu_s']:.1f} | "
              f"{it['sim_s'] / it['cpu_s']:.1f} | {it['wall_s']:.0f} | {shares} |", flush=True)  # fmt: skip
    print(f"\nCPU of all: {total:.0f} s; a hundred seeds on two cores: {total * 100 / 2 / 3600:.1f} h\n")
    return failed


if __name__ == "__main__":
    sys.exit(main())
