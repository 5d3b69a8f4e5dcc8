"""A cold `lingjing validate` of a whole mission against a cold `import scenic`, side by side.

Every measurement is a new process; rounds alternate and the best of each side counts.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOREIGN_PYTHON = ROOT / ".venv-bench" / "bin" / "python"
MISSION = ROOT / "scenarios" / "ssr.ljs"
ROUNDS = 5


def seconds(command: list[str]) -> float:
    """Return the wall-clock seconds of one process, which must succeed."""
    started = time.perf_counter()
    subprocess.run(command, capture_output=True, check=True)
    return time.perf_counter() - started


def main() -> None:
    """Print the table."""
    validate = [str(Path(sys.executable).with_name("lingjing")), "validate", "--no-cache", str(MISSION)]
    scenic = [str(FOREIGN_PYTHON), "-c", "import scenic"]
    rounds = [(seconds(validate), seconds(scenic)) for _ in range(ROUNDS)]
    ours, theirs = (min(side) for side in zip(*rounds, strict=True))
    print("| cold lingjing validate, s | cold import scenic, s | scenic : lingjing |")
    print("| --- | --- | --- |")
    print(f"| {ours:.3f} | {theirs:.3f} | {theirs / ours:.1f} |")


if __name__ == "__main__":
    main()
