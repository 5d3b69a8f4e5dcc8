"""What branches of traces cost in CPU seconds: running the episode again, forks, branches, the camera that all share.

`python benchmarks/branches.py [--branches 40] [--policy FILE.py:CLASS] TRACE...`: branches leave from boundaries spread
over the episode; in each an agent does nothing once, so that bodies stand elsewhere and pictures have to be drawn.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import lingjing
from lingjing.causal.branch_host import BranchHost
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.redriven import BranchOptions
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import Decision

TICKS_A_SECOND = os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print two lines for each trace."""
    lingjing.pin()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("traces", nargs="+", metavar="TRACE")
    parser.add_argument("--branches", type=int, default=40)
    parser.add_argument("--policy", action="append", default=[])
    args = parser.parse_args()
    for path in args.traces:
        _measure(read_trace(path), args.branches, tuple(args.policy))


def _measure(trace: Trace, count: int, files: tuple[str, ...]) -> None:
    options = BranchOptions(trace=str(trace.path), files=files, referenced=())
    with BranchHost(trace, options) as host:
        host.departures()
        results = host.play(list(_plans(trace, count)))
        held = _group_cpu_s(host.group)
    forks = [1000.0 * one.fork_s for one in results]
    ticks = sum(one.ticks for one in results)
    drawn = sum(one.drawn for one in results)
    total = held + host.cpu_s
    print(f"{trace.path}: {len(trace.boundaries) - 1} ticks; {count} branches to tick {ticks / count:.0f} on average")
    print(
        f"  {total:.1f} s CPU in all, {total / 2:.1f} s on two cores: {host.driven_s:.1f} to run it again, "
        f"{host.cpu_s:.1f} for branches ({host.cpu_s / count:.2f} each), {held - host.driven_s:.1f} for the camera "
        f"({drawn} pictures) and boundaries held; a fork {sum(forks) / count:.1f} ms, at most {max(forks):.1f}"
    )


def _plans(trace: Trace, count: int) -> list[BranchPlan]:
    """Branches that leave one boundary after another, where an agent gave a command that it then does not give."""
    given = [
        (record.tick - 1, made.agent)
        for record in trace.boundaries[1:]
        for made in record.decisions
        if made.decision.command is not None
    ]
    chosen = [given[number * len(given) // count] for number in range(count)]
    return [BranchPlan(at=tick, replacements=((agent, tick, Decision()),)) for tick, agent in chosen]


def _group_cpu_s(group: int) -> float:
    """CPU seconds of the living processes of a process group."""
    total = 0
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
            except OSError:
                continue
            total += (int(fields[11]) + int(fields[12])) * (int(fields[2]) == group)
    return total / TICKS_A_SECOND


if __name__ == "__main__":
    main()
