"""`lingjing run MISSION`: play one or several episodes to a score, a trace and a picture."""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import NoReturn

import msgspec

from lingjing.cli.arguments import (
    parse_amount,
    parse_pairs,
    parse_seed,
    parse_seeds,
    parse_settings,
    parse_tier,
    whole_number,
)
from lingjing.cli.installed import warn_of_broken_plugins
from lingjing.cli.process import ending_at_second_interrupt, results_alone, say
from lingjing.cli.progress import LiveProgress
from lingjing.cli.results import exit_code, explain, print_episode, print_error_json, print_json, print_seeds
from lingjing.dsl.loading.load import load_with_notes
from lingjing.dsl.loading.shipped import find_mission
from lingjing.errors import (
    ErrorCollector,
    ExitCode,
    ForeignCodeError,
    InfrastructureError,
    LingjingError,
    MissionError,
    UsageError,
    hint_of,
)
from lingjing.mission.model import Mission
from lingjing.play.folders import RUNS, claim_folder, claim_run_folder, release_if_empty
from lingjing.play.options import PlayOptions, checked_options, read_options
from lingjing.play.parallel import EpisodeTask, episode_servers, play_apart, play_here
from lingjing.play.report import INTERRUPTED, POLICY_FAILED, EpisodeReport, summarise
from lingjing.processes.linux import set_parent_death_signal
from lingjing.refusals import refusal_of


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options. Options that are not set are None or empty: `PlayOptions` has the defaults."""
    parser.add_argument(
        "mission", metavar="MISSION", nargs="?", help="a .ljs or resetScenario .json file, or a shipped name"
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--seed", metavar="N", help="the episode's seed (default 0)")
    which.add_argument("--seeds", metavar="A-B", help="several seeds, both ends included")
    parser.add_argument("--salt", metavar="FILE", help="a secret file that draws, with the seed, a sealed instance")
    parser.add_argument(
        "--scene", metavar="MAP", help="play in a real city: a map (.osm, .osm.pbf) or a folder of `scene build`"
    )
    parser.add_argument("--mode", metavar="MODE", help="communication mode (default: the mission's)")
    parser.add_argument("--tier", metavar="N", help="tier of difficulty: 0 (default), or one that the mission declares")
    parser.add_argument(
        "--language", metavar="CODE", help="language of goal, prompts, rules and requests: en (default), zh, …"
    )
    parser.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="set a mission parameter")
    parser.add_argument("--policy", metavar="NAME|FILE.py:CLASS", help="the policy of all agents (default heuristic)")
    parser.add_argument(
        "--policy-for",
        metavar="ROLE_OR_AGENT=NAME",
        action="append",
        default=[],
        help="the policy of this role or agent",
    )
    parser.add_argument(
        "--policy-arg", metavar="K=V", action="append", default=[], help="an option of the policy; a list as JSON"
    )
    parser.add_argument(
        "--engine-arg", metavar="ENGINE.K=V", action="append", default=[], help="an option of an engine"
    )
    parser.add_argument("--policy-seed", metavar="N", help="seed of the policies' own random streams (default 0)")
    parser.add_argument(
        "--evaluator",
        metavar="NAME",
        action="append",
        help="the evaluator that scores (default mission); the score of several is their mean",
    )
    parser.add_argument(
        "--evaluator-arg", metavar="NAME.K=V", action="append", default=[], help="an option of an evaluator"
    )
    parser.add_argument(
        "--options",
        metavar="FILE",
        help="a JSON file with any of these options; - reads standard input; the command line has priority",
    )
    parser.add_argument("-o", "--output", metavar="DIR", help="a new or empty folder (default: a new one in runs/)")
    parser.add_argument("--world", metavar="process|inline", help="where the engines run (default process)")
    parser.add_argument(
        "--blank-pictures", action="store_true", help="give the policies black pictures (a control experiment)"
    )
    parser.add_argument(
        "--swap-pictures", action="store_true", help="give them the pictures of the neighbouring seed (a control)"
    )
    parser.add_argument("--no-overview", action="store_true", help="do not draw overview.png (it takes a few seconds)")
    parser.add_argument("--sign", metavar="KEYFILE", help="sign the trace with this key (see `lingjing verify --key`)")
    parser.add_argument(
        "--calls",
        metavar="record|replay|live",
        help="record model calls beside the trace (default), replay a record, or do neither",
    )
    parser.add_argument(
        "--calls-from", metavar="PATH", help="the record to replay: a trace, its folder, or a run's folder"
    )
    parser.add_argument("--max-cost", metavar="USD", help="the greatest cost of all model calls of all episodes")
    parser.add_argument(
        "--max-tokens", metavar="N", help="the greatest number of tokens of all model calls of all episodes"
    )
    parser.add_argument(
        "--isolate", action="store_true", help="put walls around each policy: no files, network or processes of others"
    )
    parser.add_argument("--strict", action="store_true", help="as --isolate, and refuse a kernel that lacks a wall")
    parser.add_argument(
        "--policy-file", metavar="PATH", action="append", help="a file or folder that isolated policies may read"
    )
    parser.add_argument("-j", "--jobs", metavar="N", default="1", help="play N seeds at a time")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    parser.add_argument(
        "--watch",
        metavar="WHERE",
        nargs="?",
        const="terminal",
        help="show the episode while it is played: in the terminal (default), browser or foxglove",
    )
    parser.add_argument(
        "--watch-truth", action="store_true", help="watch with hidden targets shown before they are found"
    )
    parser.add_argument("--json-error", action="store_true", help=argparse.SUPPRESS)  # set by play_apart
    parser.add_argument("--end-with", metavar="PID", type=int, help=argparse.SUPPRESS)  # set by play_apart
    parser.add_argument("--fork-server", metavar="FD", type=int, help=argparse.SUPPRESS)  # set by a fork server
    parser.add_argument("--walled-server", metavar="FD", type=int, help=argparse.SUPPRESS)  # set by play_apart


def handler(args: argparse.Namespace) -> int:
    """Play, print the result and return the exit code. With `--json-error` an error is printed as an `EpisodeError`."""
    try:
        return _handle(args)
    except Exception as error:
        reported = error if isinstance(error, LingjingError) else refusal_of(error)
        if args.json_error and reported is not None:
            print_error_json(reported)
        raise


def _handle(args: argparse.Namespace) -> int:
    if args.end_with is not None and not set_parent_death_signal(args.end_with, signal.SIGTERM):
        raise KeyboardInterrupt
    warn_of_broken_plugins()
    errors = ErrorCollector()
    _read_watch(args, errors)
    jobs = _jobs(args, errors)
    options, mission = _options(args, errors)
    seeds = errors.attempt(lambda: parse_seeds(args.seeds), ()) if args.seeds is not None else ()
    folder = errors.attempt(lambda: claim_folder(Path(args.output)), None) if args.output else None
    if errors.errors or mission is None:
        if folder is not None:
            release_if_empty(folder)
        _raise_errors(options, mission, errors)
    args.jobs = jobs
    with ending_at_second_interrupt():
        if seeds:
            return _run_many(args, mission, options, folder or RUNS, seeds)
        return _run_one(args, mission, options, folder)


WATCHED_IN = ("terminal", "browser", "foxglove")
"""The places of `--watch`."""


def _read_watch(args: argparse.Namespace, errors: ErrorCollector) -> None:
    """Read `--watch` as a place, or as the mission if it names none: `lingjing run --watch ssr`."""
    if args.watch is not None and args.watch not in WATCHED_IN:
        if args.mission is None:
            args.mission, args.watch = args.watch, "terminal"
        else:
            errors.add(UsageError(f"--watch={args.watch}: must be one of {', '.join(WATCHED_IN)}"))
    if args.watch is None and args.watch_truth:
        args.watch = "terminal"
    if args.watch in ("browser", "foxglove") and args.seeds is not None:
        hint = "remove --seeds, or follow each with `lingjing view --follow TRACE`"
        errors.add(UsageError(f"--watch={args.watch} shows one episode", hint=hint))


def _jobs(args: argparse.Namespace, errors: ErrorCollector) -> int:
    jobs = whole_number(args.jobs, 9999) or 0
    if jobs < 1:
        errors.add(UsageError(f"-j {args.jobs}: must be a whole number of at least 1"))
    if args.output == "":
        errors.add(UsageError("-o is empty", hint="name a folder, or remove -o for a new folder in runs/"))
    if jobs > 1 and args.watch is not None:
        errors.add(UsageError("--watch shows one episode at a time", hint="remove -j or --watch"))
    return jobs


def _raise_errors(options: PlayOptions, mission: Mission | None, errors: ErrorCollector) -> NoReturn:
    """Raise the errors of the command line together with those that the preparation of the episode finds."""
    from lingjing.play.preparation import prepare
    from lingjing.plugins.host import PluginHost

    with suppress(InfrastructureError), episode_servers(options) as servers:
        prepare(options, mission, PluginHost(), {}, errors, servers.policies)
    errors.check()
    raise AssertionError("there is no error")


def _options(args: argparse.Namespace, errors: ErrorCollector) -> tuple[PlayOptions, Mission | None]:
    """Return the options of the file and of the command line, which has priority, and their mission."""
    file_options = _file_options(args.options, errors) if args.options else {}
    named = args.mission or file_options.get("mission")
    path: str | None = None
    if named:
        path = errors.attempt(lambda: str(find_mission(str(named))), None)
    else:
        errors.add(UsageError("no mission is named", hint="name a .ljs file or a shipped mission: lingjing run ssr"))
    mission, notes = errors.attempt(lambda: load_with_notes(path), (None, ())) if path is not None else (None, ())
    if args.end_with is None:  # else the parent process has printed the notes
        for note in notes:
            say(f"note: {note}")
    pairs = parse_pairs("--set", args.set, errors)
    mappings: dict[str, Mapping[str, object]] = {
        "policies_for": parse_pairs("--policy-for", args.policy_for, errors, "policies_for"),
        "policy_args": parse_pairs("--policy-arg", args.policy_arg, errors),
        "engine_args": parse_pairs("--engine-arg", args.engine_arg, errors),
        "evaluator_args": parse_pairs("--evaluator-arg", args.evaluator_arg, errors),
        "settings": parse_settings(pairs, mission, errors),
    }
    single = {
        "mission": path or "",  # an unknown mission has been reported: do not report it as missing too
        "seed": errors.attempt(lambda: parse_seed(args.seed), None) if args.seed is not None else None,
        "policy_seed": errors.attempt(lambda: parse_seed(args.policy_seed), None)
        if args.policy_seed is not None
        else None,
        "policy": args.policy,
        "mode": args.mode,
        "scene": args.scene,
        "tier": errors.attempt(lambda: parse_tier(args.tier), None) if args.tier is not None else None,
        "language": args.language,
        "world": args.world,
        "sign": args.sign,
        "evaluators": args.evaluator,
        "blank_pictures": args.blank_pictures or None,
        "swap_pictures": args.swap_pictures or None,
        "isolate": "strict" if args.strict else "yes" if args.isolate else None,
        "policy_files": args.policy_file,
        "salt": args.salt,
        "overview": False if args.no_overview else None,
        "calls": args.calls,
        "calls_from": args.calls_from,
        "max_cost": errors.attempt(lambda: parse_amount("--max-cost", args.max_cost), None),
        "max_tokens": errors.attempt(lambda: parse_amount("--max-tokens", args.max_tokens, whole=True), None),
    }
    plain = file_options | {name: value for name, value in single.items() if value is not None}
    plain |= {name: {**_mapping(file_options.get(name)), **pairs_here} for name, pairs_here in mappings.items()}
    options = checked_options(plain, errors)
    if args.set and mission is not None and not errors.errors:
        without = msgspec.structs.replace(options, settings={})
        options = errors.attempt(lambda: _check_settings(args.set, mission, options), without)
    return options, mission


def _file_options(file: str, errors: ErrorCollector) -> dict[str, object]:
    try:
        return read_options(sys.stdin.buffer.read() if file == "-" else Path(file).read_bytes(), file, errors)
    except OSError as error:
        errors.add(UsageError(f"cannot read `{file}`: {error.strerror}"))
        return {}


def _mapping(value: object) -> Mapping[str, object]:
    return value if isinstance(value, Mapping) else {}


def _check_settings(settings: list[str], mission: Mission, options: PlayOptions) -> PlayOptions:
    """Return the options. Raises `UsageError` if the mission is valid by itself and invalid with the settings."""
    from lingjing.mission.instantiate import instantiate

    try:
        instantiate(
            mission,
            seed=options.seed,
            mode=options.mode,
            settings=options.settings,
            tier=options.tier,
            language=options.language,
        )
    except UsageError:  # reported later with all other errors
        return options
    except MissionError as error:
        raise UsageError(f"--set {' --set '.join(settings)}: {error}", hint=hint_of(error)) from error
    return options


def _run_one(args: argparse.Namespace, mission: Mission, options: PlayOptions, folder: Path | None) -> int:
    if args.watch in ("browser", "foxglove"):
        return _run_shown(args, mission, options, folder)
    try:
        with results_alone():
            (episode,) = _played(
                args, mission, options, (options.seed,), lambda seed: folder or _claim(mission, options, seed)
            )
    finally:
        release_if_empty(folder or RUNS)
    return _print_result(args, episode)


def _run_shown(args: argparse.Namespace, mission: Mission, options: PlayOptions, claimed: Path | None) -> int:
    """Play one episode with a viewer beside it, which stays after the result until an interrupt."""
    from lingjing.cli.watch.viewer_process import ViewerProcess
    from lingjing.play.episode import TRACE_NAME

    folder = claimed or _claim(mission, options, options.seed)
    try:
        with ViewerProcess(folder / TRACE_NAME, foxglove=args.watch == "foxglove", truth=args.watch_truth) as viewer:
            with results_alone():
                (episode,) = _played(args, mission, options, (options.seed,), lambda seed: folder)
            code = _print_result(args, episode)
            if episode.reason != INTERRUPTED:
                viewer.stay()
    finally:
        release_if_empty(folder)
        if claimed is None:
            release_if_empty(RUNS)
    return code


def _print_result(args: argparse.Namespace, episode: EpisodeReport) -> int:
    if args.json:
        print_json(episode)
    if not args.json_error:  # else the report is the message
        _check_begun(episode)
    if not args.json:
        print_episode(episode)
    explain([episode])
    return exit_code([episode])


def _check_begun(episode: EpisodeReport) -> None:
    """Raise the error of a policy that prevented the episode from starting."""
    if episode.reason == POLICY_FAILED:
        raise ForeignCodeError(episode.detail, hint=episode.hint)


def _run_many(
    args: argparse.Namespace, mission: Mission, options: PlayOptions, root: Path, seeds: tuple[int, ...]
) -> int:
    try:
        with results_alone(), _one_ledger(options) as counted:
            played = _played(args, mission, counted, seeds, lambda seed: _claim(mission, options, seed, root))
            episodes, interrupted = _until_interrupted(played, seeds[0])
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


@contextmanager
def _one_ledger(options: PlayOptions) -> Iterator[PlayOptions]:
    """Yield the options with a ledger file, so that limits are counted over all episodes and processes."""
    if options.ledger or (options.max_cost is None and options.max_tokens is None):
        yield options
        return
    with tempfile.TemporaryDirectory(prefix="lingjing-") as folder:
        yield msgspec.structs.replace(options, ledger=str(Path(folder) / "ledger"))


def _until_interrupted(played: Generator[EpisodeReport], first: int) -> tuple[list[EpisodeReport], bool]:
    """Return the episodes played before an interrupt, by seed, and whether there was one.

    Raises `ForeignCodeError` if a policy prevents the episode of the `first` seed from starting and none has started
    before: the others would fail too.
    """
    episodes: list[EpisodeReport] = []
    interrupted = False
    try:
        with closing(played):
            for episode in played:
                episodes.append(episode)
                if episode.seed == first and all(other.reason == POLICY_FAILED for other in episodes):
                    _check_begun(episode)
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
) -> Generator[EpisodeReport]:
    """Play the episodes and yield their reports; each agent's policy runs in a separate process."""
    if args.jobs > 1:
        tasks = (
            EpisodeTask(msgspec.structs.replace(options, seed=seed), claim(seed), repeated=False, reports_failure=True)
            for seed in seeds
        )
        yield from (report for _, report in play_apart(tasks, args.jobs))
        return
    places = ((seed, claim(seed)) for seed in seeds)
    with episode_servers(options, args.fork_server, args.walled_server) as servers:
        if args.watch != "terminal":
            yield from play_here(options, places, LiveProgress, mission, *servers)
            return
        from lingjing.cli.watch import EpisodeDisplays
        from lingjing.play.preparation import prepare
        from lingjing.plugins.host import PluginHost

        errors = ErrorCollector()
        displays = errors.attempt(lambda: EpisodeDisplays(mission, options, truth=args.watch_truth), None)
        # A display draws the instance before it is played.
        prepare(options, mission, PluginHost(), {}, errors, servers.policies)
        if displays is None:
            raise AssertionError("without displays there is an error")
        yield from play_here(options, displays.follow(places), displays, mission, None, servers.policies)
