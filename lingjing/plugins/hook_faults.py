"""The faults of a plug-in's hooks in words: signatures, exceptions, results, declarations.

`lingjing.plugins.host` calls the hooks with these functions. A message names the plug-in and the hook.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from typing import TypeVar

from lingjing.articles import with_article
from lingjing.errors import LingjingError, PluginError, hint_of
from lingjing.installed_plugins.discovery import TrialFault
from lingjing.plugins import hookspecs
from lingjing.plugins.backbone import BackbonePlugin
from lingjing.plugins.chat_model import ModelPlugin
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.evaluator import EvaluatorPlugin
from lingjing.plugins.foreign_errors import kind_of_value, one_line, wanted_traceback
from lingjing.plugins.frame_detector import DetectorPlugin
from lingjing.plugins.hookspecs import ScenePlugin
from lingjing.plugins.model_access import AskerPlugin
from lingjing.plugins.policy import PolicyPlugin
from lingjing.plugins.prompts import PromptPlugin
from lingjing.plugins.scaffold import ScaffoldPlugin
from lingjing.plugins.writers import WriterPlugin

ResultT = TypeVar("ResultT")

_ARGUMENTS: dict[str, tuple[str, ...]] = {
    "lingjing_engines": (),
    "lingjing_scenes": ("spec",),
    "lingjing_evaluators": ("instance",),
    "lingjing_detectors": ("options",),
    "lingjing_backbones": ("access",),
    "lingjing_askers": ("arguments", "calls"),
    "lingjing_scaffolds": ("context",),
    "lingjing_writers": ("options", "calls"),
}
"""The arguments with which the function of a declaration is called, by hook. Policies without a model of options are
called with their own parameters."""

_WITH_OPTIONS = ("lingjing_evaluators", "lingjing_scaffolds")
"""The hooks of declarations with a function that also takes the options, if the declaration names a model of them."""

DECLARATIONS: dict[str, tuple[type, str]] = {
    "lingjing_engines": (EnginePlugin, "factory"),
    "lingjing_policies": (PolicyPlugin, "factory"),
    "lingjing_scenes": (ScenePlugin, "build"),
    "lingjing_evaluators": (EvaluatorPlugin, "build"),
    "lingjing_models": (ModelPlugin, ""),
    "lingjing_prompts": (PromptPlugin, ""),
    "lingjing_detectors": (DetectorPlugin, "factory"),
    "lingjing_backbones": (BackbonePlugin, "factory"),
    "lingjing_askers": (AskerPlugin, "factory"),
    "lingjing_scaffolds": (ScaffoldPlugin, "build"),
    "lingjing_writers": (WriterPlugin, "factory"),
}
"""The declaration that each offering hook returns, and its field with the function that makes the object; "" without
one."""

_SHOWN = 80
"""The most characters of an object that a message shows. Chosen."""

_MOST_TRACEBACK = 4000
"""The most characters of a traceback that a fault keeps, from its end. Chosen: results of trials are passed to child
processes in an environment variable."""


def load_fault(error: BaseException) -> TrialFault:
    """Return the fault of a plug-in that does not load."""
    hint = hint_of(error) if isinstance(error, LingjingError) else ""
    reason = _NAMED.sub("", one_line(error))
    return TrialFault(f"does not load: {reason}", hint, end_of_traceback(error))


def end_of_traceback(error: BaseException) -> str:
    """Return the end of an exception's traceback; "" unless the user wants to see it."""
    return wanted_traceback(error)[-_MOST_TRACEBACK:]


_NAMED = re.compile(r"^plug-in `[^`]*`:? ")
"""The name of the plug-in at the beginning of a message, which `PluginFault` repeats."""

_AFTER_HOOK = re.compile(r"plug-in `.*?` failed in \w+: (.*)", re.DOTALL)


def reason_of(error: PluginError) -> str:
    """Return the part of a hook's error after the names of the plug-in and the hook."""
    match = _AFTER_HOOK.fullmatch(str(error))
    return match[1] if match else str(error)


def called_hook(hook: str, call: Callable[[], ResultT], source: str) -> ResultT:
    """Return the result of a hook. Raises `PluginError` that names the plug-in and the hook."""
    try:
        return call()
    except (Exception, SystemExit) as error:
        hint = hint_of(error) if isinstance(error, LingjingError) else ""
        reason = str(error) if isinstance(error, LingjingError) else one_line(error)
        raise PluginError(f"plug-in `{source}` failed in {hook}: {reason}", hint=hint) from error


