"""Which policy plays which agent of an instance."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.errors import UsageError
from lingjing.mission.instance import AgentSpec, Instance
from lingjing.play.options import PlayOptions
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import load_policy, share_arguments
from lingjing.plugins.policy import PolicyPlugin

Assigned = tuple[PolicyPlugin, dict[str, str]]
"""A policy, and the arguments that it is built with."""


def assign_policies(
    instance: Instance, options: PlayOptions, host: PluginHost, given: Mapping[str, PolicyPlugin]
) -> dict[str, Assigned]:
    """The policy of every agent; `given` are those that are known already, by their names in the options.

    Raises `UsageError` that names every role or agent that the mission does not have.
    """
    chosen = options.policies_for
    roles = dict.fromkeys(agent.role for agent in instance.agents)
    names = dict.fromkeys((*roles, *(name for agent in instance.agents for name in (agent.name, agent.id))))
    unknown = [name for name in chosen if name not in names]
    if unknown:
        called = " or ".join(f"`{name}`" for name in unknown)
        raise UsageError(
            f"no role or agent is called {called} in {instance.mode} mode", hint=f"there are: {', '.join(names)}"
        )

    def named_for(agent: AgentSpec) -> str:
        return next((chosen[name] for name in (agent.id, agent.name, agent.role) if name in chosen), options.policy)

    names_of = {agent.id: named_for(agent) for agent in instance.agents}
    plugins = {
        name: given[name] if name in given else load_policy(name, host) for name in dict.fromkeys(names_of.values())
    }
    shares = share_arguments(plugins, options.policy_args)
    return {agent: (plugins[name], shares[name]) for agent, name in names_of.items()}
