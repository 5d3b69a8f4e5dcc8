"""The policy of each agent of an instance.

Policies in files are loaded here, or, for policies in processes of their own, by another process that reads only their
declarations (`policy_processes.examination`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from lingjing.errors import ErrorCollector, InfrastructureError, UsageError
from lingjing.mission.instance import AgentSpec, GivenOption, Instance
from lingjing.mission.model import Mission
from lingjing.play.option_sharing import share_arguments
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import is_file, load_policy
from lingjing.play.policy_processes.servers import PolicyServer
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import options_fingerprint
from lingjing.plugins.policy import PolicyPlugin
from lingjing.suggest import nearest_or


@dataclass(frozen=True, slots=True)
class AssignedPolicy:
    """The policy of an agent, with its options."""

    spec: str
    """Its name in the options."""
    name: str
    """Its name in traces."""
    privileged: bool
    """True if it receives the truth."""
    arguments: dict[str, GivenOption]
    """Its options by name."""
    fingerprint: dict[str, str]
    """Values that decide its behaviour beside the options (`PluginOptions.fingerprint`)."""
    source: str = ""
    """The plug-in that offers it; "" for a file, and for a policy given as an object."""
    plugin: PolicyPlugin | None = None
    """Its declaration; None for a file that only another process has loaded."""
    as_given: bool = False
    """True if an examination has found that its factory receives the options unchanged."""
    calls: bool = False
    """True if it calls chat models."""
    makers: tuple[str, ...] = ()
    """The plug-ins that make or wrap policies (`lingjing_make_policy`)."""


def assign_policies(
    instance: Instance | None,
    mission: Mission | None,
    options: PlayOptions,
    host: PluginHost,
    loaded: Mapping[str, PolicyPlugin],
    errors: ErrorCollector,
    server: PolicyServer | None = None,
) -> dict[str, AssignedPolicy]:
    """Return the policy of every agent. Without an instance no policy is assigned.

    `loaded` are loaded policies by their names in the options. With a `server` no code of a file runs in this process.
    `errors` holds the faults of the options so far. Unknown roles and agents, policies that cannot be loaded, and
    faults of their options are added to it. If it holds a fault, a role of any mode of the mission is accepted.
    """
    chosen, refused = options.policies_for, frozenset(re.split(r"\W", fault.where)[0] for fault in errors.faults)
    if mission is not None:
        errors.attempt(lambda: _check_roles(chosen, instance, mission, surely=not errors.errors), None)
    agents = instance.agents if instance is not None else ()
    names_of = {agent.id: _policy_for(agent, options) for agent in agents}
    wanted = dict.fromkeys((options.policy, *chosen.values()) if instance is None else names_of.values())
    whole = not refused & {"policy", "policies_for"}
    walled = server is not None and server.walls is not None
    if server is not None and any(is_file(name) or (walled and name not in host.policies) for name in wanted):
        policies = _examined(wanted, options, host, server, errors, whole=whole)
    else:
        policies = _loaded(wanted, options, host, loaded, errors, whole=whole)
    made = {name: _made(policy, host) for name, policy in policies.items()}
    return {agent: made[name] for agent, name in names_of.items() if name in made}


def _loaded(
    wanted: Iterable[str],
    options: PlayOptions,
    host: PluginHost,
    known: Mapping[str, PolicyPlugin],
    errors: ErrorCollector,
    *,
    whole: bool,
) -> dict[str, AssignedPolicy]:
    """Return policies loaded in this process; none if `wanted` is not the `whole` request, because shares would be
    wrong."""
    by_name = {name: known.get(name) or errors.attempt(partial(load_policy, name, host), None) for name in wanted}
    plugins = {name: plugin for name, plugin in by_name.items() if plugin is not None}
    if not whole:
        return {}
    complete = len(plugins) == len(by_name)
    shares = errors.attempt(lambda: share_arguments(plugins, options.policy_args, whole=complete), {})
    return {
        name: AssignedPolicy(
            spec=name,
            name=plugin.name,
            privileged=plugin.privileged,
            arguments=shares[name],
            fingerprint=options_fingerprint(plugin, shares[name]),
            source=_source(name, host),
            plugin=plugin,
            calls=plugin.calls,
        )
        for name, plugin in plugins.items()
        if name in shares
    }


def _examined(
    wanted: Iterable[str],
    options: PlayOptions,
    host: PluginHost,
    server: PolicyServer,
    errors: ErrorCollector,
    *,
    whole: bool,
) -> dict[str, AssignedPolicy]:
    """Return policies with the declarations that another process has read."""
    from lingjing.play.policy_processes.examination import examine
    from lingjing.play.policy_processes.messages import error_of, own_failure

    read = errors.attempt(lambda: examine(tuple(wanted), options.policy_args, server, whole=whole), None)
    if read is None:
        return {}
    for error in map(error_of, read.errors):
        errors.add(own_failure(error) if isinstance(error, InfrastructureError) else error)
    return {
        name: AssignedPolicy(
            spec=name,
            name=examined.name,
            privileged=examined.privileged,
            arguments=examined.arguments,
            as_given=examined.as_given,
            fingerprint=examined.fingerprint,
            source=examined.source,
            calls=examined.calls,
            plugin=host.policies.get(name),
        )
        for name, examined in read.found.items()
    }


def _made(policy: AssignedPolicy, host: PluginHost) -> AssignedPolicy:
    """Return the policy with the plug-ins that make or wrap it, which the trace names."""
    makers = host.made_by("lingjing_make_policy")
    if not makers:
        return policy
    deciding = {**policy.fingerprint, f"{policy.name}.makers": ", ".join(makers.values())}
    return replace(policy, makers=tuple(makers), fingerprint=deciding)


def _source(name: str, host: PluginHost) -> str:
    return host.sources.get(("lingjing_policies", name), "")


def _check_roles(chosen: Mapping[str, str], instance: Instance | None, mission: Mission, *, surely: bool) -> None:
    """Raise `UsageError` that names every role or agent that the mission does not have.

    `surely`: the mode of the episode is known, so roles of other modes are unknown too.
    """
    there = [(agent.role, agent.name, agent.id) for agent in instance.agents] if instance is not None else []
    played = f"in {instance.mode} mode" if surely and instance is not None else f"in '{mission.name}'"
    if not surely:
        there += [(agent.role, agent.name, agent.name) for agent in mission.agents]
    names = dict.fromkeys((*(role for role, _, _ in there), *(name for _, *each in there for name in each)))
    unknown = [name for name in chosen if name not in names]
    if unknown:
        called = " or ".join(f"`{name}`" for name in unknown)
        listed = f"there are: {', '.join(names)}"
        hint = nearest_or(unknown[0], names, listed) if len(unknown) == 1 else listed
        raise UsageError(f"no role or agent is called {called} {played}", hint=hint)


def _policy_for(agent: AgentSpec, options: PlayOptions) -> str:
    """Return the name of the policy of an agent: by its id, its name, its role, or the default."""
    chosen = options.policies_for
    return next((chosen[name] for name in (agent.id, agent.name, agent.role) if name in chosen), options.policy)
