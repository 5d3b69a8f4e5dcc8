"""The confirmation of an outage that a policy reports.

A losing policy could raise `InfrastructureError` to have its episode aborted, so its report alone does not count. An
outage is confirmed by an error of the harness itself (the record of model calls, the limits of money), or by a probe.
The declaration of a policy has the probe of its service, and the harness runs it.
"""

from __future__ import annotations

import concurrent.futures
from collections.abc import Mapping

from lingjing.errors import InfrastructureError, hint_of
from lingjing.kernel.barrier import AgentThread
from lingjing.mission.instance import GivenOption
from lingjing.play.policies import AssignedPolicy
from lingjing.play.recorded_calls import EpisodeCalls
from lingjing.plugins.loading import read_given_options
from lingjing.plugins.policy import PolicyPlugin, ServiceProbe

SERVICE_GONE = "service: "
"""The beginning of the detail of an abort that one entrant's service has caused."""

PROBE_S = 30.0
"""The longest wall-clock time of one probe, seconds. Chosen: a third of a model's time for an answer (paper: 90 s)."""


class ServiceOutages:
    """The `OutageCheck` of one episode. `assigned` holds the policies with their options, by agent."""

    def __init__(self, assigned: Mapping[str, AssignedPolicy], calls: EpisodeCalls) -> None:
        self._assigned = assigned
        self._calls = calls

    def __call__(self, agent: str, error: InfrastructureError) -> InfrastructureError | None:
        """Return the error that ends the episode; None if nothing confirms the policy's report."""
        fault = self._calls.fault_of(agent)
        plugin, arguments = self._assigned[agent].plugin, self._assigned[agent].arguments
        if fault is not None or plugin is None or plugin.probe is None:
            return fault
        probe = plugin.probe
        failure = self._calls.probed(agent, lambda: probe_failure(agent, plugin, probe, arguments))
        if not failure:
            return None
        return InfrastructureError(
            f"{SERVICE_GONE}the harness gets no answer for `{agent}` either: {failure}",
            hint=hint_of(error),
            cause="service",
        )


def probe_failure(agent: str, plugin: PolicyPlugin, probe: ServiceProbe, arguments: Mapping[str, GivenOption]) -> str:
    """Return the reason for which the service does not answer; "" if it answers, or if the probe itself fails."""
    thread = AgentThread(f"probe-{agent}")
    try:
        options = read_given_options(plugin, arguments)
        failure, _ = thread.submit(lambda: probe(options)).result(timeout=PROBE_S)
    except concurrent.futures.TimeoutError:
        return f"no answer within {PROBE_S:g} s"
    except Exception:  # noqa: BLE001 - a plug-in's own code
        return ""
    finally:
        thread.close()
    return failure if isinstance(failure, str) else ""


__all__ = ["PROBE_S", "SERVICE_GONE", "ServiceOutages", "probe_failure"]
