"""`lingjing bench SUITE`: play a suite of many episodes, continue an interrupted one, and make the paper's tables."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.adversaries import add_adversaries, play_adversaries
from lingjing.cli.arguments import check_counts, parse_seeds, parse_tier
from lingjing.cli.attribution import add_plant, measure, plant_faults
from lingjing.cli.files import tell_aside, write_output
from lingjing.cli.installed import warn_of_broken_plugins
from lingjing.cli.parser import ArgumentParser
from lingjing.cli.process import ending_at_second_interrupt, say, say_error
from lingjing.cli.validity import add_validity, play_validity
from lingjing.errors import ExitCode, InfrastructureError, UsageError
from lingjing.mission.vocabulary import MODES

if TYPE_CHECKING:
    from lingjing.bench.countdown import Countdown
    from lingjing.bench.executors import Executor
    from lingjing.bench.folder import ResultsFolder
    from lingjing.bench.planning import Isolation, SuiteCell, SuitePlan
    from lingjing.bench.rows import SuiteRow
    from lingjing.bench.running import Shard, SuiteEpisode, SuiteRun

KINDS = (
    "success", "intervals", "modes", "conditions", "stages", "behaviour", "perception", "controls", "failures", "drift",
    "paired", "cost",
)  # fmt: skip
"""The kinds of tables; `lingjing.bench.tables` makes them."""

FORMATS = ("markdown", "latex", "csv", "html")
"""The formats of tables; `lingjing.bench.exports` writes them."""


def add_options(parser: ArgumentParser) -> None:
    """Declare the actions; a first word that is no action is a suite to play."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    parser.implied_word = "play"
    _add_play(actions.add_parser("play", help="play a suite (the word `play` may be left out)", description=__doc__))
    table = actions.add_parser("table", help="make tables of results", description=_table.__doc__)
    _add_results(table)
    table.add_argument(
        "--kind", nargs="+", choices=KINDS, default=["success"], help="kinds of tables (default success)"
    )
    table.add_argument("--format", choices=FORMATS, default="markdown", help="format (default: markdown)")
    table.add_argument("-o", "--output", metavar="OUT", help="a file (default: standard output)")
    table.set_defaults(handler=_table)
    merge = actions.add_parser("merge", help="make one file of several results", description=_merge.__doc__)
    _add_results(merge)
    merge.add_argument("-o", "--output", metavar="OUT.parquet", type=Path, required=True, help="a new file")
    merge.set_defaults(handler=_merge)
    audit = actions.add_parser("audit", help="check results against their traces", description=_audit.__doc__)
    audit.add_argument("results", metavar="RESULTS", type=Path, help="a suite's folder with kept traces")
    audit.add_argument("--share", metavar="P", type=float, default=0.05, help="the share to replay (default 0.05)")
    audit.add_argument("--sample-seed", metavar="N", type=int, help="draw this sample (default: one at random)")
    audit.add_argument("--salt", metavar="FILE", help="the salt of the sealed split, to check the instances")
    audit.add_argument(
        "--suite", metavar="SUITE", help="the suite, to check rules and versions of missions that are not shipped"
    )
    audit.add_argument(
        "--trust", metavar="PLUGIN", nargs="+", help="let the code of these plug-ins run in this command"
    )
    audit.add_argument(
        "--keep-marks", action="store_true",
        help="keep what your earlier audit found of rows whose traces were removed since",
    )  # fmt: skip
    audit.set_defaults(handler=_audit)
    board = actions.add_parser("leaderboard", help="write a page that ranks entrants", description=_leaderboard.__doc__)
    _add_results(board)
    board.add_argument("-o", "--output", metavar="OUT.html", help="a file (default: standard output)")
    board.add_argument("--seeds", metavar="A-B", help="only these seeds, both ends included")
    board.add_argument("--missions", metavar="NAME", nargs="+", help="only these missions")
    board.add_argument("--modes", nargs="+", choices=MODES, help="only these modes")
    board.set_defaults(handler=_leaderboard)
    card = actions.add_parser("card", help="write a dataset card of results", description=_card.__doc__)
    _add_results(card)
    card.add_argument("-o", "--output", metavar="OUT.md", help="a file (default: standard output)")
    card.add_argument(
        "--format",
        choices=("markdown", "croissant"),
        default="markdown",
        help="a page, or MLCommons' Croissant for one results.parquet (default: markdown)",
    )
    card.set_defaults(handler=_card)
    add_plant(actions.add_parser("plant", help="make episodes with known faults", description=plant_faults.__doc__))
    add_adversaries(
        actions.add_parser(
            "adversaries", help="play those who look for a way past", description=play_adversaries.__doc__
        )
    )
    add_validity(
        actions.add_parser("validity", help="play the studies of docs/validity.md", description=play_validity.__doc__)
    )
    listed = actions.add_parser("list", help="list the suites that ship", description=_list.__doc__)
    listed.set_defaults(handler=_list)


