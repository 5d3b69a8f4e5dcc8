"""Mutate missions: what validates must begin. Counts the mutants that are refused at their start or first tick.

`python -m benchmarks.mutated_missions [--count 1000] [--seed 1] [--seeds 1] [--skip 0] [--real]` takes the shipped
missions and the examples, and changes one to three things in the text of each: a number, a place, a name (for another
one of the file), a count, a shape, or a statement that is left out. Mutants that the check of the text refuses are
counted and left. Each other one is drawn and placed in its city for each seed of `--seeds`, and plays one tick without
a decision; with `--real` its camera too, and otherwise a stand-in for that engine.

A refusal is classified: `text` if `validate` could have known it, `place` if only the built city shows it, which
`validate --deep` reports, `engine` if an engine refuses to begin, and `bug` for an exception that is no error of a
mission. The refused mutants are written to `--keep FOLDER`. An interrupt prints the table so far; `--skip N` continues
after the first N valid mutants, which are then made and not played.
"""

from __future__ import annotations

import argparse
import collections
import random
import re
import sys
import traceback
from collections.abc import Callable
from pathlib import Path

from lingjing.errors import LingjingError
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.testing import Stage, compile_text, episode, placed
from lingjing.testing.stand_ins import REPLACED

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ROOT / "scenarios"
NUMBER = re.compile(r"(?<![\w.\]])-?\d+(?:\.\d+)?(?= ?(?:m|s|deg|%|m/s|kg|tick|km|kB)\b|[,)\]}\s])")
COUNT = re.compile(r"\[1\.\.\w+\]")
NAME = re.compile(r"(?<![\w.])[a-z_]\w{2,}(?![\w(])")
ENGINES = ("city", *REPLACED)
"""The engines that play in any case."""
FACTORS = (0.0, 0.1, 0.5, 0.9, 1.1, 2.0, 10.0, -1.0)

Change = Callable[[str, random.Random], str]


def files() -> list[Path]:
    """Return the shipped missions and the examples."""
    return sorted((*SCENARIOS.glob("*.ljs"), *SCENARIOS.glob("examples/*.ljs")))


def _replaced(text: str, match: re.Match[str], written: str) -> str:
    return text[: match.start()] + written + text[match.end() :]


def other_number(text: str, rng: random.Random) -> str:
    """Multiply one number."""
    match = rng.choice(list(NUMBER.finditer(text)))
    value = float(match[0]) * rng.choice(FACTORS)
    return _replaced(text, match, f"{value:.10g}" if "." in match[0] or value != int(value) else str(int(value)))


def other_place(text: str, rng: random.Random) -> str:
    """Move one place by up to 300 m along an axis."""
    points = list(re.finditer(r"\((-?\d+(?:\.\d+)?) m, (-?\d+(?:\.\d+)?) m", text))
    if not points:
        return text
    match = rng.choice(points)
    axis = rng.choice((1, 2))
    value = float(match[axis]) + rng.uniform(-300.0, 300.0)
    return text[: match.start(axis)] + f"{value:.1f}" + text[match.end(axis) :]


def other_name(text: str, rng: random.Random) -> str:
    """Replace one name by another one of the file."""
    names = list(NAME.finditer(text))
    return _replaced(text, rng.choice(names), rng.choice(names)[0])


def other_count(text: str, rng: random.Random) -> str:
    """Declare another number of members."""
    groups = list(COUNT.finditer(text))
    return _replaced(text, rng.choice(groups), f"[1..{rng.choice((0, 1, 2, 5, 12))}]") if groups else text


def other_shape(text: str, rng: random.Random) -> str:
    """Replace a region's shape by a circle or a small box."""
    shapes = list(re.finditer(r"= (?:box|polygon|circle)\(.*\)$", text, re.MULTILINE))
    if not shapes:
        return text
    east, north, radius = rng.uniform(-500, 500), rng.uniform(-1500, 500), rng.choice((5, 50, 400))
    circle = f"= circle(({east:.0f} m, {north:.0f} m), {radius} m)"
    box = f"= box(({east:.0f} m, {north:.0f} m), ({east + radius:.0f} m, {north + radius:.0f} m))"
    return _replaced(text, rng.choice(shapes), rng.choice((circle, box)))