def as_declarations(returned: object) -> object:
    """Return the declarations of a hook as a tuple; anything that is no collection of them unchanged."""
    return tuple(returned) if isinstance(returned, Iterable) and not isinstance(returned, str) else returned


def misused_hook(hook: str, returned: object, source: str) -> PluginError:
    """Return the error for a hook that returned no collection."""
    due = f"a list of {DECLARATIONS[hook][0].__name__} is due"
    hint = f"write `return (declaration,)` in {hook}"
    shown = f"the text {returned!r}" if isinstance(returned, str) else kind_of_value(returned)
    if inspect.iscoroutine(returned):
        returned.close()
        shown, hint = "a coroutine", "write `def` instead of `async def`"
    return PluginError(f"plug-in `{source}` failed in {hook}: it returned {shown}, and {due}", hint=hint)


_HOOK_OF = re.compile(r"for hook '(\w+)'")


def invalid_hook(source: str, plugin: object, error: Exception) -> PluginError:
    """Return the error for a hook that pluggy rejects (`PluginValidationError`): its last line is the reason."""
    match = _HOOK_OF.search(str(error))
    hook = match[1] if match else ""
    own, due = getattr(plugin, hook, None), getattr(hookspecs, hook, None)
    if own is None or due is None:
        return PluginError(f"plug-in `{source}`: {' '.join(str(error).split())}")
    parameters = inspect.signature(due).parameters
    unknown = [name for name in inspect.signature(own).parameters if name not in parameters]
    known = ", ".join(parameters) or "none"
    if unknown:
        problem = f"it takes {', '.join(f'`{name}`' for name in unknown)}, and the hook has the parameters: {known}"
        return _in_hook(source, hook, problem, f"write `def {hook}({', '.join(parameters)}):`, or fewer parameters")
    return _in_hook(source, hook, str(error).strip().splitlines()[-1], "see docs/plugins.md")


def _in_hook(source: str, hook: str, problem: str, hint: str) -> PluginError:
    return PluginError(f"plug-in `{source}` failed in {hook}: {problem}", hint=hint)


def check_declaration(item: object, hook: str, source: str) -> None:
    """Raise `PluginError` for an offer that is no declaration of the hook's kind with a name and a function."""
    declaration, maker = DECLARATIONS[hook]
    wrong = f"plug-in `{source}` failed in {hook}: "
    if not isinstance(item, declaration):
        shown = repr(item)
        shown = shown if len(shown) <= _SHOWN else f"{shown[:_SHOWN]}…"
        hint = f"return {with_article(declaration.__name__)} for each"
        raise PluginError(f"{wrong}it offers {shown}, which is no {declaration.__name__}", hint=hint)
    name: object = getattr(item, "name")  # noqa: B009 - of any of them
    if not isinstance(name, str) or name.split() != [name] or not name.isprintable():
        raise PluginError(
            f"{wrong}the name of {with_article(declaration.__name__)} is {name!r}", hint="names are words"
        )
    if maker and not callable(getattr(item, maker)):
        raise PluginError(f"{wrong}`{maker}` of `{name}` cannot be called")
    if maker:
        _check_arity(item, hook, f"{wrong}`{maker}` of `{name}`", getattr(item, maker))


def _check_arity(item: object, hook: str, subject: str, function: Callable[..., object]) -> None:
    """Raise `PluginError` for a function of a declaration that does not take the arguments with which it is called."""
    arguments = _arguments(item, hook)
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # a callable in C
        return
    try:
        if arguments is not None:
            signature.bind(*arguments)
    except TypeError as error:
        called = f"it is called with ({', '.join(arguments or ())})"
        hint = f"take ({', '.join(arguments or ())})"
        if hook in _WITH_OPTIONS and not getattr(item, "options", None):
            hint = f"declare `options`, the model of its options, or {hint} alone"
        parameters = ", ".join(signature.parameters)
        raise PluginError(f"{subject} takes ({parameters}), and {called}: {error}", hint=hint) from error


def _arguments(item: object, hook: str) -> tuple[str, ...] | None:
    """Return the arguments of a declaration's function; None for the own parameters of a policy."""
    has_options = bool(getattr(item, "options", None))
    if isinstance(item, PolicyPlugin):
        return ("options", "calls")[: 1 + item.calls] if has_options else None
    return (*_ARGUMENTS[hook], "options") if has_options and hook in _WITH_OPTIONS else _ARGUMENTS[hook]


__all__ = [
    "DECLARATIONS", "as_declarations", "called_hook", "check_declaration", "end_of_traceback", "invalid_hook",
    "load_fault", "misused_hook", "reason_of",
]  # fmt: skip