def _add_results(parser: ArgumentParser) -> None:
    parser.add_argument("results", metavar="RESULTS", nargs="+", type=Path, help="a suite's folders, or .parquet files")
    parser.add_argument(
        "--other-code", action="store_true", help="accept rows that different versions of the code played"
    )


def _add_play(play: ArgumentParser) -> None:
    play.add_argument("suite", metavar="SUITE", help="a .toml file, or a shipped suite's name")
    play.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="the results folder; an existing one is continued"
    )
    play.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N episodes at a time (default 1)")
    play.add_argument("--missions", metavar="NAME", nargs="+", help="only these missions of the suite")
    play.add_argument("--modes", nargs="+", choices=MODES, help="only these modes")
    play.add_argument(
        "--tier", metavar="N", help="the missions' tier (default: the suite's; else 1 where a mission declares it)"
    )
    play.add_argument("--language", metavar="CODE", help="the language of the missions (default: the suite's, or en)")
    play.add_argument("--entrants", metavar="NAME", nargs="+", help="only these entrants of the suite")
    play.add_argument("--seeds", metavar="A-B", help="seeds in place of the suite's, both ends included")
    play.add_argument("--limit", metavar="N", type=int, help="only the first N seeds")
    play.add_argument("--policy", metavar="NAME", nargs="+", help="these policies in place of the suite's entrants")
    play.add_argument("--models", metavar="NAME", nargs="+", help="these models in place of the suite's entrants")
    play.add_argument("--method", metavar="NAME", nargs="+", help="these attribution methods (for the suite `planted`)")
    play.add_argument("--shard", metavar="K/N", help="the K-th of N parts, for batch systems; `merge` joins them")
    play.add_argument("--executor", choices=("local", "ray"), help="play on this machine, or on a Ray cluster")
    play.add_argument(
        "--ray-address", metavar="ADDRESS", default="auto", help="the address of the cluster (default: a local one)"
    )
    play.add_argument("--max-cost", metavar="USD", type=float, help="the greatest cost of all model calls")
    play.add_argument(
        "--calls",
        choices=("record", "replay", "live"),
        default="record",
        help="record model calls (default), replay a record, or do neither",
    )
    play.add_argument("--calls-from", metavar="DIR", type=Path, help="the suite's folder with the record to replay")
    play.add_argument(
        "--wait", metavar="MIN", type=float, help="wait so many minutes for a service that is down (default 60; 0: not)"
    )
    play.add_argument("--retry-lost", action="store_true", help="play lost episodes again, three times at most")
    play.add_argument(
        "--isolate",
        action=argparse.BooleanOptionalAction,
        help="put walls around every policy, or around none (default: around those that are not this project's)",
    )
    play.add_argument("--strict", action="store_true", help="as --isolate, and refuse a kernel that lacks a wall")
    play.add_argument(
        "--trust", metavar="PLUGIN", nargs="+", help="let the code of these plug-ins run in this command too"
    )
    play.add_argument("--salt", metavar="FILE", help="a secret file that draws the instances of a sealed split")
    play.add_argument("--keep", action="store_true", help="keep every trace (those of model policies are always kept)")
    play.add_argument(
        "--other-code", action="store_true", help="continue a folder whose rows another version of the code played"
    )
    play.add_argument(
        "--replay-changed", action="store_true", help="put rows of changed missions aside, and play them again"
    )
    play.add_argument(
        "--answer-s",
        metavar="S",
        type=float,
        help="seconds of an answer, for the hours of --check (default 5)",
    )
    play.add_argument("--check", action="store_true", help="check the suite, print its size, price and hours, and stop")


