"""`lingjing run MISSION`: play one or several episodes to a score, a trace and a picture."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from lingjing.cli.arguments import MODES, all_of, parse_pairs, parse_seed, parse_seeds, parse_settings
from lingjing.cli.process import restore_terminal, results_alone
from lingjing.cli.progress import LiveProgress
from lingjing.cli.results import exit_code, explain, print_episode, print_json, print_seeds
from lingjing.dsl.loading.load import load_mission
from lingjing.dsl.loading.shipped import find_mission
from lingjing.errors import ExitCode, MissionError, UsageError
from lingjing.mission.model import Mission
from lingjing.play.descendants import be_told_of_the_end_of
from lingjing.play.folders import RUNS, claim_folder, claim_run_folder, release_if_empty
from lingjing.play.options import PlayOptions, checked_options, read_options
from lingjing.play.parallel import EpisodeTask, play_apart, play_here, without_result
from lingjing.play.report import EpisodeReport, summarise
from lingjing.play.supervision import SeedFolder, can_supervise, play_supervised


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options. What is not given is None or empty: `PlayOptions` has the defaults."""
    parser = subparsers.add_parser("run", help="play a mission to a score and a trace", description=__doc__)
    parser.add_argument(
        "mission", metavar="MISSION", nargs="?", help="a .ljs or resetScenario .json file, or a shipped name"
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--seed", metavar="N", help="the episode's seed (default 0)")
    which.add_argument("--seeds", metavar="A-B", help="several seeds, both ends included")
    parser.add_argument("--mode", choices=MODES, help="communication mode (default: the mission's)")
    parser.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="set a mission parameter")
    parser.add_argument("--policy", metavar="NAME|FILE.py:CLASS", help="who plays (default heuristic)")
    parser.add_argument(
        "--policy-for", metavar="ROLE_OR_AGENT=NAME", action="append", default=[], help="who plays this role or agent"
    )
    parser.add_argument("--policy-arg", metavar="K=V", action="append", default=[], help="an option of the policy")
    parser.add_argument(
        "--engine-arg", metavar="ENGINE.K=V", action="append", default=[], help="an option of an engine"
    )
    parser.add_argument(
        "--policy-seed", metavar="N", help="what the policies' own random streams start from (default 0)"
    )
    parser.add_argument(
        "--evaluator", metavar="NAME", action="append", help="who scores (default mission); of several the mean counts"
    )
    parser.add_argument(
        "--options",
        metavar="FILE",
        help="a JSON file with all of these; - reads standard input; what is given here counts",
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="a new or empty folder (default: a new one in runs/)")
    parser.add_argument("--world", choices=("process", "inline"), help="where the engines run (default process)")
    parser.add_argument("--blank-pictures", action="store_true", help="hand the policies black pictures (a control)")
    parser.add_argument("--no-overview", action="store_true", help="do not draw overview.png (it takes a few seconds)")
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N seeds at a time")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument("--watch", action="store_true", help="show the episode in the terminal while it is played")
    parser.add_argument(
        "--watch-truth", action="store_true", help="watch with hidden targets shown before anybody has found them"
    )
    parser.add_argument("--end-with", metavar="PID", type=int, help=argparse.SUPPRESS)  # set by play_apart


def handler(args: argparse.Namespace) -> int:
    """Play, print, and answer with the exit code."""
    if args.end_with is not None and not be_told_of_the_end_of(args.end_with, signal.SIGTERM):
        raise KeyboardInterrupt
    _, (options, mission), seeds = all_of(
        lambda: _check(args), lambda: _options(args), lambda: parse_seeds(args.seeds) if args.seeds else ()
    )
    if seeds:
        return _run_many(args, mission, options, seeds)
    return _run_one(args, mission, options)


def _check(args: argparse.Namespace) -> None:
    if args.jobs < 1:
        raise UsageError(f"-j {args.jobs}: at least one")
    if args.output == "":
        raise UsageError("-o names no folder", hint="give -o a name, or leave it out for a new folder in runs/")
    if args.jobs > 1 and _watched(args):
        raise UsageError("--watch shows one episode at a time", hint="leave -j out, or --watch")


