"""An episode run again from its trace with its policies, in one process and one thread, so that it can be forked.

The engines run in this process on the recorded decisions. Every policy receives the recorded observations, messages
and pictures, and must make the recorded decision; every boundary must have the recorded digest. Then engines, kernel,
policies and references are in the state of the episode, and `os.fork` copies this state exactly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
from msgspec.structs import replace

from lingjing.causal.faculties import TrueSituation, right_parts
from lingjing.causal.recorded import RecordedRun
from lingjing.causal.references import References
from lingjing.causal.replay import first_difference
from lingjing.causal.shared_camera import SharedCamera
from lingjing.errors import InfrastructureError, LingjingError, UsageError
from lingjing.kernel.candidates import normalise_decision
from lingjing.kernel.sequential import SequentialPolicies
from lingjing.kernel.step import Kernel, Recorder
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.selection import select_engines
from lingjing.play.options import PlayOptions
from lingjing.play.policy_files import load_policy
from lingjing.play.recorded_calls import EpisodeCalls
from lingjing.plugins.calls import AbandonedCallError, MissingCallError
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import build_policy
from lingjing.plugins.policy import Policy, PolicyPlugin
from lingjing.suggest import nearest_or
from lingjing.trace.calls import CallRequest, CallResult
from lingjing.trace.digest import current_digests
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import AgentBinding, BoundaryRecord, Decision, DecisionRecord

LATE = "policy_timeout"
"""The reason of an answer that was replaced because it came too late."""


class BranchOptions(msgspec.Struct, frozen=True, kw_only=True):
    """Options of branches."""

    trace: str
    """The path of the trace."""
    files: tuple[str, ...] = ()
    """Paths of policy files that the trace names without a folder."""
    policies: dict[str, str] = {}
    """Policies in place of the trace's, by agent, role or name."""
    calls: str = "replay"
    """`replay` or `live`: whether chat models may be called after the branch point."""
    reference: str = "oracle"
    """The privileged policy that makes the reference decisions."""
    referenced: tuple[str, ...] | None = None
    """Agents with a reference; None: all."""
    jobs: int = 2
    """Branches played in parallel."""