def handler(args: argparse.Namespace) -> int:
    """Play the missing episodes, store rows and tables in the folder, and print the suite's tables."""
    from lingjing.installed_plugins.discovery import trusting

    _check_numbers(args)
    with trusting(None if _isolation(args) == "no" else args.trust or ()):
        return _play(args)


def _isolation(args: argparse.Namespace) -> Isolation:
    """Return the walls of the command line. Raises `UsageError` for a contradiction."""
    if args.strict:
        if args.isolate is False:
            raise UsageError("--strict and --no-isolate contradict each other", hint="remove one of them")
        return "strict"
    return "foreign" if args.isolate is None else "yes" if args.isolate else "no"


def _play(args: argparse.Namespace) -> int:
    from lingjing.bench.attribution import is_attribution_suite
    from lingjing.bench.folder import open_results
    from lingjing.bench.money import check_ready, is_paid
    from lingjing.bench.planning import read_plan
    from lingjing.bench.playing import chosen_cells, default_folder
    from lingjing.bench.rows import code_sha256
    from lingjing.bench.running import SuiteRun
    from lingjing.bench.suite import find_suite
    from lingjing.mission.languages import check_written
    from lingjing.plugins.host import PluginHost

    warn_of_broken_plugins()
    path = find_suite(args.suite)
    if args.language is not None:
        check_written(args.language)
    if is_attribution_suite(path):
        return measure(path, args)
    if args.method:
        raise UsageError(f"--method: the suite `{args.suite}` measures no attribution methods")
    shard = _parse_shard(args.shard) if args.shard else None
    tier = parse_tier(args.tier) if args.tier is not None else None
    plan = read_plan(
        path,
        PluginHost(),
        args.policy or (),
        models=args.models or (),
        tier=tier,
        language=args.language,
        isolate=_isolation(args),
    )
    cells = chosen_cells(plan, args.missions or (), args.modes or (), args.entrants or (), prefix="--")
    seeds = parse_seeds(args.seeds) if args.seeds else plan.suite.seeds
    seeds = seeds[: args.limit] if args.limit else seeds
    _say_tiers(cells)
    if args.check:
        episodes = _episodes(cells, seeds, shard)
        say(f"{plan.path}: {_size(cells, len(seeds), shard)}{len(episodes)} episodes")
        say(_difference(episodes))
        _print_cost(plan, episodes, args)
        return ExitCode.OK
    players = tuple({cell.player.name: cell.player for cell in cells}.values())
    if args.calls != "replay":
        check_ready(players, args.max_cost)
    if args.calls != "replay" and any(map(is_paid, players)) and args.max_cost is None:
        _print_cost(plan, _episodes(cells, seeds, shard), args)
        raise UsageError("the model calls of this suite cost money", hint="set a limit with --max-cost USD")
    code = code_sha256(plan.files)
    part = f"-{shard.number}of{shard.count}" if shard else ""
    folder = args.output or default_folder(plan, code, part)
    with open_results(folder) as results:
        if args.calls_from is not None:
            results.adopt_salt(args.calls_from)
        executor = _executor(args, plan, results)
        run = SuiteRun(plan, results, code, executor, keep=args.keep, max_cost=args.max_cost,
                       calls=args.calls, calls_from=args.calls_from, isolate=_isolation(args),
                       salt=args.salt or "")  # fmt: skip
        run.check_split(cells)
        tell_aside(run.check_resumable(other_code=args.other_code, replay_changed=args.replay_changed))
        run.services.tell = say
        if args.wait is not None:
            run.services.longest_wait_s = 60.0 * args.wait
        if args.retry_lost:
            say(f"{run.retry_lost()} lost episodes are played again")
        results.write("suite.toml", plan.path.read_text(encoding="utf-8"))
        with ending_at_second_interrupt():
            return _run(run, cells, seeds, shard, jobs=args.jobs)