def left_out(text: str, rng: random.Random) -> str:
    """Remove one line that is a whole statement."""
    lines = text.split("\n")
    whole = [at for at, line in enumerate(lines) if line.strip() and line.count("{") == line.count("}")]
    del lines[rng.choice(whole)]
    return "\n".join(lines)


CHANGES: tuple[Change, ...] = (other_number, other_number, other_place, other_name, other_count, other_shape, left_out)


def mutant(text: str, rng: random.Random) -> str:
    """Change one to three things."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        text = rng.choice(CHANGES)(text, rng)
    return text


def refusal(mission: Mission, seed: int, *, real: bool) -> tuple[str, str]:
    """Return the class and the message of a refusal at the start or in the first tick; empty if it plays."""
    try:
        instantiate(mission, seed=seed)
    except LingjingError as error:
        return "text", str(error)
    try:
        world = placed(mission, seed=seed)
    except LingjingError as error:
        return "place", str(error)
    try:
        with episode(world, seed=seed, stage=None if real else Stage(), real=ENGINES) as play:
            play.wait(1)
    except LingjingError as error:
        return "engine", str(error)
    return "", ""


def study(count: int, seed: int, seeds: range, keep: Path | None, *, skip: int = 0, real: bool) -> bool:
    """Mutate, check and play; print the table. True if no mutant ends with a bug."""
    tally, messages = collections.Counter[str](), collections.Counter[str]()
    try:
        _study(count, random.Random(seed), seeds, keep, tally, messages, skip=skip, real=real)
    except KeyboardInterrupt:
        print("interrupted")
    print(", ".join(f"{name} {number}" for name, number in tally.most_common()))
    for words, number in messages.most_common():
        print(f"{number:4d} {words}")
    return not tally["bug"]


def _study(
    count: int,
    rng: random.Random,
    seeds: range,
    keep: Path | None,
    tally: collections.Counter[str],
    messages: collections.Counter[str],
    *,
    skip: int,
    real: bool,
) -> None:
    """Count the results in `tally`, and the messages of refused mutants in `messages`."""
    texts = {file: file.read_text(encoding="utf-8") for file in files()}
    valid = 0
    while valid < count:
        file = rng.choice(list(texts))
        text = mutant(texts[file], rng)
        if text == texts[file]:
            continue
        kind, message, mission = "", "", None
        try:
            compilation = compile_text(text, path=str(file))
            errors = any(item.severity == "error" for item in compilation.diagnostics)
            mission = None if errors else compilation.mission
        except Exception:  # noqa: BLE001 - every traceback is a finding of the study
            kind, message = "bug", traceback.format_exc().strip().splitlines()[-1]
        tally["mutants"] += 1
        if mission is None and not kind:
            tally["refused by validate"] += 1
            continue
        valid += 1
        if mission is not None and valid > skip:
            kind, message = _first(mission, seeds, real=real)
            tally["played"] += 1
        if kind:
            tally[kind] += 1
            messages[f"{kind}: {file.stem}: {message.splitlines()[0][:160]}"] += 1
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / f"{kind}-{valid}-{file.name}").write_text(text, encoding="utf-8")
        if valid % 100 == 0:
            print(f"{valid} valid: {dict(tally)}", file=sys.stderr, flush=True)


def _first(mission: Mission, seeds: range, *, real: bool) -> tuple[str, str]:
    """Return the first refusal among the seeds."""
    for seed in seeds:
        try:
            kind, message = refusal(mission, seed, real=real)
        except Exception:  # noqa: BLE001 - every traceback is a finding of the study
            return "bug", traceback.format_exc().strip().splitlines()[-1]
        if kind:
            return kind, f"seed {seed}: {message}"
    return "", ""


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000, help="valid mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=1, help="seeds 0 to N-1 of each mutant")
    parser.add_argument("--skip", type=int, default=0, help="valid mutants that are made and not played")
    parser.add_argument("--real", action="store_true", help="play with the camera, too")
    parser.add_argument("--keep", type=Path, help="folder for refused mutants")
    arguments = parser.parse_args()
    seeds, keep = range(arguments.seeds), arguments.keep
    clean = study(arguments.count, arguments.seed, seeds, keep, skip=arguments.skip, real=arguments.real)
    return 0 if clean else 1


if __name__ == "__main__":
    raise SystemExit(main())
