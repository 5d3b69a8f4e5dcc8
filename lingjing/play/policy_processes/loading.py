"""The requests that load the policies of an episode, with options, seeds, and the truth for privileged policies."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.kernel.world.held_cities import packed
from lingjing.mission.instance import Instance
from lingjing.mission.seeding import integer
from lingjing.play.options import PlayOptions
from lingjing.play.policies import AssignedPolicy
from lingjing.play.policy_processes.barrier import AgentPolicy
from lingjing.play.policy_processes.messages import LoadPolicy, TruthConstants
from lingjing.play.recorded_calls import EpisodeCalls
from lingjing.scene.city import City


def agent_policies(
    assigned: Mapping[str, AssignedPolicy], options: PlayOptions, instance: Instance, city: City, calls: EpisodeCalls
) -> dict[str, AgentPolicy]:
    """Return the policy of each agent, ready to be loaded in its process."""
    truth = None
    if any(policy.privileged for policy in assigned.values()):
        truth = TruthConstants(instance=instance, city=packed(city))
    made = {}
    for agent, policy in assigned.items():
        record = calls.of(agent)
        load = LoadPolicy(
            spec=policy.spec,
            source=policy.source,
            makers=policy.makers,
            arguments=policy.arguments,
            seed=ambient_seed(options.policy_seed, agent),
            as_given=policy.as_given,
            brokered=policy.calls and options.isolate != "no",
            replaying=record.replaying,
            capped=record.capped,
            truth=truth if policy.privileged else None,
        )
        made[agent] = AgentPolicy(load, record)
    return made


def ambient_seed(policy_seed: int, agent: str) -> int:
    """Return the seed of the global random generators in an agent's process. It differs from the policy's own seed."""
    return integer(policy_seed, f"policy/{agent}/ambient")