def _executor(args: argparse.Namespace, plan: SuitePlan, results: ResultsFolder) -> Executor:
    if (args.executor or plan.suite.executor) == "ray":
        from lingjing.bench.on_ray import RayExecutor

        return RayExecutor(results.folder / "lock", args.ray_address)
    from lingjing.bench.executors import LocalExecutor

    return LocalExecutor(args.jobs)


def _run(run: SuiteRun, cells: Sequence[SuiteCell], seeds: Sequence[int], shard: Shard | None, *, jobs: int) -> int:
    from lingjing.bench.exports import EXPORTS
    from lingjing.bench.memory_watch import MemoryWatch
    from lingjing.bench.playing import write_tables
    from lingjing.bench.running import WHOLE

    results, suite = run.results, run.plan.suite
    due = run.due(seeds, cells, shard or WHOLE)
    run.check_recorded(due)
    finals = sum(row.standing != "aborted" for row in results.rows)
    say(f"{suite.name}: {finals} episodes done, {len(due)} to play, results in {results.folder}")
    done = 0

    def tell(row: SuiteRow, countdown: Countdown) -> None:
        nonlocal done
        done += row.standing != "aborted"
        say(f"{_bar(done, len(due), countdown)} {episode_line(row)}")

    run.tell = tell
    memory = MemoryWatch()
    try:
        with memory.watching():
            run.play(due)
    except KeyboardInterrupt:
        say(f"interrupted after {done} of {len(due)} episodes; the same command continues from here")
        raise
    if words := memory.in_words(min(jobs, max(1, len(due)))):
        say(words)
    results.compact()
    if run.is_out_of_money:
        raise UsageError(
            f"the rest of ${run.max_cost:g} may not pay for another call (${run.spent():.2f} spent): "
            f"{len(due) - done} of {len(due)} episodes are not played",
            hint="the same command with a higher --max-cost continues; `lingjing bench table` shows the results so far",
        )
    tables = write_tables(run.plan, results)
    sys.stdout.write("\n".join(map(EXPORTS["markdown"], tables)))
    return report_lost([row for row in results.rows if row.standing == "lost"])


def report_lost(rows: Sequence[SuiteRow]) -> int:
    """Print an error message if episodes were lost; return the exit code."""
    if not rows:
        return ExitCode.OK
    first, number = rows[0].report, f"{len(rows)} {'episode is' if len(rows) == 1 else 'episodes are'} lost"
    say_error(
        InfrastructureError(
            f"{number}; the first, {first.mission}-{first.mode} seed {first.seed}: {first.detail}",
            hint=first.hint or "`lingjing doctor` checks this machine",
        )
    )
    return ExitCode.INFRASTRUCTURE


def _table(args: argparse.Namespace) -> int:
    """Print tables of one or several results; unfinished results are accepted."""
    from lingjing.bench.exports import EXPORTS, html_page
    from lingjing.bench.merging import merge_results
    from lingjing.bench.tables import make_tables

    tables = make_tables(merge_results(args.results, other_code=args.other_code), args.kind)
    text = "\n".join(map(EXPORTS[args.format], tables))
    write_output(html_page("Results", text) if args.format == "html" else text, args.output)
    return ExitCode.OK


def _merge(args: argparse.Namespace) -> int:
    """Join shards, or results of several machines, into one Parquet file. Results that do not fit together are
    rejected.
    """
    import msgspec

    from lingjing.bench.evidence import AuditRecord, audit_file, audit_marks, audited_in_words, row_sha256
    from lingjing.bench.folder import write_whole
    from lingjing.bench.merging import merge_results
    from lingjing.bench.parquet import encode_rows

    if args.output.exists():
        raise UsageError(f"`{args.output}` already exists", hint="results are never overwritten: name a new file")
    rows = merge_results(args.results, other_code=args.other_code)
    marks = audit_marks(args.results)
    kept = {name: marks[name] for row in rows if (name := row_sha256(row)) in marks}
    try:
        write_whole(args.output, encode_rows(rows))
        if kept:
            write_whole(audit_file(args.output), msgspec.json.encode(AuditRecord(rows=kept)))
    except OSError as error:
        raise UsageError(f"cannot write `{args.output}`: {error.strerror}", hint="choose another with -o") from error
    say(f"{len(rows)} rows of {len(args.results)} results in {args.output}; {audited_in_words(rows, marks)}")
    return ExitCode.OK


