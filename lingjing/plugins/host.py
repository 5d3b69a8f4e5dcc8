"""The plug-in host: an object that finds plug-ins through entry points and answers by name."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Protocol, TypeVar

import pluggy

from lingjing.errors import LingjingError, PluginError, UsageError
from lingjing.plugins import hookspecs
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.frame_detector import DetectorPlugin
from lingjing.plugins.hookspecs import ScenePlugin
from lingjing.plugins.policy import PolicyPlugin
from lingjing.plugins.prompts import PromptPlugin
from lingjing.suggest import nearest_or


class _Named(Protocol):
    @property
    def name(self) -> str: ...


NamedT = TypeVar("NamedT", bound=_Named)


_DECLARATIONS: dict[str, tuple[type, str]] = {
    "lingjing_engines": (EnginePlugin, "factory"),
    "lingjing_policies": (PolicyPlugin, "factory"),
    "lingjing_scenes": (ScenePlugin, "build"),
    "lingjing_evaluators": (EvaluatorPlugin, "build"),
    "lingjing_models": (ModelPlugin, ""),
    "lingjing_prompts": (PromptPlugin, ""),
    "lingjing_detectors": (DetectorPlugin, "factory"),
}
"""What each hook offers, and the field of it that makes the thing, if one does."""


class PluginHost:
    """Everything the installed plug-ins offer. Two plug-ins with one name are an error that names both."""

    def __init__(self, *, entry_points: bool = True, extra: Iterable[object] = ()) -> None:
        self._manager = pluggy.PluginManager("lingjing")
        self._manager.add_hookspecs(hookspecs)
        if entry_points:
            self._load_entry_points()
        for plugin in extra:
            self._manager.register(plugin)
        self.sources: dict[tuple[str, str], str] = {}
        self.engines: dict[str, EnginePlugin] = self._collect("lingjing_engines")
        self.policies: dict[str, PolicyPlugin] = self._collect("lingjing_policies")
        self.scenes: dict[str, ScenePlugin] = self._collect("lingjing_scenes")
        self.evaluators: dict[str, EvaluatorPlugin] = self._collect("lingjing_evaluators")

    @cached_property
    def models(self) -> dict[str, ModelPlugin]:
        """The chat models, by name; asked for only when somebody wants them, since their list is read from a file."""
        return self._collect("lingjing_models")

    @cached_property
    def prompts(self) -> dict[str, PromptPlugin]:
        """The policies that have prompts, by name."""
        return self._collect("lingjing_prompts")

    @cached_property
    def detectors(self) -> dict[str, DetectorPlugin]:
        """What tells whether a frame shows a target, by name."""
        return self._collect("lingjing_detectors")

    def engine(self, name: str) -> EnginePlugin:
        """The engine of that name, or a `UsageError` that lists what there is."""
        return self._get("engine", self.engines, name)

    def policy(self, name: str) -> PolicyPlugin:
        """The policy of that name, or a `UsageError` that lists what there is."""
        return self._get("policy", self.policies, name)

    def scene(self, name: str) -> ScenePlugin:
        """The scene provider of that name, or a `UsageError` that lists what there is."""
        return self._get("scene", self.scenes, name)

    def evaluator(self, name: str) -> EvaluatorPlugin:
        """The evaluator of that name, or a `UsageError` that lists what there is."""
        return self._get("evaluator", self.evaluators, name)

    def detector(self, name: str) -> DetectorPlugin:
        """The detector of that name, or a `UsageError` that lists what there is."""
        return self._get("detector", self.detectors, name)

    def _load_entry_points(self) -> None:
        try:
            self._manager.load_setuptools_entrypoints("lingjing")
        except Exception as error:
            raise PluginError(f"a plug-in could not be loaded: {error}", hint="run `lingjing plugins`") from error

    def _collect(self, hook: str) -> dict[str, NamedT]:
        found: dict[str, NamedT] = {}
        for implementation in getattr(self._manager.hook, hook).get_hookimpls():
            source = implementation.plugin_name
            offered: Iterable[NamedT] = self._call(hook, implementation.function, source)
            for item in offered:
                _check(item, hook, source)
                other = self.sources.setdefault((hook, item.name), source)
                if item.name in found:
                    raise PluginError(f"`{item.name}` is offered twice by {hook}: in `{other}` and in `{source}`")
                found[item.name] = item
        return dict(sorted(found.items()))

    def _call(self, hook: str, function: object, source: str) -> Iterable[NamedT]:
        try:
            return tuple(function())  # type: ignore[operator]
        except Exception as error:
            hint = error.hint if isinstance(error, LingjingError) else ""
            raise PluginError(f"plug-in `{source}` failed in {hook}: {error}", hint=hint) from error

    def _get(self, kind: str, table: dict[str, NamedT], name: str) -> NamedT:
        if name in table:
            return table[name]
        proposal = nearest_or(name, table, f"known: {', '.join(table) or 'none'};")
        raise UsageError(f"no {kind} is called `{name}`", hint=f"{proposal} see `lingjing plugins`")


def _check(item: object, hook: str, source: str) -> None:
    """Raise `PluginError` if what a hook returned is no declaration of the hook's kind with a name and a maker."""
    declaration, maker = _DECLARATIONS[hook]
    wrong = f"plug-in `{source}` failed in {hook}: "
    if not isinstance(item, declaration):
        raise PluginError(f"{wrong}it offers {item!r}, which is no {declaration.__name__}")
    name: object = getattr(item, "name")  # noqa: B009 - of any of them
    if not isinstance(name, str) or name.split() != [name] or not name.isprintable():
        raise PluginError(f"{wrong}it offers a {declaration.__name__} whose name is {name!r}", hint="names are words")
    if maker and not callable(getattr(item, maker)):
        raise PluginError(f"{wrong}`{maker}` of `{name}` cannot be called")


__all__ = ["PluginHost"]
