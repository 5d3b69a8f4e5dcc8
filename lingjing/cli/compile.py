"""`lingjing compile`: write the typed mission graph, or the mission as `.ljs` text or a `resetScenario` document."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lingjing.cli.files import read_mission, write_output
from lingjing.cli.process import say
from lingjing.errors import ErrorCollector, ExitCode, UsageError
from lingjing.mission.vocabulary import MODES

if TYPE_CHECKING:
    from lingjing.mission.model import Mission


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", metavar="FILE", help="a .ljs or .json file; - reads standard input")
    parser.add_argument("-o", "--output", metavar="OUT", help="where to write (default: standard output)")
    parser.add_argument("--emit", choices=("mission", "reset-scenario", "ljs"), default="mission", help="what to write")
    parser.add_argument("--plain", action="store_true", help="a resetScenario without the `lingjing` object")
    drawn = parser.add_argument_group("what a resetScenario document is drawn with (it holds places and no draws)")
    drawn.add_argument("--seed", metavar="N", help="the episode's seed (default 0)")
    drawn.add_argument("--mode", choices=MODES, help="communication mode (default: the mission's)")
    drawn.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="set a mission parameter")


def handler(args: argparse.Namespace) -> int:
    """Compile and write; the output appears whole or not at all."""
    if args.emit != "reset-scenario" and (args.seed or args.mode or args.set):
        raise UsageError(
            f"--emit {args.emit} holds every seed, mode and setting", hint="leave out --seed, --mode and --set"
        )
    if args.plain and args.emit != "reset-scenario":
        raise UsageError(f"--plain is for resetScenario documents, not for --emit {args.emit}")
    mission = read_mission(args.file)
    from lingjing.dsl.feasibility.providers import missing_files

    for fault in missing_files(mission):
        say(f"note: {fault.message}" + (f"; {fault.hint}" if fault.hint else ""))
    if args.emit == "mission":
        from lingjing.mission.document import encode

        text = encode(mission)
    elif args.emit == "ljs":
        text = _ljs(mission)
    else:
        text = _reset_scenario(mission, args)
    write_output(text, args.output, [args.file])
    return ExitCode.OK


def _reset_scenario(mission: Mission, args: argparse.Namespace) -> str:
    from lingjing.cli.arguments import parse_pairs, parse_seed, parse_settings
    from lingjing.mission.reset.emit import emit

    if mission.origin.document and (args.seed or args.mode or args.set):
        raise UsageError(
            "a resetScenario document is given back as it is: nothing is left to draw",
            hint=f"compile the mission itself: lingjing compile {mission.name} --emit reset-scenario --seed …",
        )
    errors = ErrorCollector()
    settings = parse_settings(parse_pairs("--set", args.set, errors), mission, errors)
    seed = errors.attempt(lambda: parse_seed(args.seed or "0"), 0)
    errors.check()
    text = emit(mission, seed=seed, mode=args.mode, settings=settings, plain=args.plain)
    if mission.origin.document not in ("", text):
        say("note: the object 'lingjing' was added, which names the template; --plain leaves it out")
    return text


def _ljs(mission: Mission) -> str:
    """The mission's text, and a note for whatever it does not say."""
    from lingjing.dsl.printing.printer import round_trip_losses, to_ljs

    text = to_ljs(mission)
    for place in round_trip_losses(mission, text):
        say(f"note: {place} has no place in .ljs text and is left out")
    return text
