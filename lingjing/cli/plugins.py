"""`lingjing plugins [NAME]`: which engines, policies, scenes, evaluators and models there are; the options of one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, TypeVar

import msgspec

from lingjing.cli.files import print_columns
from lingjing.cli.process import say, say_error
from lingjing.errors import ExitCode, PluginError, UsageError
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.mission.kinds import described_by, scene_kind
from lingjing.mission.kinds_format import SceneOption
from lingjing.option_listing import OptionSpec, option_specs
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import options_model
from lingjing.plugins.options import declared_model
from lingjing.plugins.policy import PolicyPlugin
from lingjing.suggest import nearest

if TYPE_CHECKING:
    from lingjing.play.policy_files import PolicyDeclaration

_Offered = TypeVar("_Offered")

_BROKEN = "mend or uninstall it; what does not use it plays without it"


class Offer(msgspec.Struct, frozen=True, kw_only=True):
    """One thing on offer: `kind` is engine, policy, scene, evaluator or model; `source` the plug-in's entry point;
    `notes` what is special about it (where an engine runs, whether a policy sees the truth, what a model costs);
    `options` are listed of one that was asked for by name."""

    kind: str
    name: str
    source: str
    notes: str = ""
    summary: str = ""
    options: tuple[OptionSpec, ...] = ()


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "name",
        nargs="?",
        metavar="NAME|FILE.py:CLASS",
        help="list the options of what is called so (default: all names)",
    )
    parser.add_argument("--output-format", choices=("text", "json"), default="text")


def handler(args: argparse.Namespace) -> int:
    """Print the list, then every plug-in that does not load or fails in a hook; 2 if there is one."""
    host = PluginHost()
    faults: list[PluginError] = []
    found = tuple(offers(host, faults)) if args.name is None else tuple(offers_called(args.name, host))
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    elif args.name is None:
        print_columns([(one.kind, one.name, one.source, one.notes, one.summary) for one in found])
    else:
        _print_options(found)
    sys.stdout.flush()
    _report_earlier_requirements()
    if args.name is None:
        faults += [PluginError(str(fault), hint=_BROKEN) for fault in host.faults]
        faults += _faulty_descriptions()
    for error in faults:
        say_error(error)
    return ExitCode.USAGE if faults else ExitCode.OK


def offers(host: PluginHost, faults: list[PluginError]) -> Iterator[Offer]:
    """Everything on offer, by kind and name. What is read from files may be faulty: it is left out and put down."""
    for engine in host.engines.values():
        notes = f"{engine.place}, sensor" if engine.sensor else engine.place
        source = host.sources["lingjing_engines", engine.name]
        yield Offer(kind="engine", name=engine.name, source=source, notes=notes, summary=engine.summary)
    for policy in host.policies.values():
        yield _policy_offer(policy, host.sources["lingjing_policies", policy.name])
    for scene in host.scenes.values():
        source = host.sources["lingjing_scenes", scene.name]
        yield Offer(kind="scene", name=scene.name, source=source, summary=scene.summary)
    for evaluator in host.evaluators.values():
        source = host.sources["lingjing_evaluators", evaluator.name]
        yield Offer(kind="evaluator", name=evaluator.name, source=source, summary=evaluator.summary)
    for model in _read(lambda: host.models, faults):
        source = host.sources["lingjing_models", model.name]
        yield Offer(kind="model", name=model.name, source=source, notes=_price(model), summary=model.summary)
    for detector in _read(lambda: host.detectors, faults):
        source = host.sources["lingjing_detectors", detector.name]
        yield Offer(kind="detector", name=detector.name, source=source, summary=detector.summary)


def _read(read: Callable[[], Mapping[str, _Offered]], faults: list[PluginError]) -> Iterable[_Offered]:
    try:
        return read().values()
    except PluginError as error:
        faults.append(error)
        return ()


def offers_called(name: str, host: PluginHost) -> Iterator[Offer]:
    """What is called `name`, an engine and a scene perhaps, or the policy in a file, with the options of each.

    Raises `UsageError` if nothing is called so, and `PluginError` if what may be called so could not be read.
    """
    if name.partition(":")[0].endswith(".py"):
        from lingjing.play.policy_processes.examination import PolicyDeclarations

        with PolicyDeclarations(host) as declarations:
            declared, options = declarations.of(name), declarations.listed_options(name)
        yield _policy_offer(declared, name.partition(":")[0], options)
        return
    faults: list[PluginError] = []
    every = list(offers(host, faults))
    found = [offer for offer in every if offer.name == name]
    if not found and faults:
        raise faults[0]
    if not found:
        close = nearest(name, [offer.name for offer in every])
        hint = f"did you mean `{close}`?" if close else "`lingjing plugins` lists all names"
        raise UsageError(f"nothing that is installed is called `{name}`", hint=hint)
    for offer in found:
        yield msgspec.structs.replace(offer, options=_options(offer, host))


def _options(offer: Offer, host: PluginHost) -> tuple[OptionSpec, ...]:
    if offer.kind == "policy":
        return option_specs(options_model(host.policies[offer.name]))
    if offer.kind in ("model", "detector"):
        return ()
    if offer.kind == "scene":
        kind = scene_kind(offer.name)
        return tuple(_scene_option(*one) for one in kind.options.items()) if kind is not None else ()
    plugin = host.engines[offer.name] if offer.kind == "engine" else host.evaluators[offer.name]
    model = declared_model(plugin.options, f"{offer.kind} `{offer.name}`")
    return option_specs(model) if model is not None else ()


def _scene_option(name: str, option: SceneOption) -> OptionSpec:
    bounds = [f"{word} {bound:g}" for word, bound in (("from", option.low), ("to", option.high)) if bound is not None]
    usual = option.default if isinstance(option.default, tuple) else (option.default,)
    return OptionSpec(
        name=name,
        type=_SCENE_TYPES[option.type],
        bounds=" ".join(bounds) or (f"{option.points} or more" if option.points else ""),
        default=" to ".join(f"{number:g}" for number in usual if number is not None),
        help=option.help,
    )


_SCENE_TYPES = {
    "text": "text", "path": "path", "number": "number", "metres": "metres", "size": "rows by columns",
    "range": "range in metres", "positions": "list of positions", "region": "region",
}  # fmt: skip
"""The types of scenes' options, as `lingjing.mission.kinds` has them, in words."""


