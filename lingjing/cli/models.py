"""`lingjing models`: list the chat models that are known by name; check one with a real request in each column."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from lingjing.cli.arguments import parse_amount, parse_pairs
from lingjing.cli.files import print_columns
from lingjing.cli.parser import ArgumentParser
from lingjing.cli.process import say
from lingjing.errors import ExitCode, UsageError
from lingjing.suggest import did_you_mean

UNKNOWN_TOKENS = 4096
"""The tokens of a full picture of a model without a rule for pictures (`lingjing_agents.llm.models`)."""


def add_options(parser: ArgumentParser) -> None:
    """Declare the actions."""
    actions = parser.add_subparsers(dest="action", metavar="ACTION", title="actions", required=True)
    listed = actions.add_parser("list", help="list the models that are known by name", description=_list.__doc__)
    listed.set_defaults(handler=_list)
    check = actions.add_parser("check", help="check a model with a few real requests", description=_check.__doc__)
    check.add_argument("model", metavar="NAME", help="a known model, or any name with --policy-arg base_url=URL")
    check.add_argument("--columns", metavar="COLUMN", nargs="+", help="such as ssr-star (default: all twelve)")
    check.add_argument("--language", metavar="CODE", default="en", help="language of the requests: en (default), zh, …")
    check.add_argument("--policy-arg", metavar="K=V", action="append", default=[], help="an option of `react`")
    check.add_argument("--max-cost", metavar="USD", help="the greatest cost of one column's request")
    check.set_defaults(handler=_check)


def _list(args: argparse.Namespace) -> int:
    """Print the known models with their price and the tokens of a picture."""
    from lingjing.plugins.host import PluginHost

    rows = [("model", "USD per million in", "out", "tokens of a picture", "about")]
    for model in PluginHost().models.values():
        price_in, price_out = ("-" if price is None else f"{price:g}" for price in (model.price_in, model.price_out))
        rows.append((model.name, price_in, price_out, str(model.image_tokens), model.summary))
    print_columns(rows)
    return ExitCode.OK


def _check(args: argparse.Namespace) -> int:
    """Make one real request in each column and two about a drawn picture, and print tokens, compliance with the
    contract of answers, the convention of boxes, and prices. The calls may cost money.
    """
    from lingjing.bench.columns import Column, columns
    from lingjing.bench.model_check import check_column, check_picture, lines_of
    from lingjing.bench.suite import find_suite, read_document
    from lingjing.dsl.loading.load import load_mission
    from lingjing.dsl.loading.shipped import find_mission
    from lingjing.mission.languages import check_written, in_language
    from lingjing.mission.tiers import USUAL, tiers_of
    from lingjing.plugins.host import PluginHost

    check_written(args.language)
    models = PluginHost().models
    arguments = {**parse_pairs("--policy-arg", args.policy_arg), "model": args.model}
    if args.model not in models and not {"base_url", "base_url_env", "models", "client"} & {*arguments}:
        hint = did_you_mean(args.model, models, "models") or "give its address: --policy-arg base_url=URL"
        raise UsageError(f"there is no model `{args.model}`", hint=hint)
    missions = [Path(find_mission(name)) for name in read_document(find_suite("main"))["missions"]]
    loaded = [in_language(load_mission(path), args.language) for path in missions]
    tiers = {mission.name: USUAL for mission in loaded if USUAL in tiers_of(mission)}
    each = columns(missions, tiers=tiers, language=args.language)
    known: dict[str, Column] = {f"{column.mission}-{column.mode}": column for column in each}
    for name in args.columns or ():
        if name not in known:
            raise UsageError(f"there is no column `{name}`", hint=did_you_mean(name, known, "columns"))
    max_cost = parse_amount("--max-cost", args.max_cost)
    chosen = [known[name] for name in args.columns or known]
    picture = check_picture(arguments)
    if picture.failure:
        raise UsageError(f"`{args.model}` does not answer: {picture.failure}", hint="check its address, key and name")
    listed = models[args.model].image_tokens if args.model in models else None
    counted = "the service does not count" if picture.tokens is None else f"{picture.tokens:,} tokens"
    print(f"a picture of 1920 x 1080: {counted}{'' if listed is None else f' (the list says {listed:,})'}")
    if listed in (None, UNKNOWN_TOKENS):
        say(
            f"the family of `{args.model}` is unknown: estimates count {UNKNOWN_TOKENS:,} tokens a picture; set "
            "`pictures` or `image_tokens` in a list of models of your own"
        )
    print(f"boxes: {picture.convention}")
    checks = []
    for column in chosen:
        say(f"asking in {column.name}")
        checks.append(check_column(column, arguments, max_cost))
    print_columns(list(lines_of(checks)))
    results = [check.result for check in checks if check.result is not None]
    valid = sum(not check.fault and check.result is not None and not check.result.failure for check in checks)
    cost = sum(result.cost_usd or 0.0 for result in results) + picture.cost_usd
    served = sorted({result.served for result in results if result.served})
    sys.stdout.write(f"{valid} of {len(checks)} answers satisfy the contract; ${cost:.4f} in all")
    sys.stdout.write(f"; served as {', '.join(served)}\n" if served else "\n")
    return ExitCode.OK
