"""Makes episodes with a known fault: a won episode is played again with a fault in one faculty of one agent.

For each column (a mission in a mode) and seed the base policy is played without a fault. If it wins, `occasions` reads
from its trace where each faculty of each agent was used, and faults are tried there one after the other. A fault counts
if the episode is then lost and if the first decision that differs from those without it is the agent's at the fault's
boundary. What was tried is kept beside the file, so that the command goes on where it was stopped.
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
from lingjing.mission.instance import Instance
from lingjing.mission.seeding import integer
from lingjing.play.parallel import EpisodeTask
from lingjing.play.report import EpisodeReport
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import CUT_SHORT, DIGEST_VERSION, DecisionRecord

OFF_M = {"localisation": 400.0, "waypoint": 200.0, "routing": 200.0}
"""How far to the north places are that a fault displaces."""

DECOYS = 2
"""So many episodes of a column that are won in spite of their fault, and so many with two faults."""


class TriedPlay(msgspec.Struct, frozen=True, kw_only=True):
    """A play that was made: what was played and what came of it. `changed` is the first boundary at which an agent
    decided otherwise than without the faults, and `by` these agents."""

    column: str
    seed: int
    base: str
    faults: tuple[FaultLabel, ...]
    success: bool
    reason: str
    ticks: int
    digest: str
    changed: int | None = None
    by: tuple[str, ...] = ()


PlayKey = tuple[str, int, str, tuple[FaultLabel, ...]]


@dataclass(frozen=True, slots=True)
class PlantingPlan:
    """What is looked for: `most` losing faults a seed, after `tries` plays at most; `seeds` in order, `episodes` of one
    fault a column at most; so many `plays` in all (None: as many as it takes)."""

    base: str
    seeds: Sequence[int]
    most: int = 3
    tries: int = 6
    episodes: int = 20
    plays: int | None = None


@dataclass
class Planting:
    """The search over columns; `folder` keeps what was tried and the traces without faults."""

    plan: PlantingPlan
    folder: Path
    executor: Executor
    tell: Callable[[str], None] = print
    tried: dict[PlayKey, TriedPlay] = field(default_factory=dict)
    played: int = 0

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        if self._log.is_file():
            for line in self._log.read_bytes().splitlines():
                try:
                    one = msgspec.json.decode(line, type=TriedPlay)
                except msgspec.DecodeError:  # the line that was being written when it was killed
                    continue
                self.tried[one.column, one.seed, one.base, one.faults] = one

    def run(self, columns: Sequence[Column]) -> list[PlantedEpisode]:
        """Search all columns beside each other; the episodes found."""
        found: list[PlantedEpisode] = []
        searches = {column.name: _Search(self, column).episodes(found) for column in columns}
        waiting = {name: next(search, None) for name, search in searches.items()}
        while any(waiting.values()):
            due = {name: key for name, key in waiting.items() if key is not None}
            if self.plan.plays is None or self.played < self.plan.plays:
                self._play([column for column in columns if column.name in due], list(due.values()))
            for name in due:
                waiting[name] = next(searches[name], None)
        return found

    def without(self, column: Column, seed: int) -> Path:
        """Where the trace without faults is kept."""
        return self.folder / f"{column.name}-{self.plan.base}-{seed}"

    def _play(self, columns: Sequence[Column], keys: Sequence[PlayKey]) -> None:
        """Play what is due, one episode a column."""
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
        one = TriedPlay(column=name, seed=seed, base=base, faults=faults, success=report.success, reason=report.reason,
                        ticks=report.ticks, digest=report.digest, changed=changed, by=by)  # fmt: skip
        self.tried[key] = one
        if report.reason not in CUT_SHORT:  # it may end by itself another time
            with self._log.open("ab") as log:
                log.write(msgspec.json.encode(one) + b"\n")
        said = " + ".join(f"{fault.agent} {fault.faculty} {fault.way} at {fault.boundary}" for fault in faults)
        self.tell(f"{name}-{seed} {base}, {said or 'no fault'}: {report.reason}, {report.ticks} ticks")

    @property
    def _log(self) -> Path:
        return self.folder / "tried.jsonl"


@dataclass
class _Search:
    """The search in one column: seed after seed, fault after fault.

    A way to fail that three plays were won in spite of, and none was lost by, is not tried again. A seed that gives an
    episode which another one gave (a mission may draw one of few instances) is passed over."""

    planting: Planting
    column: Column
    lost: dict[tuple[str, str], int] = field(default_factory=dict)
    won: dict[tuple[str, str], int] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)
    count: dict[PlantedKind, int] = field(default_factory=lambda: {"one": 0, "two": 0, "harmless": 0, "none": 0})

    def episodes(self, found: list[PlantedEpisode]) -> Generator[PlayKey]:
        """What is to be played next; episodes go to `found`."""
        for seed in self.planting.plan.seeds:
            if self.count["one"] >= self.planting.plan.episodes:
                return
            base = yield from self._played(seed, ())
            if base is None or not base.success or base.digest in self.seen:
                continue
            self.seen.add(base.digest)
            if not self.count["none"]:
                self._found("none", base, base, found)
            losing = yield from self._one_by_one(seed, base, found)
            pair = _two(losing)
            if pair and self.count["two"] < DECOYS:
                both = yield from self._played(seed, pair)
                if both is not None and not both.success:
                    self._found("two", both, base, found)

    def _one_by_one(
        self, seed: int, base: TriedPlay, found: list[PlantedEpisode]
    ) -> Generator[PlayKey, None, list[TriedPlay]]:
        """Try single faults; those that lose the episode."""
        losing: list[TriedPlay] = []
        for _, fault in zip(range(self.planting.plan.tries), self._faults(seed), strict=False):
            play = yield from self._played(seed, (fault,))
            if play is None or (play.changed, play.by) != (fault.boundary, (fault.agent,)):
                continue
            if not play.success:
                losing.append(play)
                self._found("one", play, base, found)
            elif self.count["harmless"] < DECOYS:
                self._found("harmless", play, base, found)
            if len(losing) >= self.planting.plan.most:
                break
        return losing

    def _played(self, seed: int, faults: tuple[FaultLabel, ...]) -> Generator[PlayKey, None, TriedPlay | None]:
        """The play, made if it was not; None for one that was cut short, or not made because the plays are used up."""
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
        """Faults worth trying, the faculties in turn."""
        trace = read_trace(self.planting.without(self.column, seed) / "trace.mcap")
        used = occasions(trace)
        tracks = [
            sorted(
                (one for one in used if one.faculty == faculty),
                key=lambda one: integer(seed, f"{self.column.name}/{one.agent}/{one.faculty}/{one.way}/{one.boundary}"),
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

    def _found(self, kind: PlantedKind, play: TriedPlay, base: TriedPlay, found: list[PlantedEpisode]) -> None:
        self.count[kind] += 1
        found.append(PlantedEpisode(kind=kind, mission=self.column.mission, mode=self.column.mode, seed=play.seed,
                                    base=play.base, faults=play.faults, without=base.digest, digest=play.digest,
                                    reason=play.reason, ticks=play.ticks,
                                    settings=tuple(self.column.settings.items()),
                                    digest_version=DIGEST_VERSION))  # fmt: skip


def occasions(trace: Trace) -> tuple[FaultLabel, ...]:
    """Where each faculty of each agent was used: faults that begin at the first such boundary, and at the one in the
    middle."""
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
    """What an agent used in a decision, and how it could have failed."""
    agent = next(one for one in instance.agents if one.id == made.agent)
    bodies = {entity.id: entity for entity in instance.entities}
    sees = any(bodies[name].cameras for name in agent.controls)
    kinds = {one.kind: one.category for one in instance.messages}
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


def first_change(without: Trace, given: Trace) -> tuple[int | None, tuple[str, ...]]:
    """The first boundary at which decisions differ, and whose."""
    for tick, (one, other) in enumerate(zip(without.boundaries[1:], given.boundaries[1:], strict=False)):
        differing = tuple(
            here.agent
            for here, there in zip(one.decisions, other.decisions, strict=False)
            if (here.decision, here.substituted) != (there.decision, there.substituted)
        )
        if differing:
            return tick, differing
    return None, ()


def _two(losing: Iterable[TriedPlay]) -> tuple[FaultLabel, ...]:
    """Faults of two plays that are of different agents and faculties; () if there are no such two."""
    faults = [play.faults[0] for play in losing]
    for number, one in enumerate(faults):
        for other in faults[number + 1 :]:
            if one.agent != other.agent and one.faculty != other.faculty:
                return one, other
    return ()