def _price(model: ModelPlugin) -> str:
    """`open, free`; `commercial, $1.25 in and $10 out a million tokens`."""
    prices = (model.price_in, model.price_out)
    if None in prices:
        return f"{model.tier}, price not known"
    if prices == (0.0, 0.0):
        return f"{model.tier}, free"
    return f"{model.tier}, ${model.price_in:g} in and ${model.price_out:g} out a million tokens"


def _policy_offer(policy: PolicyPlugin | PolicyDeclaration, source: str, options: tuple[OptionSpec, ...] = ()) -> Offer:
    notes = "privileged" if policy.privileged else ""
    return Offer(kind="policy", name=policy.name, source=source, notes=notes, summary=policy.summary, options=options)


def _faulty_descriptions() -> Iterator[PluginError]:
    for point in find_entries(PLUGINS).points:
        try:
            described_by(point.name)
        except PluginError as error:
            yield error


def _report_earlier_requirements() -> None:
    from lingjing.installation import earlier_requirements

    for one in earlier_requirements():
        say(f"warning: plug-in `{one.plugin}` ({one.owner}) requires `{one.required}`, another party's package")
        say(f"hint: {one.advice}")


def _print_options(found: Iterable[Offer]) -> None:
    for number, offer in enumerate(found):
        print("\n" * (number > 0) + "  ".join(filter(None, (offer.kind, offer.name, offer.source, offer.notes))))
        print(offer.summary or "-")
        if offer.options:
            print_columns([(f"  {one.name}", _type(one), _default(one), one.help) for one in offer.options])
        else:
            print("  no options")


def _type(one: OptionSpec) -> str:
    return f"{one.type}: {one.bounds}" if one.bounds else one.type


def _default(one: OptionSpec) -> str:
    return "required" if one.required else f"default {one.default}" if one.default else ""
