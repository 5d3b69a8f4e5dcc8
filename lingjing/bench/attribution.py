"""How well methods of attribution name faults that were planted: `AttributionSuite`, `AttributionRun`, tables.

A method gets the trace of an episode and names what made it fail: a sequence of `NamedFault`, the most likely first,
empty if nothing did. `families` is what the rules of `lingjing.analysis.families` say, `blame` what branches of the
episode show (`lingjing.causal.blame`); others are functions in files (`FILE.py:FUNCTION`), which may return plain
(agent, faculty, boundary). The header of such a trace holds the faulty policy's options, which name the faults. A
method gets a copy without them, which lies apart from the answers and the episodes; one that says by `redrives` that it
runs policies again gets the trace itself, for without their options it could not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, cast

import msgspec
from pydantic import Field, ValidationError

from lingjing.analysis.families import RecordLink, attribute
from lingjing.analysis.played_city import surroundings_of
from lingjing.analysis.shares import wilson
from lingjing.bench.executors import Executor
from lingjing.bench.planted import FACULTIES, PlantedEpisode, PlantedKind, read_planted
from lingjing.bench.suite import ATTRIBUTION, NameOrFile, ShortText, SuitePart, read_document
from lingjing.bench.table_cells import UNDEFINED, ResultCell, ResultLine, ResultTable
from lingjing.errors import LingjingError, UsageError
from lingjing.play.parallel import EpisodeTask
from lingjing.play.python_files import function_of
from lingjing.play.report import EpisodeReport
from lingjing.suggest import nearest_or
from lingjing.trace.copying import copy_trace
from lingjing.trace.digest import last_digest
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import CUT_SHORT, DIGEST_VERSION, DigestVersion

BRANCHES = 60
"""Branches that `blame` may play for an episode here; shares and placebos, which name nobody, are left to `lingjing
blame` itself."""


class NamedFault(msgspec.Struct, frozen=True, kw_only=True):
    """What a method names: a faculty of an agent, and the boundary from which it failed (None: not known)."""

    agent: str
    faculty: str
    boundary: int | None = None


NamesFaults = Callable[[Trace], Sequence[NamedFault]]


@dataclass(frozen=True, slots=True)
class AttributionMethod:
    """A method: what it says of a trace. One that `redrives` policies gets their options with the trace."""

    ask: NamesFaults
    redrives: bool = False


class AttributionSuite(SuitePart):
    """A suite that measures methods of attribution: the file of planted faults, and who is measured."""

    suite: Literal[1] = Field(description="the version of this form")
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$", description="a word for folders")
    title: str = Field("", max_length=200, description="what its tables are headed with")
    about: str = Field("", max_length=4000, description="what is measured")
    planted: NameOrFile = Field(description="the file of episodes with planted faults, beside the suite")
    methods: tuple[ShortText, ...] = Field(("families",), min_length=1, strict=False, description="who is measured")


class AttributionRow(msgspec.Struct, frozen=True, kw_only=True):
    """A method's answer for an episode. `standing` is `differs` if the episode is another here than in the file, for
    which nothing is counted, nor for one that was `cut short`; `failed` if the method raised, which counts as an answer
    of nothing."""

    method: str
    episode: PlantedEpisode
    named: tuple[NamedFault, ...] = ()
    standing: Literal["answered", "differs", "failed", "cut short"] = "answered"
    detail: str = ""

    @property
    def names_first(self) -> bool:
        """Whether the first that is named is the planted fault, agent and faculty."""
        return bool(self.named) and _pair(self.named[0]) == _planted(self.episode)[0]

    @property
    def names_all(self) -> bool:
        """Whether all that was planted is among what is named."""
        return set(_planted(self.episode)) <= {_pair(one) for one in self.named}

    @property
    def boundary_off(self) -> int | None:
        """By how many boundaries the first that is named is off, if agent and faculty are right and one is named."""
        if not self.names_first or self.named[0].boundary is None:
            return None
        return abs(self.named[0].boundary - self.episode.faults[0].boundary)


def _pair(one: NamedFault) -> tuple[str, str]:
    return one.agent, one.faculty


def _planted(episode: PlantedEpisode) -> list[tuple[str, str]]:
    return [(one.agent, one.faculty) for one in episode.faults]


def is_attribution_suite(path: Path) -> bool:
    """Whether a suite file measures methods of attribution. Raises `UsageError` for one that cannot be read."""
    return ATTRIBUTION in read_document(path)


def read_attribution_suite(path: Path) -> tuple[AttributionSuite, tuple[PlantedEpisode, ...]]:
    """The suite and its episodes. Raises `UsageError`."""
    try:
        suite = AttributionSuite.model_validate(read_document(path))
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors())
        raise UsageError(f"{path}: {faults}", hint="docs/studies.md says what such a suite may hold") from error
    return suite, read_planted(path.parent / suite.planted)


def find_method(name: str) -> AttributionMethod:
    """The method of that name, or the function `FILE.py:FUNCTION`. Raises `UsageError`."""
    if name in METHODS:
        return METHODS[name]
    if not Path(name.partition(":")[0]).is_file():
        hint = nearest_or(name, METHODS, f"known are {', '.join(METHODS)}, and FILE.py:FUNCTION")
        raise UsageError(f"there is no method of attribution `{name}`", hint=hint)
    method = function_of(name, "method")
    return AttributionMethod(
        lambda trace: tuple(map(_named, method(trace))), redrives=bool(getattr(method, "redrives", False))
    )


def _named(given: object) -> NamedFault:
    if isinstance(given, NamedFault):
        return given
    agent, faculty, boundary = cast("tuple[str, str, int | None]", given)
    return NamedFault(agent=str(agent), faculty=str(faculty), boundary=boundary)


def by_families(trace: Trace) -> tuple[NamedFault, ...]:
    """What the failure family of an episode names: the faculty that the family is about, the agent of its chain that
    was to use it, the tick of the breakdown."""
    found = attribute(trace)
    faculty = _FACULTY_OF.get(found.family) if found is not None else None
    if found is None or faculty is None:
        return ()
    agent = next(filter(None, (_agent_of(trace, link) for link in found.chain)), "")
    return (NamedFault(agent=agent, faculty=faculty, boundary=found.tick),)


_FACULTY_OF = {
    "perception_miss": "perception",
    "object_confusion": "perception",
    "localisation_error": "localisation",
    "handoff_break": "handoff",
    "coordination_deadlock": "execution",
    "context_drift": "waypoint",
}


def _agent_of(trace: Trace, link: RecordLink) -> str:
    """The agent that a record is about: it is the record, it sent the message, or the text begins with it."""
    agents = [one.id for one in trace.header.instance.agents]
    envelopes = (one for record in trace.boundaries for one in record.messages if link.kind == "message")
    sender = next((one.sender for one in envelopes if one.id == link.record), "")
    words = (sender, link.record, link.record.partition(" ")[0], link.text.partition(" ")[0])
    return next((word for word in words if word in agents), "")


def by_blame(trace: Trace) -> tuple[NamedFault, ...]:
    """What `lingjing blame` names: the causes of all smallest repairs, those of the best repair first."""
    from lingjing.causal.blame import BlameOptions, blame

    found = blame(trace, BlameOptions(branches=BRANCHES, placebos=0, shares=False, jobs=1))
    causes = (cause for repair in found.repairs for cause in repair.causes)
    return tuple(NamedFault(agent=one.agent, faculty=one.faculty, boundary=one.boundary) for one in causes)


METHODS: dict[str, AttributionMethod] = {
    "families": AttributionMethod(by_families),
    "blame": AttributionMethod(by_blame, redrives=True),
}


@dataclass
class AttributionRun:
    """Plays episodes and asks methods of them. Answers are kept in `folder`: what was stopped goes on from there."""

    folder: Path
    methods: dict[str, AttributionMethod]
    executor: Executor
    tell: Callable[[str], None] = print

    def run(self, episodes: Sequence[PlantedEpisode]) -> list[AttributionRow]:
        """Every method's answer for every episode, in the episodes' order."""
        self.folder.mkdir(parents=True, exist_ok=True)
        known = {(row.method, row.episode): row for row in self._kept()}
        places = {
            self.folder / f"episode-{number}": episode
            for number, episode in enumerate(episodes)
            if any((name, episode) not in known for name in self.methods)
        }
        for place in places:  # what a killed command has left
            _clear(place)
        tasks = (EpisodeTask(episode.options(), place) for place, episode in places.items())
        for task, report in self.executor.play(tasks):
            episode = places[task.folder]
            for name, method in self.methods.items():
                if (name, episode) not in known:
                    known[name, episode] = self._answer(name, method, episode, report)
            _clear(task.folder)
        return [known[name, episode] for episode in episodes for name in self.methods]

    def _answer(
        self, name: str, method: AttributionMethod, episode: PlantedEpisode, report: EpisodeReport
    ) -> AttributionRow:
        """A row for an episode that was played; kept, unless it was cut short: then it is played again another time."""
        if report.reason in CUT_SHORT:
            row = AttributionRow(method=name, episode=episode, standing="cut short", detail=report.reason)
        elif _played_digest(report, episode.digest_version) != episode.digest:
            row = AttributionRow(
                method=name, episode=episode, standing="differs", detail="its digest is another one here"
            )
        else:
            row = self._asked(name, method, episode, Path(report.trace))
        if row.standing != "cut short":
            self._keep(row)
        said = ", ".join(f"{one.agent} {one.faculty} at {one.boundary}" for one in row.named) or "nothing"
        self.tell(f"{episode.name}; {name}: {said if row.standing == 'answered' else row.standing}")
        return row

    def _asked(self, name: str, method: AttributionMethod, episode: PlantedEpisode, path: Path) -> AttributionRow:
        try:
            trace = read_trace(path)
            with TemporaryDirectory(prefix="lingjing-attribution-") as apart:
                given = trace if method.redrives else without_labels(trace, Path(apart) / "trace.mcap")
                answer = tuple(method.ask(given))
        except Exception as error:  # noqa: BLE001 - a method of somebody's own: whatever it raises is its answer
            detail = f"{type(error).__name__}: {error}"
            return AttributionRow(method=name, episode=episode, standing="failed", detail=detail)
        return AttributionRow(method=name, episode=episode, named=answer)

    def _keep(self, row: AttributionRow) -> None:
        with self._file.open("ab") as answers:
            answers.write(msgspec.json.encode(row) + b"\n")

    def _kept(self) -> Iterable[AttributionRow]:
        for line in self._file.read_bytes().splitlines() if self._file.is_file() else ():
            try:
                yield msgspec.json.decode(line, type=AttributionRow)
            except msgspec.DecodeError:  # the line that was being written when it was killed
                continue

    @property
    def _file(self) -> Path:
        return self.folder / "answers.jsonl"


def _played_digest(report: EpisodeReport, version: DigestVersion) -> str:
    """The digest of the played episode in the version of the planted one; "" if its trace cannot be read."""
    if version == DIGEST_VERSION:
        return report.digest
    try:
        return last_digest(read_trace(report.trace), version)
    except LingjingError:
        return ""


def without_labels(trace: Trace, path: Path) -> Trace:
    """A copy of the trace, at `path`, without the options of its policies, which name the planted faults."""
    bindings = tuple(msgspec.structs.replace(one, arguments={}) for one in trace.header.bindings)
    header = msgspec.structs.replace(trace.header, bindings=bindings)
    return copy_trace(trace, header, path, surroundings_of(trace))


def _clear(folder: Path) -> None:
    from shutil import rmtree

    rmtree(folder, ignore_errors=True)


# -- tables

_NOT_COUNTED = {
    "differs": "are others here than when they were made",
    "cut short": "were cut short, will be played again by the same command",
}


def attribution_tables(rows: Sequence[AttributionRow], title: str) -> tuple[ResultTable, ...]:
    """All methods on all episodes; then by faculty and by mission, single faults alone."""
    counted = [row for row in rows if row.standing not in _NOT_COUNTED]
    notes = []
    for standing, why in _NOT_COUNTED.items():
        left_out = len({row.episode for row in rows if row.standing == standing})
        if left_out:
            notes.append(f"{left_out} episodes {why}, and are not counted")
    raised = sum(row.standing == "failed" for row in counted)
    if raised:
        notes.append(f"in {raised} cases a method raised, which counts as an answer of nothing")
    heads = ("Agent and faculty", "Among all named", "Boundary within 1", "Both of two", "Harmless", "No fault")
    methods = list(dict.fromkeys(row.method for row in rows))
    whole = tuple(ResultLine("", (name,), _cells([row for row in counted if row.method == name])) for name in methods)
    short = heads[:3]
    by_faculty = tuple(
        ResultLine(name, (faculty,), _cells(some)[:3])
        for name in methods
        for faculty in FACULTIES
        if (some := [row for row in counted if row.method == name and _faculty(row) == faculty])
    )
    by_mission = tuple(
        ResultLine(name, (mission, base), _cells(some)[:3])
        for name in methods
        for mission, base in dict.fromkeys((row.episode.mission, row.episode.base) for row in counted)
        if (some := [row for row in counted if (row.method, row.episode.mission, row.episode.base)
                     == (name, mission, base) and row.episode.kind == "one"])
    )  # fmt: skip
    return (
        ResultTable("attribution", title, ("Method",), heads, whole, tuple(notes)),
        ResultTable("attribution", f"{title}, by faculty", ("Faculty",), short, by_faculty),
        ResultTable("attribution", f"{title}, by mission", ("Mission", "Policy"), short, by_mission),
    )


def _faculty(row: AttributionRow) -> str:
    return row.episode.faults[0].faculty if row.episode.kind == "one" else ""


def _cells(rows: Sequence[AttributionRow]) -> tuple[ResultCell, ...]:
    def of(kind: PlantedKind) -> list[AttributionRow]:
        return [row for row in rows if row.episode.kind == kind]

    ones, twos = of("one"), of("two")
    near = [row.boundary_off is not None and row.boundary_off <= 1 for row in ones]
    return (
        _share([row.names_first for row in ones]),
        _share([row.names_all for row in ones]),
        _share(near),
        _share([row.names_all for row in twos]),
        *(_share([not row.named for row in of(kind)]) for kind in ("harmless", "none")),
    )  # fmt: skip


def _share(right: Sequence[bool]) -> ResultCell:
    """`14/16 (87.5, 64.0 to 96.5)`: how often, in per cent, with Wilson's interval."""
    if not right:
        return ResultCell(UNDEFINED)
    low, high = wilson(sum(right), len(right))
    share = 100 * sum(right) / len(right)
    return ResultCell(f"{sum(right)}/{len(right)} ({share:.1f}, {100 * low:.1f} to {100 * high:.1f})", share)
