"""Confirmation from outside of a policy that what it depends on is gone.

A policy that loses could raise `InfrastructureError` to have its episode aborted. So its word does not count. What
counts is an error of the harness itself (the record of model calls, the limits of money), or a probe: the plug-in that
declares the policy also declares how its service is asked for a sign of life, and the harness asks.
"""

from __future__ import annotations

import concurrent.futures
from collections.abc import Mapping

from lingjing.errors import InfrastructureError
from lingjing.kernel.barrier import AgentThread
from lingjing.mission.instance import GivenOption
from lingjing.play.policies import AssignedPolicy
from lingjing.play.recorded_calls import EpisodeCalls
from lingjing.plugins.loading import read_given_options
from lingjing.plugins.policy import PolicyPlugin, ServiceProbe

SERVICE_GONE = "service: "
"""How the detail of an abort begins that a service of one entrant has caused."""

PROBE_S = 30.0
"""The wall clock that one probe may take. Chosen: a third of the time that a model has for an answer (paper: 90 s)."""


class ServiceOutages:
    """The `OutageCheck` of one episode: `assigned` are the policies by agent, with their options."""

    def __init__(self, assigned: Mapping[str, AssignedPolicy], calls: EpisodeCalls) -> None:
        self._assigned = assigned
        self._calls = calls

    def __call__(self, agent: str, error: InfrastructureError) -> InfrastructureError | None:
        """The error that ends the episode; None if the policy alone says that its infrastructure is gone."""
        fault = self._calls.fault_of(agent)
        plugin, arguments = self._assigned[agent].plugin, self._assigned[agent].arguments
        if fault is not None or plugin is None or plugin.probe is None:
            return fault
        probe = plugin.probe
        silence = self._calls.probed(agent, lambda: _asked(agent, plugin, probe, arguments))
        if not silence:
            return None
        return InfrastructureError(
            f"{SERVICE_GONE}the service of `{agent}` gives the harness no answer either: {silence}",
            hint=str(error.hint),
        )


def _asked(agent: str, plugin: PolicyPlugin, probe: ServiceProbe, arguments: Mapping[str, GivenOption]) -> str:
    """Why the service is silent; "" if it answers, or if the probe itself fails, which shows nothing."""
    thread = AgentThread(f"probe-{agent}")
    try:
        options = read_given_options(plugin, arguments)
        silence, _ = thread.submit(lambda: probe(options)).result(timeout=PROBE_S)
    except concurrent.futures.TimeoutError:
        return f"no answer within {PROBE_S:g} s"
    except Exception:  # noqa: BLE001 - a plug-in's own code
        return ""
    finally:
        thread.close()
    return silence if isinstance(silence, str) else ""


__all__ = ["PROBE_S", "SERVICE_GONE", "ServiceOutages"]