class RedrivenEpisode:
    """The episode at the boundary reached last.

    Raises `UsageError` with the reason if the trace cannot be branched: remote engines, missing or irreproducible
    policies, unrecorded model calls.
    """

    def __init__(self, options: BranchOptions) -> None:
        self.options = options
        self.trace = read_trace(options.trace)
        self._digests = current_digests(self.trace)
        self.host = PluginHost()
        self._refuse_remote()
        instance = self.trace.header.instance
        agents = [agent.id for agent in instance.agents]
        referenced = agents if options.referenced is None else [name for name in agents if name in options.referenced]
        plugins = _plugins(self.trace, options, self.host)
        self.models = tuple(agent for agent, (plugin, _) in plugins.items() if plugin.calls)
        self.calls = _BranchCalls(self.trace, options) if self.models else None
        self.recorder: Recorder | None = None
        self.run = RecordedRun(
            self.trace,
            world="inline",
            host=self.host,
            pixels=any(not plugin.privileged for plugin, _ in plugins.values()),
            referenced=frozenset(referenced),
            record=self._record,
        )
        self.camera = SharedCamera(self.trace, self.run.city, self.host)
        self.policies = SequentialPolicies(
            {agent: self._build(agent, *plugin_and_binding) for agent, plugin_and_binding in plugins.items()},
            instance.budget.policy_s,
            self._outage,
        )
        self.published = self.run.advance()
        self._check_digest()
        briefs = self.kernel.briefs()
        for agent, answer in self.policies.reset(briefs).items():
            if answer.reason:
                raise UsageError(f"the policy of `{agent}` cannot take its brief here: {answer.detail}")
        reference = _reference(options, self.host) if referenced else None
        self.references = References(
            referenced, briefs, lambda agent: build_policy(_some(reference), {}), instance.budget.policy_s
        )
        self.departures: dict[tuple[str, str], list[int]] = {}
        self.agreements: dict[tuple[str, str], list[int]] = {}

    @property
    def kernel(self) -> Kernel:
        """The kernel, at the boundary reached last."""
        return self.run.kernel

    @property
    def tick(self) -> int:
        """The boundary reached last."""
        return self.published.record.tick

    @property
    def last(self) -> int:
        """The last boundary of the trace."""
        return len(self.trace.boundaries) - 1

    def advance(self) -> None:
        """Advance to the next boundary: run all policies, compare their decisions, and step."""
        recorded = self.run.decisions(self.tick)
        self._check_answered(recorded)
        references = self.references.decide(self.published)
        for mine, made in zip(recorded, self.policies.decide(self.published, self.kernel.exhausted()), strict=True):
            self._check_decision(mine, normalise_decision(made))
        scenes = self.scenes()
        for pair in self.references.note(recorded, references, scenes):
            self.departures.setdefault(pair, []).append(self.tick)
        for made in recorded:
            right = (
                right_parts(made.decision, references[made.agent], scenes[made.agent])
                if made.agent in references
                else ()
            )
            for faculty in right:
                self.agreements.setdefault((faculty, made.agent), []).append(self.tick)
        self.published = self.run.advance()
        self._check_digest()

    def scenes(self) -> dict[str, TrueSituation]:
        """Return the true situation of each agent."""
        registry = self.kernel.state.registry
        return {agent.id: TrueSituation(self.kernel.instance, agent, registry) for agent in self.kernel.instance.agents}

    def _record(self, record: BoundaryRecord, frames: Sequence[StoredFrame]) -> None:
        """Pass a record on to the recorder of a branch."""
        if self.recorder is not None:
            self.recorder(record, frames)

    def _outage(self, agent: str, error: InfrastructureError) -> InfrastructureError | None:
        """Return the error that ends the branch, or None.

        Before the branch point that is an error of the record. After it, it is any error of a model call, because a
        branch without its service says nothing about the intervention.
        """
        if self.calls is None or agent not in self.models:
            return None
        return error if self.calls.branched else self.calls.faults.get(agent)

    def _build(self, agent: str, plugin: PolicyPlugin, binding: AgentBinding) -> Policy:
        if self.calls is not None and plugin.calls:
            return build_policy(plugin, binding.arguments, _AgentBranchCalls(self.calls, agent), self.host)
        return build_policy(plugin, binding.arguments, host=self.host)

    def _refuse_remote(self) -> None:
        foreign = [binding.engine for binding in self.trace.header.remote_engines]
        remote = foreign or select_engines(self.trace.header.instance, self.host).remote
        if remote:
            raise UsageError(
                f"{self.trace.path} cannot be branched: {', '.join(remote)} run remotely and cannot be copied"
            )

    def _check_answered(self, recorded: tuple[DecisionRecord, ...]) -> None:
        for decision in recorded:
            if decision.substituted == LATE and decision.agent not in self.models:
                raise UsageError(
                    f"{self.trace.path} cannot be branched after boundary {self.tick}: the answer of "
                    f"`{decision.agent}` came too late, so its policy's state is unknown"
                )

    def _check_decision(self, recorded: DecisionRecord, made: DecisionRecord) -> None:
        if _reproducible(recorded) == _reproducible(made):
            return
        raise UsageError(
            f"{self.trace.path} cannot be branched after boundary {self.tick}: the policy of `{recorded.agent}` "
            f"makes another decision on the same observation ({_difference(recorded, made)})",
            hint="the policy depends on other inputs (a clock, unseeded random numbers, files, earlier episodes), or "
            "its code has changed",
        )

    def _check_digest(self) -> None:
        recorded, record = self.trace.boundaries[self.tick], self.published.record
        if self._digests[self.tick] != record.digest:
            other = first_difference(self.trace, recorded, record)
            raise UsageError(
                f"{self.trace.path} cannot be branched: its replay differs at boundary {self.tick} "
                f"({other.engine}: {other.field})",
                hint="`lingjing replay` shows the difference",
            )


