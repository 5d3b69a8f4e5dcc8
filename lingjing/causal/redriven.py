"""`RedrivenEpisode`: a trace's episode run again with its policies, in one process and one thread, to be forked.

The engines run in this process on the recorded decisions. Every policy is asked with the recorded observation, inbox
and pictures, and must decide what it decided then; every boundary must have the recorded digest. What then stands at a
boundary (engines, kernel, policies, references) is the episode itself, and `os.fork` copies it bit by bit.
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
from lingjing.kernel.candidates import received
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


class BranchOptions(msgspec.Struct, frozen=True, kw_only=True):
    """How a trace is branched.

    `files` are where policies lie that the trace calls by the name of their file alone, `policies` by agent, role or
    name take the place of what it calls them. `calls` says whether chat models may be asked beyond the branch.
    `reference` is the privileged policy that knows what would have been right, asked for `referenced` agents (None:
    for all). So many `jobs` branches run at once.
    """

    trace: str
    files: tuple[str, ...] = ()
    policies: dict[str, str] = {}
    calls: str = "replay"
    reference: str = "oracle"
    referenced: tuple[str, ...] | None = None
    jobs: int = 2


class RedrivenEpisode:
    """The episode, at the boundary that was reached last. Raises `UsageError` that says why a trace cannot be branched:
    remote engines, policies that are not to be had or not reproducible, model calls that are not recorded."""

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
        self.calls = BranchCalls(self.trace, options) if self.models else None
        self.recorder: Recorder | None = None
        self.run = RecordedRun(
            self.trace,
            world="inline",
            host=self.host,
            pixels=any(not plugin.privileged for plugin, _ in plugins.values()),
            referenced=frozenset(referenced),
            record=self._hand_on,
        )
        self.camera = SharedCamera(self.trace, self.run.city, self.host)
        self.policies = SequentialPolicies(
            {agent: self._built(agent, *one) for agent, one in plugins.items()},
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
        """At the boundary that was reached last."""
        return self.run.kernel

    @property
    def tick(self) -> int:
        """The boundary that was reached last."""
        return self.published.record.tick

    @property
    def last(self) -> int:
        """The last boundary of the trace."""
        return len(self.trace.boundaries) - 1

    def advance(self) -> None:
        """On to the next boundary: ask everybody, compare, and step."""
        recorded = self.run.decisions(self.tick)
        self._check_answered(recorded)
        due = self.references.decide(self.published)
        for mine, made in zip(recorded, self.policies.decide(self.published, self.kernel.exhausted()), strict=True):
            self._check_decision(mine, received(made))
        scenes = self.scenes()
        for pair in self.references.note(recorded, due, scenes):
            self.departures.setdefault(pair, []).append(self.tick)
        for made in recorded:
            right = right_parts(made.decision, due[made.agent], scenes[made.agent]) if made.agent in due else ()
            for faculty in right:
                self.agreements.setdefault((faculty, made.agent), []).append(self.tick)
        self.published = self.run.advance()
        self._check_digest()

    def scenes(self) -> dict[str, TrueSituation]:
        """What the truth is read from, by agent."""
        registry = self.kernel.state.registry
        return {agent.id: TrueSituation(self.kernel.instance, agent, registry) for agent in self.kernel.instance.agents}

    def _hand_on(self, record: BoundaryRecord, frames: Sequence[StoredFrame]) -> None:
        if self.recorder is not None:
            self.recorder(record, frames)

    def _outage(self, agent: str, error: InfrastructureError) -> InfrastructureError | None:
        """Up to the branch an error of the record; beyond it whatever is raised where models are asked, since a branch
        without its service says nothing about what it replaces."""
        if self.calls is None or agent not in self.models:
            return None
        return error if self.calls.branched else self.calls.faults.get(agent)

    def _built(self, agent: str, plugin: PolicyPlugin, binding: AgentBinding) -> Policy:
        if self.calls is not None and plugin.calls:
            return build_policy(plugin, binding.arguments, AgentBranchCalls(self.calls, agent))
        return build_policy(plugin, binding.arguments)

    def _refuse_remote(self) -> None:
        remote = select_engines(self.trace.header.instance, self.host).remote
        if remote:
            raise UsageError(f"{self.trace.path} cannot be branched: {', '.join(remote)} run elsewhere, without a copy")

    def _check_answered(self, recorded: tuple[DecisionRecord, ...]) -> None:
        for one in recorded:
            if one.substituted == LATE and one.agent not in self.models:
                raise UsageError(
                    f"{self.trace.path} cannot be branched after boundary {self.tick}: `{one.agent}` was given up, "
                    "and what it went on with is not known"
                )

    def _check_decision(self, recorded: DecisionRecord, made: DecisionRecord) -> None:
        if _told(recorded) == _told(made):
            return
        raise UsageError(
            f"{self.trace.path} cannot be branched after boundary {self.tick}: the policy of `{recorded.agent}` "
            f"decides otherwise than it did on the same observation ({_difference(recorded, made)})",
            hint="it depends on something else (a clock, unseeded chance, a file, what an episode before left), or its "
            "code is another now",
        )

    def _check_digest(self) -> None:
        recorded, record = self.trace.boundaries[self.tick], self.published.record
        if self._digests[self.tick] != record.digest:
            other = first_difference(self.trace, recorded, record)
            raise UsageError(
                f"{self.trace.path} cannot be branched: run again it differs at boundary {self.tick} "
                f"({other.engine}: {other.field})",
                hint="`lingjing replay` says more",
            )


class BranchCalls:
    """The model calls of an episode that is branched: recorded up to the branch, then live if that was asked for."""

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


class AgentBranchCalls:
    """`lingjing.plugins.calls.ModelCalls` for one agent of an episode that is branched."""

    capped = False

    def __init__(self, calls: BranchCalls, agent: str) -> None:
        self._calls = calls
        self._agent = agent

    @property
    def replaying(self) -> bool:
        """Whether no service will ever be asked."""
        return not self._calls.live

    def begin(self, request: CallRequest) -> CallResult | None:
        """The recorded result; beyond the branch None, if models may be asked there."""
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
            raise MissingCallError(f"`{self._agent}` may ask no chat model beyond the branch", hint="--calls live")
        return None

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Nothing is kept of a branch's calls but what its decisions say that they cost."""


