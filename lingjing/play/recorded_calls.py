"""The model calls of one episode: recorded beside its trace, replayed from a record, and limited.

`EpisodeCalls` belongs to the episode. The policy of each agent receives an `AgentCalls`, so it has no access to the
path of the record and to the requests of other agents.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import Instance
from lingjing.play.options import PlayOptions
from lingjing.play.spending import SpendingLimits
from lingjing.plugins.calls import AbandonedCallError, MissingCallError
from lingjing.trace.call_store import CALLS_NAME, CallReader, CallStore, calls_of
from lingjing.trace.calls import CalledEpisode, CallRequest, CallResult, RecordedCall

PROBE_TICK = -1
"""The tick of probes in the record. The harness makes them, so they belong to no boundary."""

_NOT_PROBED = "the record has no probe of it"
"""The answer of a probe in a replay without a record of it."""

_KINDS = ("parameters", "texts", "pictures")
"""The kinds of content in which a request can differ from the recorded one."""


def check_calls(options: PlayOptions) -> None:
    """Raise `UsageError` if the options of model calls contradict each other."""
    if options.calls == "replay" and not options.calls_from:
        raise UsageError("--calls replay requires --calls-from", hint="--calls-from TRACE, or its folder")
    if options.calls != "replay" and options.calls_from:
        raise UsageError(f"--calls-from requires --calls replay, not --calls {options.calls}", hint="--calls replay")
    if options.calls_from and not Path(options.calls_from).exists():
        raise UsageError(f"--calls-from: `{options.calls_from}` does not exist")
    for name, value in (("cost", options.max_cost), ("tokens", options.max_tokens)):
        if value is not None and not value > 0:
            raise UsageError(f"--max-{name} {value:g}: the limit must be greater than 0")


class EpisodeCalls:
    """The record of an episode's model calls, their replay and their limits. Any thread may call it.

    Raises `UsageError` if a replay has no record, or the record is that of another episode.
    """

    def __init__(self, options: PlayOptions, instance: Instance) -> None:
        self.episode = CalledEpisode(
            mission=instance.mission,
            mode=instance.mode,
            seed=options.seed,
            policy_seed=options.policy_seed,
            settings=options.settings,
            tier=options.tier,
            language=options.language,
        )
        ledger = Path(options.ledger).absolute() if options.ledger else None
        self.limits = SpendingLimits(options.max_cost, options.max_tokens, ledger)
        self.source = _source(Path(options.calls_from).absolute(), self.episode) if options.calls == "replay" else None
        self._recorded = options.calls != "live"
        self._folder: Path | None = None
        self._store: CallStore | None = None
        self._lock = threading.Lock()
        self._faults: dict[str, InfrastructureError] = {}
        self._probes: Counter[str] = Counter()
        self._differing: dict[str, list[tuple[int, str, int]]] = {kind: [] for kind in _KINDS}
        self._replayed = 0

    def of(self, agent: str) -> AgentCalls:
        """Return the record of an agent's calls, for its policy."""
        return AgentCalls(self, agent)

    def keep_in(self, folder: Path) -> None:
        """Set the folder of the record. Its file is created with the first call."""
        self._folder = folder

    def store(self) -> CallStore | None:
        """Return the record that is written; None if nothing is recorded."""
        with self._lock:
            if self._store is None and self._recorded and self._folder is not None:
                self._store = CallStore(self._folder / CALLS_NAME, self.episode)
            return self._store

    def replayed(self, agent: str, request: CallRequest) -> CallResult:
        """Return the recorded result for a request, and count its differences from the recorded request.

        Raises `MissingCallError` if the record has no result for it.
        """
        assert self.source is not None
        place = (request.tick, agent, request.number)
        recorded = self.source.find(agent, request.tick, request.number)
        if recorded is None or recorded.result is None:
            raise MissingCallError(
                f"calls: `{self.source.path}` has no answer for {_named(place)}",
                hint="the recorded episode differs or is incomplete: record it again with --calls record",
            )
        with self._lock:
            self._replayed += 1
            for kind in _differences(recorded, request):
                self._differing[kind].append(place)
        return recorded.result

    @contextmanager
    def noting_faults(self, agent: str) -> Iterator[None]:
        """Keep an `InfrastructureError` of the record or the limits. A policy cannot add one by itself."""
        try:
            yield
        except InfrastructureError as error:
            self._faults[agent] = error
            raise

    def fault_of(self, agent: str) -> InfrastructureError | None:
        """Return the last error of the record or the limits for the agent; None without one."""
        return self._faults.get(agent)

    def probed(self, agent: str, probe: Callable[[], str]) -> str:
        """Return the answer of `probe` and record it; in a replay, return the recorded answer.

        Records from before probes were kept have none where an episode was aborted. A replay is aborted at the same
        place.
        """
        request = CallRequest(tick=PROBE_TICK, number=self._probes[agent], head=b'{"probe":true}', messages=())
        self._probes[agent] += 1
        recorded = self.source.find(agent, request.tick, request.number) if self.source is not None else None
        if self.source is not None and (recorded is None or recorded.result is None):
            return _NOT_PROBED
        failure = recorded.result.failure if recorded is not None and recorded.result is not None else probe()
        store = self.store()
        if store is not None:
            store.begin(agent, request, CallResult(failure=failure, fault="service" if failure else ""))
        return failure

    def close(self) -> None:
        """Close the written record and the replayed one."""
        with self._lock:
            if self._store is not None:
                self._store.close()
            if self.source is not None:
                self.source.close()

    def differences(self) -> tuple[str, ...]:
        """Return one line for each kind of difference between replayed requests and their record."""
        return tuple(
            f"{len(places)} of {self._replayed} replayed calls were asked with other {kind}, "
            f"first {_named(min(places))}"
            for kind, places in self._differing.items()
            if places
        )


