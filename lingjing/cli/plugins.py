"""`lingjing plugins [NAME]`: list engines, policies, scenes, evaluators, models and detectors, or the options of
one.
"""

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
from lingjing.installed_plugins.slow_trials import forget_slow_trials
from lingjing.mission.kinds import described_by, scene_kind
from lingjing.mission.kinds_format import SceneOption
from lingjing.option_listing import OptionSpec, option_specs
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.host import MAKERS, PluginHost
from lingjing.plugins.loading import options_model
from lingjing.plugins.options import declared_model
from lingjing.plugins.policy import PolicyPlugin
from lingjing.plugins.scaffold import ScaffoldPlugin
from lingjing.suggest import nearest

if TYPE_CHECKING:
    from lingjing.play.policy_files import PolicyDeclaration

_Offered = TypeVar("_Offered")

_BROKEN = "repair or uninstall it; episodes that do not use it can be played"


class _Offer(msgspec.Struct, frozen=True, kw_only=True):
    """An installed plug-in item: one line of the list."""

    kind: str
    """Engine, policy, scene, evaluator, model, detector, backbone, scaffold or maker."""
    name: str
    source: str
    """The entry point of the plug-in, or the file of a policy."""
    notes: str = ""
    """The place of an engine, `privileged` for a policy that observes the ground truth, or the price of a model."""
    summary: str = ""
    """One line by the plug-in's author; may be empty."""
    options: tuple[OptionSpec, ...] = ()
    """The options of an item that the command line names; empty in the list of all items."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "name",
        nargs="?",
        metavar="NAME|FILE.py:CLASS",
        help="list the options of the item with this name (default: list all items)",
    )
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print the list, then the error of every plug-in that does not load or fails in a hook; return 2 if there is
    one.
    """
    forget_slow_trials()
    host = PluginHost()
    faults: list[PluginError] = []
    items = tuple(offers(host, faults)) if args.name is None else tuple(_offers_called(args.name, host))
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode(items).decode() + "\n")
    elif args.name is None:
        print_columns([(item.kind, item.name, item.source, item.notes, item.summary) for item in items])
    else:
        _print_options(items)
    sys.stdout.flush()
    _report_earlier_requirements()
    if args.name is None:
        faults += [PluginError(str(fault), hint=_BROKEN) for fault in host.faults]
        faults += _faulty_descriptions()
    for error in faults:
        say_error(error)
    return ExitCode.USAGE if faults else ExitCode.OK


def offers(host: PluginHost, faults: list[PluginError]) -> Iterator[_Offer]:
    """Yield every item by kind and name. An item read from a faulty file is left out, and the error is added to
    `faults`.
    """
    for engine in host.engines.values():
        notes = f"{engine.place}, sensor" if engine.sensor else engine.place
        source = host.sources["lingjing_engines", engine.name]
        yield _Offer(kind="engine", name=engine.name, source=source, notes=notes, summary=engine.summary)
    for policy in host.policies.values():
        yield _policy_offer(policy, host.sources["lingjing_policies", policy.name])
    for scene in host.scenes.values():
        source = host.sources["lingjing_scenes", scene.name]
        yield _Offer(kind="scene", name=scene.name, source=source, summary=scene.summary)
    for evaluator in host.evaluators.values():
        source = host.sources["lingjing_evaluators", evaluator.name]
        yield _Offer(kind="evaluator", name=evaluator.name, source=source, summary=evaluator.summary)
    for model in _read(lambda: host.models, faults):
        source = host.sources["lingjing_models", model.name]
        yield _Offer(kind="model", name=model.name, source=source, notes=_price(model), summary=model.summary)
    for detector in _read(lambda: host.detectors, faults):
        source = host.sources["lingjing_detectors", detector.name]
        yield _Offer(kind="detector", name=detector.name, source=source, summary=detector.summary)
    for backbone in _read(lambda: host.backbones, faults):
        source = host.sources["lingjing_backbones", backbone.name]
        yield _Offer(kind="backbone", name=backbone.name, source=source, summary=backbone.summary)
    for scaffold in _read(lambda: host.scaffolds, faults):
        source = host.sources["lingjing_scaffolds", scaffold.name]
        yield _Offer(kind="scaffold", name=scaffold.name, source=source, summary=scaffold.summary)
    for hook in MAKERS:
        for name in host.makers(hook):
            yield _Offer(kind="maker", name=name, source=name, notes=hook, summary=f"makes or wraps by {hook}")


