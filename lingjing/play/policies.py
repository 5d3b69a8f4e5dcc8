"""Which policy plays which agent of an instance."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial

from lingjing.errors import ErrorCollector, UsageError
from lingjing.mission.instance import AgentSpec, GivenOption, Instance
from lingjing.mission.model import Mission
from lingjing.play.option_sharing import share_arguments
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import load_policy
from lingjing.plugins.host import PluginHost
from lingjing.plugins.policy import PolicyPlugin
from lingjing.suggest import nearest_or

Assigned = tuple[PolicyPlugin, dict[str, GivenOption]]
"""A policy, and the arguments that it is built with."""


def assign_policies(
    instance: Instance | None,
    mission: Mission | None,
    options: PlayOptions,
    host: PluginHost,
    given: Mapping[str, PolicyPlugin],
    errors: ErrorCollector,
) -> dict[str, Assigned]:
    """The policy of every agent; `given` are those that are known already, by their names in the options.

    `errors` holds what is wrong with the options so far and receives every role or agent that the mission does not
    have, every policy that cannot be loaded, and every fault of the policies' options. Without an instance nobody is
    assigned. Where one is refused, a role is right that the mission has in any mode.
    """
    chosen, refused = options.policies_for, frozenset(re.split(r"\W", fault.where)[0] for fault in errors.faults)
    if mission is not None:
        errors.attempt(lambda: _check_roles(chosen, instance, mission, surely=not errors.errors), None)
    agents = instance.agents if instance is not None else ()
    names_of = {agent.id: _named_for(agent, options) for agent in agents}
    wanted = dict.fromkeys((options.policy, *chosen.values()) if instance is None else names_of.values())
    plugins: dict[str, PolicyPlugin] = {}
    for name in wanted:
        plugin = given.get(name) or errors.attempt(partial(load_policy, name, host), None)
        if plugin is not None:
            plugins[name] = plugin
    if refused & {"policy", "policies_for"}:
        return {}
    whole = len(plugins) == len(wanted)
    shares = errors.attempt(lambda: share_arguments(plugins, options.policy_args, whole=whole), {})
    return {agent: (plugins[name], shares[name]) for agent, name in names_of.items() if name in shares}


def _check_roles(chosen: Mapping[str, str], instance: Instance | None, mission: Mission, *, surely: bool) -> None:
    """Raise `UsageError` that names every role or agent that the mission does not have.

    Only where it is known for sure how the mission is played, its other modes do not count.
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


def _named_for(agent: AgentSpec, options: PlayOptions) -> str:
    chosen = options.policies_for
    return next((chosen[name] for name in (agent.id, agent.name, agent.role) if name in chosen), options.policy)