def _leaderboard(args: argparse.Namespace) -> int:
    """Write an HTML page that ranks the entrants of one suite's results. The page loads nothing from the network."""
    from lingjing.bench.evidence import audit_marks
    from lingjing.bench.leaderboard import leaderboard
    from lingjing.bench.merging import merge_results

    rows = merge_results(args.results, other_code=args.other_code)
    if args.seeds:
        seeds = set(parse_seeds(args.seeds))
        rows = [row for row in rows if row.seed in seeds]
        if not rows:
            raise UsageError(f"--seeds {args.seeds}: the results hold none of these seeds")
    if args.missions:
        unknown = sorted(set(args.missions) - {row.mission for row in rows})
        if unknown:
            raise UsageError(f"--missions: the results hold no episode of {', '.join(f'`{name}`' for name in unknown)}")
        rows = [row for row in rows if row.mission in args.missions]
    if args.modes:
        rows = [row for row in rows if row.mode in args.modes]
        if not rows:
            raise UsageError(f"--modes {' '.join(args.modes)}: the results hold no episode of these modes")
    write_output(leaderboard(rows, audit_marks(args.results)), args.output)
    return ExitCode.OK


def _suite_of(rows: Sequence[SuiteRow], word: str) -> Path:
    """Return the suite's file. Raises `UsageError` if the rows are of another suite."""
    from lingjing.bench.suite import PROGRAM, find_suite, read_document

    file = find_suite(word)
    document, suites = read_document(file), sorted({row.suite for row in rows})
    if PROGRAM not in document and document.get("name") not in suites:  # a program has suites with names of their own
        raise UsageError(f"--suite {word}: the rows are of the suite {' and '.join(f'`{name}`' for name in suites)}")
    return file


def _audit(args: argparse.Namespace) -> int:
    """Verify and score again every kept trace, compare it with its row, replay a drawn sample, and store the result
    beside the rows. Exit code 1 if a row is not what it claims.
    """
    import msgspec

    from lingjing.bench.auditing import LEAST_SHARE, Auditor
    from lingjing.bench.evidence import AuditRecord, audit_file, audited_in_words, named, read_audit
    from lingjing.bench.folder import read_results, write_whole
    from lingjing.bench.rows import code_sha256
    from lingjing.installed_plugins.discovery import trusting
    from lingjing.mission.salts import read_salt

    if not LEAST_SHARE <= args.share <= 1.0:
        raise UsageError(f"--share {args.share:g}: must be between {LEAST_SHARE:g} and 1")
    rows = read_results(args.results)
    folder = args.results if args.results.is_dir() else args.results.parent
    salt = read_salt(args.salt, published=True) if args.salt else None
    if salt is not None and not any(row.split_sha256 for row in rows):
        raise UsageError(f"--salt {args.salt}: the rows are of public seeds, which no salt has drawn")
    code = code_sha256(())
    earlier = read_audit(args.results) if args.keep_marks else None
    if args.keep_marks and earlier is None:
        raise UsageError(
            f"--keep-marks: there is no audit beside `{args.results}`", hint="audit the kept traces without it first"
        )
    with trusting(args.trust or ()):
        suite = _suite_of(rows, args.suite) if args.suite else None
        known = earlier or AuditRecord(rows={})
        audit = Auditor(folder, code, args.share, args.sample_seed, salt, suite, known, say).audit(rows)
    print(f"{audited_in_words(rows, audit.marks)}; {len(audit.findings)} wrong")
    for reason, number in audit.unchecked.most_common():
        print(f"not checked: {number} {'row' if number == 1 else 'rows'}: {reason}")
    for finding in audit.findings:
        print(f"wrong: {named(finding.row)}: {finding.reason}")
    file = audit_file(args.results)
    try:
        write_whole(file, msgspec.json.encode(audit.record(code)))
    except OSError as error:
        hint = "the marks of the rows are not stored: audit a copy in a folder that can be written"
        raise UsageError(f"cannot write `{file}`: {error.strerror}", hint=hint) from error
    return ExitCode.MISSION if audit.findings else ExitCode.OK


