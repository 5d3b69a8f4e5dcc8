"""Entry point of the command `lingjing`: find the verb, run it, return the exit code.

Only the chosen verb's module is imported, so `lingjing validate` starts without the libraries of an episode.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, NamedTuple

from lingjing.cli.process import (
    end_despite_threads,
    open_streams,
    say,
    say_error,
    silence_stdout,
)
from lingjing.collector import collector_at_rest
from lingjing.errors import ExitCode, LingjingError, UsageError
from lingjing.file_names import check_name
from lingjing.processes.signals import blocked_signals, ignore_interrupts, terminated_as_interrupted
from lingjing.refusals import refusal_of

if TYPE_CHECKING:
    import argparse

    from lingjing.cli.parser import ArgumentParser

    _Subparsers = argparse._SubParsersAction[ArgumentParser]

BROKEN_PIPE = 141
"""128 + SIGPIPE: the exit code that a shell reports for a tool that writes to a closed pipe."""


class _CommandVerb(NamedTuple):
    """A verb of the command line: the module `lingjing.cli.NAME` has `add_options` and `handler`.

    No dataclass: importing `dataclasses` takes 6 ms of every start.
    """

    name: str
    """The word on the command line, and the name of the module."""
    summary: str
    """Its line in `lingjing --help`."""
    computes: bool = False
    """True if the verb loads numerical libraries. Their threads are pinned before its module is imported."""
    is_brief: bool = False
    """True if the collector rests until the end: its first search would take a fiftieth of the whole."""


VERBS = (
    _CommandVerb("run", "play a mission to a score and a trace", computes=True),
    _CommandVerb("bench", "play a suite of many episodes; make tables of it", computes=True),
    _CommandVerb("verify", "check that traces are as they were written"),
    _CommandVerb("trace", "export a trace as CSV, Parquet or GeoJSON", computes=True),
    _CommandVerb("replay", "run traces again and compare their digests", computes=True),
    _CommandVerb("fork", "run a trace on from a boundary with a change", computes=True),
    _CommandVerb("blame", "find the decisions that lost an episode, by branches", computes=True),
    _CommandVerb("value", "measure the value of each message, by branches", computes=True),
    _CommandVerb("why", "explain the outcome of an episode"),
    _CommandVerb("shrink", "make the smallest mission that fails as a trace did", computes=True),
    _CommandVerb("view", "show an episode in the browser, or as one HTML file", computes=True),
    _CommandVerb("serve", "serve an episode to clients of AirSim's API, or to the paper's engines", computes=True),
    _CommandVerb("engine", "play our engines for a backend of the paper's protocol", computes=True),
    _CommandVerb("film", "make a film of an episode, MP4 or GIF", computes=True),
    _CommandVerb("metrics", "compute the paper's metrics of traces"),
    _CommandVerb("report", "make the paper's figures from your own runs", computes=True),
    _CommandVerb("validate", "report every error of mission files", is_brief=True),
    _CommandVerb("test", "run the expectations of missions: who wins, what is infeasible", computes=True),
    _CommandVerb("explain", "explain an error code"),
    _CommandVerb("compile", "write the typed mission graph as JSON"),
    _CommandVerb("graph", "draw the mission graph"),
    _CommandVerb("docs", "write a page that describes a mission or a library, or the language on one card"),
    _CommandVerb("fmt", "format mission files"),
    _CommandVerb("lsp", "run the language server: errors, completion and renaming in an editor"),
    _CommandVerb("scene", "build a city from a map; describe, draw or export a city; install models", computes=True),
    _CommandVerb("plugins", "list engines, policies, scenes, evaluators and models, or the options of one of them"),
    _CommandVerb("models", "list chat models; check one with a few real requests", computes=True),
    _CommandVerb("prompts", "list, show and improve the prompts of policies", computes=True),
    _CommandVerb("frames", "make labelled sets of frames; test detectors with them", computes=True),
    _CommandVerb("new", "write a policy, a mission or an engine to start from"),
    _CommandVerb("generate", "compose missions, each with a certificate that it can be won", computes=True),
    _CommandVerb("completion", "print a script that completes commands in bash, zsh or fish", computes=True),
    _CommandVerb("calls", "list and print the recorded model calls of an episode"),
    _CommandVerb("doctor", "check that this machine can play missions", computes=True),
)

_DESCRIPTION = """Missions for heterogeneous unmanned systems: write, play, score, replay.

  lingjing run ssr              play a shipped mission; see runs/ for its trace
  lingjing new mission first    write a mission of your own: first.ljs
  lingjing VERB --help          the options of a verb
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line and return the exit code. Raises `SystemExit` only from argparse (usage: 2, help: 0).

    Without `argv` this is the command of the process. It then also ends the process, even if a policy left threads
    behind.
    """
    if argv is not None:
        return _guarded(list(argv))
    open_streams()
    # pydantic searches all installed distributions for plug-ins of its own, and raises if one has broken metadata.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    arguments = sys.argv[1:]
    chosen = _chosen(arguments)
    with collector_at_rest() if chosen is not None and chosen.is_brief else nullcontext():
        code = _guarded(arguments)
        ignore_interrupts()
        return end_despite_threads(code, at_once=chosen is None or not chosen.computes)


def _guarded(arguments: list[str]) -> int:
    """Return the exit code of a command line. A failure prints one message."""
    try:
        with terminated_as_interrupted():
            try:
                _check_names(arguments)
                code = _dispatch(arguments)
            finally:
                sys.stdout.flush()  # here a closed pipe is still handled without a message, also after --help
    except KeyboardInterrupt:
        return _interrupted()
    except BrokenPipeError:
        silence_stdout()
        return BROKEN_PIPE
    except LingjingError as error:
        return _interrupted() if _was_interrupt(error) else _report(error, arguments)
    except Exception as error:  # noqa: BLE001 - what arrives here is an error of the system or a bug of this program
        if isinstance(error, OSError) and error.filename is None:
            silence_stdout()  # the disk may be full: the buffered rest must not be written again at exit
        if _was_interrupt(error):
            return _interrupted()
        refusal = refusal_of(error)
        return _bug(error, arguments) if refusal is None else _report(refusal, arguments)
    return code


def _check_names(arguments: Sequence[str]) -> None:
    """Raise `UsageError` if the name of an argument or of the working folder is not valid text, or the folder was
    removed.
    """
    for argument in arguments:
        check_name(argument, "argument")
    try:
        folder = os.getcwd()  # noqa: PTH109 - pathlib costs a tenth of the cold start
    except OSError as error:
        hint = "it was removed: change to another folder"
        raise UsageError(f"the working folder cannot be used: {error.strerror}", hint=hint) from error
    check_name(folder, "working folder")


def _interrupted() -> int:
    say("interrupted")
    return ExitCode.INTERRUPTED


def _was_interrupt(error: BaseException | None) -> bool:
    """Return whether an interrupt caused the error. A compiled module that is interrupted while it loads raises
    `ImportError`.
    """
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False


def _dispatch(arguments: list[str]) -> int:
    chosen = _chosen(arguments)
    with collector_at_rest():  # its searches would take a tenth of the start, and modules stay anyway
        parser, module = _parser_of(chosen, arguments)
        args = parser.parse_args(arguments)
    if args.version:
        return _print_version()
    if chosen is None or module is None:
        parser.print_help(sys.stderr)
        return ExitCode.USAGE
    if chosen.computes and chosen.name != "doctor":  # doctor reports the cache among its findings
        from lingjing.cli.files import check_cache

        check_cache()
    handler = vars(args).get("handler") or module.handler  # the handler of an action, or of the verb
    return int(handler(args))


def _parser_of(chosen: _CommandVerb | None, arguments: list[str]) -> tuple[ArgumentParser, ModuleType | None]:
    """Return the parser with the options of the chosen verb, and the verb's module."""
    parser, subparsers = _empty_parser()
    if chosen is not None and chosen.computes:
        from lingjing.numerics import pin

        pin()
    if chosen is not None:
        _import_msgspec()
    module = import_module(f"lingjing.cli.{chosen.name}") if chosen else None
    shown = (chosen,) if chosen is not None and arguments[0] == chosen.name else VERBS
    for verb in shown:  # if the command line begins with a verb, no message names the other verbs
        declared = subparsers.add_parser(verb.name, help=verb.summary)
        if verb is chosen and module is not None:
            declared.description = module.__doc__
            module.add_options(declared)
    return parser, module


