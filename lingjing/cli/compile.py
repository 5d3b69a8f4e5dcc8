"""`lingjing compile`: write the typed mission graph, or the mission as `.ljs` text or a `resetScenario` document."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.pairs import MODES
from lingjing.errors import ExitCode, UsageError
from lingjing.terminal import write_data

if TYPE_CHECKING:
    from lingjing.mission.model import Mission


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the verb and its options."""
    parser = subparsers.add_parser("compile", help="write the typed mission graph as JSON", description=__doc__)
    parser.add_argument("file", metavar="FILE", help="a .ljs or .json file; - reads standard input")
    parser.add_argument("-o", "--output", metavar="OUT", help="where to write (default: standard output)")
    parser.add_argument("--emit", choices=("mission", "reset-scenario", "ljs"), default="mission", help="what to write")
    parser.add_argument("--plain", action="store_true", help="a resetScenario without the `lingjing` object")
    drawn = parser.add_argument_group("what a resetScenario document is drawn with (it holds places and no draws)")
    drawn.add_argument("--seed", metavar="N", help="the episode's seed (default 0)")
    drawn.add_argument("--mode", choices=MODES, help="communication mode (default: the mission's)")
    drawn.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="set a mission parameter")
    parser.set_defaults(handler=handler)


def handler(args: argparse.Namespace) -> int:
    """Compile and write; the output appears whole or not at all."""
    if args.emit != "reset-scenario" and (args.seed or args.mode or args.set):
        raise UsageError(
            f"--emit {args.emit} holds every seed, mode and setting", hint="leave out --seed, --mode and --set"
        )
    if args.plain and args.emit != "reset-scenario":
        raise UsageError(f"--plain is for resetScenario documents, not for --emit {args.emit}")
    from lingjing.dsl.loading.load import load_noted

    mission, notes = load_noted(args.file)
    for note in notes:
        print(f"note: {note}", file=sys.stderr)
    if args.emit == "mission":
        from lingjing.mission.document import encode

        text = encode(mission)
    elif args.emit == "ljs":
        text = _ljs(mission)
    else:
        text = _reset_scenario(mission, args)
    if args.output in (None, "-"):
        write_data(text)
    else:
        write_whole(args.output, text)
    return ExitCode.OK


def _reset_scenario(mission: Mission, args: argparse.Namespace) -> str:
    from lingjing.cli.pairs import parse_pairs, parse_seed, parse_settings
    from lingjing.mission.reset.emit import emit

    if mission.origin.document and (args.seed or args.mode or args.set):
        raise UsageError(
            "a resetScenario document is given back as it is: nothing is left to draw",
            hint=f"compile the mission itself: lingjing compile {mission.name} --emit reset-scenario --seed …",
        )
    settings = parse_settings(parse_pairs("--set", args.set), mission)
    text = emit(mission, seed=parse_seed(args.seed or "0"), mode=args.mode, settings=settings, plain=args.plain)
    if mission.origin.document not in ("", text):
        print("note: the object 'lingjing' was added, which names the template; --plain leaves it out", file=sys.stderr)
    return text


def _ljs(mission: Mission) -> str:
    """The mission's text, and a note for whatever it does not say."""
    from lingjing.dsl.printing.printer import lost, to_ljs

    text = to_ljs(mission)
    for place in lost(mission, text):
        print(f"note: {place} has no place in .ljs text and is left out", file=sys.stderr)
    return text


def write_whole(path: str, text: str) -> None:
    """Write a file so that it is there whole or not at all; `UsageError` if it cannot be written.

    A device or a pipe gets the text itself. A link is followed.
    """
    target = Path(path).resolve()
    if target.is_dir():
        raise UsageError(f"cannot write `{path}`: it is a folder", hint="name a file")
    if target.exists() and not target.is_file():  # a device or a pipe is written to, never replaced
        with target.open("w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        return
    try:
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=".lingjing-", suffix=".part")
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="choose another place with -o") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(target)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(temporary).unlink()
        raise


def _umask() -> int:
    """The process's umask: `mkstemp` gives 0600, a written file should be as readable as any other."""
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
