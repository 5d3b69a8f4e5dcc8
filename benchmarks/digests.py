"""Digests of played episodes: `digests.json` beside this file holds the stored ones, `--write` stores them again.

Twelve columns (the nine missions of the paper in their modes), seeds 1 to 3, the oracle and the heuristic. After a
change without intended effects, `python benchmarks/digests.py` names every episode that differs from the stored one;
`--columns ssr-star --seeds 1` plays fewer.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

from lingjing.bench.columns import Column, columns, shipped
from lingjing.trace.reader import read_trace

STORE = Path(__file__).with_name("digests.json")
ROOT = Path(__file__).parents[1]
NOT_THE_PAPERS = ("queue",)
POLICIES = ("oracle", "heuristic")
SEEDS = (1, 2, 3)

Told = dict[str, str | int]


def main() -> int:
    """Play the selected episodes and compare them with the stored digests, or store theirs; return 1 if any differs."""
    known = {column.name: column for column in columns(shipped()) if column.mission not in NOT_THE_PAPERS}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--columns", nargs="+", choices=sorted(known), default=sorted(known), metavar="COLUMN")
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS, metavar="SEED")
    parser.add_argument("--policies", nargs="+", choices=POLICIES, default=POLICIES)
    parser.add_argument("--write", action="store_true", help="store what was played")
    parser.add_argument("-j", "--jobs", type=int, default=2)
    args = parser.parse_args()
    stored: dict[str, Told] = json.loads(STORE.read_text()) if STORE.is_file() else {}
    wanted = list(product(args.columns, args.policies, args.seeds))
    differing = []
    with ThreadPoolExecutor(args.jobs) as pool:
        names = [f"{column} {policy} {seed}" for column, policy, seed in wanted]
        played = pool.map(lambda job: play(known[job[0]], job[1], job[2]), wanted)
        for done, (name, measured) in enumerate(zip(names, played, strict=True), 1):
            same = stored.get(name) == measured
            verdict = "as stored" if same else "not stored" if name not in stored else "DIFFERS"
            print(
                f"[{done}/{len(wanted)}] {name}: {measured['reason']}, {measured['ticks']} ticks, {verdict}", flush=True
            )
            if name in stored and not same:
                differing.append(name)
            if args.write:
                stored[name] = measured
                STORE.write_text(json.dumps(dict(sorted(stored.items())), indent=1) + "\n")
    print(f"{len(differing)} of {len(wanted)} differ from what was stored", *differing, sep="\n")
    return int(bool(differing) and not args.write)


def play(column: Column, policy: str, seed: int) -> Told:
    """Play an episode in a process of its own and return its result and its two digests."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        call = [sys.executable, "-m", "lingjing.cli.main", "run", str(column.path), "--mode", column.mode, "--seed"]
        done = subprocess.run([*call, str(seed), "--policy", policy, "-o", str(out), "--json"],
                              cwd=ROOT, capture_output=True, text=True, check=False)  # fmt: skip
        if done.returncode:
            raise SystemExit(f"{column.name} {policy} {seed}: exit {done.returncode}\n{done.stderr}")
        outcome = read_trace(out / "trace.mcap").outcome
    assert outcome is not None
    last = {"reason": outcome.reason, "ticks": outcome.ticks}
    return {**last, "digest": outcome.digest, "frames_digest": outcome.frames_digest}


if __name__ == "__main__":
    raise SystemExit(main())
