"""Runs of the harness in a process of its own, for tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def planted(*arguments: str, shown: bool = False) -> subprocess.CompletedProcess[str]:
    """A run of the harness; what it prints names each wrong case with the line that plays it again. With `shown` it
    prints to the terminal while it runs."""
    line = [sys.executable, "-m", "tests.faults.again", *arguments]
    return subprocess.run(line, cwd=ROOT, capture_output=not shown, text=True, check=False)


def assert_all_end_well(cases: int, *targets: str) -> None:
    """Play so many cases of the targets: none may be wrong, and hardly one may miss the call that is to fail."""
    done = planted("--cases", str(cases), "--seed", "0", "--targets", ",".join(targets))
    assert done.returncode == 0, done.stdout + done.stderr
    summary = done.stdout.splitlines()[-1]
    assert summary.startswith(f"{cases} cases, 0 wrong, "), summary
    assert int(summary.split()[4]) <= cases // 10, summary