def _card(args: argparse.Namespace) -> int:
    """Describe results for a file beside them: in Markdown the suite, the entrants and the meaning of each column, as
    Croissant the columns and the checksum of one results.parquet.
    """
    from lingjing.bench.dataset_card import dataset_card
    from lingjing.bench.merging import merge_results
    from lingjing.bench.suite import read_document

    if args.format == "croissant":
        from lingjing.bench.croissant import parquet_file, results_croissant
        from lingjing.bench.parquet import read_rows

        if len(args.results) != 1:
            raise UsageError("a Croissant card describes one results.parquet", hint="merge first: lingjing bench merge")
        file = parquet_file(args.results[0])
        write_output(results_croissant(file, read_rows(file)), args.output)
        return ExitCode.OK
    suites = [place / "suite.toml" for place in args.results if (place / "suite.toml").is_file()]
    about = str(read_document(suites[0]).get("about", "")) if suites else ""
    write_output(dataset_card(merge_results(args.results, other_code=args.other_code), about), args.output)
    return ExitCode.OK


def _list(args: argparse.Namespace) -> int:
    """Print the name, title and size of every shipped suite."""
    from lingjing.bench.attribution import read_attribution_suite
    from lingjing.bench.suite import Suite, attribution_suites, find_suite, read_document, shipped_suites

    for name in shipped_suites():
        suite = Suite.model_validate(read_document(find_suite(name)))
        entrants = f"{len(suite.entrants)} entrant{'s' * (len(suite.entrants) > 1)}"
        print(f"{name:<14}{suite.title} ({entrants}, {len(suite.seeds)} seeds)")
    for name in attribution_suites():
        measured, episodes = read_attribution_suite(find_suite(name))
        print(f"{name:<14}{measured.title} ({len(episodes)} episodes)")
    return ExitCode.OK


# -- arguments


def _parse_shard(text: str) -> Shard:
    """Parse `3/16`. Raises `UsageError` for any other form."""
    from lingjing.bench.running import Shard

    number, slash, count = text.partition("/")
    if slash and number.isdecimal() and count.isdecimal() and 1 <= int(number) <= int(count):
        return Shard(int(number), int(count))
    raise UsageError(
        f"--shard {text}: not a part of a suite", hint="write K/N, such as 3/16 for the third of sixteen parts"
    )


def _check_numbers(args: argparse.Namespace) -> None:
    check_counts(("-j", args.jobs), ("--limit", args.limit))
    if args.max_cost is not None and not 0.0 < args.max_cost < 1e9:
        raise UsageError(f"--max-cost {args.max_cost:g}: must be an amount of US dollars above 0")
    if args.policy and args.models:
        raise UsageError("--policy and --models name other entrants both", hint="leave one of them out")
    if args.wait is not None and not 0.0 <= args.wait < 1e5:
        raise UsageError(f"--wait {args.wait:g}: must be a number of minutes, 0 or more")
    if args.answer_s is not None and not 0.0 < args.answer_s < 1e5:
        raise UsageError(f"--answer-s {args.answer_s:g}: must be a number of seconds above 0")
    if (args.calls == "replay") != (args.calls_from is not None):
        raise UsageError(
            "--calls replay and --calls-from DIR need each other", hint="name the suite's folder to replay"
        )
    if args.calls_from is not None and not (args.calls_from / "salt").is_file():
        raise UsageError(f"--calls-from: `{args.calls_from}` is not the results folder of a suite")


# -- printed lines


def _episodes(cells: Sequence[SuiteCell], seeds: Sequence[int], shard: Shard | None) -> list[SuiteEpisode]:
    """Return the episodes to play, including those that the results folder already holds."""
    from lingjing.bench.running import WHOLE, SuiteEpisode

    part = shard or WHOLE
    return [SuiteEpisode(cell, seed) for seed in seeds for cell in cells if part.has(cell, seed)]


