"""Plant faults in episodes and suites: `python -m tests.faults.again --cases 100 --seed 1`, or one case again.

Each case that leaves something wrong is printed with the line that plays it again. The exit code is 1 if there is any.
`TARGET wall - 0 leap` plays a target with the clock in 2200 from the start.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.faults.cases import Aftermath, Injection
from tests.faults.play import FaultPlayer, processor_s
from tests.faults.targets import SHARES, Counts, arguments, sample, shares
from tests.faults.verdict import Results, faults_of, results_of

AGAIN = 10
"""Every tenth case is played twice, to see that it meets the same call."""

PROGRESS = 100
"""After so many cases a line is printed."""

NOT_AGAIN = ("wall", "steady")
"""Kinds of calls that depend on the speed of the machine."""

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
        self._cache = Path(tempfile.mkdtemp(prefix="lingjing-fault-cache-"))
        os.environ["XDG_CACHE_HOME"] = str(self._cache)  # for what the player itself makes
        self._player = FaultPlayer(spared=(self._service.pid,))
        self._played = 0
        self._wanted: dict[str, Results] = {}

    def prepare(self, target: str) -> Counts:
        """Play a target without a fault: fill the cache, note the results, count the calls. A call counts that each of
        two runs makes."""
        counts = []
        for _ in range(3):
            after, folder = self._play(Injection(target))
            self._wanted.setdefault(target, results_of(after, folder))
            faults = faults_of(Injection(target), after, folder, self._wanted[target])
            assert after.code == 0 and not faults, (target, after, faults)
            shutil.rmtree(self._cache)
            shutil.copytree(folder / "cache", self._cache)
            shutil.rmtree(folder)
            counts.append(Counter(after.calls))
        made = {tuple(call.split(" ", 1)): number for call, number in (counts[1] & counts[2]).items()}
        return {**made, **({("service", "-"): MODEL_CALLS} if target == "chat" else {})}  # type: ignore[dict-item]

    def judge(self, case: Injection, kept: Path | None = None) -> Aftermath:
        """Play a case and say what is wrong with it. Its folder is removed, or takes the name `kept`."""
        after, folder = self._play(case)
        after.faults = faults_of(case, after, folder, self._wanted[case.target])
        after.calls = [line.replace(str(folder), "") for line in after.calls]
        if kept is None:
            shutil.rmtree(folder)
        else:
            shutil.move(folder, kept)
        return after

    def close(self) -> None:
        """End the service."""
        self._service.communicate()
        shutil.rmtree(self._cache)

    def _play(self, case: Injection) -> tuple[Aftermath, Path]:
        self._played += 1
        return self._player.play(case, arguments(case, self._port, f"case{self._played}"), self._cache)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", nargs="*", metavar="TARGET KIND PLACE NUMBER ERROR", help="one case")
    parser.add_argument("--lasting", action="store_true", help="all later calls of the kind at the place fail too")
    parser.add_argument("--keep", type=Path, help="where the folder of the one case is kept")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--targets", default=",".join(SHARES), help="of which the cases are")
    options = parser.parse_args()
    harness = Harness()
    try:
        if options.case:
            target, kind, place, number, error = options.case
            harness.prepare(target)
            return show(harness, Injection(target, kind, place, int(number), error, options.lasting), options.keep)
        cases: list[Injection] = []
        for target, share in shares(options.cases, options.targets.split(",")).items():
            cases += sample(target, harness.prepare(target), share, options.seed)
        return report(harness, cases)
    finally:
        harness.close()


def show(harness: Harness, case: Injection, kept: Path | None) -> int:
    """Play one case and print all of it."""
    after = harness.judge(case, kept)
    print(described(case, after))
    return int(bool(after.faults))


def report(harness: Harness, cases: list[Injection]) -> int:
    """Play all cases, every tenth of them twice, print those that are wrong, and a summary."""
    codes: Counter[int] = Counter()
    wrong, missed, begun = 0, 0, processor_s()
    for at, case in enumerate(cases):
        if at and at % PROGRESS == 0:
            print(f"{at} of {len(cases)} cases, {wrong} wrong", flush=True)
        after = harness.judge(case)
        if at % AGAIN == 0 and case.kind not in NOT_AGAIN:
            after.faults += differences(after, harness.judge(case))
        codes[after.code] += 1
        missed += not after.calls and case.kind != "service"
        if after.faults:
            wrong += 1
            print(described(case, after), flush=True)
    numbers = ", ".join(f"{code}: {number}" for code, number in sorted(codes.items()))
    spent = f"{processor_s() - begun:.0f} s of processor time"
    print(f"{len(cases)} cases, {wrong} wrong, {missed} not met; exit codes {numbers}; {spent}")
    return int(wrong > 0)


def described(case: Injection, after: Aftermath) -> str:
    """A case in a few lines: how it is played again, how it ended, the call that failed, the last words."""
    lines = [case.line, f"  exit code {after.code}; {'; '.join(after.faults) or 'nothing is wrong'}"]
    lines += [f"  met: {call}" for call in after.calls[:1]]
    return "\n".join([*lines, *(f"  | {line}" for line in after.errors.splitlines()[-12:])])


def differences(first: Aftermath, second: Aftermath) -> list[str]:
    """The differences between two runs of one case: the failed call (without process numbers) and the end."""
    met, again = ([re.sub(r"\d+", "#", call) for call in after.calls[:1]] for after in (first, second))
    if met != again:
        return [f"played again it meets {second.calls[:1] or 'no call'}"]
    if first.code != second.code:
        return [f"played again it ends with exit code {second.code}"]
    return []


if __name__ == "__main__":
    sys.exit(main())
