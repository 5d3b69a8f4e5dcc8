"""Policies by name or by file: `heuristic`, `./mine.py:Scout`, or `./mine.py` if it holds one policy class."""

from __future__ import annotations

import inspect
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import msgspec

from lingjing.errors import UsageError
from lingjing.play.python_files import load_file
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import options_model, policy_of
from lingjing.plugins.policy import PolicyPlugin
from lingjing.suggest import nearest

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

_METHODS = ("reset", "act")
"""The methods of a policy (`lingjing.plugins.policy.Policy`)."""
_START = "`lingjing new agent NAME` writes a policy to start from"
"""The hint for a file that holds no policy."""


PRICE_OPTIONS = ("price_in", "price_out")
"""Options of policies that state the price of a model, US dollars per million tokens of prompt and answer."""


class PolicyDeclaration(msgspec.Struct, frozen=True, kw_only=True):
    """The part of a `PolicyPlugin` that can be sent to another process."""

    name: str
    """The policy's name."""
    privileged: bool
    """True if it receives the truth."""
    calls: bool
    """True if it calls chat models."""
    summary: str
    """One line about it."""
    options: tuple[str, ...]
    """The spellings of its options, aliases included."""
    takes_any_name: bool
    """True if it accepts options of any name."""
    prices: tuple[float | None, ...] = (None, None)
    """The defaults of its options `price_in` and `price_out`, US dollars per million tokens; None without one."""

    def takes(self, option: str) -> bool:
        """Return True if the policy has an option of this name."""
        return self.takes_any_name or option in self.options


def declaration_of(plugin: PolicyPlugin) -> PolicyDeclaration:
    """Return the declaration of a policy loaded in this process. Raises `PluginError` for a wrong model of options."""
    from lingjing.option_reading import spellings, takes_any_name

    model = options_model(plugin)
    return PolicyDeclaration(
        name=plugin.name,
        privileged=plugin.privileged,
        calls=plugin.calls,
        summary=plugin.summary,
        options=spellings(model),
        takes_any_name=takes_any_name(model),
        prices=tuple(_default_price(model, name) for name in PRICE_OPTIONS),
    )


def _default_price(model: type[PluginOptions], name: str) -> float | None:
    """Return the default of an option if it is a number."""
    field = model.model_fields.get(name)
    return float(field.default) if field is not None and isinstance(field.default, int | float) else None


def is_file(spec: str) -> bool:
    """Return True if the spec names a policy in a file."""
    return spec.partition(":")[0].endswith(".py")


def load_policy(spec: str, host: PluginHost) -> PolicyPlugin:
    """Return the policy that `spec` names: an entry point's name, or `FILE.py:CLASS`. Raises `UsageError`.

    A policy from a file is named `FILE.py:CLASS` without its folder, so that a trace does not depend on the folder.
    """
    if not is_file(spec):
        return host.policy(spec)
    path, _, name = spec.partition(":")
    cls = _policy_class(load_file(Path(path), "policy", _START), Path(path), name)
    summary = (inspect.getdoc(cls) or "").partition("\n")[0]
    return policy_of(cls, f"{Path(path).name}:{cls.__name__}", summary)


def _policy_class(module: ModuleType, path: Path, name: str) -> type:
    """Return the policy class of a module: the named one, or the only one. Raises `UsageError`."""
    own = {key: value for key, value in vars(module).items() if _is_own_class(value, module)}
    if not name:
        return _only_policy(own, path)
    policy = vars(module).get(name)
    if policy is None:
        close = nearest(name, own)
        known = f"did you mean `{close}`?" if close else f"it has: {', '.join(own) or 'no classes'}"
        raise UsageError(f"`{path}` has no class `{name}`", hint=known)
    if not isinstance(policy, type):
        raise UsageError(f"`{name}` in `{path}` is not a class", hint=_START)
    _check_methods(policy, path)
    return policy


def _is_own_class(value: object, module: ModuleType) -> bool:
    """Return True for a class that the module defines itself."""
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
    """Raise `UsageError` unless the class has the methods of a policy as coroutines."""
    for method in _METHODS:
        function = inspect.getattr_static(cls, method, None)
        if function is None:
            raise UsageError(f"`{cls.__name__}` in `{path}` has no method `{method}`", hint=_START)
        if not inspect.iscoroutinefunction(inspect.unwrap(function)):
            raise UsageError(
                f"`{cls.__name__}.{method}` in `{path}` must be `async def {method}(…)`",
                hint="a policy's methods are coroutines, so that it may wait for a model",
            )
