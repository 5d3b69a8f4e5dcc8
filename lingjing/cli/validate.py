"""`lingjing validate`: report every error of mission files, in one run each, and mend what can only be one thing."""

from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING, NamedTuple

from lingjing.cli.process import say_error
from lingjing.errors import ExitCode, MissionError, UsageError
from lingjing.terminal import visible, write_data, write_styled

if TYPE_CHECKING:
    from lingjing.dsl import Compilation
    from lingjing.dsl.source.text import SourceText
    from lingjing.mission.diagnostics import Diagnostic
    from lingjing.mission.model import Mission


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("files", metavar="FILE", nargs="+", help="a .ljs or .json file; - reads standard input")
    parser.add_argument("--output-format", choices=("text", "json", "sarif"), default="text")
    parser.add_argument("--fix", action="store_true", help="apply the safe fixes to the files")
    parser.add_argument("--unsafe-fixes", action="store_true", help="apply the likely fixes too; look at them")
    parser.add_argument("--diff", action="store_true", help="show what --fix would change, and change nothing")
    parser.add_argument("--no-cache", action="store_true", help="compile anew even what is known to be good")


class Checked(NamedTuple):
    """One file's diagnostics and what goes to standard output for it."""

    diagnostics: tuple[Diagnostic, ...]
    shown: str


def handler(args: argparse.Namespace) -> int:
    """Check the files: 0 all are good, 1 one has errors, 2 one cannot be read (the others are still checked)."""
    found: list[Diagnostic] = []
    unreadable = wrong = 0
    for path in args.files:
        try:
            checked = _check(path, args)
        except UsageError as error:
            unreadable += 1
            say_error(error)
            continue
        except MissionError as error:
            wrong += 1
            if args.output_format == "text":
                say_error(error)
            else:
                found.extend(_as_diagnostics(error, path))
            continue
        found.extend(checked.diagnostics)
        if args.diff or (_mends(args) and path == "-"):
            write_data(checked.shown)
        else:
            write_styled(sys.stdout, checked.shown)
    return _conclude(args, found, unreadable=unreadable, wrong=wrong)


def _conclude(args: argparse.Namespace, found: list[Diagnostic], *, unreadable: int, wrong: int) -> int:
    errors = any(item.severity == "error" for item in found)
    if args.output_format == "json":
        from lingjing.dsl.diagnostics.render import render_json

        sys.stdout.write(render_json(found))
    elif args.output_format == "sarif":
        import lingjing
        from lingjing.dsl.diagnostics.sarif import render_sarif

        sys.stdout.write(render_sarif(found, lingjing.__version__))
    elif errors:
        from lingjing.dsl.diagnostics.render import conclusion

        # where standard output is a text or a patch, the summary is not part of it
        data = args.diff or (_mends(args) and "-" in args.files)
        print(conclusion(found), file=sys.stderr if data else sys.stdout)
    elif sys.stdout.isatty() and not unreadable and not wrong:
        print(_all_is_well(args.files, found))
    if unreadable:
        return ExitCode.USAGE
    return ExitCode.MISSION if wrong or errors else ExitCode.OK


def _all_is_well(files: list[str], found: list[Diagnostic]) -> str:
    """What somebody who sits at a terminal is told, so that silence need not be interpreted."""
    warnings = sum(item.severity == "warning" for item in found)
    said = f"{len(files)} files are valid" if len(files) > 1 else f"{files[0]} is valid"
    return f"{said}, with {warnings} warning{'s' * (warnings != 1)}" if warnings else said


def _check(path: str, args: argparse.Namespace) -> Checked:
    from lingjing.dsl.loading.load import is_document, source_of
    from lingjing.dsl.loading.shipped import find_mission

    found = str(find_mission(path))
    if _mends(args) and found != path and not args.diff:
        raise UsageError(f"`{path}` is a shipped mission, which is not mended", hint="copy it and name the copy")
    source = source_of(found)
    as_text = args.output_format == "text"
    if is_document(source):
        return _check_document(source, as_text=as_text)
    if _mends(args) or args.diff:
        return _fix(found, source, args)
    if not args.no_cache:
        from lingjing.dsl.loading.cache import cached_warnings

        diagnostics = cached_warnings(source)
        if diagnostics is not None:
            return Checked(diagnostics, _text(diagnostics, source) if as_text else "")
    compilation = _compile(source)
    if not args.no_cache:
        from lingjing.dsl.loading.cache import keep

        keep(compilation)
    return Checked(compilation.diagnostics, _text(compilation.diagnostics, source) if as_text else "")


