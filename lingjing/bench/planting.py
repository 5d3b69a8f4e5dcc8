"""Creation of episodes with a known fault: a won episode is played again with a fault in one faculty of one agent.

For each column and seed the base policy is played without a fault. If it wins, `occasions` lists where its trace uses
each faculty of each agent, and faults are tried there one after the other. A fault is accepted if the episode is lost
and the first changed decision is that of the agent at the fault's boundary. Tried plays are stored beside the file, so
that an interrupted command continues.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from shutil import rmtree

import msgspec

from lingjing.bench.columns import Column
from lingjing.bench.executors import Executor
from lingjing.bench.planted import FACULTIES, FaultLabel, PlantedEpisode, PlantedKind, faulty_options
from lingjing.decoding import from_json
from lingjing.mission.instance import Instance
from lingjing.mission.seeding import integer
from lingjing.play.parallel import EpisodeTask
from lingjing.play.report import EpisodeReport
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import CUT_SHORT, DIGEST_VERSION, DecisionRecord

OFF_M = {"localisation": 400.0, "waypoint": 200.0, "routing": 200.0}
"""Displacement to the north by a `displaced` fault, metres. Chosen."""

DECOYS = 2
"""Episodes per column that are won in spite of their fault, and the same number with two faults. Chosen."""


class _TriedPlay(msgspec.Struct, frozen=True, kw_only=True):
    """A play of the search and its result; one line of the log."""

    column: str
    seed: int
    base: str
    faults: tuple[FaultLabel, ...]
    success: bool
    reason: str
    ticks: int
    digest: str
    changed: int | None = None
    """The first boundary at which the faults changed a decision; None if there is none."""
    by: tuple[str, ...] = ()
    """The agents with a changed decision at the boundary `changed`."""


PlayKey = tuple[str, int, str, tuple[FaultLabel, ...]]
"""Column, seed, base policy and faults."""


@dataclass(frozen=True, slots=True)
class PlantingPlan:
    """The limits of the search."""

    base: str
    """The policy that faults are planted in."""
    seeds: Sequence[int]
    """The seeds, in the order of the search."""
    most: int = 3
    """Losing faults per seed, at most."""
    tries: int = 6
    """Plays with single faults per seed, at most."""
    episodes: int = 20
    """Episodes with one fault per column, at most."""
    plays: int | None = None
    """Plays in total, at most; None: no limit."""


@dataclass
class Planting:
    """The search over all columns."""

    plan: PlantingPlan
    folder: Path
    """Holds the log of tried plays and the traces without faults."""
    executor: Executor
    tell: Callable[[str], None] = print
    """Receives a line for each play."""
    tried: dict[PlayKey, _TriedPlay] = field(default_factory=dict)
    """Known plays, also those of earlier commands."""
    played: int = 0
    """The number of plays of this command."""

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        if self._log.is_file():
            for line in self._log.read_bytes().splitlines():
                try:
                    play = from_json(line, _TriedPlay)
                except msgspec.DecodeError:  # an incomplete last line of a killed command
                    continue
                self.tried[play.column, play.seed, play.base, play.faults] = play

    def run(self, columns: Sequence[Column]) -> list[PlantedEpisode]:
        """Search all columns in parallel and return the accepted episodes."""
        episodes: list[PlantedEpisode] = []
        searches = {column.name: _Search(self, column).episodes(episodes) for column in columns}
        waiting = {name: next(search, None) for name, search in searches.items()}
        while any(waiting.values()):
            due = {name: key for name, key in waiting.items() if key is not None}
            if self.plan.plays is None or self.played < self.plan.plays:
                self._play([column for column in columns if column.name in due], list(due.values()))
            for name in due:
                waiting[name] = next(searches[name], None)
        return episodes

    def without(self, column: Column, seed: int) -> Path:
        """Return the folder of the trace without faults."""
        return self.folder / f"{column.name}-{self.plan.base}-{seed}"

    def _play(self, columns: Sequence[Column], keys: Sequence[PlayKey]) -> None:
        """Play the next episode of each column."""
        self.played += len(keys)
        places = {}
        for column, (_, seed, base, faults) in zip(columns, keys, strict=True):
            place = self.folder / f"{column.name}-now" if faults else self.without(column, seed)
            rmtree(place, ignore_errors=True)
            options = faulty_options(str(column.path), column.mode, seed, base, faults, column.settings)
            places[place] = (column, (column.name, seed, base, faults), EpisodeTask(options, place))
        for task, report in self.executor.play([task for _, _, task in places.values()]):
            column, key, _ = places[task.folder]
            self._keep(column, key, report)

    def _keep(self, column: Column, key: PlayKey, report: EpisodeReport) -> None:
        name, seed, base, faults = key
        changed: int | None = None
        by: tuple[str, ...] = ()
        if faults and report.reason not in CUT_SHORT:
            whole = read_trace(self.without(column, seed) / "trace.mcap")
            changed, by = first_change(whole, read_trace(report.trace))
        play = _TriedPlay(column=name, seed=seed, base=base, faults=faults, success=report.success,
                          reason=report.reason, ticks=report.ticks, digest=report.digest, changed=changed,
                          by=by)  # fmt: skip
        self.tried[key] = play
        if report.reason not in CUT_SHORT:  # not logged: the same play may end by itself later
            with self._log.open("ab") as log:
                log.write(msgspec.json.encode(play) + b"\n")
        listed = " + ".join(f"{fault.agent} {fault.faculty} {fault.way} at {fault.boundary}" for fault in faults)
        self.tell(f"{name}-{seed} {base}, {listed or 'no fault'}: {report.reason}, {report.ticks} ticks")

    @property
    def _log(self) -> Path:
        return self.folder / "tried.jsonl"


@dataclass
class _Search:
    """The search in one column, over seeds and faults.

    A kind of fault is given up after three won plays and no lost one. A seed is skipped if its episode equals that of
    another seed, because a mission may have few instances.
    """

    planting: Planting
    column: Column
    lost: dict[tuple[str, str], int] = field(default_factory=dict)
    won: dict[tuple[str, str], int] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    count: dict[PlantedKind, int] = field(default_factory=lambda: {"one": 0, "two": 0, "harmless": 0, "none": 0})

    def episodes(self, accepted: list[PlantedEpisode]) -> Generator[PlayKey]:
        """Yield the next play that is needed; accepted episodes are appended to `accepted`."""
        for seed in self.planting.plan.seeds:
            if self.count["one"] >= self.planting.plan.episodes:
                return
            base = yield from self._played(seed, ())
            if base is None or not base.success or base.digest in self.seen:
                continue
            self.seen.add(base.digest)
            if not self.count["none"]:
                self._accept("none", base, base, accepted)
            losing = yield from self._one_by_one(seed, base, accepted)
            pair = _two(losing)
            if pair and self.count["two"] < DECOYS:
                both = yield from self._played(seed, pair)
                if both is not None and not both.success:
                    self._accept("two", both, base, accepted)

    def _one_by_one(
        self, seed: int, base: _TriedPlay, accepted: list[PlantedEpisode]
    ) -> Generator[PlayKey, None, list[_TriedPlay]]:
        """Try single faults and return the plays that lose the episode."""
        losing: list[_TriedPlay] = []
        for _, fault in zip(range(self.planting.plan.tries), self._faults(seed), strict=False):
            play = yield from self._played(seed, (fault,))
            if play is None or (play.changed, play.by) != (fault.boundary, (fault.agent,)):
                continue
            if not play.success:
                losing.append(play)
                self._accept("one", play, base, accepted)
            elif self.count["harmless"] < DECOYS:
                self._accept("harmless", play, base, accepted)
            if len(losing) >= self.planting.plan.most:
                break
        return losing

    def _played(self, seed: int, faults: tuple[FaultLabel, ...]) -> Generator[PlayKey, None, _TriedPlay | None]:
        """Return a play, which is requested if it is not known. None: it was cut short, or the limit of plays was
        reached.
        """
        key = self.column.name, seed, self.planting.plan.base, faults
        trace = self.planting.without(self.column, seed) / "trace.mcap"
        if key not in self.planting.tried or (not faults and not trace.is_file()):
            yield key
        play = self.planting.tried.get(key)
        if play is None or not trace.is_file() or play.reason in CUT_SHORT:
            return None
        for fault in faults if len(faults) == 1 else ():
            counted = self.won if play.success else self.lost
            counted[fault.faculty, fault.way] = counted.get((fault.faculty, fault.way), 0) + 1
        return play

    def _faults(self, seed: int) -> Iterator[FaultLabel]:
        """Yield faults to try, one faculty after the other."""
        trace = read_trace(self.planting.without(self.column, seed) / "trace.mcap")
        used = occasions(trace)
        tracks = [
            sorted(
                (fault_at for fault_at in used if fault_at.faculty == faculty),
                key=lambda fault_at: integer(
                    seed, f"{self.column.name}/{fault_at.agent}/{fault_at.faculty}/{fault_at.way}/{fault_at.boundary}"
                ),
            )
            for faculty in sorted(FACULTIES, key=lambda name: integer(seed, f"{self.column.name}/{name}"))
        ]
        for turn in zip_longest(*tracks):
            for fault in turn:
                if fault is not None and not self._hopeless(fault):
                    yield fault

    def _hopeless(self, fault: FaultLabel) -> bool:
        kind = fault.faculty, fault.way
        return self.won.get(kind, 0) >= 3 and not self.lost.get(kind, 0)

    def _accept(self, kind: PlantedKind, play: _TriedPlay, base: _TriedPlay, accepted: list[PlantedEpisode]) -> None:
        self.count[kind] += 1
        accepted.append(PlantedEpisode(kind=kind, mission=self.column.mission, mode=self.column.mode, seed=play.seed,
                                    base=play.base, faults=play.faults, without=base.digest, digest=play.digest,
                                    reason=play.reason, ticks=play.ticks,
                                    settings=tuple(self.column.settings.items()),
                                    digest_version=DIGEST_VERSION))  # fmt: skip


def occasions(trace: Trace) -> tuple[FaultLabel, ...]:
    """Return faults at the uses of each faculty of each agent: at the first such boundary, and at the middle one."""
    used: dict[tuple[str, str, str], list[int]] = {}
    for tick, record in enumerate(trace.boundaries[1:]):
        for made in record.decisions:
            for faculty, way in dict.fromkeys(_faculties(trace.header.instance, made)):
                used.setdefault((made.agent, faculty, way), []).append(tick)
    return tuple(
        FaultLabel(agent=agent, faculty=faculty, boundary=tick, way=way,
                   north_m=OFF_M[faculty] if way == "displaced" else 0.0)
        for (agent, faculty, way), ticks in used.items()
        for tick in dict.fromkeys((ticks[0], ticks[len(ticks) // 2]))
    )  # fmt: skip


def _faculties(instance: Instance, made: DecisionRecord) -> Iterator[tuple[str, str]]:
    """Yield the faculties that an agent used in a decision, each with the way in which it can fail."""
    agent = next(spec for spec in instance.agents if spec.id == made.agent)
    bodies = {entity.id: entity for entity in instance.entities}
    sees = any(bodies[name].cameras for name in agent.controls)
    kinds = {spec.kind: spec.category for spec in instance.messages}
    for message in made.decision.messages:
        if kinds.get(message.kind) == "report" and sees:
            yield "perception", "blind"
            if "position" in message.body:
                yield "localisation", "displaced"
        else:
            yield "handoff", "dropped"
            if "assignee" in message.body:
                yield "handoff", "misaddressed"
    command = made.decision.command
    if command is None:
        return
    yield "execution", "withheld"
    body = bodies.get(command.resource or next(iter(agent.commands), ""))
    motions = {verb.name: verb.motion for verb in body.verbs} if body is not None else {}
    motion = motions.get(command.verb, "")
    faculty = "waypoint" if "straight" in motions.values() else "routing"
    if motion in ("straight", "route"):
        yield faculty, "displaced"
    elif motion == "turn" and faculty == "routing":
        yield faculty, "mirrored"


def first_change(without: Trace, changed: Trace) -> tuple[int | None, tuple[str, ...]]:
    """Return the first boundary at which decisions differ, and the agents with different decisions."""
    for tick, (record, other) in enumerate(zip(without.boundaries[1:], changed.boundaries[1:], strict=False)):
        differing = tuple(
            here.agent
            for here, there in zip(record.decisions, other.decisions, strict=False)
            if (here.decision, here.substituted) != (there.decision, there.substituted)
        )
        if differing:
            return tick, differing
    return None, ()


def _two(losing: Iterable[_TriedPlay]) -> tuple[FaultLabel, ...]:
    """Return the faults of two plays with different agents and faculties, or () if there are no such plays."""
    faults = [play.faults[0] for play in losing]
    for number, fault in enumerate(faults):
        for other in faults[number + 1 :]:
            if fault.agent != other.agent and fault.faculty != other.faculty:
                return fault, other
    return ()
