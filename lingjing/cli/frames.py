"""`lingjing frames`: labelled sets of frames for detectors, and the probe of another appearance."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import parse_pairs, parse_seeds, parse_settings
from lingjing.cli.parser import ArgumentParser
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.vocabulary import MODES

if TYPE_CHECKING:
    from lingjing.play.options import PlayOptions

NONE = "none"


def add_parser(subparsers: argparse._SubParsersAction[ArgumentParser]) -> None:
    """Declare the verb and its actions."""
    parser = subparsers.add_parser("frames", help="labelled sets of frames for detectors", description=__doc__)
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    _add_export(actions)


def handler(args: argparse.Namespace) -> int:
    """Do what was asked for."""
    return int(args.run(args))


def _add_export(actions: argparse._SubParsersAction[ArgumentParser]) -> None:
    export = actions.add_parser("export", help="make a balanced set of traces' frames", description=_export.__doc__)
    export.add_argument("traces", metavar="TRACE", nargs="*", type=Path, help="a trace.mcap, or a folder with some")
    export.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="a new folder for the set")
    export.add_argument("--classes", metavar="CLASS", nargs="+", help="default: every target that a frame shows")
    export.add_argument("--most", metavar="N", type=int, help="of each class and split, N frames with and N without")
    export.add_argument("--every", action="store_true", help="every frame, whatever the balance")
    export.add_argument("--validation", metavar="SHARE", type=float, default=0.2, help="of the seeds (default 0.2)")
    export.add_argument(
        "--held-out", metavar="A-B", default="0-199",
        help=f"seeds of evaluations, which are refused (default 0-199; `{NONE}` for a probe)",
    )  # fmt: skip
    export.add_argument("--play", metavar="MISSION", nargs="+", default=[], help="play these missions for it")
    export.add_argument("--seeds", metavar="A-B", default="2000-2009", help="what is played (default 2000-2009)")
    export.add_argument("--policy", default="heuristic", help="who plays (default heuristic)")
    export.add_argument("--mode", choices=MODES, help="the missions' mode")
    export.add_argument("--set", metavar="PARAM=VALUE", action="append", default=[], help="a parameter of the missions")
    export.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="episodes at a time")
    export.add_argument("--episodes", metavar="DIR", type=Path, help="where they are kept (default DIR.episodes)")
    export.set_defaults(run=_export)


def _export(args: argparse.Namespace) -> int:
    """Choose frames of traces, or of episodes that are played for it: for each class as many that show a target as that
    show none, hard ones first, split by seed; write them as COCO and as a Hugging Face image folder with a card. The
    same episodes give the same bytes."""
    from lingjing.bench.frame_sets.balance import class_set
    from lingjing.bench.frame_sets.folder import write_set
    from lingjing.bench.frame_sets.labelled import seen_targets
    from lingjing.bench.frame_sets.sources import FrameSources, found_traces, played

    _check_numbers(args)
    if args.output.exists() and (not args.output.is_dir() or any(args.output.iterdir())):
        raise UsageError(
            f"`{args.output}` is there already", hint="frame sets are never overwritten: name a new folder"
        )
    paths = found_traces(args.traces)
    folder = args.episodes or args.output.with_name(f"{args.output.name}.episodes")
    paths += played(_episodes(args), folder, args.jobs) if args.play else ()
    if not paths:
        raise UsageError("no trace is named", hint="name some, or have missions played with --play")
    sources = FrameSources(sorted(paths))
    _check_seeds({frame.seed for frame in sources.frames}, args.held_out)
    seen = seen_targets(sources.frames)
    if unseen := sorted(set(args.classes or ()) - set(seen)):
        raise UsageError(f"no frame shows a `{unseen[0]}`", hint=f"frames show: {', '.join(seen) or 'no target'}")
    if not seen:
        raise UsageError("no frame shows a target", hint="export other episodes")
    sets = [
        class_set(sources.frames, cls, args.validation, args.most, balanced=not args.every)
        for cls in args.classes or seen
    ]
    write_set(args.output, sets, sources.jpeg)
    for one in sets:
        hard = sum(bool(frame.hard) for frame in one.frames)
        shown = sum(frame.present for frame in one.frames)
        print(f"{one.cls}: {shown} frames with, {len(one.frames) - shown} without, of these {hard} hard")
    print(f"{args.output}")
    return ExitCode.OK


def _check_numbers(args: argparse.Namespace) -> None:
    for option, number in (("-j", args.jobs), ("--most", args.most)):
        if number is not None and number < 1:
            raise UsageError(f"{option} {number}: at least one")
    if not 0 <= args.validation < 1:
        raise UsageError(f"--validation {args.validation:g}: a share from 0 to below 1")


def _check_seeds(seeds: set[int], held_out: str) -> None:
    """Raise `UsageError` for frames of episodes that are kept for evaluations."""
    both = sorted(seeds.intersection(() if held_out == NONE else parse_seeds(held_out)))
    if both:
        raise UsageError(
            f"seed {both[0]} is kept for evaluations: what is trained on it must not be scored on it",
            hint=f"play seeds from 2000 on; `--held-out {NONE}` exports what is looked at and never trained on",
        )


def _episodes(args: argparse.Namespace) -> list[PlayOptions]:
    from lingjing.play.options import PlayOptions, compiled

    seeds, pairs = parse_seeds(args.seeds), parse_pairs("--set", args.set)
    _check_seeds(set(seeds), args.held_out)
    options = []
    for mission in args.play:
        one = PlayOptions(mission=mission, policy=args.policy, mode=args.mode)
        settings = parse_settings(pairs, compiled(one))
        options += [PlayOptions(mission=mission, policy=args.policy, mode=args.mode, settings=settings, seed=seed)
                    for seed in seeds]  # fmt: skip
    return options
