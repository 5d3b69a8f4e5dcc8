"""The policy's side of an examination: policies are loaded for their declarations, and never built."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from lingjing.errors import ErrorCollector, LingjingError
from lingjing.installed_plugins.entry_points import PLUGINS, find_entries
from lingjing.option_listing import option_specs
from lingjing.play.option_sharing import share_arguments
from lingjing.play.policy_files import declaration_of, is_file, load_policy
from lingjing.play.policy_processes.messages import (
    CheckOptions,
    DeclarePolicy,
    ExaminedPolicy,
    ExaminePolicies,
    OptionsChecked,
    PoliciesExamined,
    PolicyDeclared,
    RaisedError,
    raised,
)
from lingjing.play.policy_processes.preloading import policy_host
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import options_fingerprint, options_model, takes_as_given
from lingjing.plugins.options import option_faults
from lingjing.plugins.policy import PolicyPlugin


class LoadedDeclarations:
    """Answers requests for declarations. A file is executed once."""

    def __init__(self) -> None:
        self._plugins: dict[str, PolicyPlugin] = {}

    def examine(self, request: ExaminePolicies) -> PoliciesExamined:
        """Load policies by name or file, and share the options among them."""
        errors = ErrorCollector()
        host = _host_of(request.specs, walled=request.walled)
        plugins: dict[str, PolicyPlugin] = {}
        for spec in request.specs:
            plugin = errors.attempt(partial(load_policy, spec, host), None)
            if plugin is not None:
                plugins[spec] = plugin
        complete, shares = len(plugins) == len(request.specs), {}
        if request.whole:
            shares = errors.attempt(lambda: share_arguments(plugins, request.arguments, whole=complete), {})
        examined = {
            spec: ExaminedPolicy(
                name=plugin.name,
                privileged=plugin.privileged,
                arguments=shares[spec],
                as_given=takes_as_given(plugin, shares[spec]),
                fingerprint=options_fingerprint(plugin, shares[spec]),
                source=host.sources.get(("lingjing_policies", spec), ""),
                calls=plugin.calls,
            )
            for spec, plugin in plugins.items()
            if spec in shares
        }
        return PoliciesExamined(found=examined, errors=tuple(map(raised, errors.errors)))

    def declare(self, request: DeclarePolicy) -> PolicyDeclared | RaisedError:
        """Load the policy of a file, and return its declaration or the error."""
        try:
            host = _host_of((request.spec,), walled=request.walled)
            plugin = self._plugins[request.spec] = load_policy(request.spec, host)
            listed = option_specs(options_model(plugin)) if request.listed else ()
            return PolicyDeclared(declaration=declaration_of(plugin), listed=listed)
        except LingjingError as error:
            return raised(error)

    def check(self, request: CheckOptions) -> OptionsChecked | RaisedError:
        """Check options with the model of a declared policy."""
        try:
            model = options_model(self._plugins[request.spec])
            return OptionsChecked(faults=option_faults(model, request.arguments))
        except LingjingError as error:
            return raised(error)


def _host_of(specs: Sequence[str], *, walled: bool) -> PluginHost:
    """Return a host with the plug-ins that may offer these policies. Behind walls plug-ins are loaded without a
    trial."""
    if all(map(is_file, specs)):
        return policy_host(())
    return policy_host(point.name for point in find_entries(PLUGINS).points) if walled else PluginHost()


__all__ = ["LoadedDeclarations"]
