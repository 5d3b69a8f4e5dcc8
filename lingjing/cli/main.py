"""Entry point of the command `lingjing`: pick the verb, run it, answer with an exit code.

Only the chosen verb's module is imported, so that `lingjing validate` starts without anything an episode needs.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from types import TracebackType
from typing import NamedTuple

from lingjing.cli.process import deaf, endable, leave, open_streams, say, say_error, silence_stdout
from lingjing.errors import ExitCode, LingjingError, UsageError
from lingjing.file_names import check_name
from lingjing.refusals import refusal_of
from lingjing.signals import blocked_signals

BROKEN_PIPE = 141
"""128 + SIGPIPE: what a shell reports for any tool whose reader went away."""


class CommandVerb(NamedTuple):
    """A verb of the command line: `lingjing.cli.NAME` has `add_options` and `handler`; `summary` is its line in the
    help. One that `computes` loads numerical libraries, which are pinned before its module is imported.

    No dataclass: that module costs 6 ms of every start.
    """

    name: str
    summary: str
    computes: bool = False


VERBS = (
    CommandVerb("run", "play a mission to a score and a trace", computes=True),
    CommandVerb("bench", "play a suite of many episodes; make tables of it", computes=True),
    CommandVerb("verify", "say whether traces are what was written"),
    CommandVerb("replay", "run traces again and confirm their digests", computes=True),
    CommandVerb("fork", "run a trace on with something changed", computes=True),
    CommandVerb("blame", "find what lost an episode by branches of it", computes=True),
    CommandVerb("value", "find what each message was worth by branches", computes=True),
    CommandVerb("why", "say why an episode ended as it did"),
    CommandVerb("shrink", "make the smallest mission that fails as a trace did", computes=True),
    CommandVerb("view", "show an episode in the browser, or as one HTML file", computes=True),
    CommandVerb("film", "make a film of an episode, MP4 or GIF", computes=True),
    CommandVerb("metrics", "compute the paper's metrics of traces"),
    CommandVerb("report", "make the paper's figures of one's own runs", computes=True),
    CommandVerb("validate", "report every error of mission files"),
    CommandVerb("explain", "say what an error code means"),
    CommandVerb("compile", "write the typed mission graph as JSON"),
    CommandVerb("graph", "draw the mission graph"),
    CommandVerb("docs", "write a page that says what a mission is"),
    CommandVerb("fmt", "lay mission files out the one way"),
    CommandVerb("lsp", "serve an editor: errors, completion, renaming as you type"),
    CommandVerb("scene", "build a city from a map; look at one", computes=True),
    CommandVerb("plugins", "list engines, policies, scenes and evaluators; the options of one"),
    CommandVerb("prompts", "list, show and improve the prompts of policies", computes=True),
    CommandVerb("frames", "make labelled sets of frames; probe detectors with them", computes=True),
    CommandVerb("new", "write a file to start from"),
    CommandVerb("calls", "list and read what an episode's policies asked chat models"),
    CommandVerb("doctor", "check that this machine can play missions", computes=True),
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line; returns the exit code. `SystemExit` comes only from argparse (usage: 2, help: 0).

    Without `argv` this is the command of the process: it then also ends it, whatever threads a policy left behind.
    """
    if argv is not None:
        return _guarded(list(argv))
    open_streams()
    # pydantic asks all installed distributions for plug-ins of its own, and raises where one's metadata is broken.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    code = _guarded(sys.argv[1:])
    deaf()
    return leave(code)


def _guarded(arguments: list[str]) -> int:
    """The exit code of a command line, with one message where it fails."""
    try:
        with endable():
            try:
                _check_names(arguments)
                code = _dispatch(arguments)
            finally:
                sys.stdout.flush()  # here, where a closed pipe can still be met quietly, also after --help
    except KeyboardInterrupt:
        return _interrupted()
    except BrokenPipeError:
        silence_stdout()
        return BROKEN_PIPE
    except LingjingError as error:
        return _interrupted() if _was_interrupt(error) else _report(error, arguments)
    except Exception as error:  # noqa: BLE001 - whatever comes here is a refusal of the system's or a fault of ours
        if isinstance(error, OSError) and error.filename is None:
            silence_stdout()  # it may be full: what it still holds must not be tried again at the end
        if _was_interrupt(error):
            return _interrupted()
        refusal = refusal_of(error)
        return _bug(error, arguments) if refusal is None else _report(refusal, arguments)
    return code


