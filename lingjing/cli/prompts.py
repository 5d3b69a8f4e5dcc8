"""`lingjing prompts`: list and print the prompts of policies; revise a prompt from traces of failed episodes."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import check_counts, parse_amount, parse_pairs, parse_seeds, parse_settings, parse_tier
from lingjing.cli.files import write_output
from lingjing.cli.parser import ArgumentParser
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError
from lingjing.mission.vocabulary import MODES
from lingjing.suggest import nearest_or

if TYPE_CHECKING:
    from lingjing.mission.model import Mission
    from lingjing.play.options import PlayOptions
    from lingjing.plugins.prompts import PromptPlugin


def add_options(parser: ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    listed = actions.add_parser("list", help="list the prompts that ship", description=_list.__doc__)
    listed.set_defaults(handler=_list)
    show = actions.add_parser("show", help="print a prompt", description=_show.__doc__)
    show.add_argument("prompt", metavar="NAME", help="the name of a shipped prompt")
    show.set_defaults(handler=_show)
    better = actions.add_parser("improve", help="revise a prompt from failed traces", description=_improve.__doc__)
    better.add_argument("mission", metavar="MISSION", help="a shipped mission or an .ljs file")
    better.add_argument("-o", "--output", metavar="FILE", type=Path, required=True, help="the file for the best prompt")
    better.add_argument("--start", metavar="NAME|FILE", default="P0", help="the prompt to begin with (default P0)")
    better.add_argument("--rounds", metavar="N", type=int, default=4, help="number of revisions (default 4)")
    better.add_argument("--seeds", metavar="A-B", default="1000-1019", help="development seeds (default 1000-1019)")
    better.add_argument(
        "--held-out", metavar="A-B", default="0-199", help="seeds of the evaluation, which --seeds must not contain"
    )
    better.add_argument("--mode", choices=MODES, help="the mission's mode")
    better.add_argument("--tier", metavar="N", default="0", help="the mission's tier (default 0)")
    better.add_argument("--set", metavar="PARAM=VALUE", action="append", default=[], help="a parameter of the mission")
    better.add_argument("--policy", default="react", help="the policy of the prompt (default react)")
    better.add_argument("--policy-arg", metavar="K=V", action="append", default=[], help="an option of the policy")
    better.add_argument("--reviser-arg", metavar="K=V", action="append", default=[], help="an option of the reviser")
    better.add_argument("--max-cost", metavar="USD", help="the greatest cost of all calls of both models")
    better.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N episodes at a time")
    better.add_argument("--folder", metavar="DIR", type=Path, help="the folder of the search (default FILE.search)")
    better.set_defaults(handler=_improve)


def _list(args: argparse.Namespace) -> int:
    """List the shipped prompts, with the first words of each and the SHA-256 that traces hold."""
    import hashlib

    from lingjing.plugins.host import PluginHost

    for plugin in PluginHost().prompts.values():
        for name, text in plugin.shipped().items():
            sha256 = hashlib.sha256(text.encode()).hexdigest()
            print(f"{plugin.policy}  {name}  sha256:{sha256[:12]}  {' '.join(text.split())[:60]}…")
    return ExitCode.OK


def _show(args: argparse.Namespace) -> int:
    """Print a shipped prompt, with its placeholders."""
    from lingjing.plugins.host import PluginHost

    shipped = {name: text for plugin in PluginHost().prompts.values() for name, text in plugin.shipped().items()}
    if args.prompt not in shipped:
        hint = nearest_or(args.prompt, shipped, f"there are: {', '.join(shipped) or 'none'}")
        raise UsageError(f"there is no prompt `{args.prompt}`", hint=hint)
    sys.stdout.write(shipped[args.prompt])
    return ExitCode.OK


def _improve(args: argparse.Namespace) -> int:
    """Play a prompt on development seeds, let a second model revise it from the traces of failed episodes, keep the
    better prompt, repeat, and write the best. The same command continues an interrupted search.
    """
    from functools import partial

    from msgspec.structs import replace

    from lingjing.bench.prompt_search import PromptCandidate, PromptSearch
    from lingjing.play.options import PlayOptions, compiled
    from lingjing.plugins.calls import UnrecordedCalls

    seeds, held_out = parse_seeds(args.seeds), parse_seeds(args.held_out)
    if both := sorted(set(seeds) & set(held_out)):
        raise UsageError(
            f"development seeds must not be seeds of the evaluation, and {both[0]} is both",
            hint="name other --seeds, or other --held-out seeds",
        )
    check_counts(("--rounds", args.rounds), ("-j", args.jobs))
    plugin = _prompts_of(args.policy)
    start = _text_of(args.start, plugin)
    policy_args = parse_pairs("--policy-arg", args.policy_arg)
    options = PlayOptions(
        mission=args.mission, policy=args.policy, mode=args.mode, tier=parse_tier(args.tier),
        policy_args={**policy_args},
        max_cost=parse_amount("--max-cost", args.max_cost),
    )  # fmt: skip
    mission = compiled(options)
    options = replace(options, settings=parse_settings(parse_pairs("--set", args.set), mission))
    _check_money(options, mission, episodes=(args.rounds + 1) * len(seeds))
    reviser_args = parse_pairs("--reviser-arg", args.reviser_arg)
    plugin.reviser(reviser_args, UnrecordedCalls())  # reports wrong options before anything is played
    folder = args.folder or args.output.with_name(f"{args.output.name}.search")
    if not (parent := args.output.resolve().parent).is_dir():
        raise UsageError(f"cannot write `{args.output}`: there is no folder `{parent}`")

    def tell(candidate: PromptCandidate) -> None:
        say(f"candidate {candidate.number}: {candidate.line}")

    search = PromptSearch(
        folder, options, plugin.option, seeds, partial(plugin.reviser, reviser_args), plugin.check, args.jobs, tell
    )
    try:
        best = search.run(start, args.rounds)
    except KeyboardInterrupt:
        say("interrupted; the same command continues from here")
        raise
    write_output(best.text, str(args.output))
    print(f"candidate {best.number} is the best: {best.line}; sha256:{best.sha256}")
    return ExitCode.OK


def _check_money(options: PlayOptions, mission: Mission, episodes: int) -> None:
    """Print the expected cost if the calls cost money. Raises `UsageError` unless a limit is set."""
    from lingjing.bench.columns import Column
    from lingjing.bench.money import check_ready, cost_lines, estimates, is_paid
    from lingjing.bench.planning import Player, SuiteCell
    from lingjing.bench.running import SuiteEpisode
    from lingjing.play.policy_files import declaration_of
    from lingjing.plugins.host import PluginHost

    host = PluginHost()
    model = host.models.get(str(options.policy_args.get("model", "")))
    name = model.name if model else str(options.policy_args.get("model", options.policy))
    player = Player(name, "", options.policy, declaration_of(host.policy(options.policy)), options.policy_args, model)
    check_ready([player], options.max_cost)
    if not is_paid(player):
        return
    column = Column(Path(options.mission), mission.name, options.mode or mission.modes.default, options.settings)
    cell = SuiteCell(player, column, args=options.policy_args)
    for line in cost_lines(estimates([SuiteEpisode(cell, 0)] * episodes, {mission.name: mission}, (), host)):
        say(line)
    if options.max_cost is None:
        raise UsageError(
            "model calls cost money",
            hint="set a limit with --max-cost USD; for a server of your own use --policy-arg price_in=0 "
            "--policy-arg price_out=0, or a list with its prices: LINGJING_MODELS=FILE",
        )


def _prompts_of(policy: str) -> PromptPlugin:
    from lingjing.plugins.host import PluginHost

    known = {plugin.policy: plugin for plugin in PluginHost().prompts.values()}
    if policy not in known:
        raise UsageError(
            f"policy `{policy}` has no prompt", hint=f"policies with prompts: {', '.join(known) or 'none'}"
        )
    return known[policy]


def _text_of(name: str, plugin: PromptPlugin) -> str:
    """Return a shipped prompt by its name, or the text of a file."""
    shipped = plugin.shipped()
    if name in shipped:
        return shipped[name]
    try:
        text = Path(name).read_text(encoding="utf-8")
        plugin.check(text)
    except OSError as error:
        raise UsageError(
            f"`{name}` is neither a shipped prompt ({', '.join(shipped)}) nor a readable file: {error.strerror}"
        ) from error
    except ValueError as error:
        raise UsageError(f"`{name}` {error}") from error
    return text
