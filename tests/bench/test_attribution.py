"""Episodes with planted faults: their file, the count of a method's answers, and the trace that a method receives."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import EpisodeReport, Trace, run
from lingjing import read as read_trace
from lingjing.bench import planting
from lingjing.bench.attribution import (
    METHODS,
    AttributionMethod,
    AttributionRow,
    AttributionRun,
    NamedFault,
    attribution_tables,
    find_method,
    read_attribution_suite,
)
from lingjing.bench.columns import columns
from lingjing.bench.executors import LocalExecutor
from lingjing.bench.planted import FACULTIES, FaultLabel, PlantedEpisode, encode_planted, read_planted
from lingjing.bench.planting import Planting, PlantingPlan, first_change, occasions
from lingjing.bench.suite import attribution_suites, find_suite, shipped_suites
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import run_command, shipped_missions
from lingjing.testing.traces import last_digest
from lingjing.trace.records import DIGEST_VERSION
from tests.bench.suite_kit import EpisodeTask

SHIPPED = find_suite("planted")
FAULT = FaultLabel(agent="scout[1]", faculty="perception", boundary=7, way="blind")
OTHER = FaultLabel(agent="skipper", faculty="execution", boundary=3, way="withheld")


def episode(kind: str = "one", *faults: FaultLabel, seed: int = 1) -> PlantedEpisode:
    return PlantedEpisode(
        kind=kind, mission="ssr", mode="star", seed=seed, base="oracle", faults=faults, without="a", digest="b",
        reason="budget", ticks=60, digest_version=DIGEST_VERSION,
    )  # fmt: skip


def answer(planted: PlantedEpisode, *named: NamedFault, method: str = "m", **more: object) -> AttributionRow:
    return AttributionRow(method=method, episode=planted, named=named, **more)


def named(agent: str, faculty: str, boundary: int | None = None) -> NamedFault:
    return NamedFault(agent=agent, faculty=faculty, boundary=boundary)


# -- the file


def test_the_planted_file_reads_back_and_has_a_fixed_order(tmp_path: Path) -> None:
    some = [episode("one", FAULT, seed=2), episode("none"), episode("two", FAULT, OTHER)]
    path = tmp_path / "planted.jsonl"
    path.write_bytes(encode_planted(some))
    assert set(read_planted(path)) == set(some)
    assert encode_planted(reversed(some)) == path.read_bytes()
    path.write_bytes(path.read_bytes().replace(b"lingjing-planted/1", b"lingjing-planted/9"))
    with pytest.raises(UsageError, match="has the format lingjing-planted/9"):
        read_planted(path)
    path.write_bytes(b"")
    with pytest.raises(UsageError, match="not a file of planted faults"):
        read_planted(path)


def test_an_episode_may_have_settings_of_its_own() -> None:
    item = msgspec.structs.replace(episode("none", seed=4), settings=(("uavs", 2.0),))
    assert item.name == "ssr-star-uavs=2-4 oracle: no fault"
    assert item.options().settings == {"uavs": 2.0}
    assert episode("none").options().settings == {}
    assert b"settings" not in encode_planted([episode("none")])


def test_a_setting_that_the_mission_does_not_have_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "mine.jsonl"
    command = ["bench", "plant", "-o", str(out), "--plays", "0", "--columns", "idf-broadcast", "--policies", "oracle"]
    assert run_command([*command, "--set", "vans=1"]) == ExitCode.USAGE
    assert "vans" in capsys.readouterr().err
    assert not out.exists()
    assert run_command([*command, "--set", "dogs=1"]) == ExitCode.OK
    assert read_planted(out) == ()


def test_the_shipped_episodes_match_their_kinds_and_the_shipped_file() -> None:
    suite, episodes = read_attribution_suite(SHIPPED)
    assert suite.name == "planted"
    assert len({planted.name for planted in episodes}) == len(episodes)
    known = {(column.mission, column.mode) for column in columns(shipped_missions())}
    for planted in episodes:
        assert (planted.mission, planted.mode) in known
        assert len(planted.faults) == {"one": 1, "two": 2, "harmless": 1, "none": 0}[planted.kind]
        assert (planted.reason == "success") == (planted.kind in ("harmless", "none"))
        assert (planted.digest == planted.without) == (planted.kind == "none")
        assert all(fault.faculty in FACULTIES for fault in planted.faults)
        assert planted.options().policy == f"faulty-{planted.base}"
    assert encode_planted(episodes) == (SHIPPED.parent / suite.planted).read_bytes()


def test_the_planted_suite_is_not_among_the_ordinary_suites(capsys: pytest.CaptureFixture[str]) -> None:
    assert attribution_suites() == ("planted",)
    assert "planted" not in shipped_suites()
    assert run_command(["bench", "list"]) == ExitCode.OK
    assert "Attribution of planted faults" in capsys.readouterr().out
    assert run_command(["bench", "planted", "--check", "--missions", "ssr"]) == ExitCode.OK
    assert "methods: families" in capsys.readouterr().err
    assert run_command(["bench", "reference", "--check", "--method", "families"]) == ExitCode.USAGE
    assert "measures no attribution methods" in capsys.readouterr().err


# -- what is counted


def test_agent_and_faculty_must_both_be_right() -> None:
    planted = episode("one", FAULT)
    assert answer(planted, named("scout[1]", "perception", 8)).names_first
    assert not answer(planted, named("scout[2]", "perception", 7)).names_first
    assert not answer(planted, named("scout[1]", "localisation", 7)).names_first
    assert not answer(planted).names_first
    late = answer(planted, named("skipper", "execution", 7), named("scout[1]", "perception", 7))
    assert (late.names_first, late.names_all, late.boundary_off) == (False, True, None)
    assert answer(planted, named("scout[1]", "perception", 5)).boundary_off == 2
    assert answer(planted, named("scout[1]", "perception")).boundary_off is None
    both = episode("two", FAULT, OTHER)
    assert answer(both, named("skipper", "execution"), named("scout[1]", "perception")).names_all
    assert not answer(both, named("skipper", "execution")).names_all


def test_the_tables_match_a_count_by_hand() -> None:
    rows = [
        answer(episode("one", FAULT, seed=1), named("scout[1]", "perception", 8)),
        answer(episode("one", FAULT, seed=2), named("scout[1]", "perception", 9)),
        answer(episode("one", FAULT, seed=3)),
        answer(episode("one", OTHER, seed=4), standing="failed", detail="ValueError: no"),
        answer(episode("one", OTHER, seed=5), standing="differs"),
        answer(episode("two", FAULT, OTHER), named("scout[1]", "perception"), named("skipper", "execution")),
        answer(episode("harmless", FAULT, seed=6), named("scout[1]", "perception")),
        answer(episode("none", seed=7)),
    ]
    whole, by_faculty, by_mission = attribution_tables(rows, "T")
    (line,) = whole.lines
    assert [cell.text.partition(" ")[0] for cell in line.cells] == ["2/4", "2/4", "1/4", "1/1", "0/1", "1/1"]
    assert line.cells[0].text == "2/4 (50.0, 15.0 to 85.0)"  # Wilson's interval of 2 of 4
    assert len(whole.notes) == 2
    assert [(line.label, line.cells[0].value) for line in by_faculty.lines] == [
        (("perception",), pytest.approx(200 / 3)), (("execution",), 0.0),
    ]  # fmt: skip
    assert [(line.label, line.cells[0].value) for line in by_mission.lines] == [(("ssr", "oracle"), 50.0)]
    assert math.isnan(attribution_tables(rows[:1], "T")[0].lines[0].cells[3].value)


# -- methods and episodes


class Stored:
    """An executor that plays nothing: each episode is the same stored trace."""

    jobs = 1

    def __init__(self, report: EpisodeReport) -> None:
        self.report, self.played = report, 0

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        for task in tasks:
            self.played += 1
            yield task, self.report


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> EpisodeReport:
    """A small harbour mission in which the skipper's commands are not sent from the third boundary on."""
    fault = {"agent": "skipper[1]", "faculty": "execution", "boundary": 2}
    return run(
        Path(__file__).parents[1] / "causal" / "shrink" / "harbour.ljs", policy="faulty-oracle", seed=3,
        settings={"people": 1.0, "boats": 1.0}, policy_args={"faults": [fault]}, overview=False,
        out=tmp_path_factory.mktemp("harbour") / "episode",
    )  # fmt: skip


