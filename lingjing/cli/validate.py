"""`lingjing validate`: report every error of mission files in one run, and apply fixes."""

from __future__ import annotations

import argparse
import gc
import os
import sys
from typing import TYPE_CHECKING, NamedTuple

from lingjing.cli.arguments import parse_seeds
from lingjing.cli.process import say_error
from lingjing.collector import collector_at_work
from lingjing.errors import ExitCode, MissionError, UsageError, hint_of
from lingjing.terminal import visible, write_data, write_styled

if TYPE_CHECKING:
    from lingjing.dsl import Compilation
    from lingjing.dsl.source.text import SourceText
    from lingjing.mission.diagnostics import Diagnostic, Span
    from lingjing.mission.model import Mission

_COLLECTED_FILES = 16
"""Files after which the collector, which rests otherwise, runs once (chosen)."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("files", metavar="FILE", nargs="+", help="a .ljs or .json file; - reads standard input")
    parser.add_argument(
        "--output-format", choices=("text", "json", "sarif"), default="text", help="output format (default: text)"
    )
    parser.add_argument("--fix", action="store_true", help="apply the safe fixes to the files")
    parser.add_argument(
        "--unsafe-fixes", action="store_true", help="apply safe and likely fixes (without --fix too); review them"
    )
    parser.add_argument("--diff", action="store_true", help="print the changes of --fix, and write nothing")
    parser.add_argument(
        "--deep", action="store_true", help="also build the city and place everything, for the seeds of --seeds"
    )
    parser.add_argument("--seeds", metavar="A-B", help="the seeds of --deep (default: 0-9)")
    parser.add_argument("--no-cache", action="store_true", help="compile files again that are cached as valid")


class _Checked(NamedTuple):
    """The result of one file."""

    diagnostics: tuple[Diagnostic, ...]
    """Errors and warnings, in order."""
    shown: str
    """Text for standard output; empty for JSON and SARIF."""


def handler(args: argparse.Namespace) -> int:
    """Check the files. Exit codes: 0 all are valid, 1 a file has errors, 2 a file cannot be read (the others are
    checked).
    """
    if args.seeds is not None and not args.deep:
        raise UsageError("--seeds selects the instances of --deep", hint="add --deep")
    seeds = parse_seeds(args.seeds or "0-9") if args.deep else ()
    diagnostics: list[Diagnostic] = []
    unreadable = wrong = 0
    for number, path in enumerate(args.files, 1):
        if number % _COLLECTED_FILES == 0:
            gc.collect()
        try:
            checked = _check(path, args)
            if seeds and not any(item.severity == "error" for item in checked.diagnostics):
                with collector_at_work():
                    checked = _deep(path, args, seeds, checked)
        except UsageError as error:
            unreadable += 1
            say_error(error)
            continue
        except MissionError as error:
            wrong += 1
            if args.output_format == "text":
                say_error(error)
            else:
                diagnostics.extend(_as_diagnostics(error, path))
            continue
        diagnostics.extend(checked.diagnostics)
        if args.diff or (_fixes(args) and path == "-"):
            write_data(checked.shown)
        else:
            write_styled(sys.stdout, checked.shown)
    return _conclude(args, diagnostics, unreadable=unreadable, wrong=wrong)


def _conclude(args: argparse.Namespace, diagnostics: list[Diagnostic], *, unreadable: int, wrong: int) -> int:
    errors = any(item.severity == "error" for item in diagnostics)
    if args.output_format == "json":
        from lingjing.dsl.diagnostics.render import render_json

        sys.stdout.write(render_json(diagnostics))
    elif args.output_format == "sarif":
        import lingjing
        from lingjing.dsl.diagnostics.sarif import render_sarif

        sys.stdout.write(render_sarif(diagnostics, lingjing.__version__))
    elif errors:
        from lingjing.dsl.diagnostics.render import conclusion

        # a text or patch on standard output must not contain the summary
        data = args.diff or (_fixes(args) and "-" in args.files)
        print(conclusion(diagnostics), file=sys.stderr if data else sys.stdout)
    elif sys.stdout.isatty() and not unreadable and not wrong:
        print(_summary_of_valid(args.files, diagnostics))
    if unreadable:
        return ExitCode.USAGE
    return ExitCode.MISSION if wrong or errors else ExitCode.OK


def _summary_of_valid(files: list[str], diagnostics: list[Diagnostic]) -> str:
    """Return the line for a terminal if no file has an error."""
    warnings = sum(item.severity == "warning" for item in diagnostics)
    text = f"{len(files)} files are valid" if len(files) > 1 else f"{files[0]} is valid"
    return f"{text}, with {warnings} warning{'s' * (warnings != 1)}" if warnings else text


def _check(path: str, args: argparse.Namespace) -> _Checked:
    from lingjing.dsl.loading.load import is_document, source_of
    from lingjing.dsl.loading.shipped import mission_file

    file = mission_file(path)
    if _fixes(args) and file != path and not args.diff:
        raise UsageError(
            f"`{path}` is a shipped mission, which --fix does not change", hint="copy it and name the copy"
        )
    source = source_of(file)
    as_text = args.output_format == "text"
    if is_document(source):
        return _check_document(source, as_text=as_text)
    if _fixes(args) or args.diff:
        return _fix(file, source, args)
    if not args.no_cache:
        from lingjing.dsl.loading.cache import cached_warnings

        diagnostics = cached_warnings(source)
        if diagnostics is not None:
            return _Checked(diagnostics, _text(diagnostics, source) if as_text else "")
    compilation = _compile(source)
    if not args.no_cache:
        from lingjing.dsl.loading.cache import keep

        keep(compilation)
    return _Checked(compilation.diagnostics, _text(compilation.diagnostics, source) if as_text else "")


def _deep(path: str, args: argparse.Namespace, seeds: tuple[int, ...], checked: _Checked) -> _Checked:
    """Add the findings of the built city to the result of a file."""
    from lingjing.cli.progress import CountProgress
    from lingjing.dsl.loading.load import load_mission, source_of
    from lingjing.dsl.loading.shipped import mission_file
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.numerics import pin

    pin()
    from lingjing.play.deep_check import deep_check

    file = mission_file(path)
    mission, source = load_mission(file), source_of(file)
    with CountProgress(f"placing {mission.name}") as progress:
        findings = deep_check(mission, seeds, progress)
    refused = tuple(
        Diagnostic("LJ0211", _span(source, finding.message), f"{finding.where()}: {finding.message}", finding.hint)
        for finding in findings
        if finding.refused
    )
    notes = "".join(f"{path}: note: {item.where()}: {item.message}\n" for item in findings if not item.refused)
    if not refused and sys.stdout.isatty():
        notes += f"{path}: {len(seeds) * len(mission.modes.allowed)} instances have their places\n"
    text = visible(notes) + _text(refused, source) if args.output_format == "text" else ""
    return _Checked((*checked.diagnostics, *refused), checked.shown + text)


def _span(source: SourceText, message: str) -> Span:
    """The declaration of the first entity that the message names; the beginning of a document, or of a text without
    one."""
    from lingjing.dsl.feasibility.playability import declaration
    from lingjing.dsl.loading.load import is_document

    place = None if is_document(source) else declaration(source, message)
    return source.span(*(place or (0, 1)))


def _check_document(source: SourceText, *, as_text: bool) -> _Checked:
    """Check a JSON document: its notes, and errors at its first line for missing plug-ins and unwinnable missions."""
    from lingjing.cli.installed import offers
    from lingjing.dsl.feasibility.providers import missing_files, missing_providers
    from lingjing.dsl.loading.load import place_of, proofs, read_document
    from lingjing.mission.diagnostics import Diagnostic

    mission, notes = read_document(source)
    start = source.span(0, 0)
    diagnostics = [*proofs(mission, source)]
    absent = [(f"no {kind} called `{name}` is installed", "") for kind, name, _ in missing_providers(mission, offers)]
    absent += [(missing.message, missing.hint) for missing in missing_files(mission)]
    diagnostics += [Diagnostic("LJ0505", start, text, hint, severity="warning") for text, hint in absent]
    if mission.origin.places and not absent and not any(diagnostic.severity == "error" for diagnostic in diagnostics):
        try:
            notes += _displacements(mission)
        except MissionError as error:
            text = f"{place}: {error}" if (place := place_of(mission, "", str(error))) else str(error)
            diagnostics.append(Diagnostic("LJ0211", start, text, hint_of(error)))
    shown = visible("".join(f"{source.path}: note: {note}\n" for note in notes))
    return _Checked(tuple(diagnostics), shown + _text(tuple(diagnostics), source) if as_text else "")


def _displacements(mission: Mission) -> tuple[str, ...]:
    """Return notes on the places that the city moves. Raises `MissionError` if something has no place in the city."""
    from lingjing.numerics import pin

    pin()
    from lingjing.mission.instantiate import instantiate
    from lingjing.plugins.building import build_city
    from lingjing.plugins.host import PluginHost
    from lingjing.scene.anchor import anchor
    from lingjing.scene.displacement import displacements

    instance = instantiate(mission)
    placed = anchor(instance, build_city(instance.scene, PluginHost()), imported=True)
    return tuple(displacements(instance, placed, mission.origin.places))


def _fixes(args: argparse.Namespace) -> bool:
    return bool(args.fix or args.unsafe_fixes)


def _compile(source: SourceText) -> Compilation:
    from lingjing.cli.installed import offers
    from lingjing.dsl import compile_source

    return compile_source(source, offers=offers)


def _fix(path: str, source: SourceText, args: argparse.Namespace) -> _Checked:
    """Apply fixes. Messages go to standard error if standard output is data: JSON, SARIF, or the text of `-`."""
    from lingjing.dsl.diagnostics.fixes import fix_source, unified_diff, write_text
    from lingjing.dsl.loading.load import STDIN

    fixed = fix_source(source, _compile, unsafe=args.unsafe_fixes)
    left, now = fixed.compilation.diagnostics, fixed.compilation.source
    messages = visible(
        "".join(f"{source.path}:{item.line}: fixed {item.code}: {item.title}\n" for item in fixed.applied)
    )
    if args.diff:
        shown, left = unified_diff(source.text, fixed.text, source.path), _compile(source).diagnostics
    elif path == STDIN:
        shown = fixed.text
        write_styled(sys.stderr, messages + _text(left, now))
    else:
        if fixed.text != source.text:
            write_text(path, fixed.text)
        shown = messages + _text(left, now)
    if args.output_format == "text":
        return _Checked(left, shown)
    sys.stderr.write(messages)
    return _Checked(left, "")


def _text(diagnostics: tuple[Diagnostic, ...], source: SourceText) -> str:
    if not diagnostics:
        return ""
    from lingjing.dsl.diagnostics.render import render_text

    color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    return render_text(diagnostics, source, color=color)


def _as_diagnostics(error: MissionError, path: str) -> tuple[Diagnostic, ...]:
    """Return the errors of an invalid document for JSON and SARIF, all at its first line: they carry no line
    numbers.
    """
    from lingjing.mission.diagnostics import Diagnostic, Span
    from lingjing.mission.faults import lines_of

    start = Span(path, 0, 0, 1, 1, 1, 1)
    faults = [(lines_of([fault]), fault.hint) for fault in error.faults]
    return tuple(Diagnostic("LJ0009", start, text, hint) for text, hint in faults or [(str(error), hint_of(error))])
