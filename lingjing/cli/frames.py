"""`lingjing frames`: make labelled sets of frames for detectors, and test detectors on pictures of another
appearance.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import check_counts, parse_pairs, parse_seeds, parse_settings, parse_tier
from lingjing.cli.parser import ArgumentParser
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.vocabulary import MODES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lingjing.bench.frame_sets.probe import ProbeCell, ProbedFrame
    from lingjing.bench.frame_sets.twins import TwinRecord
    from lingjing.bench.table_cells import ResultTable
    from lingjing.play.options import PlayOptions

NONE = "none"
"""The value of `--held-out` that excludes no seeds."""


def add_options(parser: ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    _add_export(actions)
    _add_twins(actions)
    _add_probe(actions)


def _add_export(actions: argparse._SubParsersAction[ArgumentParser]) -> None:
    export = actions.add_parser("export", help="make a balanced set of traces' frames", description=_export.__doc__)
    export.add_argument("traces", metavar="TRACE", nargs="*", type=Path, help="a trace.mcap, or a folder with some")
    export.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="a new folder for the set")
    export.add_argument(
        "--classes", metavar="CLASS", nargs="+", help="classes of targets (default: every class that a frame shows)"
    )
    export.add_argument(
        "--most", metavar="N", type=int, help="at most N frames with and N without the target, per class and split"
    )
    export.add_argument("--every", action="store_true", help="export every frame, without balancing")
    export.add_argument(
        "--validation", metavar="SHARE", type=float, default=0.2, help="share of the seeds for validation (default 0.2)"
    )
    export.add_argument(
        "--held-out", metavar="A-B", default="0-199",
        help=f"seeds of evaluations, which are rejected (default 0-199; `{NONE}` for a probe)",
    )  # fmt: skip
    export.add_argument(
        "--play", metavar="MISSION", nargs="+", default=[], help="play these missions and export their frames"
    )
    export.add_argument("--seeds", metavar="A-B", default="2000-2009", help="seeds to play (default 2000-2009)")
    export.add_argument("--policy", default="heuristic", help="the policy that plays (default heuristic)")
    export.add_argument("--mode", choices=MODES, help="the missions' mode")
    export.add_argument("--tier", metavar="N", default="0", help="the tier of the missions (default 0)")
    export.add_argument("--set", metavar="PARAM=VALUE", action="append", default=[], help="a parameter of the missions")
    export.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N episodes at a time")
    export.add_argument(
        "--episodes", metavar="DIR", type=Path, help="the folder of played episodes (default DIR.episodes)"
    )
    export.set_defaults(handler=_export)


def _add_twins(actions: argparse._SubParsersAction[ArgumentParser]) -> None:
    twins = actions.add_parser("twins", help="import edited pictures of a set", description=_twins.__doc__)
    twins.add_argument("set", metavar="SET", type=Path, help="a set that `lingjing frames export` made")
    twins.add_argument("edited", metavar="EDITED", type=Path, help="the folder of the edited pictures")
    twins.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="a new folder for the twins")
    twins.add_argument(
        "--refuse", metavar="FILE", type=Path, help="CSV file of frames to reject after inspection: name, reason"
    )
    twins.set_defaults(handler=_twins)


def _add_probe(actions: argparse._SubParsersAction[ArgumentParser]) -> None:
    probe = actions.add_parser("probe", help="test detectors on a set and its twins", description=_probe.__doc__)
    probe.add_argument("set", metavar="SET", type=Path, help="a set that `lingjing frames export` made")
    probe.add_argument(
        "--twins", metavar="DIR", type=Path, help="the twins of the set that `lingjing frames twins` made"
    )
    probe.add_argument("--detector", metavar="NAME", nargs="+", default=["colours", "learned"], dest="detectors",
                       help="the detectors (default: colours learned)")  # fmt: skip
    probe.add_argument(
        "--detector-arg",
        metavar="K=V",
        action="append",
        default=[],
        help="an option of the detector, if there is one only",
    )
    probe.add_argument("--classes", metavar="CLASS", nargs="+", help="classes of targets (default: those of the set)")
    probe.add_argument("--split", choices=("train", "validation", "all"), default="all", help="default: all")
    probe.add_argument("-o", "--output", metavar="DIR", type=Path, help="a new folder for detections and tables")
    probe.set_defaults(handler=_probe)


def _export(args: argparse.Namespace) -> int:
    """Choose frames of traces, or of episodes played for it: for each class as many with a target as without, hard
    ones first, split by seed. Write them as COCO and as a Hugging Face image folder with a card. The same episodes
    give the same bytes.
    """
    from lingjing.bench.frame_sets.balance import class_set
    from lingjing.bench.frame_sets.folder import check_new, write_set
    from lingjing.bench.frame_sets.labelled import seen_targets
    from lingjing.bench.frame_sets.sources import FrameSources, found_traces, played

    _check_numbers(args)
    check_new(args.output)
    paths = found_traces(args.traces)
    folder = args.episodes or args.output.with_name(f"{args.output.name}.episodes")
    paths += played(_episodes(args), folder, args.jobs) if args.play else ()
    if not paths:
        raise UsageError("no trace is named", hint="name traces, or play missions with --play")
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
    write_set(args.output, sets, sources.jpeg, mask=sources.mask)
    for chosen in sets:
        hard = sum(bool(frame.hard) for frame in chosen.frames)
        shown = sum(frame.present for frame in chosen.frames)
        print(f"{chosen.cls}: {shown} frames with, {len(chosen.frames) - shown} without, of these {hard} hard")
    print(f"{args.output}")
    return ExitCode.OK


def _check_numbers(args: argparse.Namespace) -> None:
    check_counts(("-j", args.jobs), ("--most", args.most))
    if not 0 <= args.validation < 1:
        raise UsageError(f"--validation {args.validation:g}: must be a share from 0 to below 1")


def _check_seeds(seeds: set[int], held_out: str) -> None:
    """Raise `UsageError` for frames of episodes that are reserved for evaluations."""
    both = sorted(seeds.intersection(() if held_out == NONE else parse_seeds(held_out)))
    if both:
        raise UsageError(
            f"seed {both[0]} is reserved for evaluations: a detector trained on it must not be scored on it",
            hint=f"play seeds from 2000 on; `--held-out {NONE}` exports frames that are never used for training",
        )


def _episodes(args: argparse.Namespace) -> list[PlayOptions]:
    from msgspec.structs import replace

    from lingjing.play.options import PlayOptions, compiled

    seeds, pairs = parse_seeds(args.seeds), parse_pairs("--set", args.set)
    _check_seeds(set(seeds), args.held_out)
    options = []
    for mission in args.play:
        base = PlayOptions(mission=mission, policy=args.policy, mode=args.mode, tier=parse_tier(args.tier))
        settings = parse_settings(pairs, compiled(base))
        options += [replace(base, settings=settings, seed=seed) for seed in seeds]
    return options


def _twins(args: argparse.Namespace) -> int:
    """Import edited pictures of a set's frames, matched by file name. An edit is rejected if it is missing,
    unreadable, unchanged or of another size, or if the outlines of the view or of a target have moved. Frames in the
    list of rejections are rejected for the stated reason. All rejections are counted.
    """
    from collections import Counter

    from lingjing.bench.frame_sets.twins import import_twins

    twins = import_twins(args.set, args.edited, args.output, _refusals(args.refuse))
    reasons = Counter(edit.reason for edit in twins.refused)
    summary = ", ".join(f"{number} {reason}" for reason, number in sorted(reasons.items()))
    print(f"{len(twins.taken)} twins imported, {len(twins.refused)} edits rejected{f': {summary}' if summary else ''}")
    print(f"{args.output}")
    return ExitCode.OK


def _refusals(file: Path | None) -> dict[str, str]:
    """Return reasons by frame name, from lines `NAME,REASON`; the reason of a line without one is `refused`."""
    import csv

    if file is None:
        return {}
    try:
        rows = list(csv.reader(file.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read `{file}`: {error}") from error
    return {row[0].strip(): ",".join(row[1:]).strip() or "refused" for row in rows if row and row[0].strip()}


def _probe(args: argparse.Namespace) -> int:
    """Run detectors on each frame, and on its twin: F1 of presence on both and the difference with bootstrap
    intervals, and precision and recall of boxes where a detector returns boxes.
    """
    from lingjing.bench.exports import to_markdown
    from lingjing.bench.frame_sets.folder import check_new, read_class, set_classes
    from lingjing.bench.frame_sets.probe import ProbedFrame, probe_cell, probe_table, probed
    from lingjing.plugins.host import PluginHost

    options = parse_pairs("--detector-arg", args.detector_arg)
    if options and len(args.detectors) > 1:
        raise UsageError("--detector-arg is for one detector", hint="name one with --detector")
    if args.output is not None:
        check_new(args.output)
    known = set_classes(args.set)
    if unknown := sorted(set(args.classes or ()) - set(known)):
        raise UsageError(f"the set has no `{unknown[0]}`", hint=f"it has: {', '.join(known)}")
    host = PluginHost()
    plugins = [host.detector(name) for name in args.detectors]
    detectors = {plugin.name: plugin.factory(options) for plugin in plugins}
    twins, notes = _twins_of(args.twins)
    cells, answers = [], list[ProbedFrame]()
    for cls in args.classes or known:
        frames = [frame for frame in read_class(args.set, cls) if args.split in ("all", frame.split)]
        pairs = {name: twin for (of, name), twin in twins.items() if of == cls}
        for plugin in plugins:
            if not plugin.knows(cls):
                notes.append(f"{plugin.name} does not know {cls}")
            elif frames:
                results = list(probed(args.set, cls, frames, (plugin.name, detectors[plugin.name]), pairs))
                answers += results
                cells.append(probe_cell(results))
    if not cells:
        raise UsageError("no frame to test", hint="; ".join(notes) or f"no frame is in the split `{args.split}`")
    table = probe_table(cells, notes)
    if args.output is not None:
        _write_probe(args.output, cells, answers, table)
    print(to_markdown(table))
    return ExitCode.OK


def _twins_of(folder: Path | None) -> tuple[dict[tuple[str, str], tuple[Path, TwinRecord]], list[str]]:
    """Return twins by class and frame name, with their folder, and notes for below the table."""
    from collections import Counter

    from lingjing.bench.frame_sets.twins import read_twins

    if folder is None:
        return {}, []
    known = read_twins(folder)
    reasons = Counter(twin.reason for twin in known.refused)
    summary = ", ".join(f"{number} {reason}" for reason, number in sorted(reasons.items()))
    note = f"{len(known.taken)} pairs, {len(known.refused)} edits rejected{f' ({summary})' if summary else ''}"
    return {(twin.cls, twin.name): (folder, twin) for twin in known.taken}, [note]


def _write_probe(folder: Path, cells: Sequence[ProbeCell], answers: Sequence[ProbedFrame], table: ResultTable) -> None:
    """Write detections, counts and the table in every format to a folder that is complete or absent."""
    import msgspec

    from lingjing.bench.exports import EXPORTS, SUFFIXES
    from lingjing.bench.frame_sets.folder import new_folder

    with new_folder(folder) as made:
        (made / "answers.jsonl").write_bytes(b"".join(msgspec.json.encode(answer) + b"\n" for answer in answers))
        (made / "counts.json").write_bytes(msgspec.json.format(msgspec.json.encode(cells), indent=1) + b"\n")
        for name, export in EXPORTS.items():
            (made / f"table.{SUFFIXES[name]}").write_text(export(table), encoding="utf-8")