def _read(read: Callable[[], Mapping[str, _Offered]], faults: list[PluginError]) -> Iterable[_Offered]:
    try:
        return read().values()
    except PluginError as error:
        faults.append(error)
        return ()


def _offers_called(name: str, host: PluginHost) -> Iterator[_Offer]:
    """Yield the items called `name` (an engine and a scene may share one), or the policy of a file, with their
    options.

    Raises `UsageError` if no item has the name, and `PluginError` if items that may have it could not be read.
    """
    if name.partition(":")[0].endswith(".py"):
        from lingjing.play.policy_processes.examination import PolicyDeclarations

        with PolicyDeclarations(host) as declarations:
            declared, options = declarations.of(name), declarations.listed_options(name)
        yield _policy_offer(declared, name.partition(":")[0], options)
        return
    faults: list[PluginError] = []
    items = list(offers(host, faults))
    matches = [offer for offer in items if offer.name == name]
    if not matches and faults:
        raise faults[0]
    if not matches:
        close = nearest(name, [offer.name for offer in items])
        hint = f"did you mean `{close}`?" if close else "`lingjing plugins` lists all names"
        raise UsageError(f"no installed item is called `{name}`", hint=hint)
    for offer in matches:
        yield msgspec.structs.replace(offer, options=_options(offer, host))


def _options(offer: _Offer, host: PluginHost) -> tuple[OptionSpec, ...]:
    if offer.kind == "policy":
        return option_specs(options_model(host.policies[offer.name]))
    if offer.kind in ("model", "detector", "backbone", "maker"):
        return ()
    if offer.kind == "scene":
        kind = scene_kind(offer.name)
        return tuple(_scene_option(*item) for item in kind.options.items()) if kind is not None else ()
    declared: dict[str, Mapping[str, EnginePlugin | EvaluatorPlugin | ScaffoldPlugin]] = {
        "engine": host.engines,
        "evaluator": host.evaluators,
        "scaffold": host.scaffolds,
    }
    model = declared_model(declared[offer.kind][offer.name].options, f"{offer.kind} `{offer.name}`")
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
"""Names for the types of scene options in `lingjing.mission.kinds`."""


def _price(model: ModelPlugin) -> str:
    """Return the price in words: `open, free`; `commercial, $1.25 in and $10 out a million tokens`."""
    prices = (model.price_in, model.price_out)
    if None in prices:
        return f"{model.tier}, price unknown"
    if prices == (0.0, 0.0):
        return f"{model.tier}, free"
    return f"{model.tier}, ${model.price_in:g} in and ${model.price_out:g} out a million tokens"


def _policy_offer(
    policy: PolicyPlugin | PolicyDeclaration, source: str, options: tuple[OptionSpec, ...] = ()
) -> _Offer:
    notes = "privileged" if policy.privileged else ""
    return _Offer(kind="policy", name=policy.name, source=source, notes=notes, summary=policy.summary, options=options)


def _faulty_descriptions() -> Iterator[PluginError]:
    for point in find_entries(PLUGINS).points:
        try:
            described_by(point.name)
        except PluginError as error:
            yield error


def _report_earlier_requirements() -> None:
    from lingjing.installation import earlier_requirements

    for requirement in earlier_requirements():
        plugin = f"plug-in `{requirement.plugin}` ({requirement.owner})"
        say(f"warning: {plugin} requires `{requirement.required}` of another project")
        say(f"hint: {requirement.advice}")


def _print_options(items: Iterable[_Offer]) -> None:
    for number, offer in enumerate(items):
        print("\n" * (number > 0) + "  ".join(filter(None, (offer.kind, offer.name, offer.source, offer.notes))))
        print(offer.summary or "-")
        if offer.options:
            print_columns(
                [(f"  {option.name}", _type(option), _default(option), option.help) for option in offer.options]
            )
        else:
            print("  no options")


def _type(option: OptionSpec) -> str:
    return f"{option.type}: {option.bounds}" if option.bounds else option.type


def _default(option: OptionSpec) -> str:
    return "required" if option.required else f"default {option.default}" if option.default else ""
