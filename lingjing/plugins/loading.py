"""Policies by name or by file, and built with their options.

A policy is named `heuristic`, `./mine.py:Scout`, or `./mine.py` (if it holds one policy class).

A mistake in the author's file is reported with the file and its line, never with a traceback of ours.
"""

from __future__ import annotations

import difflib
import hashlib
import inspect
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

from lingjing.errors import LingjingError, PluginError, UsageError
from lingjing.plugins.calls import ModelCalls, UnrecordedCalls
from lingjing.plugins.host import PluginHost
from lingjing.plugins.policy import Policy, PolicyPlugin

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

ValueT = TypeVar("ValueT")

UNRECORDED = UnrecordedCalls()

_METHODS = ("reset", "act")
_START = "`lingjing new agent NAME` writes a policy to start from"


def load_policy(spec: str, host: PluginHost) -> PolicyPlugin:
    """The policy that `spec` names: an entry point's, or `FILE.py:CLASS`. Raises `UsageError`.

    A file's policy is called `FILE.py:CLASS` without its folder, so that a trace does not depend on where it lay.
    """
    path, _, name = spec.partition(":")
    if not path.endswith(".py"):
        return host.policy(spec)
    cls = _policy_class(_load_module(Path(path)), Path(path), name)
    summary = (inspect.getdoc(cls) or "").partition("\n")[0]
    return policy_of(cls, f"{Path(path).name}:{cls.__name__}", summary)


def policy_of(factory: Callable[..., Policy], name: str, summary: str = "") -> PolicyPlugin:
    """The declaration of a class or function that no plug-in declares.

    Its own attributes say what a declaration says: `privileged = True` that it wants to see the truth, `options` which
    model its options have (without one its parameters are the options), `calls = True` that it asks chat models.
    """
    own: Mapping[str, Any] = getattr(factory, "__dict__", {})
    return PolicyPlugin(
        name=name,
        factory=factory,
        privileged=bool(own.get("privileged", False)),
        summary=summary,
        options=own.get("options"),
        calls=bool(own.get("calls", False)),
    )


def options_model(plugin: PolicyPlugin) -> type[PluginOptions]:
    """The model of a policy's options: the declared one, else that of its factory's parameters."""
    from lingjing.plugins.options import declared_model, model_of_parameters

    return declared_model(plugin.options, _owner(plugin)) or model_of_parameters(plugin.factory)


def share_arguments(
    plugins: Mapping[str, PolicyPlugin], arguments: Mapping[str, ValueT], *, whole: bool = True
) -> dict[str, dict[str, ValueT]]:
    """Which of the given options each policy gets: those of its model; a policy alone gets them all.

    The policies are told apart and called by the names they were asked for with, folders and all: two files of one
    name in two folders hold two policies. Where they are not all that were asked for (`whole`), what none of them takes
    may be another's.

    Raises `UsageError` that tells every fault: of each policy's options, and what none of them takes.
    """
    from lingjing.plugins.options import option_faults, options_error, spellings, takes_any_name, unknown_option

    models = {name: options_model(plugin) for name, plugin in plugins.items()}
    taken = {name: spellings(model) for name, model in models.items()}
    shares = {
        name: {key: value for key, value in arguments.items() if takes_any_name(model) or key in taken[name]}
        for name, model in models.items()
    }
    faults = {f"policy `{name}`": option_faults(model, shares[name]) for name, model in models.items()}
    names = [name for each in taken.values() for name in each]
    strangers = [key for key in arguments if whole and not any(key in share for share in shares.values())]
    owners = f"polic{'y' if len(models) == 1 else 'ies'} {', '.join(f'`{name}`' for name in models)}"
    faults[owners] = (*faults.get(owners, ()), *(unknown_option(key, names) for key in strangers))
    if any(faults.values()):
        raise options_error(faults)
    return shares


def engine_options(
    arguments: Mapping[str, str], host: PluginHost, used: Iterable[str] = ()
) -> dict[str, dict[str, str]]:
    """The `--engine-arg` pairs by engine and option. `used` are the engines that take part: each must have been given
    what it requires. Raises `UsageError` that tells every fault."""
    declaring = [name for name in used if host.engine(name).options]
    if not arguments and not declaring:
        return {}
    from lingjing.plugins.options import shared_among_engines

    return shared_among_engines(arguments, host.engines, declaring)