class AgentCalls:
    """`lingjing.plugins.calls.ModelCalls` for one agent of an episode."""

    broker = None

    def __init__(self, calls: EpisodeCalls, agent: str) -> None:
        self._calls = calls
        self._agent = agent

    @property
    def replaying(self) -> bool:
        """True if every answer comes from a record."""
        return self._calls.source is not None

    @property
    def capped(self) -> bool:
        """True if money is limited."""
        return self._calls.limits.money_is_capped

    def begin(self, request: CallRequest) -> CallResult | None:
        """See `lingjing.plugins.calls.ModelCalls.begin`."""
        with self._calls.noting_faults(self._agent):
            result = self._calls.replayed(self._agent, request) if self.replaying else None
            if result is None:
                self._calls.limits.reserve(request)
            store = self._calls.store()
            if store is not None:
                store.begin(self._agent, request, result)
        if result is not None and result.fault == "abandoned":
            raise AbandonedCallError(result)
        return result

    def end(self, request: CallRequest, result: CallResult) -> None:
        """See `lingjing.plugins.calls.ModelCalls.end`."""
        with self._calls.noting_faults(self._agent):
            self._calls.limits.settle(request, result)
            store = self._calls.store()
            if store is not None:
                store.end(self._agent, request, result)


def _named(place: tuple[int, str, int]) -> str:
    return f"`{place[1]}`, tick {place[0]}, call {place[2]}"


def _source(place: Path, episode: CalledEpisode) -> CallReader:
    """Return the reader of the record to replay. Raises `UsageError` without one, or for another episode's."""
    path = calls_of(place)
    if path is None and place.is_dir():
        path = _among(place, episode)
    if path is None:
        raise UsageError(f"--calls-from {place}: no record of model calls (`{CALLS_NAME}`) is there")
    reader = CallReader(path)
    if _same(reader.episode, episode):
        return reader
    other = reader.episode
    raise UsageError(
        f"`{path}` is the record of {other.mission}, {other.mode}, seed {other.seed}, and "
        f"the options are those of {episode.mission}, {episode.mode}, seed {episode.seed}",
        hint="name the folder of that episode, or the one that holds the folders of a run of several seeds",
    )


def _among(folder: Path, episode: CalledEpisode) -> Path | None:
    """Return the record of the episode in the folder of a run, the latest of several; None without one."""
    name = f"{episode.mission}-{episode.mode}-{episode.seed}-"
    numbered = {
        int(run.name.removeprefix(name)): run / CALLS_NAME
        for run in folder.glob(f"{name}*")
        if run.name.removeprefix(name).isdecimal() and (run / CALLS_NAME).is_file()
    }
    return numbered[max(numbered)] if numbered else None


def _same(recorded: CalledEpisode, episode: CalledEpisode) -> bool:
    """Return True if both are the same mission, mode and seed."""
    return (recorded.mission, recorded.mode, recorded.seed) == (episode.mission, episode.mode, episode.seed)


def _differences(recorded: RecordedCall, request: CallRequest) -> list[str]:
    """Return the kinds of content in which a request differs from the recorded one."""
    if recorded.head == request.head and recorded.messages == request.messages:
        return []
    recorded_texts, texts = _texts(recorded.messages), _texts(request.messages)
    differ = (recorded.head != request.head, recorded_texts != texts, recorded.pictures != _shown(request))
    return [kind for kind, is_other in zip(_KINDS, differ, strict=True) if is_other]


def _shown(request: CallRequest) -> tuple[str, ...]:
    """Return the names of the pictures of a request, in the form of a record."""
    as_recorded = RecordedCall(agent="", tick=0, number=0, head=b"", messages=request.messages)
    return as_recorded.pictures


def _texts(messages: tuple[bytes, ...]) -> list[object]:
    """Return the messages without the names of their pictures."""
    return [_without_names(from_json(message)) for message in messages]


def _without_names(message: dict[str, object]) -> dict[str, object]:
    content = message.get("content")
    if isinstance(content, list):
        content = [part if part.get("type") != "picture" else "picture" for part in content]
    return {**message, "content": content}


__all__ = ["AgentCalls", "EpisodeCalls", "check_calls"]
