"""`lingjing bench plant`, and `lingjing bench SUITE` for a suite that measures attribution methods."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import parse_pairs, parse_seeds, parse_settings
from lingjing.cli.files import write_whole
from lingjing.cli.parser import ArgumentParser
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from lingjing.bench.columns import Column


def add_plant(plant: ArgumentParser) -> None:
    """Declare the options of `plant`."""
    plant.add_argument("-o", "--output", metavar="OUT.jsonl", type=Path, required=True, help="the file of episodes")
    plant.add_argument(
        "--columns", metavar="NAME", nargs="+", help="missions in modes, such as ssr-star (default: all)"
    )
    plant.add_argument("--set", metavar="PARAM=VALUE", action="append", default=[], help="a parameter of the missions")
    plant.add_argument("--policies", nargs="+", choices=("oracle", "heuristic"), default=["oracle", "heuristic"])
    plant.add_argument("--seeds", metavar="A-B", default="1-6", help="seeds in which faults are tried (default 1-6)")
    plant.add_argument("--most", metavar="N", type=int, default=3, help="episodes with one fault per seed (default 3)")
    plant.add_argument("--tries", metavar="N", type=int, default=6, help="faults tried per seed (default 6)")
    plant.add_argument(
        "--plays", metavar="N", type=int, help="the greatest number of episodes to play; tried ones are kept"
    )
    plant.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N episodes at a time (default 1)")
    plant.set_defaults(handler=plant_faults)


def plant_faults(args: argparse.Namespace) -> int:
    """Play episodes with planted faults and write those that the fault loses, and decoys, to a file. Tried episodes
    are kept beside it, and the same command continues from them.
    """
    from lingjing.bench.columns import columns, shipped
    from lingjing.bench.executors import LocalExecutor
    from lingjing.bench.planted import encode_planted
    from lingjing.bench.planting import Planting, PlantingPlan

    if min(args.most, args.tries, args.jobs) < 1 or (args.plays is not None and args.plays < 0):
        raise UsageError("--most, --tries and -j must be 1 or more, --plays 0 or more")
    known = {column.name: column for column in columns(shipped())}
    unknown = [name for name in args.columns or () if name not in known]
    if unknown:
        raise UsageError(f"--columns {unknown[0]}: no such column", hint=f"there are {', '.join(known)}")
    chosen = [_set(known[name], parse_pairs("--set", args.set)) for name in args.columns or known]
    episodes = []
    for policy in args.policies:
        plan = PlantingPlan(policy, parse_seeds(args.seeds), args.most, args.tries, plays=args.plays)
        folder = args.output.with_name(f"{args.output.name}.tried") / policy
        episodes += Planting(plan, folder, LocalExecutor(args.jobs), say).run(chosen)
        write_whole(str(args.output), encode_planted(episodes).decode())
    with_fault = sum(episode.kind == "one" for episode in episodes)
    print(f"{args.output}: {with_fault} episodes with one fault that loses them, {len(episodes) - with_fault} decoys")
    return ExitCode.OK


def _set(column: Column, pairs: Mapping[str, str]) -> Column:
    """Return the column with these settings. Raises `UsageError` for a setting that its mission does not allow."""
    from lingjing.dsl.loading.load import load_mission
    from lingjing.mission.instantiate import parameters

    mission = load_mission(column.path)
    settings = parse_settings(pairs, mission)
    parameters(mission, column.mode, settings)
    return replace(column, settings=settings)


def measure(path: Path, args: argparse.Namespace) -> int:
    """Play a suite's episodes with planted faults, run its attribution methods on them and print tables."""
    from lingjing.bench.attribution import AttributionRun, attribution_tables, find_method, read_attribution_suite
    from lingjing.bench.executors import LocalExecutor
    from lingjing.bench.exports import EXPORTS
    from lingjing.play.folders import RUNS

    suite, episodes = read_attribution_suite(path)
    chosen = [episode for episode in episodes if episode.mission in (args.missions or (episode.mission,))]
    chosen = [episode for episode in chosen if episode.mode in (args.modes or (episode.mode,))][: args.limit]
    if not chosen:
        known = dict.fromkeys(f"{episode.mission} {episode.mode}" for episode in episodes)
        raise UsageError(
            f"{path}: no episode of the suite matches --missions and --modes",
            hint=f"it has episodes of {', '.join(known)}",
        )
    names: Sequence[str] = args.method or suite.methods
    methods = {name: find_method(name) for name in names}
    if args.check:
        say(f"{path}: {len(chosen)} episodes with planted faults, methods: {', '.join(names)}")
        return ExitCode.OK
    run = AttributionRun(args.output or RUNS / "bench" / suite.name, methods, LocalExecutor(args.jobs), say)
    tables = attribution_tables(run.run(chosen), suite.title or suite.name)
    sys.stdout.write("\n".join(map(EXPORTS["markdown"], tables)))
    return ExitCode.OK