def build_policy(plugin: PolicyPlugin, arguments: Mapping[str, object], calls: ModelCalls = UNRECORDED) -> Policy:
    """One policy object for one agent; `calls` keeps what it asks chat models, if it says that it does.

    Raises `UsageError` that tells every fault of its options.
    """
    from lingjing.plugins.options import given_parameters, read_options

    options = read_options(options_model(plugin), arguments, _owner(plugin))
    if plugin.calls and not plugin.options:
        raise PluginError(
            f"{_owner(plugin)} asks chat models and declares no model of its options", hint="declare both"
        )
    try:
        if not plugin.options:
            return plugin.factory(**given_parameters(options))
        return plugin.factory(options, calls) if plugin.calls else plugin.factory(options)
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        raise UsageError(
            f"{_owner(plugin)} cannot be built: {one_line(error)}", hint="check its --policy-arg and its code"
        ) from error


def _owner(plugin: PolicyPlugin) -> str:
    return f"policy `{plugin.name}`"


def _load_module(path: Path) -> ModuleType:
    if not path.is_file():
        raise UsageError(f"there is no policy file `{path}`", hint=_START)
    resolved = path.resolve()
    unique = hashlib.sha256(str(resolved).encode()).hexdigest()[:12]
    spec = spec_from_file_location(f"lingjing_policy_{path.stem}_{unique}", resolved)
    if spec is None or spec.loader is None:
        raise UsageError(f"`{path}` cannot be loaded as a Python module")
    module = module_from_spec(spec)
    if str(resolved.parent) not in sys.path:
        sys.path.append(str(resolved.parent))  # last, so that a sibling is found and nothing installed is shadowed
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        raise UsageError(f"{error.filename or path}:{error.lineno}: {error.msg}", hint="fix the policy file") from error
    except (Exception, SystemExit) as error:
        where = f"{path}:{_line_in(error, resolved)}"
        raise UsageError(f"{where}: {one_line(error)}", hint="fix the policy file") from error
    return module


def one_line(error: BaseException) -> str:
    """An exception of a stranger in one line: its type and what it says, if it can say anything."""
    try:
        text = f"{type(error).__name__}: {error}"
    except Exception:  # noqa: BLE001 - its own `__str__` may raise anything
        text = type(error).__name__
    return text.splitlines()[0].rstrip(": ").encode("utf-8", "backslashreplace").decode()


def _line_in(error: BaseException, path: Path) -> int:
    """The last line of `path` that the exception passed through; 1 if it never did."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    return lines[-1] or 1 if lines else 1


def _policy_class(module: ModuleType, path: Path, name: str) -> type:
    own = {key: value for key, value in vars(module).items() if _is_own_class(value, module)}
    if not name:
        return _only_policy(own, path)
    found = vars(module).get(name)
    if found is None:
        close = difflib.get_close_matches(name, own, n=1)
        known = f"did you mean `{close[0]}`?" if close else f"it has: {', '.join(own) or 'no classes'}"
        raise UsageError(f"`{path}` has no class `{name}`", hint=known)
    if not isinstance(found, type):
        raise UsageError(f"`{name}` in `{path}` is not a class", hint=_START)
    _check_methods(found, path)
    return found


def _is_own_class(value: object, module: ModuleType) -> bool:
    return isinstance(value, type) and value.__module__ == module.__name__


def _only_policy(own: dict[str, type], path: Path) -> type:
    policies = [cls for cls in own.values() if all(callable(getattr(cls, method, None)) for method in _METHODS)]
    if len(policies) != 1:
        names = ", ".join(cls.__name__ for cls in policies) or "none"
        hint = f"name one: {path}:CLASS; it has: {names}"
        raise UsageError(f"`{path}` does not hold exactly one policy class", hint=hint)
    _check_methods(policies[0], path)
    return policies[0]


def _check_methods(cls: type, path: Path) -> None:
    for method in _METHODS:
        function = inspect.getattr_static(cls, method, None)
        if function is None:
            raise UsageError(f"`{cls.__name__}` in `{path}` has no method `{method}`", hint=_START)
        if not inspect.iscoroutinefunction(inspect.unwrap(function)):
            raise UsageError(
                f"`{cls.__name__}.{method}` in `{path}` must be `async def {method}(…)`",
                hint="a policy's methods are coroutines, so that it may wait for a model",
            )


__all__ = [
    "build_policy", "engine_options", "load_policy", "one_line", "options_model", "policy_of", "share_arguments",
]  # fmt: skip
