"""Write `docs/missions`: a page with pictures for every shipped mission, made from played episodes (`make missions`).

Each mission is played by the oracle and by the heuristic agents. The map shows an episode that was won, if possible by
searching agents; the frames are the best of both. A camera without frames in the episodes takes one afterwards, so that
each kind of camera is shown. If neither policy can play a mission, random agents do. Traces are kept in a folder; a
mission is played again only with `--again` or without a trace.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from lingjing.bench.columns import shipped
from lingjing.cli.missionpage import rows_of, write_page
from lingjing.dsl.loading.load import load_mission
from lingjing.errors import LingjingError
from lingjing.mission.model import Mission
from lingjing.play.episode import TRACE_NAME, run
from lingjing.trace.reader import read_trace

ROOT = Path(__file__).parents[1]
POLICIES = ("oracle", "heuristic")
"""Policies that play each mission."""
FALLBACK = "random"
"""Policy that plays a mission if the others cannot."""
LIMIT_BYTES = 4_000_000
"""Most bytes of all pages and pictures in the repository (chosen)."""


def main(argv: Sequence[str] | None = None) -> int:
    """Play missions without traces, and write the pages and the index. Return 1 if they are too large."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("missions", nargs="*", help="names of shipped missions (default: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--traces", type=Path, default=ROOT / "runs" / "missions", help="where the traces are kept")
    parser.add_argument("--results", type=Path, help="a suite's folder or .parquet file, for the tables of results")
    parser.add_argument("--again", action="store_true", help="play again what has been played")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "missions")
    args = parser.parse_args(argv)
    files = {path: load_mission(path) for path in shipped()}
    for path, mission in files.items():
        if not args.missions or mission.name in args.missions:
            traces = played(mission, args.seed, args.traces, again=args.again)
            for old in args.output.glob(f"{mission.name}-*.*"):  # frames of other episodes may have other names
                old.unlink()
            rows = rows_of(mission, path, args.results) if args.results else []
            print(write_page(mission, traces, rows, args.output), flush=True)
    (args.output / "README.md").write_text(index([*files.values()], args.output), encoding="utf-8")
    size = sum(path.stat().st_size for path in args.output.rglob("*") if path.is_file())
    print(f"{size / 1e6:.2f} MB in {args.output}")
    return int(size > LIMIT_BYTES)


def played(mission: Mission, seed: int, folder: Path, *, again: bool) -> list[Path]:
    """Return the traces of a mission; the first is for the map."""
    traces = [trace for policy in POLICIES if (trace := _trace(mission, policy, seed, folder, again=again)) is not None]
    answered = [trace for trace in traces if _answered(trace)]
    if not answered and (trace := _trace(mission, FALLBACK, seed, folder, again=again)) is not None:
        answered = [trace]
    return sorted(answered, key=_rank)


def _trace(mission: Mission, policy: str, seed: int, folder: Path, *, again: bool) -> Path | None:
    place = folder / f"{mission.name}-{policy}"
    path = place / TRACE_NAME
    if again and place.exists():
        shutil.rmtree(place)
    if not path.is_file():
        shutil.rmtree(place, ignore_errors=True)  # the remainder of an interrupted run
        try:
            result = run(mission, policy=policy, seed=seed, out=place)
        except LingjingError as error:
            print(f"{mission.name}: {policy} cannot play it: {error}", file=sys.stderr)
            return None
        print(f"{mission.name}: {policy}, {result.reason}, SCR {result.scr:.2f}, {result.ticks} ticks", flush=True)
    return path if path.is_file() else None


def _answered(path: Path) -> bool:
    """True if the policies made most decisions themselves, since an episode of substitutes shows nothing."""
    made = [decided for record in read_trace(path).boundaries for decided in record.decisions]
    return 2 * sum(bool(decided.substituted) for decided in made) <= len(made)


def _rank(path: Path) -> tuple[bool, bool, float]:
    """Sort key of traces: won episodes before lost ones, then searching agents before privileged ones, then by
    score."""
    trace = read_trace(path)
    privileged = any(binding.privileged for binding in trace.header.bindings)
    return (
        (True, privileged, 0.0)
        if trace.outcome is None
        else (not trace.outcome.success, privileged, -trace.outcome.scr)
    )


def index(missions: Sequence[Mission], folder: Path) -> str:
    """A page with links to the existing pages."""
    lines = ["# Missions\n", "| Mission | | Modes | Goal |", "| --- | --- | --- | --- |"]
    for mission in missions:
        if (folder / f"{mission.name}.md").is_file():
            goal = " ".join(mission.goal.split())
            modes = ", ".join(mission.modes.allowed)
            lines.append(f"| [{mission.title}]({mission.name}.md) | `{mission.name}` | {modes} | {goal} |")
    return "\n".join([*lines, "", "These pages are generated: `make missions`.", ""])


if __name__ == "__main__":
    sys.exit(main())