def _options(args: argparse.Namespace) -> tuple[PlayOptions, Mission]:
    """The options of a file, if one is named, with those of the command line over them; and their mission."""
    given = _file_options(args.options) if args.options else {}
    named = args.mission or given.get("mission")
    if not named:
        raise UsageError("no mission is named", hint="name a .ljs file or a shipped mission: lingjing run ssr")
    path, policies_for, policy_args, engine_args, pairs, seed, policy_seed = all_of(
        lambda: find_mission(str(named)),
        lambda: parse_pairs("--policy-for", args.policy_for),
        lambda: parse_pairs("--policy-arg", args.policy_arg),
        lambda: parse_pairs("--engine-arg", args.engine_arg),
        lambda: parse_pairs("--set", args.set),
        lambda: parse_seed(args.seed) if args.seed is not None else None,
        lambda: parse_seed(args.policy_seed) if args.policy_seed is not None else None,
    )
    mission = load_mission(path)
    settings = parse_settings(pairs, mission)
    options = checked_options(given | {"mission": str(path)})
    over = {
        "policies_for": options.policies_for | policies_for,
        "policy_args": options.policy_args | policy_args,
        "engine_args": options.engine_args | engine_args,
        "settings": options.settings | settings,
        "blank_pictures": options.blank_pictures or args.blank_pictures,
        "overview": options.overview and not args.no_overview,
    }
    single = {"seed": seed, "policy_seed": policy_seed, "policy": args.policy, "mode": args.mode, "world": args.world}
    if args.evaluator:
        single["evaluators"] = tuple(args.evaluator)
    over |= {name: value for name, value in single.items() if value is not None}
    options = msgspec.structs.replace(options, **over)
    _check_settings(args.set, mission, options)
    return options, mission


def _file_options(file: str) -> dict[str, object]:
    try:
        return read_options(sys.stdin.buffer.read() if file == "-" else Path(file).read_bytes(), file)
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from error


def _check_settings(given: list[str], mission: Mission, options: PlayOptions) -> None:
    """A mission that is fine by itself and no longer once a value is set is a mistake of the command line."""
    if not given:
        return
    from lingjing.mission.instantiate import instantiate

    try:
        instantiate(mission, seed=options.seed, mode=options.mode, settings=options.settings)
    except MissionError as error:
        raise UsageError(f"--set {' --set '.join(given)}: {error}", hint=error.hint) from error


def _run_one(args: argparse.Namespace, mission: Mission, options: PlayOptions) -> int:
    given = claim_folder(Path(args.output)) if args.output else None
    try:
        with results_alone():
            (episode,) = _played(
                args, mission, options, (options.seed,), lambda seed: given or _claim(mission, options, seed)
            )
    finally:
        release_if_empty(given or RUNS)
    if args.json:
        print_json(episode)
    else:
        print_episode(episode)
    explain([episode])
    return exit_code([episode])


def _run_many(args: argparse.Namespace, mission: Mission, options: PlayOptions, seeds: tuple[int, ...]) -> int:
    root = claim_folder(Path(args.output)) if args.output else RUNS
    try:
        with results_alone():
            played = _played(args, mission, options, seeds, lambda seed: _claim(mission, options, seed, root))
            episodes, interrupted = _until_interrupted(played)
    finally:
        release_if_empty(root)
    if not episodes:
        raise KeyboardInterrupt
    report = summarise(episodes, seeds=args.seeds, folder=str(root))
    if args.json:
        print_json(report)
    else:
        print_seeds(report)
    explain(episodes)
    return ExitCode.INTERRUPTED if interrupted else exit_code(episodes)


def _until_interrupted(played: Iterator[EpisodeReport]) -> tuple[list[EpisodeReport], bool]:
    """All episodes by seed, or those that an interrupt left; and whether there was one."""
    episodes: list[EpisodeReport] = []
    interrupted = False
    try:
        episodes.extend(played)
    except KeyboardInterrupt:
        interrupted = True
    return sorted(episodes, key=lambda report: report.seed), interrupted


def _claim(mission: Mission, options: PlayOptions, seed: int, root: Path = RUNS) -> Path:
    return claim_run_folder(mission.name, options.mode or mission.modes.default, seed, root)


def _played(
    args: argparse.Namespace,
    mission: Mission,
    options: PlayOptions,
    seeds: Sequence[int],
    claim: Callable[[int], Path],
) -> Iterator[EpisodeReport]:
    """The episodes, each played in a process that a policy may ruin; in this one where it cannot be watched over."""
    if args.jobs > 1:
        tasks = (EpisodeTask(msgspec.structs.replace(options, seed=seed), claim(seed)) for seed in seeds)
        return (report for _, report in play_apart(tasks, args.jobs))

    def play(places: Iterator[SeedFolder]) -> Iterator[EpisodeReport]:
        if not _watched(args):
            return play_here(options, places, LiveProgress, mission)
        from lingjing.cli.watch import EpisodeDisplays

        displays = EpisodeDisplays(mission, options, truth=args.watch_truth)
        return play_here(options, displays.follow(places), displays, mission)

    if not can_supervise():
        return play((seed, claim(seed)) for seed in seeds)

    def abort(seed: int, folder: Path, why: str) -> EpisodeReport:
        restore_terminal()
        report = without_result(EpisodeTask(msgspec.structs.replace(options, seed=seed), folder), why)
        return msgspec.structs.replace(report, mission=mission.name, mode=options.mode or mission.modes.default)

    return play_supervised(seeds, claim, play, abort)


def _watched(args: argparse.Namespace) -> bool:
    return bool(args.watch or args.watch_truth)
