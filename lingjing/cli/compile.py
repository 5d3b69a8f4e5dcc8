"""`lingjing compile`: write the mission as JSON, GraphML, `.ljs` text or a `resetScenario` document."""

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
    parser.add_argument(
        "--emit", choices=("mission", "reset-scenario", "ljs", "graphml"), default="mission", help="what to write"
    )
    parser.add_argument("--plain", action="store_true", help="write a resetScenario without the `lingjing` object")
    drawn = parser.add_argument_group(
        "the draw of a resetScenario document (it holds drawn positions, no distributions)"
    )
    drawn.add_argument("--seed", metavar="N", help="the episode's seed (default 0)")
    drawn.add_argument("--mode", choices=MODES, help="communication mode (default: the mission's)")
    drawn.add_argument("--tier", metavar="N", help="tier of difficulty (default 0)")
    drawn.add_argument("--set", metavar="NAME=VALUE", action="append", default=[], help="set a mission parameter")


def handler(args: argparse.Namespace) -> int:
    """Compile and write; the output file is complete or absent."""
    if args.emit != "reset-scenario" and (args.seed or args.mode or args.tier or args.set):
        raise UsageError(
            f"--emit {args.emit} covers every seed, mode, tier and setting",
            hint="remove --seed, --mode, --tier and --set",
        )
    if args.plain and args.emit != "reset-scenario":
        raise UsageError(f"--plain is for resetScenario documents, not for --emit {args.emit}")
    mission = read_mission(args.file)
    from lingjing.dsl.feasibility.providers import missing_files

    for missing in missing_files(mission):
        say(f"note: {missing.message}" + (f"; {missing.hint}" if missing.hint else ""))
    if args.emit == "mission":
        from lingjing.mission.document import encode

        text = encode(mission)
    elif args.emit == "ljs":
        text = _ljs(mission)
    elif args.emit == "graphml":
        from lingjing.mission.draw.graphml import graphml
        from lingjing.mission.graph.exchange import exchange

        text = graphml(exchange(mission))
    else:
        text = _reset_scenario(mission, args)
    write_output(text, args.output, [args.file])
    return ExitCode.OK


def _reset_scenario(mission: Mission, args: argparse.Namespace) -> str:
    from lingjing.cli.arguments import parse_pairs, parse_seed, parse_settings, parse_tier
    from lingjing.mission.instantiate import choose_mode
    from lingjing.mission.reset.emit import emit
    from lingjing.mission.tiers import with_tier

    if mission.origin.document and (args.seed or args.mode or args.tier or args.set):
        raise UsageError(
            "a resetScenario document is written unchanged: it has nothing left to draw",
            hint=f"compile the mission itself: lingjing compile {mission.name} --emit reset-scenario --seed …",
        )
    errors = ErrorCollector()
    settings = parse_settings(parse_pairs("--set", args.set, errors), mission, errors)
    seed = errors.attempt(lambda: parse_seed(args.seed or "0"), 0)
    tier = errors.attempt(lambda: parse_tier(args.tier or "0"), 0)
    errors.check()
    if tier:
        settings = with_tier(mission, tier, choose_mode(mission, args.mode), settings)
    text = emit(mission, seed=seed, mode=args.mode, settings=settings, plain=args.plain)
    if mission.origin.document not in ("", text):
        say("note: the object 'lingjing' was added, which names the template; --plain omits it")
    return text


def _ljs(mission: Mission) -> str:
    """Return the mission as `.ljs` text, and print a note for each part that the text cannot express."""
    from lingjing.dsl.printing.printer import round_trip_losses, to_ljs

    text = to_ljs(mission)
    for place in round_trip_losses(mission, text):
        say(f"note: {place} cannot be written in .ljs and is left out")
    return text