def _check_document(source: SourceText, *, as_text: bool) -> Checked:
    """A JSON document: its notes, and errors for what cannot be won or is not installed, at its first line."""
    from lingjing.cli.installed import offers
    from lingjing.dsl.feasibility.providers import missing_files, missing_providers
    from lingjing.dsl.loading.load import place_of, proofs, read_document
    from lingjing.mission.diagnostics import Diagnostic

    mission, notes = read_document(source)
    start = source.span(0, 0)
    found = [*proofs(mission, source)]
    absent = [(f"no {kind} called `{name}` is installed", "") for kind, name, _ in missing_providers(mission, offers)]
    absent += [(fault.message, fault.hint) for fault in missing_files(mission)]
    found += [Diagnostic("LJ0505", start, said, hint, severity="warning") for said, hint in absent]
    if mission.origin.places and not absent and not any(one.severity == "error" for one in found):
        try:
            notes += _displacements(mission)
        except MissionError as error:
            said = f"{place}: {error}" if (place := place_of(mission, "", str(error))) else str(error)
            found.append(Diagnostic("LJ0211", start, said, error.hint))
    shown = visible("".join(f"{source.path}: note: {note}\n" for note in notes))
    return Checked(tuple(found), shown + _text(tuple(found), source) if as_text else "")


def _displacements(mission: Mission) -> tuple[str, ...]:
    """What the mission's city moves of what its document places; `MissionError` where something has no place in it."""
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


def _mends(args: argparse.Namespace) -> bool:
    return bool(args.fix or args.unsafe_fixes)


def _compile(source: SourceText) -> Compilation:
    from lingjing.cli.installed import offers
    from lingjing.dsl import compile_source

    return compile_source(source, offers=offers)


def _fix(path: str, source: SourceText, args: argparse.Namespace) -> Checked:
    """Apply fixes. What was done goes to standard error where standard output is data: JSON, SARIF, the text of `-`."""
    from lingjing.dsl.diagnostics.fixes import fix_source, unified_diff, write_text
    from lingjing.dsl.loading.load import STDIN

    fixed = fix_source(source, _compile, unsafe=args.unsafe_fixes)
    left, now = fixed.compilation.diagnostics, fixed.compilation.source
    done = visible("".join(f"{source.path}:{item.line}: fixed {item.code}: {item.title}\n" for item in fixed.applied))
    if args.diff:
        shown, left = unified_diff(source.text, fixed.text, source.path), _compile(source).diagnostics
    elif path == STDIN:
        shown = fixed.text
        write_styled(sys.stderr, done + _text(left, now))
    else:
        if fixed.text != source.text:
            write_text(path, fixed.text)
        shown = done + _text(left, now)
    if args.output_format == "text":
        return Checked(left, shown)
    sys.stderr.write(done)
    return Checked(left, "")


def _text(diagnostics: tuple[Diagnostic, ...], source: SourceText) -> str:
    if not diagnostics:
        return ""
    from lingjing.dsl.diagnostics.render import render_text

    color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    return render_text(diagnostics, source, color=color)


def _as_diagnostics(error: MissionError, path: str) -> tuple[Diagnostic, ...]:
    """A document that is no mission, for readers of JSON and SARIF: a fault has no line, so it stands at the first."""
    from lingjing.mission.diagnostics import Diagnostic, Span
    from lingjing.mission.faults import lines_of

    start = Span(path, 0, 0, 1, 1, 1, 1)
    faults = [(lines_of([one]), one.hint) for one in error.faults]
    return tuple(Diagnostic("LJ0009", start, said, hint) for said, hint in faults or [(str(error), error.hint)])
