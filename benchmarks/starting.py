"""The cost of an episode's start: CPU seconds of all processes together, user and system.

For each column, with the oracle's kinds of engines and `stopping.py` as the policy, which ends the episode at once:

- *alone, cold*: the first episode after the caches were emptied, as a process of its own (`lingjing run`);
- *alone*: the same on a city seen before;
- *forked*: each further episode of a study (`play_apart`) on another seed, up to the first decision and to the second
  one with a picture between them; this one holds a tick of simulation and a picture, which are no part of starting;
- *seen before*: each further episode on the same seed, up to the first decision;
- *environment*: each further `reset` of an environment (`lingjing.envs`) on the same seed, with `--seen`.

The first episode and the first reset of a run, which fill caches and start servers, are not counted. `--oracle` also
plays oracles' episodes and prints the share of the start. `--many N` plays N episodes in one run and prints what they
leave: memory of the process from which they are forked, descriptors, processes.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lingjing.dsl.loading.shipped import find_mission
from lingjing.envs import parallel_env
from lingjing.play import parallel
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.processes.fork_client import ForkServer

ROOT = Path(__file__).parents[1]
POLICY = f"{Path(__file__).with_name('stopping.py')}:Stop"
COLUMNS = (
    "bi-single",
    "cd-broadcast",
    "cd-star",
    "cr-star",
    "idf-broadcast",
    "ld-star",
    "ssr-broadcast",
    "ssr-star",
    "ufr-broadcast",
    "ufr-star",
    "upr-star",
    "vdn-single",
)
FURTHER = 6
SETTLE_S = 0.3
"""The time in which the processes of a stopped episode end, seconds. Chosen."""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--columns", nargs="+", default=COLUMNS, metavar="COLUMN")
    parser.add_argument("--oracle", action="store_true", help="play oracles' episodes as well")
    parser.add_argument("--seen", action="store_true", help="measure nothing but `seen before` and `environment`")
    parser.add_argument("--many", type=int, metavar="N", help="play N episodes in one run, and nothing else")
    args = parser.parse_args()
    with caches():
        if args.many:
            many(args.columns[0], args.many)
            return
        if args.seen:
            print_row("column", "seen before", "environment")
            print_row(*["---"] * 3)
            for column in args.columns:
                print_row(column, f"{further(column, 'decision', same=True):.2f}", f"{further_resets(column):.2f}")
            return
        head = [
            "column",
            "alone, cold",
            "alone",
            "seen before",
            "forked, to a decision",
            "forked, to the next one with a picture",
        ]
        print_row(*head, *(["oracle's episode", "share of starting"] if args.oracle else []))
        print_row(*["---"] * (len(head) + 2 * args.oracle))
        for column in args.columns:
            cold, warm = alone(column), alone(column)
            seen = further(column, "decision", same=True)
            decision, picture = further(column, "decision"), further(column, "picture")
            played = [f"{(whole := further(column, '')):.2f}", f"{100 * decision / whole:.0f} %"] if args.oracle else []
            print_row(column, f"{cold:.2f}", f"{warm:.2f}", f"{seen:.2f}", f"{decision:.2f}", f"{picture:.2f}", *played)


def alone(column: str) -> float:
    """Return the CPU seconds of `lingjing run` that is stopped at its first decision."""
    mission, _, mode = column.rpartition("-")
    with tempfile.TemporaryDirectory() as folder:
        call = [sys.executable, "-m", "lingjing.cli.main", "run", mission, "--mode", mode, "--policy", POLICY]
        before = spent()
        subprocess.run([*call, "-o", f"{folder}/run", "--no-overview"], cwd=ROOT, capture_output=True, check=False)
        return spent() - before


def further(column: str, until: str, *, same: bool = False) -> float:
    """Return the CPU seconds of each episode after the first in one run, on the `same` seed or on others.

    Without `until` they are those of a whole episode of the oracle.
    """
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in play_apart(tasks(column, until, 1 + FURTHER, Path(folder), same=same), jobs=1):
            time.sleep(SETTLE_S)
            seconds.append(time.process_time() + spent_below(os.getpid()))
    return (seconds[-1] - seconds[0]) / FURTHER


def further_resets(column: str) -> float:
    """Return the CPU seconds of each reset of an environment after the first, on the same seed."""
    mission, _, mode = column.rpartition("-")
    environment = parallel_env(mission, mode=mode)
    seconds = []
    for _ in range(1 + FURTHER):
        environment.reset(seed=1)
        seconds.append(time.process_time() + spent_below(os.getpid()))
    environment.close()
    return (seconds[-1] - seconds[0]) / FURTHER


def tasks(column: str, until: str, count: int, folder: Path, *, same: bool = False) -> Iterator[EpisodeTask]:
    """Return the episodes: seed 1 each time, or different seeds from 1 on."""
    mission, _, mode = column.rpartition("-")
    policy = {"policy": POLICY, "policy_args": {"until": until}} if until else {"policy": "oracle"}
    for seed in range(1, 1 + count):
        played = 1 if same else seed
        options = PlayOptions(mission=str(find_mission(mission)), mode=mode, seed=played, overview=False, **policy)
        yield EpisodeTask(options, folder / str(seed), repeated=same)


def many(column: str, count: int) -> None:
    """Print the memory, descriptors and processes that more and more episodes of one run leave."""
    servers: list[ForkServer] = []

    class TimedStart(ForkServer):
        def __init__(self, imports: list[str]) -> None:
            super().__init__(imports)
            servers.append(self)

    parallel.ForkServer = TimedStart  # type: ignore[misc]
    print_row(
        "episodes", "memory of the server, MB", "its descriptors", "its processes", "ours: memory, MB", "descriptors"
    )
    print_row(*["---"] * 6)
    with tempfile.TemporaryDirectory() as folder:
        for done, _ in enumerate(play_apart(tasks(column, "picture", count, Path(folder)), jobs=2), 1):
            if done in {1, 2, 5, count} or done % 10 == 0:
                pid = servers[-1].pid
                forks = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
                own = os.getpid()
                print_row(done, memory_mb(pid), descriptors(pid), len(forks), memory_mb(own), descriptors(own))
    print(f"{len(servers)} server(s)")


def memory_mb(pid: int) -> int:
    status = Path(f"/proc/{pid}/status").read_text()
    return round(int(status.partition("VmRSS:")[2].split()[0]) / 1024)


def descriptors(pid: int) -> int:
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())


def spent_below(pid: int) -> float:
    """Return the CPU seconds of the descendants of a process, those included that they have waited for."""
    seconds = 0.0
    for thread in Path(f"/proc/{pid}/task").iterdir():
        for child in (thread / "children").read_text().split():
            with suppress(OSError):  # it has just ended
                seconds += used_by(child) + spent_below(int(child))
    return seconds


def used_by(pid: str) -> float:
    """Return the CPU seconds of a process and of its ended children."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def spent() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def caches() -> Iterator[None]:
    """Use separate caches that are empty at first."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        yield


def print_row(*cells: object) -> None:
    print("|", " | ".join(map(str, cells)), "|", flush=True)


if __name__ == "__main__":
    main()