def _check_names(arguments: Sequence[str]) -> None:
    """Raise `UsageError` for an argument or a working folder whose name is not text, or a folder that was removed."""
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
    """Whether an interrupt led to an error: a compiled module that is interrupted while it loads says `ImportError`."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        if isinstance(error, KeyboardInterrupt):
            return True
        seen.add(id(error))
        error = error.__cause__ or error.__context__
    return False


def _dispatch(arguments: list[str]) -> int:
    from lingjing.cli.parser import ArgumentParser  # not above: an interrupt while argparse loads is met here

    chosen = next((verb for verb in VERBS if verb.name == _first_word(arguments)), None)
    parser = ArgumentParser(
        prog="lingjing",
        description="Missions for heterogeneous unmanned systems: write, play, score, replay.",
        epilog="exit codes: 0 done, 1 mission errors, 2 usage, 3 infrastructure abort, 70 a bug, 130 interrupted",
    )
    parser.add_argument("--version", action="store_true", help="print the version and stop")
    subparsers = parser.add_subparsers(dest="verb", metavar="VERB", title="verbs", prog=parser.prog)
    if chosen is not None and chosen.computes:
        from lingjing.numerics import pin

        pin()
    if chosen is not None:
        with blocked_signals():  # interrupted while it loads, msgspec 0.22 may crash the process where it is used
            import_module("msgspec")
    module = import_module(f"lingjing.cli.{chosen.name}") if chosen else None
    shown = (chosen,) if chosen is not None and arguments[0] == chosen.name else VERBS
    for verb in shown:  # where a verb comes first, nothing that is printed names the others
        declared = subparsers.add_parser(verb.name, help=verb.summary)
        if verb is chosen and module is not None:
            declared.description = module.__doc__
            module.add_options(declared)
    args = parser.parse_args(arguments)
    if args.version:
        return _print_version()
    if module is None:
        parser.print_help(sys.stderr)
        return ExitCode.USAGE
    if chosen is not None and chosen.computes and chosen.name != "doctor":  # which tells it among its findings
        from lingjing.cli.files import check_cache

        check_cache()
    handler = vars(args).get("handler") or module.handler  # an action's, or the verb's
    return int(handler(args))


def _first_word(arguments: Sequence[str]) -> str:
    return next((argument for argument in arguments if not argument.startswith("-")), "")


def _print_version() -> int:
    import lingjing

    print(f"lingjing {lingjing.__version__}")
    return ExitCode.OK


def _report(error: LingjingError, arguments: Sequence[str]) -> int:
    if _wants_traceback():
        _print_traceback(error)
    if error.exit_code == ExitCode.BUG:
        return _bug(error, arguments)
    say_error(error)
    return error.exit_code


def _bug(error: BaseException, arguments: Sequence[str]) -> int:
    """One line that can be pasted into a report: version, verb, exception and where it was raised."""
    if _wants_traceback():
        _print_traceback(error)
    import lingjing

    verb = _first_word(arguments)
    say(f"bug: lingjing {lingjing.__version__} {verb}: {type(error).__name__}: {error} [{_origin(error)}]")
    say("hint: please report the line above; LINGJING_TRACEBACK=1 shows the traceback")
    return ExitCode.BUG


def _origin(error: BaseException) -> str:
    trace: TracebackType | None = error.__traceback__
    place = "unknown place"
    while trace is not None:
        path = trace.tb_frame.f_code.co_filename
        place = f"{os.path.basename(os.path.dirname(path))}/{os.path.basename(path)}:{trace.tb_lineno}"  # noqa: PTH119, PTH120
        trace = trace.tb_next
    return place


def _wants_traceback() -> bool:
    return os.environ.get("LINGJING_TRACEBACK", "") not in {"", "0"}


def _print_traceback(error: BaseException) -> None:
    import traceback

    traceback.print_exception(error)


if __name__ == "__main__":
    sys.exit(main())