def _size(cells: Sequence[SuiteCell], seeds: int, shard: Shard | None) -> str:
    """Return the size in words: `2 entrants in 12 columns, 20 seeds: `, with the number of the shard."""
    entrants = len({cell.player.name for cell in cells})
    columns = len({cell.key[1:] for cell in cells})
    return (
        f"{entrants} entrant{'s' * (entrants > 1)} in {columns} column{'s' * (columns > 1)}, "
        f"{seeds} seed{'s' * (seeds > 1)}: {f'part {shard.number} of {shard.count}, ' if shard else ''}"
    )


def _difference(episodes: Sequence[SuiteEpisode]) -> str:
    """Return the smallest differences that the episodes can show, as text."""
    from collections import Counter

    from lingjing.bench.statistics import smallest_difference

    entrant = max(Counter(episode.cell.player.name for episode in episodes).values(), default=0)
    column = max(Counter(episode.cell.key for episode in episodes).values(), default=0)
    places = ((entrant, f"over the {entrant} episodes of an entrant"), (column, f"over {column} of one column"))
    points = [(smallest_difference(pairs), where) for pairs, where in places]
    shown = [f"{'none' if math.isnan(least) else f'{100 * least:.0f} points'} {where}" for least, where in points]
    return (
        f"smallest difference of two entrants' TSR that is found in four of five cases: {', '.join(shown)} "
        "(McNemar's exact test at 5 %, half of the pairs differ)"
    )


def _say_tiers(cells: Sequence[SuiteCell]) -> None:
    """Print the tier of each mission: those without tiers are played at tier 0."""
    from lingjing.bench.rows import NEVER_BY_NUMBER, tiers_in_words

    missions = [(cell.column.tier, cell.column.mission) for cell in cells]
    paper = f" ({NEVER_BY_NUMBER})" if any(tier == 0 for tier, _ in missions) else ""
    say(f"{tiers_in_words(missions)}{paper}")


def _print_cost(plan: SuitePlan, episodes: Sequence[SuiteEpisode], args: argparse.Namespace) -> None:
    """Print the expected calls, price and hours of the episodes: one line per entrant that calls models. Rows of the
    results folder replace what was measured elsewhere.
    """
    from lingjing.bench.folder import read_results
    from lingjing.bench.money import ANSWER_S, cost_lines, estimates
    from lingjing.plugins.host import PluginHost

    rows: list[SuiteRow] = []
    with suppress(UsageError):  # a folder without results, or with those of another suite
        rows = read_results(args.output) if args.output is not None else []
    answer_s = ANSWER_S if args.answer_s is None else args.answer_s
    for line in cost_lines(estimates(episodes, plan.missions, rows, PluginHost()), args.jobs, answer_s):
        say(line)


def episode_line(row: SuiteRow) -> str:
    """Return one episode's result as one line."""
    from lingjing.play.report import POLICY_FAILED

    report, condition = row.report, f", {row.condition}" if row.condition else ""
    scored = f"{report.reason}, SCR {report.scr:.2f}, {report.ticks} ticks, {row.wall_s:.0f} s"
    if report.reason == POLICY_FAILED:
        scored = f"{report.reason}: {report.detail}"
    if row.standing != "counted":
        scored = f"{report.reason} ({'to be played again' if row.standing == 'aborted' else 'lost'}): {report.detail}"
    return f"{row.entrant}, {row.column}{condition}, seed {row.seed}: {scored}"


def _bar(done: int, whole: int, countdown: Countdown) -> str:
    """Return the progress as text: `[#####.....] 10/20, 1 h 05 min and $3.20 left:`."""
    filled = round(10 * done / max(whole, 1))
    money = f" and ${countdown.left_usd:.2f}" if countdown.left_usd > 0.0 else ""
    return f"[{'#' * filled}{'.' * (10 - filled)}] {done}/{whole}, {duration(countdown.left_s)}{money} left:"


def duration(seconds: float) -> str:
    """Return a duration in words: `1 h 05 min`, `12 min`, `40 s`; `?` for nan."""
    if seconds != seconds:
        return "?"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