def test_a_method_that_only_reads_receives_no_labels_and_its_answers_are_kept(
    report: EpisodeReport, tmp_path: Path
) -> None:
    seen: dict[str, object] = {}
    beside: dict[str, set[str]] = {}
    whole = read_trace(report.trace)

    def reader(name: str) -> AttributionMethod:
        def ask(trace: Trace) -> list[NamedFault]:
            seen[name] = trace.header.bindings[0].arguments
            assert read_trace(trace.path).header == trace.header
            assert [planted.digest for planted in trace.boundaries] == [planted.digest for planted in whole.boundaries]
            assert lingjing.verify(trace.path).state == "ok"
            beside[name] = {path.name for path in trace.path.parent.iterdir()}
            return [named("skipper[1]", "execution", 2)]

        return AttributionMethod(ask, redrives=name == "again")

    def raises(trace: Trace) -> list[NamedFault]:
        raise RuntimeError("no idea")

    methods = {"reads": reader("reads"), "again": reader("again"), "raises": AttributionMethod(raises)}
    planted = msgspec.structs.replace(episode("one", OTHER), digest=report.digest)
    other = msgspec.structs.replace(planted, seed=2, digest="another")
    executor = Stored(report)
    left = tmp_path / "out" / "episode-0"
    left.mkdir(parents=True)  # a folder that a killed command has left
    rows = AttributionRun(tmp_path / "out", methods, executor, lambda line: None).run([planted, other])
    assert seen["reads"] == {}
    assert beside["reads"] == {"trace.mcap"}
    assert "execution" in str(seen["again"])
    assert [row.standing for row in rows] == ["answered", "answered", "failed", *["differs"] * 3]
    assert rows[2].detail == "RuntimeError: no idea"
    assert executor.played == 2
    assert not left.exists()
    again = AttributionRun(tmp_path / "out", methods, executor, lambda line: None).run([planted, other])
    assert again == rows
    assert executor.played == 2  # answers are kept


