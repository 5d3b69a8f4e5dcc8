"""The model calls of one episode: recorded beside its trace, replayed from a record, and limited.

`EpisodeCalls` belongs to the episode and `AgentCalls` is what one agent's policy gets of it. A policy never learns
where the record lies, and a question of another agent is out of its reach.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import Instance
from lingjing.play.options import PlayOptions
from lingjing.play.spending import SpendingLimits
from lingjing.plugins.calls import AbandonedCallError, MissingCallError
from lingjing.trace.call_store import CALLS_NAME, CallReader, CallStore, calls_of
from lingjing.trace.calls import CalledEpisode, CallRequest, CallResult, RecordedCall

PROBE_TICK = -1
"""The tick under which probes of a service are recorded: they are the harness's questions and belong to no boundary."""

_NOT_PROBED = "the record has no probe of it"

_KINDS = ("parameters", "texts", "pictures")


def check_calls(options: PlayOptions) -> None:
    """Raise `UsageError` if what the options say of model calls does not go together."""
    if options.calls == "replay" and not options.calls_from:
        raise UsageError("--calls replay: nothing says from where", hint="--calls-from TRACE, or its folder")
    if options.calls != "replay" and options.calls_from:
        raise UsageError(f"--calls-from says what is replayed, and --calls is {options.calls}", hint="--calls replay")
    if options.calls_from and not Path(options.calls_from).exists():
        raise UsageError(f"--calls-from: there is no `{options.calls_from}`")
    for name, value in (("cost", options.max_cost), ("tokens", options.max_tokens)):
        if value is not None and not value > 0:
            raise UsageError(f"--max-{name} {value:g}: more than 0 is due")


class EpisodeCalls:
    """Raises `UsageError` if there is no record to be replayed, or it is that of another episode."""

    def __init__(self, options: PlayOptions, instance: Instance) -> None:
        self.episode = CalledEpisode(
            mission=instance.mission,
            mode=instance.mode,
            seed=options.seed,
            policy_seed=options.policy_seed,
            settings=options.settings,
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
        """What the policy of an agent is given."""
        return AgentCalls(self, agent)

    def keep_in(self, folder: Path) -> None:
        """Say where the record goes; its file is made with the first call."""
        self._folder = folder

    def store(self) -> CallStore | None:
        """The record that is being written; None if nothing is recorded."""
        with self._lock:
            if self._store is None and self._recorded and self._folder is not None:
                self._store = CallStore(self._folder / CALLS_NAME, self.episode)
            return self._store

    def replayed(self, agent: str, request: CallRequest) -> CallResult:
        """The recorded result at the place of the question. What differs in the question is noted."""
        assert self.source is not None
        place = (request.tick, agent, request.number)
        found = self.source.find(agent, request.tick, request.number)
        if found is None or found.result is None:
            raise MissingCallError(
                f"calls: `{self.source.path}` has no answer for {_named(place)}",
                hint="it was played another way, or cut short: record it again with --calls record",
            )
        with self._lock:
            self._replayed += 1
            for kind in _differences(found, request):
                self._differing[kind].append(place)
        return found.result

    @contextmanager
    def noting_faults(self, agent: str) -> Iterator[None]:
        """Keep an `InfrastructureError` of the record or of the limits, which no policy can raise by itself."""
        try:
            yield
        except InfrastructureError as error:
            self._faults[agent] = error
            raise

    def fault_of(self, agent: str) -> InfrastructureError | None:
        """The last error that the record or the limits have raised for the agent; None if there was none."""
        return self._faults.get(agent)

    def probed(self, agent: str, probe: Callable[[], str]) -> str:
        """The answer of `probe`, recorded; in a replay the recorded one.

        A record from before probes were kept holds none where its episode was aborted: the replay is aborted there too.
        """
        request = CallRequest(tick=PROBE_TICK, number=self._probes[agent], head=b'{"probe":true}', messages=())
        self._probes[agent] += 1
        found = self.source.find(agent, request.tick, request.number) if self.source is not None else None
        if self.source is not None and (found is None or found.result is None):
            return _NOT_PROBED
        silence = found.result.failure if found is not None and found.result is not None else probe()
        store = self.store()
        if store is not None:
            store.begin(agent, request, CallResult(failure=silence, fault="service" if silence else ""))
        return silence

    def close(self) -> None:
        """Close the record."""
        with self._lock:
            if self._store is not None:
                self._store.close()
            if self.source is not None:
                self.source.close()

    def differences(self) -> tuple[str, ...]:
        """What was asked otherwise than the replayed record says, a line for each kind."""
        return tuple(
            f"{len(places)} of {self._replayed} replayed calls were asked with other {kind}, "
            f"first {_named(min(places))}"
            for kind, places in self._differing.items()
            if places
        )


class AgentCalls:
    """`lingjing.plugins.calls.ModelCalls` for one agent of an episode."""

    def __init__(self, calls: EpisodeCalls, agent: str) -> None:
        self._calls = calls
        self._agent = agent

    @property
    def replaying(self) -> bool:
        """Whether every answer comes from a record."""
        return self._calls.source is not None

    @property
    def capped(self) -> bool:
        """Whether money is limited."""
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
    found = calls_of(place)
    if found is None and place.is_dir():
        found = _among(place, episode)
    if found is None:
        raise UsageError(f"--calls-from {place}: there is no record of model calls (`{CALLS_NAME}`)")
    reader = CallReader(found)
    if _same(reader.episode, episode):
        return reader
    other = reader.episode
    raise UsageError(
        f"`{found}` is the record of {other.mission}, {other.mode}, seed {other.seed}, and "
        f"{episode.mission}, {episode.mode}, seed {episode.seed} is to be played",
        hint="name the folder of that episode, or the one that holds the folders of a run of several seeds",
    )


def _among(folder: Path, episode: CalledEpisode) -> Path | None:
    """The record of the episode among the folders of a run; the latest, if it was played several times."""
    name = f"{episode.mission}-{episode.mode}-{episode.seed}-"
    numbered = {
        int(one.name.removeprefix(name)): one / CALLS_NAME
        for one in folder.glob(f"{name}*")
        if one.name.removeprefix(name).isdecimal() and (one / CALLS_NAME).is_file()
    }
    return numbered[max(numbered)] if numbered else None


def _same(recorded: CalledEpisode, episode: CalledEpisode) -> bool:
    return (recorded.mission, recorded.mode, recorded.seed) == (episode.mission, episode.mode, episode.seed)


def _differences(recorded: RecordedCall, request: CallRequest) -> list[str]:
    """Which kinds of content of a question are others than recorded."""
    if recorded.head == request.head and recorded.messages == request.messages:
        return []
    said, asked = _texts(recorded.messages), _texts(request.messages)
    differ = (recorded.head != request.head, said != asked, recorded.pictures != _shown(request))
    return [kind for kind, is_other in zip(_KINDS, differ, strict=True) if is_other]


def _shown(request: CallRequest) -> tuple[str, ...]:
    asked = RecordedCall(agent="", tick=0, number=0, head=b"", messages=request.messages)
    return asked.pictures


def _texts(messages: tuple[bytes, ...]) -> list[object]:
    """The messages without the names of their pictures."""
    return [_without_names(msgspec.json.decode(message)) for message in messages]


def _without_names(message: dict[str, object]) -> dict[str, object]:
    content = message.get("content")
    if isinstance(content, list):
        content = [part if part.get("type") != "picture" else "picture" for part in content]
    return {**message, "content": content}


__all__ = ["AgentCalls", "EpisodeCalls", "check_calls"]
