"""The building of policies with their options, and the declaration of policies that no plug-in declares.

A mistake in the author's code becomes an error that names the policy, without a traceback.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

from lingjing.errors import ForeignCodeError, LingjingError, PluginError
from lingjing.plugins.calls import ModelCalls, UnrecordedCalls
from lingjing.plugins.foreign_errors import one_line
from lingjing.plugins.making import lingjing_make_policy
from lingjing.plugins.policy import Policy, PolicyPlugin
from lingjing.plugins.policy_calls import BilledPolicy, PolicyCalls

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions

UNRECORDED = UnrecordedCalls()


class PolicyMaker(Protocol):
    """The part of `lingjing.plugins.host.PluginHost` that makes policies."""

    def makers(self, hook: str) -> tuple[str, ...]:
        """Return the plug-ins that implement a hook which makes objects."""
        ...

    def make_policy(self, declaration: PolicyPlugin, options: PluginOptions, calls: ModelCalls) -> Policy:
        """Return a policy object."""
        ...


def policy_of(factory: Callable[..., Policy], name: str, summary: str = "") -> PolicyPlugin:
    """Return the declaration of a class or function that no plug-in declares.

    Its attributes, inherited ones too, stand for the fields of a declaration: `privileged = True` if it receives the
    truth, `options` for the model of its options (without one its parameters are the options), `calls = True` if it
    asks chat models.
    """
    return PolicyPlugin(
        name=name,
        factory=factory,
        privileged=getattr(factory, "privileged", False) is True,
        summary=summary,
        options=getattr(factory, "options", None),
        calls=getattr(factory, "calls", False) is True,
    )


def options_model(plugin: PolicyPlugin) -> type[PluginOptions]:
    """Return the model of a policy's options: the declared one, else that of its factory's parameters."""
    from lingjing.plugins.options import declared_model, model_of_parameters

    return declared_model(plugin.options, _owner(plugin)) or model_of_parameters(plugin.factory)


def read_given_options(plugin: PolicyPlugin, arguments: Mapping[str, object]) -> PluginOptions:
    """Return the policy's options as an object of their model. Raises `UsageError` that lists every fault."""
    from lingjing.plugins.options import read_options

    return read_options(options_model(plugin), arguments, _owner(plugin))


def build_policy(
    plugin: PolicyPlugin,
    arguments: Mapping[str, object],
    calls: ModelCalls = UNRECORDED,
    host: PolicyMaker | None = None,
    *,
    as_given: bool = False,
) -> Policy:
    """Return one policy object for one agent. `calls` records the policy's model calls; the plug-ins of `host` may make
    or wrap the policy (None: its factory makes it). `as_given`: `takes_as_given` holds for these arguments, so that no
    model of options is built.

    Raises `UsageError` that lists every fault of its options, `ForeignCodeError` if its factory fails.
    """
    makers = host.makers("lingjing_make_policy") if host is not None else ()
    has_checked_arguments = as_given and not makers
    options = None if has_checked_arguments else read_given_options(plugin, arguments)
    if plugin.calls and not plugin.options:
        raise PluginError(
            f"{_owner(plugin)} asks chat models and declares no model of its options", hint="declare both"
        )
    own_calls = PolicyCalls(calls)
    try:
        if options is None:
            return plugin.factory(**arguments)
        policy = (host.make_policy if host is not None else lingjing_make_policy)(plugin, options, own_calls)
        return BilledPolicy(policy, own_calls) if plugin.calls else policy
    except LingjingError:
        raise
    except (Exception, SystemExit) as error:
        also = f" (plug-ins that make policies: {', '.join(makers)})" if makers else ""
        raise ForeignCodeError(
            f"{_owner(plugin)} cannot be built{also}: {one_line(error)}", hint="check its --policy-arg and its code"
        ) from error


def takes_as_given(plugin: PolicyPlugin, arguments: Mapping[str, object]) -> bool:
    """Return True if the policy's factory receives exactly these arguments, with values of the same types.

    Raises `UsageError` that lists every fault of the options.
    """
    if plugin.options:
        return False
    from lingjing.plugins.options import given_parameters

    return _is_same(given_parameters(read_given_options(plugin, arguments)), dict(arguments))


def _is_same(value: object, other: object) -> bool:
    """Return True for equal JSON values of the same types."""
    if type(value) is not type(other):
        return False
    if isinstance(value, dict) and isinstance(other, dict):
        return [*value] == [*other] and all(_is_same(value[key], other[key]) for key in value)
    if isinstance(value, list) and isinstance(other, list):
        return len(value) == len(other) and all(map(_is_same, value, other))
    return value == other


def options_fingerprint(plugin: PolicyPlugin, arguments: Mapping[str, object]) -> dict[str, str]:
    """Return the fingerprint of a policy's options (`PluginOptions.fingerprint`), by names that begin with the policy's
    name."""
    if not plugin.options:
        return {}
    fingerprint = read_given_options(plugin, arguments).fingerprint()
    return {f"{plugin.name}.{name}": value for name, value in fingerprint.items()}


def _owner(plugin: PolicyPlugin) -> str:
    return f"policy `{plugin.name}`"


__all__ = [
    "build_policy", "options_fingerprint", "options_model", "policy_of", "read_given_options",
    "takes_as_given",
]  # fmt: skip