def _plugins(trace: Trace, options: BranchOptions, host: PluginHost) -> dict[str, tuple[PolicyPlugin, AgentBinding]]:
    agents = {agent.id: agent for agent in trace.header.instance.agents}
    found: dict[str, tuple[PolicyPlugin, AgentBinding]] = {}
    for binding in trace.header.bindings:
        agent = agents[binding.agent]
        keys = (agent.id, agent.name, agent.role)
        there = next((one for one in options.files if Path(one).name == binding.policy), binding.policy)
        name = next((options.policies[key] for key in keys if key in options.policies), there)
        try:
            found[agent.id] = load_policy(name, host), binding
        except LingjingError as error:
            raise UsageError(
                f"the policy `{name}` of `{agent.id}` is not to be had here: {error}",
                hint=_whereabouts(name, options.files),
            ) from error
    unknown = [name for name in options.policies if not _names(name, trace)]
    if unknown:
        hint = nearest_or(unknown[0], agents, f"there are: {', '.join(agents)}")
        raise UsageError(f"no role or agent is called `{unknown[0]}`", hint=hint)
    return found


def _whereabouts(name: str, files: Sequence[str]) -> str:
    """How a policy that is not to be had may be."""
    if ".py" not in name:
        return "install what offers it"
    other = f", not {', '.join(files)}" if files and name not in files else ""
    return f"say where it is: --policy FOLDER/{name}{other}"


def _names(name: str, trace: Trace) -> bool:
    return any(name in (agent.id, agent.name, agent.role) for agent in trace.header.instance.agents)


def _reference(options: BranchOptions, host: PluginHost) -> PolicyPlugin:
    plugin = load_policy(options.reference, host)
    if not plugin.privileged:
        raise UsageError(
            f"--reference {options.reference}: it does not see the truth", hint="a privileged policy is due: `oracle`"
        )
    return plugin


def _some(plugin: PolicyPlugin | None) -> PolicyPlugin:
    if plugin is None:
        raise AssertionError("nobody is referenced")
    return plugin


def _told(made: DecisionRecord) -> tuple[object, ...]:
    """What of an answer must be equal: all but what it cost and how long it took."""
    return replace(made.decision, usage=None), made.substituted


def _difference(recorded: DecisionRecord, made: DecisionRecord) -> str:
    if recorded.substituted != made.substituted:
        return f"{recorded.substituted or 'an answer'} then, {made.substituted or 'an answer'} now: {made.detail}"
    fields: Mapping[str, tuple[object, object]] = {
        name: (getattr(recorded.decision, name), getattr(made.decision, name)) for name in Decision.__struct_fields__
    }
    return ", ".join(name for name, (then, now) in fields.items() if name != "usage" and then != now)
