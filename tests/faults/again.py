"""Plant faults in episodes and suites: `python -m tests.faults.again --cases 100 --seed 1`, or one case again.

Each case that leaves something wrong is printed with the line that plays it again. The exit code is 1 if there is any.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.faults.cases import Aftermath, Injection
from tests.faults.play import FaultPlayer, processor_s
from tests.faults.targets import SHARES, arguments, sample
from tests.faults.verdict import faults_of

MODEL_CALLS = 3
"""Answers of the service in the episode with a chat model: one for each tick."""


class Harness:
    """Plays cases, with a chat service beside them and a cache that knows what they build."""

    def __init__(self) -> None:
        self._service = subprocess.Popen(
            [sys.executable, "-m", "tests.faults.service"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._service.stdout is not None
        self._port = int(self._service.stdout.readline())
        self._player = FaultPlayer(spared=(self._service.pid,))
        self._cache = Path(tempfile.mkdtemp(prefix="lingjing-fault-cache-"))
        self._played = 0
        self.counts: dict[str, dict[str, int]] = {}
        self._digests: dict[str, str] = {}

    def prepare(self, target: str) -> None:
        """Play a target without a fault: fill the cache, count the calls, note the digest."""
        for _ in range(2):
            after, folder = self._play(Injection(target))
            faults = faults_of(Injection(target), after, folder, "")
            assert after.code == 0 and not faults, (target, after, faults)
            shutil.rmtree(self._cache)
            shutil.copytree(folder / "cache", self._cache)
            shutil.rmtree(folder)
        self.counts[target] = {**after.counts, "service": MODEL_CALLS if target == "chat" else 0}
        self._digests[target] = "" if target == "suite" else _digest(after)

    def judge(self, case: Injection) -> Aftermath:
        """Play a case and say what is wrong with it."""
        after, folder = self._play(case)
        after.faults = faults_of(case, after, folder, self._digests[case.target])
        shutil.rmtree(folder)
        return after

    def close(self) -> None:
        """End the service."""
        self._service.communicate()
        shutil.rmtree(self._cache)

    def _play(self, case: Injection) -> tuple[Aftermath, Path]:
        self._played += 1
        return self._player.play(case, arguments(case, self._port, f"case{self._played}"), self._cache)


def _digest(after: Aftermath) -> str:
    import json

    return str(json.loads(after.output)["digest"])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", nargs="*", metavar="TARGET KIND NUMBER ERROR", help="one case")
    parser.add_argument("--lasting", action="store_true", help="all later calls of the kind fail too")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    harness = Harness()
    try:
        if options.case:
            target, kind, number, error = options.case
            harness.prepare(target)
            cases = [Injection(target, kind, int(number), error, options.lasting)]
        else:
            for target in SHARES:
                harness.prepare(target)
            cases = list(sample(harness.counts, options.cases, options.seed))
        return report(harness, cases, verbose=bool(options.case))
    finally:
        harness.close()


def report(harness: Harness, cases: list[Injection], *, verbose: bool) -> int:
    """Play all cases, print those that are wrong, and a summary."""
    codes: Counter[int] = Counter()
    wrong, begun = 0, processor_s()
    for case in cases:
        after = harness.judge(case)
        codes[after.code] += 1
        if after.faults or verbose:
            wrong += bool(after.faults)
            print(f"{case.line}\n  exit code {after.code}; {'; '.join(after.faults) or 'nothing is wrong'}")
            print("".join(f"  | {line}\n" for line in after.errors.splitlines()[-12:]), flush=True)
    found = ", ".join(f"{code}: {number}" for code, number in sorted(codes.items()))
    print(f"{len(cases)} cases, {wrong} wrong; exit codes {found}; {processor_s() - begun:.0f} s of processor time")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
