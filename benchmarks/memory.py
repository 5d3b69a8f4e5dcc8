"""Memory over many episodes of model agents in one session, which should stay constant.

It prints the resident memory of this process and of its workers (`/proc/PID/smaps_rollup`: private and shared in
proportion) after numbers of short episodes, recorded calls and pictures included. Usage: memory.py [EPISODES] (default
200).
"""

from __future__ import annotations

import gc
import os
import re
import sys
import tempfile
from pathlib import Path

import harness

from lingjing.dsl.loading.load import load_mission
from lingjing.play.episode import Session

SHORT = """\
ljs 1
use std.air { quadrotor }
use std.sensors { nadir_hd }

mission glance "Two look down" {
  goal "Look."
  scene bay
  clock { tick = 2 s, sync = 500 ms }
  budget { ticks <= 4, policy <= 60 s, engine <= 60 s, capture <= 60 s }
  mode broadcast
  asset uav[1..2] : quadrotor {
    position = at(i, [(100 m, -700 m), (140 m, -700 m)], spread 8 m), band = 20 m..60 m
    camera nadir : nadir_hd { size = 640 by 360 }
    actions { takeoff, takePhoto }
  }
  agent scout[i in 1..2] as scout controls uav[i] { observes uav[i].*, events }
  success when distance_xy(uav[1], uav[2]) <= 0 m
}
"""


def descendants(pid: int) -> list[int]:
    """Return the process and all its descendants."""
    lists = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    return [pid, *(descendant for child in " ".join(lists).split() for descendant in descendants(int(child)))]


def resident_mb() -> tuple[float, float]:
    """Return the resident megabytes of this process, and of its workers."""
    gc.collect()
    own, *workers = (_pss_mb(pid) for pid in descendants(os.getpid()))
    return own, sum(workers)


def _pss_mb(pid: int) -> float:
    match = re.search(r"^Pss:\s+(\d+) kB", Path(f"/proc/{pid}/smaps_rollup").read_text(), re.MULTILINE)
    assert match
    return int(match[1]) / 1024


def main() -> None:
    """Print a line after each tenth of the episodes."""
    episodes = int(sys.argv[1]) if sys.argv[1:] else 200
    print("| episodes | this process, MB | its workers, MB |")
    print("| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name, Session() as session:
        folder = Path(name)
        (folder / "glance.ljs").write_text(SHORT)
        mission = load_mission(folder / "glance.ljs")
        for number in range(1, episodes + 1):
            harness.turns.clear()
            report = session.run(
                mission,
                policy=harness.Looking,
                policy_args={"model": "m", "base_url": "http://localhost:1/v1"},
                seed=number,
                overview=False,
                out=folder / str(number),
            )
            assert report.metrics is not None
            assert report.metrics.calls == 8
            if number % max(1, episodes // 10) == 0:
                own, workers = resident_mb()
                print(f"| {number} | {own:.1f} | {workers:.1f} |", flush=True)


if __name__ == "__main__":
    main()
