"""`lingjing plugins [NAME]`: list the items of all plug-ins and the packages of types, or one item with its options."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Protocol, TypeVar

import msgspec

from lingjing.cli.files import print_columns
from lingjing.cli.process import say, say_error
from lingjing.dsl.checking.library import installed_types, known_paths
from lingjing.errors import ExitCode, PluginError, UsageError
from lingjing.installed_plugins.discovery import fault_error, installed_plugins
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


class _Described(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def summary(self) -> str: ...


_BROKEN = "repair or uninstall it; episodes that do not use it can be played"


class _Offer(msgspec.Struct, frozen=True, kw_only=True):
    """An installed plug-in item: one line of the list."""

    kind: str
    """Engine, policy, scene, evaluator, model, detector, backbone, scaffold, maker or types."""
    name: str
    source: str
    """The entry point of the plug-in, the file of a policy, or the package of types."""
    notes: str = ""
    """The place of an engine, `privileged` for a policy that observes the ground truth, the price of a model, or the
    paths of types for `use`."""
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
        help="list the items of this name or of this plug-in, with their options (default: list all items)",
    )
    parser.add_argument(
        "--output-format", choices=("text", "json"), default="text", help="output format (default: text)"
    )


def handler(args: argparse.Namespace) -> int:
    """Print the list, then the error of every plug-in with a fault, or of the plug-in that is asked for; return 2 if
    there is one.
    """
    forget_slow_trials()
    host = PluginHost()
    faults: list[PluginError] = []
    if args.name is None:
        items = tuple(offers(host, faults))
        faults += (*_faults_of(host), *_faulty_descriptions(), *_faulty_options(items, host))
    else:
        items = tuple(_offers_called(args.name, host, faults))
    if args.output_format == "json":
        sys.stdout.write(msgspec.json.encode(items).decode() + "\n")
    elif args.name is None:
        print_columns([(item.kind, item.name, item.source, item.notes, item.summary) for item in items])
    else:
        _print_options(items)
    sys.stdout.flush()
    _report_earlier_requirements()
    for error in faults:
        for note in getattr(error, "__notes__", ())[1:]:  # the first is the hint
            say(note)
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
    yield from _plain_offers("scene", "lingjing_scenes", host, host.scenes.values())
    yield from _plain_offers("evaluator", "lingjing_evaluators", host, host.evaluators.values())
    for model in _read(lambda: host.models, faults):
        source = host.sources["lingjing_models", model.name]
        yield _Offer(kind="model", name=model.name, source=source, notes=_price(model), summary=model.summary)
    yield from _plain_offers("detector", "lingjing_detectors", host, _read(lambda: host.detectors, faults))
    yield from _plain_offers("backbone", "lingjing_backbones", host, _read(lambda: host.backbones, faults))
    yield from _plain_offers("scaffold", "lingjing_scaffolds", host, _read(lambda: host.scaffolds, faults))
    yield from _plain_offers("writer", "lingjing_writers", host, _read(lambda: host.writers, faults))
    for hook in MAKERS:
        for name in host.makers(hook):
            yield _Offer(kind="maker", name=name, source=name, notes=hook, summary=f"makes or wraps by {hook}")
    yield from _types_offers(faults)


def _plain_offers(kind: str, hook: str, host: PluginHost, declared: Iterable[_Described]) -> Iterator[_Offer]:
    for item in declared:
        yield _Offer(kind=kind, name=item.name, source=host.sources[hook, item.name], summary=item.summary)


def _types_offers(faults: list[PluginError]) -> Iterator[_Offer]:
    """Yield the packages of types of installed plug-ins."""
    for name, module in installed_types():
        try:
            paths = known_paths(name)
        except PluginError as error:
            faults.append(error)
            continue
        if not paths:
            problem = f"the types `{name}`: `{module}` holds no .ljs file"
            faults.append(PluginError(problem, hint=f"add one: `use {name}.FILE {{ … }}` reads FILE.ljs"))
        else:
            summary = f"use {paths[0]} {{ … }}"
            yield _Offer(kind="types", name=name, source=module, notes=", ".join(paths), summary=summary)


def _read(read: Callable[[], Mapping[str, _Offered]], faults: list[PluginError]) -> Iterable[_Offered]:
    try:
        return read().values()
    except PluginError as error:
        faults.append(error)
        return ()


def _offers_called(name: str, host: PluginHost, faults: list[PluginError]) -> Iterator[_Offer]:
    """Yield the items called `name` (an engine and a scene may share one) and those of a plug-in `name`, or the policy
    of a file, with their options. The faults of their plug-ins are added to `faults`.

    Raises `UsageError` if no item has the name, and `PluginError` if items that may have it could not be read.
    """
    if name.partition(":")[0].endswith(".py"):
        from lingjing.play.policy_processes.examination import PolicyDeclarations

        with PolicyDeclarations(host) as declarations:
            declared, options = declarations.of(name), declarations.listed_options(name)
        yield _policy_offer(declared, name.partition(":")[0], options)
        return
    unread: list[PluginError] = []
    items = list(offers(host, unread))
    matches = [offer for offer in items if name in (offer.name, offer.source)]
    plugins = {name, *(offer.source for offer in matches)}
    faults += (*_faults_of(host, plugins), *_faulty_descriptions(plugins))
    if not matches and not faults:
        if unread:
            raise unread[0]
        close = nearest(name, [offer.name for offer in items])
        hint = f"did you mean `{close}`?" if close else "`lingjing plugins` lists all names"
        raise UsageError(f"no installed item is called `{name}`", hint=hint)
    for offer in matches:
        try:
            yield msgspec.structs.replace(offer, options=_options(offer, host))
        except PluginError as error:
            faults += [error] if str(error) not in map(str, faults) else []
            yield offer


def _options(offer: _Offer, host: PluginHost) -> tuple[OptionSpec, ...]:
    if offer.kind == "policy":
        return option_specs(options_model(host.policies[offer.name]))
    if offer.kind in ("model", "detector", "backbone", "maker", "types"):
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


def _faults_of(host: PluginHost, plugins: Collection[str] | None = None) -> Iterator[PluginError]:
    """Yield the faults that the host has found, of all plug-ins or of these."""
    for fault in host.faults:
        if plugins is None or fault.plugin in plugins:
            yield fault_error(fault, _BROKEN)


def _faulty_descriptions(plugins: Collection[str] | None = None) -> Iterator[PluginError]:
    for point in find_entries(PLUGINS).points:
        if plugins is None or point.name in plugins:
            try:
                described_by(point.name)
            except PluginError as error:
                yield error


def _faulty_options(items: Iterable[_Offer], host: PluginHost) -> Iterator[PluginError]:
    """Yield the error of each declared model of options that does not load. Those of this project are tested."""
    own = {entry.name for entry in installed_plugins().own}
    for offer in items:
        if offer.source not in own and offer.kind in ("engine", "policy", "evaluator", "scaffold"):
            try:
                _options(offer, host)
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