class _BranchCalls:
    """The model calls of a branched episode: replayed up to the branch point, then live if the options allow it."""

    def __init__(self, trace: Trace, options: BranchOptions) -> None:
        instance = trace.header.instance
        self.recorded = EpisodeCalls(
            PlayOptions(
                mission=instance.mission,
                seed=instance.seed,
                policy_seed=trace.header.policy_seed,
                calls="replay",
                calls_from=str(trace.path.parent if trace.path.parent.parts else Path()),
            ),
            instance,
        )
        self.live = options.calls == "live"
        self.branched = False
        self.faults: dict[str, InfrastructureError] = {}


class _AgentBranchCalls:
    """`lingjing.plugins.calls.ModelCalls` of one agent of a branched episode."""

    capped = False
    broker = None

    def __init__(self, calls: _BranchCalls, agent: str) -> None:
        self._calls = calls
        self._agent = agent

    @property
    def replaying(self) -> bool:
        """True if no service is ever called."""
        return not self._calls.live

    def begin(self, request: CallRequest) -> CallResult | None:
        """Return the recorded result; after the branch point None if models may be called."""
        if not self._calls.branched:
            try:
                result = self._calls.recorded.replayed(self._agent, request)
            except InfrastructureError as error:
                self._calls.faults[self._agent] = error
                raise
            if result.fault == "abandoned":
                raise AbandonedCallError(result)
            return result
        if not self._calls.live:
            raise MissingCallError(
                f"`{self._agent}` may not call a chat model after the branch point", hint="--calls live"
            )
        return None

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Do nothing: the cost of a branch's calls is part of its decisions."""


def _plugins(trace: Trace, options: BranchOptions, host: PluginHost) -> dict[str, tuple[PolicyPlugin, AgentBinding]]:
    agents = {agent.id: agent for agent in trace.header.instance.agents}
    plugins: dict[str, tuple[PolicyPlugin, AgentBinding]] = {}
    for binding in trace.header.bindings:
        agent = agents[binding.agent]
        keys = (agent.id, agent.name, agent.role)
        recorded_name = next((file for file in options.files if Path(file).name == binding.policy), binding.policy)
        name = next((options.policies[key] for key in keys if key in options.policies), recorded_name)
        try:
            plugins[agent.id] = load_policy(name, host), binding
        except LingjingError as error:
            raise UsageError(
                f"the policy `{name}` of `{agent.id}` is not available: {error}",
                hint=_location_hint(name, options.files),
            ) from error
    unknown = [name for name in options.policies if not _names(name, trace)]
    if unknown:
        hint = nearest_or(unknown[0], agents, f"there are: {', '.join(agents)}")
        raise UsageError(f"no role or agent is called `{unknown[0]}`", hint=hint)
    return plugins


def _location_hint(name: str, files: Sequence[str]) -> str:
    """Return a hint on how to provide a missing policy."""
    if ".py" not in name:
        return "install the plug-in that offers it"
    other = f", not {', '.join(files)}" if files and name not in files else ""
    return f"name its file: --policy FOLDER/{name}{other}"


def _names(name: str, trace: Trace) -> bool:
    return any(name in (agent.id, agent.name, agent.role) for agent in trace.header.instance.agents)


def _reference(options: BranchOptions, host: PluginHost) -> PolicyPlugin:
    plugin = load_policy(options.reference, host)
    if not plugin.privileged:
        raise UsageError(
            f"--reference {options.reference}: this policy is not privileged",
            hint="choose a privileged policy such as `oracle`",
        )
    return plugin


def _some(plugin: PolicyPlugin | None) -> PolicyPlugin:
    if plugin is None:
        raise AssertionError("no agent has a reference")
    return plugin


def _reproducible(made: DecisionRecord) -> tuple[object, ...]:
    """Return the part of an answer that must be reproduced: all but its cost and duration."""
    return replace(made.decision, usage=None), made.substituted


def _difference(recorded: DecisionRecord, made: DecisionRecord) -> str:
    if recorded.substituted != made.substituted:
        return f"{recorded.substituted or 'an answer'} then, {made.substituted or 'an answer'} now: {made.detail}"
    fields: Mapping[str, tuple[object, object]] = {
        name: (getattr(recorded.decision, name), getattr(made.decision, name)) for name in Decision.__struct_fields__
    }
    return ", ".join(name for name, (then, now) in fields.items() if name != "usage" and then != now)
