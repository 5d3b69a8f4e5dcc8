"""Every benchmark in one run, each in a process of its own: `make bench`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCRIPTS = (
    "kernel.py",
    "render.py",
    "city.py",
    "world.py",
    "validate.py",
    "language.py",
    "episode.py",
    "missions.py",
    "harness.py",
    "memory.py",
    "starting.py",
    "policies.py",
    "remote_engines.py",
)


def main() -> int:
    """Run the benchmarks in order. Return the exit code of the first that fails, after all have run."""
    codes = []
    for script in SCRIPTS:
        print(f"\n## {script.removesuffix('.py')}\n", flush=True)
        codes.append(subprocess.run([sys.executable, str(HERE / script)], check=False).returncode)
    return next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
