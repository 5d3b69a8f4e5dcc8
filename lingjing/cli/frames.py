"""`lingjing frames`: labelled sets of frames for detectors, and the probe of another appearance."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import check_counts, parse_pairs, parse_seeds, parse_settings
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
    export.set_defaults(handler=_export)


def _add_twins(actions: argparse._SubParsersAction[ArgumentParser]) -> None:
    twins = actions.add_parser("twins", help="take edited pictures of a set in", description=_twins.__doc__)
    twins.add_argument("set", metavar="SET", type=Path, help="what `lingjing frames export` made")
    twins.add_argument("edited", metavar="EDITED", type=Path, help="the folder of the edited pictures")
    twins.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="a new folder for the twins")
    twins.add_argument(
        "--refuse", metavar="FILE", type=Path, help="CSV of frames' names and why a look at their edits refused them"
    )
    twins.set_defaults(handler=_twins)


def _add_probe(actions: argparse._SubParsersAction[ArgumentParser]) -> None:
    probe = actions.add_parser("probe", help="ask detectors what frames show", description=_probe.__doc__)
    probe.add_argument("set", metavar="SET", type=Path, help="what `lingjing frames export` made")
    probe.add_argument("--twins", metavar="DIR", type=Path, help="what `lingjing frames twins` made of it")
    probe.add_argument("--detector", metavar="NAME", nargs="+", default=["colours", "learned"], dest="detectors",
                       help="who is asked (default: colours learned)")  # fmt: skip
    probe.add_argument("--detector-arg", metavar="K=V", action="append", default=[], help="an option of the only one")
    probe.add_argument("--classes", metavar="CLASS", nargs="+", help="default: those of the set")
    probe.add_argument("--split", choices=("train", "validation", "all"), default="all", help="default: all")
    probe.add_argument("-o", "--output", metavar="DIR", type=Path, help="a new folder for answers and tables")
    probe.set_defaults(handler=_probe)


def _export(args: argparse.Namespace) -> int:
    """Choose frames of traces, or of episodes that are played for it: for each class as many that show a target as that
    show none, hard ones first, split by seed; write them as COCO and as a Hugging Face image folder with a card. The
    same episodes give the same bytes."""
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
    check_counts(("-j", args.jobs), ("--most", args.most))
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


def _twins(args: argparse.Namespace) -> int:
    """Take in edited pictures of a set's frames, by the names of their files. An edit is refused if it is missing,
    cannot be read, has another size, is unchanged, or if the outlines of the view or of a target are no longer where
    they were; what a list of refusals names is refused for the reason it gives. All refusals are counted."""
    from collections import Counter

    from lingjing.bench.frame_sets.twins import take_in

    made = take_in(args.set, args.edited, args.output, _refusals(args.refuse))
    reasons = Counter(one.reason for one in made.refused)
    told = ", ".join(f"{number} {reason}" for reason, number in sorted(reasons.items()))
    print(f"{len(made.taken)} twins taken in, {len(made.refused)} edits refused{f': {told}' if told else ''}")
    print(f"{args.output}")
    return ExitCode.OK


def _refusals(file: Path | None) -> dict[str, str]:
    """Reasons by frames' names, of lines `NAME,REASON`; a line without a reason is `refused`."""
    import csv

    if file is None:
        return {}
    try:
        rows = list(csv.reader(file.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read `{file}`: {error}") from error
    return {row[0].strip(): ",".join(row[1:]).strip() or "refused" for row in rows if row and row[0].strip()}


def _probe(args: argparse.Namespace) -> int:
    """Ask detectors of each frame, and of its twin, whether it shows a target: F1 of presence on both and the
    difference with bootstrap intervals, precision and recall of boxes where a detector gives some."""
    from lingjing.bench.exports import to_markdown
    from lingjing.bench.frame_sets.folder import check_new, read_class, set_classes
    from lingjing.bench.frame_sets.probe import ProbedFrame, probe_cell, probe_table, probed
    from lingjing.plugins.host import PluginHost

    given = parse_pairs("--detector-arg", args.detector_arg)
    if given and len(args.detectors) > 1:
        raise UsageError("--detector-arg is for one detector", hint="name one with --detector")
    if args.output is not None:
        check_new(args.output)
    there = set_classes(args.set)
    if unknown := sorted(set(args.classes or ()) - set(there)):
        raise UsageError(f"the set has no `{unknown[0]}`", hint=f"it has: {', '.join(there)}")
    host = PluginHost()
    plugins = [host.detector(name) for name in args.detectors]
    asked = {plugin.name: plugin.factory(given) for plugin in plugins}
    twins, notes = _twins_of(args.twins)
    cells, answers = [], list[ProbedFrame]()
    for cls in args.classes or there:
        frames = [one for one in read_class(args.set, cls) if args.split in ("all", one.split)]
        pairs = {name: twin for (of, name), twin in twins.items() if of == cls}
        for plugin in plugins:
            if not plugin.knows(cls):
                notes.append(f"{plugin.name} does not know {cls}")
            elif frames:
                said = list(probed(args.set, cls, frames, (plugin.name, asked[plugin.name]), pairs))
                answers += said
                cells.append(probe_cell(said))
    if not cells:
        raise UsageError("nothing was asked", hint="; ".join(notes) or f"no frame is in the split `{args.split}`")
    table = probe_table(cells, notes)
    if args.output is not None:
        _write_probe(args.output, cells, answers, table)
    print(to_markdown(table))
    return ExitCode.OK


def _twins_of(folder: Path | None) -> tuple[dict[tuple[str, str], tuple[Path, TwinRecord]], list[str]]:
    """Twins by class and frame's name, with their folder; and what is to be said of them below the table."""
    from collections import Counter

    from lingjing.bench.frame_sets.twins import read_twins

    if folder is None:
        return {}, []
    known = read_twins(folder)
    reasons = Counter(one.reason for one in known.refused)
    told = ", ".join(f"{number} {reason}" for reason, number in sorted(reasons.items()))
    note = f"{len(known.taken)} pairs, {len(known.refused)} edits refused{f' ({told})' if told else ''}"
    return {(one.cls, one.name): (folder, one) for one in known.taken}, [note]


def _write_probe(folder: Path, cells: Sequence[ProbeCell], answers: Sequence[ProbedFrame], table: ResultTable) -> None:
    """Answers, counts and the table in every format, in a folder that is there whole or not at all."""
    import msgspec

    from lingjing.bench.exports import EXPORTS, SUFFIXES
    from lingjing.bench.frame_sets.folder import new_folder

    with new_folder(folder) as made:
        (made / "answers.jsonl").write_bytes(b"".join(msgspec.json.encode(one) + b"\n" for one in answers))
        (made / "counts.json").write_bytes(msgspec.json.format(msgspec.json.encode(cells), indent=1) + b"\n")
        for name, export in EXPORTS.items():
            (made / f"table.{SUFFIXES[name]}").write_text(export(table), encoding="utf-8")
