"""The language: how fast, how linear, how small, and how much of what is wrong it finds; beside Scenic where both can.

Every compilation is a process of its own, measured in processor time (user and system) with its imports; the cache of
compiled missions is off unless a row says otherwise. The equal scene is one region and N objects with a place and a
heading each, nothing drawn; Scenic's rule that objects must not meet is switched off. Medians of ROUNDS, sides in turn.
`--quick` leaves out 100,000 assets and makes the corpora small.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOREIGN_PYTHON = ROOT / ".venv-bench" / "bin" / "python"
LINGJING = str(Path(sys.executable).with_name("lingjing"))
SSR = ROOT / "scenarios" / "ssr.ljs"
ROUNDS = 5
HELD_OUT = 1001
FRAME = """\
ljs 1
use std.air { quadrotor }
mission many "Many" {
  goal "Be there."
  scene bay { datum = sea level at 0 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  region field = polygon((0 m, 0 m), (10 km, 0 m), (10 km, 10 km), (0 m, 10 km))
"""
END = """\
  agent pilot as pilot controls a0 { observes a0.* }
  success when a0 in field
}
"""


def mission(assets: int, *, rich: bool) -> str:
    """Return a mission with this number of explicit assets; `rich` ones also have a band and verbs."""
    more = "\n    band = 20 m..120 m\n    actions { takeoff, forward <= 50 m, up <= 20 m, stop }\n  " if rich else ""
    lines = [
        f"  asset a{k} : quadrotor {{ position = ({x:.1f} m, {y:.1f} m, 10 m), heading = {k % 360} deg{more} }}\n"
        for k, x, y in places(assets)
    ]
    return FRAME + "".join(lines) + END


def scene(objects: int) -> str:
    """Return the same scene in Scenic."""
    lines = [
        f"new Object at ({x:.1f}, {y:.1f}, 10), facing {k % 360} deg, with allowCollisions True\n"
        for k, x, y in places(objects)
    ]
    return "workspace = Workspace(RectangularRegion((5000, 5000), 0, 10000, 10000))\nego = " + "".join(lines)


def places(number: int) -> list[tuple[int, float, float]]:
    """Yield number, east and north of places at most 100 m apart."""
    side = math.ceil(math.sqrt(number))
    return [(k, 50 + (k % side) * 9900 / side, 50 + k // side * 9900 / side) for k in range(number)]


def cost(command: list[str], environment: dict[str, str] | None = None) -> tuple[float, float]:
    """Return processor seconds and peak memory in MB of one process, which must succeed."""
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, env=environment or dict(os.environ))
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            output.seek(0)
            raise SystemExit(f"{' '.join(command)}\n{output.read().decode()[-2000:]}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def validate(path: Path) -> list[str]:
    return [LINGJING, "validate", "--no-cache", str(path)]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cold(folder)
        shipped()
        kinds(folder)
        scaling(folder, (1_000, 10_000) if quick else (1_000, 10_000, 100_000))
        beside_scenic(folder)
    corpora(30 if quick else 300)


def cold(folder: Path) -> None:
    """Measure a cold start on the shipped mission, with and without the cache."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}
    cached = [LINGJING, "validate", str(SSR)]
    cost(cached, environment)  # fills the cache
    rounds = [(cost(validate(SSR), environment)[0], cost(cached, environment)[0]) for _ in range(2 * ROUNDS)]
    anew, known = (statistics.median(side) for side in zip(*rounds, strict=True))
    print("| cold validate of ssr.ljs, CPU s | the same, known to the cache, CPU s |")
    print("| --- | --- |")
    print(f"| {anew:.3f} | {known:.3f} |\n")


def shipped() -> None:
    """Measure a cold start without the cache on each shipped mission and example."""
    print("| mission | cold validate, CPU s |")
    print("| --- | --- |")
    for path in sorted((*SSR.parent.glob("*.ljs"), *SSR.parent.glob("examples/*.ljs"))):
        print(f"| {path.stem} | {statistics.median(cost(validate(path))[0] for _ in range(ROUNDS)):.3f} |")
    print()


LINES = {
    "assets": "  asset b{k} : quadrotor {{ position = ({x:.1f} m, {y:.1f} m, 10 m), heading = {h} deg }}\n",
    "targets": "  target t{k} : person_in_water {{ position = ({x:.1f} m, {y:.1f} m), deadline = {h} s }}\n",
    "events": "  event e{k} at {h} s {{ weather {{ cloud = 50 % }} }}\n",
    "stages": "  stage s{k} {{ done when a0.position.east > {x:.1f} m, weight = 2 }}\n",
}
"""One declaration of each kind; `k` is its number, `x` and `y` its place, `h` a number from 1 to 359."""


def kinds(folder: Path) -> None:
    """Compare the time for 1,000 and 10,000 declarations of each kind, and fit a power law above the start."""
    head = FRAME.replace("use std.air { quadrotor }", "use std.air { quadrotor }\nuse std.sea { person_in_water }")
    first = "  asset a0 : quadrotor { position = (1 m, 1 m, 10 m) }\n"
    bare = folder / "bare.ljs"
    bare.write_text(head + first + END)
    start = statistics.median(cost(validate(bare))[0] for _ in range(3))
    print("| declarations | 1,000, CPU s | 10,000, CPU s | exponent above the start |")
    print("| --- | --- | --- | --- |")
    for kind, line in LINES.items():
        seconds = []
        for size in (1_000, 10_000):
            lines = [line.format(k=k, x=x, y=y, h=1 + k % 359) for k, x, y in places(size)]
            path = folder / f"{kind}{size}.ljs"
            path.write_text(head + first + "".join(lines) + END)
            seconds.append(statistics.median(cost(validate(path))[0] for _ in range(3)))
        exponent = slope((1_000, 10_000), [max(1e-3, took - start) for took in seconds])
        print(f"| {kind} | {seconds[0]:.2f} | {seconds[1]:.2f} | {exponent:.2f} |")
    print()


def scaling(folder: Path, sizes: tuple[int, ...]) -> None:
    """Compare explicit assets with time and memory, and fit a power law to the part above the start."""
    bare = folder / "bare.ljs"
    bare.write_text(mission(1, rich=True))
    start = statistics.median(cost(validate(bare))[0] for _ in range(3))
    print("| assets | MB of text | CPU s | peak MB |")
    print("| --- | --- | --- | --- |")
    seconds = []
    for size in sizes:
        path = folder / f"many{size}.ljs"
        path.write_text(mission(size, rich=True))
        rounds = [cost(validate(path)) for _ in range(ROUNDS if size <= 1_000 else 3 if size <= 10_000 else 1)]
        seconds.append(statistics.median(took for took, _ in rounds))
        print(f"| {size:,} | {path.stat().st_size / 1e6:.1f} | {seconds[-1]:.2f} | {max(mb for _, mb in rounds):.0f} |")
    whole, above = (slope(sizes, times) for times in (seconds, [took - start for took in seconds]))
    print(f"\nexponent: {whole:.2f} with the start, {above:.2f} without it\n")


def slope(sizes: tuple[int, ...], times: list[float]) -> float:
    """Return the exponent of a power law: least squares in logarithms."""
    x, y = [math.log(size) for size in sizes], [math.log(took) for took in times]
    return statistics.linear_regression(x, y).slope


def beside_scenic(folder: Path) -> None:
    """Compare with Scenic: 1,000 objects with a place and a heading each, and one error to report."""
    ours, theirs = folder / "equal.ljs", folder / "equal.scenic"
    ours.write_text(mission(1_000, rich=False))
    theirs.write_text(scene(1_000))
    compile_it = [str(FOREIGN_PYTHON), "-c", "import scenic, sys; scenic.scenarioFromFile(sys.argv[1])", str(theirs)]
    bad, worse = folder / "bad.ljs", folder / "bad.scenic"
    bad.write_text(mission(1, rich=False).replace("deg }", "dge }"))
    worse.write_text(scene(1).replace("deg,", "dge,"))
    script = "import scenic, sys\ntry: scenic.scenarioFromFile(sys.argv[1])\nexcept Exception: pass"
    fail = [str(FOREIGN_PYTHON), "-c", script, str(worse)]
    ours_fails = ["sh", "-c", f'"{LINGJING}" validate --no-cache "{bad}" || true']
    rounds = [tuple(cost(command)[0] for command in (validate(ours), compile_it, ours_fails, fail)) for _ in range(3)]
    ok, scenic_ok, error, scenic_error = (statistics.median(side) for side in zip(*rounds, strict=True))
    print("| | lingjing, CPU s | Scenic, CPU s | Scenic : lingjing |")
    print("| --- | --- | --- | --- |")
    print(f"| 1,000 objects | {ok:.2f} | {scenic_ok:.2f} | {scenic_ok / ok:.0f} |")
    print(f"| one error | {error:.2f} | {scenic_error:.2f} | {scenic_error / error:.0f} |\n")


def corpora(files: int) -> None:
    """Count faults found and spurious errors, on a seed that recovery was not tuned on."""
    script = str(ROOT / "tests" / "dsl" / "corpus.py")
    for faults, kinds in ((1, ()), (3, ()), (10, ()), (1, ("--kinds", "brace"))):
        number = str(max(20, files // faults))
        command = [sys.executable, script, "--seed", str(HELD_OUT), "--files", number, "--faults", str(faults), *kinds]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        print(f"{faults} fault{'s' * (faults > 1)} a file{', braces' * bool(kinds)}: {done.stdout}")


if __name__ == "__main__":
    main()