def _import_msgspec() -> None:
    """Import msgspec without `typing_extensions`, of which it uses two names that `typing` has too.

    That module imports `inspect`, `ast` and `dis`, which take a twentieth of a cold `lingjing validate`.
    """
    modules: dict[str, ModuleType | None] = sys.modules  # type: ignore[assignment]
    hides = "typing_extensions" not in modules
    if hides:
        modules["typing_extensions"] = None  # an import of it raises `ImportError`
    try:
        with blocked_signals():  # msgspec 0.22 may crash the process later if its import is interrupted
            import_module("msgspec")
    finally:
        if hides:
            del modules["typing_extensions"]


def _empty_parser() -> tuple[ArgumentParser, _Subparsers]:
    """Return a parser without verbs, and the action that the verbs are added to."""
    from lingjing.cli.parser import ArgumentParser  # not at the top: an interrupt while argparse loads is caught here

    parser = ArgumentParser(
        prog="lingjing",
        description=_DESCRIPTION,
        epilog="exit codes: 0 done, 1 mission errors, 2 usage, 3 infrastructure abort, 70 a bug, 130 interrupted; "
        "LINGJING_TRACEBACK=1 shows the traceback of an error",
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    return parser, parser.add_subparsers(dest="verb", metavar="VERB", title="verbs", prog=parser.prog)


def complete_parser() -> ArgumentParser:
    """Return the parser with the options of every verb. It imports the modules of all verbs, which takes a second."""
    parser, subparsers = _empty_parser()
    for verb in VERBS:
        module = import_module(f"lingjing.cli.{verb.name}")
        module.add_options(subparsers.add_parser(verb.name, help=verb.summary))
    return parser


def _chosen(arguments: Sequence[str]) -> _CommandVerb | None:
    return next((verb for verb in VERBS if verb.name == _first_word(arguments)), None)


def _first_word(arguments: Sequence[str]) -> str:
    return next((argument for argument in arguments if not argument.startswith("-")), "")


def _print_version() -> int:
    import lingjing

    print(f"lingjing {lingjing.__version__}")
    return ExitCode.OK


def _report(error: LingjingError, arguments: Sequence[str]) -> int:
    from lingjing.plugins.foreign_errors import print_wanted_traceback

    if error.exit_code == ExitCode.BUG:
        return _bug(error, arguments)
    print_wanted_traceback(error)
    say_error(error)
    return error.exit_code


def _bug(error: BaseException, arguments: Sequence[str]) -> int:
    """Print one line for a bug report (version, verb, exception and its origin); return the exit code."""
    import lingjing
    from lingjing.plugins.foreign_errors import print_wanted_traceback

    print_wanted_traceback(error)
    verb = _first_word(arguments)
    say(f"bug: lingjing {lingjing.__version__} {verb}: {type(error).__name__}: {error} [{_origin(error)}]")
    say("hint: this is a bug in lingjing: please report the line above; LINGJING_TRACEBACK=1 shows the traceback")
    return ExitCode.BUG


def _origin(error: BaseException) -> str:
    trace: TracebackType | None = error.__traceback__
    place = "unknown place"
    while trace is not None:
        path = trace.tb_frame.f_code.co_filename
        place = f"{os.path.basename(os.path.dirname(path))}/{os.path.basename(path)}:{trace.tb_lineno}"  # noqa: PTH119, PTH120
        trace = trace.tb_next
    return place


if __name__ == "__main__":
    sys.exit(main())
