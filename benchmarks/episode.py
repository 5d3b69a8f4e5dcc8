"""The real-time factor of the sea rescue, the same flight with and without pictures: simulated by real seconds."""

from __future__ import annotations

import tempfile
from pathlib import Path

import lingjing
from lingjing.trace.reader import read_trace

HERE = Path(__file__).resolve().parent
ROUNDS = 2


def factor(pictures: str) -> tuple[float, int]:
    """Return the real-time factor of one episode and the number of its stored pictures."""
    mission = lingjing.compile(HERE.parent / "scenarios" / "ssr.ljs")
    with tempfile.TemporaryDirectory() as folder:
        result = lingjing.run(
            mission,
            policy=f"{HERE / 'sweep.py'}:SweepPolicy",
            policy_args={"pictures": pictures},
            out=Path(folder) / "run",
            overview=False,
        )
        count = sum(len(boundary.frames) for boundary in read_trace(result.trace).boundaries)
    assert result.metrics.wall_s
    return result.metrics.sim_s / result.metrics.wall_s, count


def main() -> None:
    """Print the table."""
    print("| SSR episode | pictures | real-time factor |")
    print("| --- | --- | --- |")
    for pictures in ("yes", "no"):
        best, count = max(factor(pictures) for _ in range(ROUNDS))
        print(f"| {'with' if pictures == 'yes' else 'without'} pictures | {count} | {best:.1f} |")


if __name__ == "__main__":
    main()