def test_an_episode_that_was_cut_short_is_not_counted_and_is_played_again(
    report: EpisodeReport, tmp_path: Path
) -> None:
    planted = msgspec.structs.replace(episode("one", OTHER), digest=report.digest)
    methods = {"one": AttributionMethod(lambda trace: [named("skipper[1]", "execution", 2)])}
    lost = Stored(msgspec.structs.replace(report, reason="infrastructure-abort", digest=""))
    (row,) = AttributionRun(tmp_path, methods, lost, lambda line: None).run([planted])
    assert row.standing == "cut short"
    whole, *_ = attribution_tables([row], "T")
    assert whole.notes == ("1 episodes were cut short (the same command plays them again) and are not counted",)
    assert all(math.isnan(cell.value) for cell in whole.lines[0].cells)
    older = msgspec.structs.replace(planted, digest=last_digest(read_trace(report.trace), 1), digest_version=1)
    for known in (planted, older):
        (row,) = AttributionRun(tmp_path, methods, Stored(report), lambda line: None).run([known])
        assert row.standing == "answered"


def test_a_mission_without_planted_episodes_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["bench", "planted", "--check", "--missions", "ssx"]) == ExitCode.USAGE
    assert "no episode of the suite matches" in capsys.readouterr().err


def test_a_method_is_loaded_from_a_file_and_wrong_names_are_usage_errors(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("def first(trace):\n    return [('a', 'handoff', 4), ('b', 'routing', None)]\n")
    method = find_method(f"{path}:first")
    assert tuple(method.ask(None)) == (named("a", "handoff", 4), named("b", "routing"))  # type: ignore[arg-type]
    for wrong in ("nothing", f"{path}:second", str(tmp_path / "not.py:first")):
        with pytest.raises(UsageError):
            find_method(wrong)
    assert "families" in METHODS


@pytest.mark.slow
def test_occasions_are_faults_at_used_faculties_and_such_a_fault_changes_the_episode(tmp_path: Path) -> None:
    place = tmp_path / "whole"
    harbour = Path(__file__).parents[1] / "causal" / "shrink" / "harbour.ljs"
    settings = {"people": 1.0, "boats": 1.0}
    whole = read_trace(run(harbour, policy="faulty-oracle", seed=3, settings=settings, out=place, overview=False).trace)
    used = occasions(whole)
    assert {(label.faculty, label.way) for label in used} >= {("waypoint", "displaced"), ("execution", "withheld")}
    first = next(label for label in used if label.faculty == "execution")
    lost = run(
        harbour, policy="faulty-oracle", seed=3, settings=settings, out=tmp_path / "lost", overview=False,
        policy_args={"faults": [msgspec.to_builtins(first)]},
    )  # fmt: skip
    assert not lost.success
    assert first_change(whole, read_trace(lost.trace)) == (first.boundary, (first.agent,))
    assert first_change(whole, whole) == (None, ())


def test_planting_without_plays_gives_no_episodes_and_tolerates_a_truncated_log(tmp_path: Path) -> None:
    (tmp_path / "tried.jsonl").write_bytes(b'{"cut')
    plan = PlantingPlan("oracle", [1], plays=0)
    column = next(item for item in columns(shipped_missions()) if item.name == "ssr-star")
    assert Planting(plan, tmp_path, LocalExecutor(), lambda line: None).run([column]) == []


class Lost:
    """An executor: every episode with a fault is lost, every other one is won; all have the trace of the harbour
    mission.
    """

    jobs = 1

    def __init__(self, report: EpisodeReport) -> None:
        self.report = report
        self.changed: tuple[int | None, tuple[str, ...]] = (None, ())

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        for task in tasks:
            faults = task.options.policy_args["faults"]
            self.changed = (min(item["boundary"] for item in faults), (faults[0]["agent"],)) if faults else (None, ())
            task.folder.mkdir(parents=True)
            (task.folder / "trace.mcap").write_bytes(Path(self.report.trace).read_bytes())
            drawn = task.options.seed % 4  # one of four instances
            yield task, msgspec.structs.replace(self.report, success=not faults, digest=f"{drawn} {faults}")


def test_planted_episodes_come_from_several_seeds_and_none_is_planted_twice(
    report: EpisodeReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    executor = Lost(report)
    monkeypatch.setattr(planting, "occasions", lambda trace: (FAULT, OTHER))
    monkeypatch.setattr(planting, "first_change", lambda whole, changed: executor.changed)
    column = next(item for item in columns(shipped_missions()) if item.name == "ssr-star")
    plan = PlantingPlan("oracle", [1, 5, 2, 3])  # 5 gives the same episode as 1
    episodes = Planting(plan, tmp_path, executor, lambda line: None).run([column])
    assert [(item.kind, item.seed) for item in episodes if item.kind != "one"] == [("none", 1), ("two", 1), ("two", 2)]
    assert [item.seed for item in episodes if item.kind == "one"] == [1, 1, 2, 2, 3, 3]
    assert all(
        {fault.agent for fault in item.faults} == {"scout[1]", "skipper"} for item in episodes if item.kind == "two"
    )


@pytest.mark.study
@pytest.mark.parametrize("planted", read_planted(SHIPPED.with_name("planted.jsonl")), ids=lambda item: item.name)
def test_each_shipped_episode_ends_as_stored_and_is_won_without_its_faults(
    planted: PlantedEpisode, tmp_path: Path
) -> None:
    options = msgspec.structs.asdict(planted.options())
    with_fault = run(options.pop("mission"), out=tmp_path / "given", **options)
    digest = last_digest(read_trace(with_fault.trace), planted.digest_version)
    assert (digest, with_fault.reason, with_fault.ticks) == (planted.digest, planted.reason, planted.ticks)
    options = {**msgspec.structs.asdict(planted.options()), "policy_args": {"faults": []}}
    without = run(options.pop("mission"), out=tmp_path / "without", **options)
    assert without.success
    assert last_digest(read_trace(without.trace), planted.digest_version) == planted.without
