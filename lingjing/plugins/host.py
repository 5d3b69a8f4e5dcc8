"""The plug-in host: the object that finds plug-ins through entry points and returns their offers by name.

An installed plug-in that does not load, or with a hook that fails, is left out and listed in `faults`: commands that do
not use it go on. A fault of a plug-in that the caller passes raises at once.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import redirect_stdout
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import pluggy

from lingjing.errors import PluginError, UsageError
from lingjing.installed_plugins.discovery import (
    InstalledPlugins,
    LoadablePlugin,
    PluginFault,
    TrialFault,
    installed_plugins,
    is_core,
)
from lingjing.installed_plugins.entry_points import label
from lingjing.plugins import hookspecs, making
from lingjing.plugins.backbone import BackbonePlugin
from lingjing.plugins.calls import ModelCalls
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.contract import version_fault
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.evaluator import Evaluator, EvaluatorPlugin
from lingjing.plugins.frame_detector import DetectorPlugin
from lingjing.plugins.hook_faults import (
    DECLARATIONS,
    as_declarations,
    called_hook,
    check_declaration,
    end_of_traceback,
    invalid_hook,
    load_fault,
    misused_hook,
    reason_of,
)
from lingjing.plugins.hookspecs import ScenePlugin
from lingjing.plugins.model_access import AskerPlugin
from lingjing.plugins.policy import Policy, PolicyPlugin
from lingjing.plugins.prompts import PromptPlugin
from lingjing.plugins.scaffold import ScaffoldPlugin
from lingjing.plugins.writers import WriterPlugin
from lingjing.suggest import nearest_or

if TYPE_CHECKING:
    from lingjing.mission.instance import Instance
    from lingjing.plugins.options import PluginOptions


class _Named(Protocol):
    @property
    def name(self) -> str: ...


NamedT = TypeVar("NamedT", bound=_Named)


HOOKS = tuple(DECLARATIONS)
"""The hooks that offer declarations. Each implementation is called alone, so that its fault is attributed to it."""

MAKERS = ("lingjing_make_policy", "lingjing_make_evaluator")
"""The hooks that make an object of a declaration. pluggy calls them: `tryfirst`, `trylast` and `wrapper` count."""

_PREFIX = "lingjing_"
"""The beginning of the name of every hook."""

_DEFAULT = "lingjing"
"""The name of the plug-in with the default implementations of `MAKERS`."""


class PluginHost:
    """All offers of the plug-ins.

    Two offers of one kind and name are an error that names both plug-ins. An installed plug-in cannot take a name of
    this project or of `extra`. `faults` are the installed plug-ins that are left out, whole or for one hook; `sources`
    is the plug-in of each hook and name.
    """

    def __init__(
        self, *, entry_points: bool = True, extra: Iterable[object] = (), only: Iterable[LoadablePlugin] = ()
    ) -> None:
        """`entry_points`: load all installed plug-ins; else those of `only`. `extra`: plug-in objects of the caller."""
        self._manager = pluggy.PluginManager("lingjing")
        self._manager.add_hookspecs(hookspecs)
        self._manager.register(making, name=_DEFAULT)
        self._order: list[str] = []
        self._strangers: dict[str, LoadablePlugin] = {}
        self._owners: dict[str, str] = {}
        self._clashes: dict[tuple[str, str], str] = {}
        self.faults: list[PluginFault] = []
        self.sources: dict[tuple[str, str], str] = {}
        installed = installed_plugins() if entry_points else InstalledPlugins((), (), ())
        self.faults += installed.faults
        chosen = tuple(only)
        own = (*(LoadablePlugin(point) for point in installed.own), *(p for p in chosen if is_core(p.point)))
        for plugin in own:
            self._load(plugin)
        for plugin_object in extra:
            self.register(plugin_object)
        for stranger in (*installed.strangers, *(p for p in chosen if not is_core(p.point))):
            self._load(stranger)
            self._strangers[stranger.point.name] = stranger
        self.engines: dict[str, EnginePlugin] = self._collect("lingjing_engines")
        self.policies: dict[str, PolicyPlugin] = self._collect("lingjing_policies")
        self.scenes: dict[str, ScenePlugin] = self._collect("lingjing_scenes")
        self.evaluators: dict[str, EvaluatorPlugin] = self._collect("lingjing_evaluators")

    @cached_property
    def models(self) -> dict[str, ModelPlugin]:
        """The chat models, by name. Collected on first use, because their list is read from a file."""
        return self._collect("lingjing_models")

    @cached_property
    def prompts(self) -> dict[str, PromptPlugin]:
        """The prompts of policies, by name."""
        return self._collect("lingjing_prompts")

    @cached_property
    def detectors(self) -> dict[str, DetectorPlugin]:
        """The detectors of targets in frames, by name."""
        return self._collect("lingjing_detectors")

    @cached_property
    def backbones(self) -> dict[str, BackbonePlugin]:
        """The chat-model backbones, by name."""
        return self._collect("lingjing_backbones")

    @cached_property
    def askers(self) -> dict[str, AskerPlugin]:
        """The accesses to models for policies of others, by name."""
        return self._collect("lingjing_askers")

    @cached_property
    def scaffolds(self) -> dict[str, ScaffoldPlugin]:
        """The agent scaffolds, by name."""
        return self._collect("lingjing_scaffolds")

    @cached_property
    def writers(self) -> dict[str, WriterPlugin]:
        """The writers of missions, by name."""
        return self._collect("lingjing_writers")

    def with_engines(self, engines: Mapping[str, EnginePlugin]) -> PluginHost:
        """Return a host with these engines in place of those of the same names, and all other offers of this one."""
        other = copy(self)
        other.engines = {**self.engines, **engines}
        return other

    def engine(self, name: str) -> EnginePlugin:
        """Return the engine of that name. Raises `UsageError` that lists the known ones."""
        return self._get("engine", "lingjing_engines", self.engines, name)

    def policy(self, name: str) -> PolicyPlugin:
        """Return the policy of that name. Raises `UsageError` that lists the known ones."""
        return self._get("policy", "lingjing_policies", self.policies, name)

    def scene(self, name: str) -> ScenePlugin:
        """Return the scene provider of that name. Raises `UsageError` that lists the known ones."""
        return self._get("scene", "lingjing_scenes", self.scenes, name)

    def evaluator(self, name: str) -> EvaluatorPlugin:
        """Return the evaluator of that name. Raises `UsageError` that lists the known ones."""
        return self._get("evaluator", "lingjing_evaluators", self.evaluators, name)

    def detector(self, name: str) -> DetectorPlugin:
        """Return the detector of that name. Raises `UsageError` that lists the known ones."""
        return self._get("detector", "lingjing_detectors", self.detectors, name)

    def backbone(self, name: str) -> BackbonePlugin:
        """Return the backbone of that name. Raises `UsageError` that lists the known ones."""
        return self._get("backbone", "lingjing_backbones", self.backbones, name)

    def scaffold(self, name: str) -> ScaffoldPlugin:
        """Return the scaffold of that name. Raises `UsageError` that lists the known ones."""
        return self._get("scaffold", "lingjing_scaffolds", self.scaffolds, name)

    def writer(self, name: str) -> WriterPlugin:
        """Return the writer of that name. Raises `UsageError` that lists the known ones."""
        return self._get("writer", "lingjing_writers", self.writers, name)

    def owner(self, hook: str, name: str) -> str:
        """Return the distribution, with its version, of the plug-in that offers `name`; without one, the plug-in's
        name."""
        source = self.sources[hook, name]
        return self._owners.get(source, source)

    def makers(self, hook: str) -> tuple[str, ...]:
        """Return the plug-ins that implement a hook of `MAKERS`, in the order in which pluggy calls them."""
        implementations = getattr(self._manager.hook, hook).get_hookimpls()
        names = [implementation.plugin_name for implementation in reversed(implementations)]
        return tuple(name for name in names if name != _DEFAULT)

    def made_by(self, hook: str) -> dict[str, str]:
        """Return the distributions of `makers`, by plug-in."""
        return {name: self._owners.get(name, name) for name in self.makers(hook)}

    def make_policy(self, declaration: PolicyPlugin, options: PluginOptions, calls: ModelCalls) -> Policy:
        """Return a policy object: that of the first plug-in that makes one, else that of its factory."""
        made: Policy = self._manager.hook.lingjing_make_policy(declaration=declaration, options=options, calls=calls)
        return made

    def make_evaluator(
        self, declaration: EvaluatorPlugin, instance: Instance, options: PluginOptions | None
    ) -> Evaluator[Any]:
        """Return an evaluator: that of the first plug-in that makes one, else that of its `build`."""
        made: Evaluator[Any] = self._manager.hook.lingjing_make_evaluator(
            declaration=declaration, instance=instance, options=options
        )
        return made

    def register(self, plugin: object, name: str | None = None) -> None:
        """Add a plug-in object. Its hooks are called when their offers are needed.

        Without a name it gets its `__name__`, else the name of its class. Raises `PluginError` if it is written for
        another version of the contract, or if a hook has another signature.
        """
        kind = type(plugin).__name__
        if name is None and not hasattr(plugin, "__name__") and not self._manager.has_plugin(kind):
            name = kind
        source = name or self._manager.get_canonical_name(plugin)
        try:
            self._manager.register(plugin, name=source)
        except pluggy.PluginValidationError as error:
            self._manager.unregister(name=source)  # the hooks before it were added
            raise invalid_hook(source, plugin, error) from error
        try:
            self._check_version(source)
            self._check_order(source)
        except BaseException:
            self._manager.unregister(name=source)
            raise
        self._order.append(source)

    def hook_fault(self, hook: str) -> TrialFault | None:
        """Call a hook of all plug-ins. Returns its fault; None if it does not fail."""
        try:
            self._collect(hook)
        except PluginError as error:
            return TrialFault(reason_of(error), error.hint, end_of_traceback(error))
        return None

    def _check_version(self, source: str) -> None:
        implementations = self._manager.hook.lingjing_api_version.get_hookimpls()
        for implementation in implementations:
            if implementation.plugin_name == source:
                written_for = called_hook("lingjing_api_version", implementation.function, source)
                fault, _, remedy = version_fault(written_for).partition(": install ")
                if fault:
                    raise PluginError(f"plug-in `{source}`: {fault}", hint=f"install {remedy}" if remedy else "")

    def _check_order(self, source: str) -> None:
        """Raise `PluginError` for an offering hook that is a wrapper: each implementation of these is called alone."""
        for hook in HOOKS:
            for implementation in getattr(self._manager.hook, hook).get_hookimpls():
                wraps = implementation.wrapper or implementation.hookwrapper
                if wraps and implementation.plugin_name == source:
                    hint = f"wrap {' or '.join(MAKERS)}, or leave `wrapper=True` out"
                    raise PluginError(f"plug-in `{source}`: {hook} cannot be wrapped", hint=hint)

    def _load(self, plugin: LoadablePlugin) -> None:
        name, owner = plugin.point.name, label(plugin.point.dist)
        self._owners[name] = owner
        try:
            with redirect_stdout(sys.stderr):  # standard output may be read by a program: `run --json`
                self.register(plugin.point.load(), name)
        except (Exception, SystemExit) as error:
            fault = load_fault(error).of(name, owner)
            if is_core(plugin.point):
                raise PluginError(str(fault), hint="install this project again") from error
            self.faults.append(fault)
            if self._manager.has_plugin(name):  # its hooks were refused after some of them had been added
                self._manager.unregister(name=name)
            return
        if not is_core(plugin.point) and (reason := self._idle_reason(name)):
            self.faults.append(PluginFault(name, owner, reason))

    def _idle_reason(self, name: str) -> str:
        """Return the reason for which a plug-in offers less than its author means; "" if it does not."""
        plugin = self._manager.get_plugin(name)
        hooked = {caller.name for caller in self._manager.get_hookcallers(plugin) or ()}
        known = {word for word in vars(hookspecs) if word.startswith(_PREFIX)}
        for word in sorted(hooked - known):
            return f"there is no hook `{word}`: {nearest_or(word, known, 'see docs/plugins.md')}"
        for word in sorted(known - hooked):
            if callable(getattr(plugin, word, None)):
                return f"`{word}` is not marked with `@hookimpl`, so that it is never called"
        return "" if hooked else "offers nothing: it has no function that is marked with `@hookimpl`"

    def _collect(self, hook: str) -> dict[str, NamedT]:
        """Return the offers of a hook by name. This project's own are collected first, then `extra`, then installed
        plug-ins of others."""
        offers: dict[str, NamedT] = {}
        hooks = getattr(self._manager.hook, hook).get_hookimpls()
        implementations = {implementation.plugin_name: implementation.function for implementation in hooks}
        for source in sorted(implementations, key=self._order.index):
            stranger = self._strangers.get(source)
            if stranger is None:
                offered: tuple[NamedT, ...] = self._offered(hook, implementations[source], source)
                for item in offered:
                    other = self.sources.setdefault((hook, item.name), source)
                    if item.name in offers:
                        raise PluginError(f"`{item.name}` is offered twice by {hook}: in `{other}` and in `{source}`")
                    offers[item.name] = item
            elif hook not in stranger.barred:
                offers |= self._offered_by(stranger, hook, implementations[source])
        return {name: offers[name] for name in sorted(offers) if (hook, name) not in self._clashes}

    def _offered_by(self, stranger: LoadablePlugin, hook: str, function: Callable[[], object]) -> dict[str, NamedT]:
        """Return the offers of another party's hook that have names of their own; faults are added to `faults`."""
        name, owner = stranger.point.name, label(stranger.point.dist)
        try:
            with redirect_stdout(sys.stderr):
                offered: tuple[NamedT, ...] = self._offered(hook, function, name)
        except PluginError as error:
            fault = TrialFault(reason_of(error), error.hint, end_of_traceback(error))
            self.faults.append(fault.of(name, owner, hook))
            return {}
        offers: dict[str, NamedT] = {}
        for item in offered:
            other = self.sources.setdefault((hook, item.name), name)
            if other == name and item.name not in offers:
                offers[item.name] = item
                continue
            clash = f"`{item.name}` is offered twice by {hook}: in `{other}` and in `{name}`"
            self.faults.append(PluginFault(name, owner, clash))
            if other in self._strangers:
                self._clashes[hook, item.name] = clash
        return offers

    def _offered(self, hook: str, function: Callable[[], object], source: str) -> tuple[NamedT, ...]:
        offered = called_hook(hook, lambda: as_declarations(function()), source)
        if not isinstance(offered, tuple):
            raise misused_hook(hook, offered, source)
        for item in offered:
            check_declaration(item, hook, source)
        return offered

    def _get(self, kind: str, hook: str, table: dict[str, NamedT], name: str) -> NamedT:
        if name in table:
            return table[name]
        if (hook, name) in self._clashes:
            raise PluginError(self._clashes[hook, name], hint="uninstall one of them")
        broken = ", ".join(dict.fromkeys(f"`{fault.plugin or fault.distribution}`" for fault in self.faults))
        listed = f"known: {', '.join(table) or 'none'}"
        if not table:  # even this project's own were not found
            listed += "; see `lingjing doctor`, which checks the installation"
        listed += f"; see `lingjing plugins`, which says why {broken} is not loaded" if broken else ""
        raise UsageError(f"no {kind} is called `{name}`", hint=nearest_or(name, table, listed))


__all__ = ["HOOKS", "MAKERS", "PluginHost"]
