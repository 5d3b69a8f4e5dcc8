"""Playing a suite: aborted episodes are played again, and no row is lost, doubled or incomplete after any
interruption.
"""

from __future__ import annotations

import collections
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import pytest

from lingjing import EpisodeReport
from lingjing.bench import folder as folders
from lingjing.bench.folder import ResultsFolder, open_results
from lingjing.bench.parquet import encode_rows, read_rows
from lingjing.bench.planning import SuitePlan
from lingjing.bench.running import Shard, SuiteRun
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import (
    SMALL,
    TRIP,
    AnsweringExecutor,
    EpisodeTask,
    SuiteRow,
    answered,
    made_row,
    read_plan,
    read_results,
)
from tests.play.report_kit import ABORTED, INTERRUPTED, blank_metrics
from tools.python_forks import PipedFork, run_python

SEEDS = (0, 1)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> SuitePlan:
    file = tmp_path_factory.mktemp("suite") / "small.toml"
    file.write_text(SMALL)
    return read_plan(file, PluginHost())


def play(plan: SuitePlan, folder: Path, executor: AnsweringExecutor, code: str = "code", **how: object) -> SuiteRun:
    with open_results(folder) as results:
        run = SuiteRun(plan, results, code, executor, **how)  # type: ignore[arg-type]
        run.check_resumable()
        run.play(run.due(SEEDS, plan.cells))
        results.compact()
        return run


def aborting(*times: str) -> AnsweringExecutor:
    """Return answers that abort every episode of the oracle with these details in turn, then let it win."""
    count: collections.Counter[object] = collections.Counter()

    def answer(task: EpisodeTask) -> EpisodeReport:
        count[task.folder] += 1
        if task.options.policy == "oracle" and count[task.folder] <= len(times):
            return answered(task, success=False, reason=ABORTED, detail=times[count[task.folder] - 1], metrics=None)
        return answered(task)

    return AnsweringExecutor(answer)


def test_every_episode_is_played_once_in_the_order_of_seeds(plan: SuitePlan, tmp_path: Path) -> None:
    executor = AnsweringExecutor()
    play(plan, tmp_path / "a", executor)
    assert [task.options.seed for task in executor.tasks] == [0] * 6 + [1] * 6
    rows = read_results(tmp_path / "a")
    assert len(rows) == 12 and {row.standing for row in rows} == {"counted"}
    assert not list((tmp_path / "a" / "runs").iterdir()), "runs that are not kept are removed"
    again = AnsweringExecutor()
    play(plan, tmp_path / "a", again)
    assert again.tasks == []


def test_results_are_readable_while_their_parts_are_compacted(
    plan: SuitePlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    play(plan, tmp_path / "a", AnsweringExecutor())
    whole = read_results(tmp_path / "a")
    other = tmp_path / "b"
    with open_results(other) as results:
        for row in whole:
            results.add(row)

        def compacting(file: Path) -> list[SuiteRow]:
            monkeypatch.setattr(folders, "read_rows", read_rows)
            results.compact()
            return read_rows(file)

        monkeypatch.setattr(folders, "read_rows", compacting)
        assert {row.key for row in read_results(other)} == {row.key for row in whole}


def test_an_aborted_episode_is_played_again_with_its_seed_and_its_row_is_kept(plan: SuitePlan, tmp_path: Path) -> None:
    executor = aborting("engine `road` died")
    play(plan, tmp_path / "a", executor)
    rows = read_results(tmp_path / "a")
    oracle = [row for row in rows if row.entrant == "oracle"]
    assert collections.Counter((row.standing, row.tries) for row in oracle) == {("aborted", 1): 6, ("counted", 2): 6}
    assert len([task for task in executor.tasks if task.options.policy == "oracle"]) == 12
    first = {task.folder: task.options for task in executor.tasks[:12]}
    assert all(first[task.folder] == task.options for task in executor.tasks[12:]), "the same seed, the same draws"


def test_an_episode_is_lost_after_three_aborts_and_listed(plan: SuitePlan, tmp_path: Path, capsys) -> None:
    executor = aborting("one", "two", "three", "never")
    play(plan, tmp_path / "a", executor)
    lost = [row for row in read_results(tmp_path / "a") if row.standing == "lost"]
    assert {(row.entrant, row.tries, row.report.detail) for row in lost} == {("oracle", 3, "three")}
    assert len(lost) == 6
    assert run_command(["bench", "table", str(tmp_path / "a")]) == 0
    output = capsys.readouterr().out
    assert "6 are lost (aborted 3 times) and in no rate: oracle bi-single seed 0, " in output
    assert "12 infrastructure aborts were played again" in output


def test_tries_are_counted_across_commands(plan: SuitePlan, tmp_path: Path) -> None:
    """Each command plays one try and then ends."""
    cells = plan.cells[:1]
    for tries, standing in ((1, "aborted"), (2, "aborted"), (3, "lost")):
        with open_results(tmp_path / "a") as results:
            run = SuiteRun(plan, results, "code", aborting("one"))
            run.check_resumable()
            due = run.due((0,), cells)
            assert [(item.tries, item.seed) for item in due] == [(tries, 0)]
            run._round(due, _countdown())
        stored = read_results(tmp_path / "a")
        assert len(stored) == tries and (stored[-1].tries, stored[-1].standing) == (tries, standing)
    with open_results(tmp_path / "a") as results:
        assert SuiteRun(plan, results, "code", aborting("one")).due((0,), cells) == []


def _countdown():
    from lingjing.bench.countdown import Countdown

    return Countdown(1, ())


def test_an_interrupted_episode_is_played_again(plan: SuitePlan, tmp_path: Path) -> None:
    play(plan, tmp_path / "a", AnsweringExecutor(lambda task: answered(task, reason=INTERRUPTED)))
    assert read_results(tmp_path / "a") == []
    executor = AnsweringExecutor()
    play(plan, tmp_path / "a", executor)
    assert len(executor.tasks) == len(read_results(tmp_path / "a")) == 12


def test_shards_are_disjoint_and_cover_all_episodes(plan: SuitePlan, tmp_path: Path) -> None:
    with open_results(tmp_path / "a") as results:
        run = SuiteRun(plan, results, "code", AnsweringExecutor())
        whole = run.due(range(40), plan.cells)
        parts = [run.due(range(40), plan.cells, Shard(number, 3)) for number in (1, 2, 3)]
    assert sorted((item.cell.key, item.seed) for part in parts for item in part) == sorted(
        (item.cell.key, item.seed) for item in whole
    )
    assert all(0.7 < 3 * len(part) / len(whole) < 1.3 for part in parts)


def test_policy_seeds_are_drawn_from_the_salt_of_the_results_folder(plan: SuitePlan, tmp_path: Path) -> None:
    def drawn(folder: Path) -> dict[tuple[object, ...], int]:
        if not folder.exists():
            play(plan, folder, AnsweringExecutor())
        return {row.key: row.policy_seed for row in read_results(folder)}

    first, other = drawn(tmp_path / "a"), drawn(tmp_path / "b")
    assert len({*first.values(), *other.values()}) == 24, "each row of each suite has its own seed"
    (tmp_path / "c").mkdir()
    shutil.copy(tmp_path / "a" / "salt", tmp_path / "c" / "salt")
    assert drawn(tmp_path / "a") == first
    play(plan, tmp_path / "c", AnsweringExecutor())
    assert drawn(tmp_path / "c") == first, "the same salt draws the same"
    fingerprints = {row.salt_sha256 for name in "abc" for row in read_results(tmp_path / name)}
    assert len(fingerprints) == 2
    assert (tmp_path / "a" / "salt").read_text().strip() not in str(fingerprints)


def test_rows_of_other_code_options_or_suites_stop_the_suite(plan: SuitePlan, tmp_path: Path) -> None:
    play(plan, tmp_path / "a", AnsweringExecutor())
    before = (tmp_path / "a" / "results.parquet").read_bytes()
    with pytest.raises(
        UsageError, match=r"^12 of the 12 rows in .* were played with other code or missions \(code; now"
    ):
        play(plan, tmp_path / "a", AnsweringExecutor(), code="other")
    with open_results(tmp_path / "a") as results:
        results.add(made_row(suite="else", entrant="x"))
        with pytest.raises(UsageError, match="holds results of the suite `else`, this is `small`"):
            SuiteRun(plan, results, "code", AnsweringExecutor()).check_resumable()
    play(plan, tmp_path / "b", AnsweringExecutor())
    file = tmp_path / "changed.toml"
    file.write_text(SMALL.replace('policy = "oracle"', 'policy = "oracle"\nblank_pictures = true'))
    with pytest.raises(UsageError, match="`blank_pictures` was False and is True"):
        play(read_plan(file, PluginHost()), tmp_path / "b", AnsweringExecutor())
    assert read_rows(tmp_path / "a" / "results.parquet") and before == (tmp_path / "a" / "results.parquet").read_bytes()


@pytest.mark.parametrize("name", ["x.partial", "²³.parquet", "99999999.parquet", "junk"])
def test_foreign_files_among_the_parts_hide_no_row(tmp_path: Path, name: str) -> None:
    with open_results(tmp_path) as results:
        results.add(made_row(seed=0))
        part = (tmp_path / "parts" / "00000001.parquet").read_bytes()
    if name.endswith(".parquet"):
        (tmp_path / "parts" / name).write_bytes(part)
    else:
        (tmp_path / "parts" / name).mkdir()
    for seed in (1, 2):
        with open_results(tmp_path) as results:
            results.add(made_row(seed=seed))
            results.compact()
    assert sorted(row.seed for row in read_results(tmp_path)) == [0, 1, 2]


def test_a_broken_part_is_reported_with_a_remedy_and_no_other_row_is_lost(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        results.add(made_row(seed=0))
    broken = tmp_path / "parts" / "00000007.parquet"
    broken.write_bytes(b"junk")
    with pytest.raises(UsageError, match=rf"`{broken}` holds no results") as caught, open_results(tmp_path):
        pass
    assert "move it away: in a suite's folder, the next `lingjing bench` plays" in caught.value.hint
    broken.unlink()
    with open_results(tmp_path) as results:
        assert [row.seed for row in results.rows] == [0]


def test_rows_survive_the_removal_of_their_files_while_a_suite_is_played(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        results.add(made_row(seed=0))
        results.compact()
        results.add(made_row(seed=1))
        shutil.rmtree(tmp_path / "parts")
        (tmp_path / "results.parquet").unlink()
        results.add(made_row(seed=2))
    assert sorted(row.seed for row in read_results(tmp_path)) == [0, 1, 2]


def test_a_salt_that_is_removed_while_a_suite_is_played_is_written_again(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        salt = results.salt()
        (tmp_path / "salt").unlink()
        results.add(made_row(seed=0))
        results.compact()
    with open_results(tmp_path) as results:
        assert results.salt() == salt


def test_two_commands_do_not_share_a_folder(tmp_path: Path) -> None:
    with (
        open_results(tmp_path / "a"),
        pytest.raises(UsageError, match="another suite is writing to"),
        open_results(tmp_path / "a"),
    ):
        pass


def test_a_removed_results_folder_is_reported_and_not_created_again(plan: SuitePlan, tmp_path: Path) -> None:
    def answer(task: EpisodeTask) -> EpisodeReport:
        if task.options.seed == 1:
            shutil.rmtree(tmp_path / "a")
        return answered(task)

    with pytest.raises(UsageError, match="was removed or replaced while its suite was played"):
        play(plan, tmp_path / "a", AnsweringExecutor(answer))
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("text", [f"{TRIP}# changed\n", "mission {", None])
def test_an_episode_is_not_stored_if_its_mission_changed_meanwhile(text: str | None, tmp_path: Path) -> None:
    mission, suite = tmp_path / "trip.ljs", tmp_path / "own.toml"
    mission.write_text(TRIP)
    suite.write_text(SMALL.replace('["bi", "cd"]', '["trip.ljs"]'))

    def answer(task: EpisodeTask) -> EpisodeReport:
        if task.options.seed == 1:
            mission.unlink() if text is None else mission.write_text(text)
        return answered(task)

    with pytest.raises(UsageError, match="changed while the suite was played"):
        play(read_plan(suite, PluginHost()), tmp_path / "a", AnsweringExecutor(answer))
    mission.write_text(TRIP)
    assert {row.seed for row in read_results(tmp_path / "a")} == {0}
    again = AnsweringExecutor()
    play(read_plan(suite, PluginHost()), tmp_path / "a", again)
    assert {task.options.seed for task in again.tasks} == {1}, "the restored mission goes on"


FULL = """
import resource, signal, sys
from pathlib import Path
from lingjing.bench.folder import open_results
from lingjing.errors import UsageError
from tests.bench.suite_kit import made_row
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
with open_results(Path(sys.argv[1])) as results:
    results.add(made_row())
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
    try:
        results.add(made_row(seed=1))
    except UsageError as error:
        print(error)
"""


def test_a_full_disk_is_reported_once_and_leaves_only_complete_rows(tmp_path: Path) -> None:
    """The system refuses to let the file grow, like a full disk."""
    done = subprocess.run([sys.executable, "-c", FULL, str(tmp_path / "a")], capture_output=True, text=True, check=True,
                          cwd=Path(__file__).parents[2])  # fmt: skip
    assert done.stdout == f"cannot write to `{tmp_path}/a`: File too large; 1 rows are stored\n"
    assert [row.seed for row in read_results(tmp_path / "a")] == [0]
    assert not list((tmp_path / "a").rglob("*.partial"))
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


STUDY = """
import sys, time
from lingjing.bench import executors
from tests.bench.suite_kit import answered
class Slow(executors.LocalExecutor):
    def play(self, tasks):
        for task in tasks:
            task.folder.mkdir(parents=True)
            (task.folder / "trace.mcap.part").touch()
            time.sleep(0.02)
            yield task, answered(task)
executors.LocalExecutor = Slow
from lingjing.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def test_a_suite_that_is_killed_several_times_plays_every_episode_once(tmp_path: Path) -> None:
    """After a kill at any moment, reported rows are stored, missing ones are played by the next command, and no row is
    doubled.
    """
    suite = tmp_path / "small.toml"
    suite.write_text(SMALL.replace("seeds = 2", "seeds = 6"))
    folder = tmp_path / "results"
    command = [sys.executable, "-c", STUDY, "bench", str(suite), "-o", str(folder)]
    root, moments = Path(__file__).parents[2], random.Random(5)
    for _ in range(4):
        running = PipedFork(command, cwd=root)
        for _ in range(moments.randrange(2, 8)):  # killed a few episodes after it began, in the middle of one
            running.stderr.readline()
        time.sleep(moments.uniform(0.0, 0.02))
        running.kill()
        running.communicate()
        assert len({row.key for row in read_results(folder)}) == len(read_results(folder)) > 0
    done = run_python(command, cwd=root)
    assert done.returncode == ExitCode.OK, done.stderr
    rows = read_results(folder)
    assert collections.Counter(row.key for row in rows).most_common(1)[0][1] == 1
    assert len(rows) == 2 * 3 * 6
    assert not any((folder / "runs").iterdir()) and not any((folder / "parts").iterdir())
    assert len({row.code for row in rows}) == 1 and len(rows[0].code) == 64
    again = run_python(command, cwd=root)
    assert "small: 36 episodes done, 0 to play" in again.stderr
    assert again.stdout == done.stdout and again.stdout.count("| random | 100 | 100 | 100 | 100 |") == 1


def test_parts_become_one_file_and_a_kill_in_between_duplicates_no_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folders, "MOST_PARTS", 5)
    with open_results(tmp_path) as results:
        for seed in range(12):
            results.add(made_row(seed=seed))
        assert len(list((tmp_path / "parts").iterdir())) == 2
    part = tmp_path / "parts" / "00000099.parquet"
    part.write_bytes(encode_rows([made_row(seed=3)]))  # as after a kill before the parts were taken away
    assert sorted(row.seed for row in read_results(tmp_path)) == list(range(12))
    (tmp_path / "parts" / "00000100.parquet.partial").write_bytes(b"PAR1")
    with open_results(tmp_path) as results:
        assert len(results.rows) == 12
        results.add(made_row(seed=12))
        results.compact()
    assert [path.name for path in (tmp_path / "parts").iterdir()] == []


def test_rows_read_back_completely_from_parquet_and_can_be_queried(tmp_path: Path) -> None:
    import pyarrow.compute as compute
    import pyarrow.parquet as parquet

    metrics = blank_metrics(scr=0.5, messages=7, recall=None, gap=12.5)
    rows = [made_row(seed=seed, metrics=metrics, success=seed == 1, entrant="ä|<b>") for seed in range(3)]
    odd = msgspec.structs.replace(rows[0].report, trace="runs/\udce9")  # a folder name that is not valid text
    rows[0] = msgspec.structs.replace(rows[0], report=odd)
    (tmp_path / "r.parquet").write_bytes(encode_rows(rows))
    assert read_rows(tmp_path / "r.parquet") == rows
    assert encode_rows(rows) == encode_rows(rows[::-1])
    table = parquet.read_table(tmp_path / "r.parquet")
    assert table.column("messages").to_pylist() == [7] * 3 and table.column("recall").to_pylist() == [None] * 3
    assert compute.sum(table.column("success")).as_py() == 1
    assert set(SuiteRow.__struct_fields__) - {"options", "report"} <= set(table.schema.names)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "holds no results of a suite"),
        (b"PAR1 and then nothing", "holds no results of a suite"),
        (b'[{"case": 1}]', "holds no results of a suite"),
        ("table", "holds no results that this version can read: it has no version"),
        ("version", "holds no results that this version can read: it has version 9"),
        ("report", r"row 0 of .* cannot be read: .*`mission`"),
        ("half", "holds no results of a suite"),
    ],
)
def test_a_file_without_valid_results_is_reported(content: bytes | str, message: str, tmp_path: Path, capsys) -> None:
    import pyarrow as pa
    import pyarrow.parquet as parquet

    file = tmp_path / "r.parquet"
    file.write_bytes(content if isinstance(content, bytes) else encode_rows([made_row()]))
    table = None if isinstance(content, bytes) else parquet.read_table(file)
    if content == "half":
        file.write_bytes(file.read_bytes()[:-40])
    elif content == "table":
        parquet.write_table(pa.table({"x": [1]}), file)
    elif content == "version":
        parquet.write_table(table.replace_schema_metadata({"lingjing.results": "9"}), file)
    elif content == "report":
        at = table.schema.names.index("report")
        parquet.write_table(table.set_column(at, "report", pa.array([json.dumps({"seed": 1})])), file)
    assert run_command(["bench", "table", str(file)]) == ExitCode.USAGE
    captured = capsys.readouterr()
    assert re.search(message, captured.err) and captured.out == ""
    assert ("lingjing report FOLDER/runs" in captured.err) == (content == "report")


def test_results_are_readable_while_a_suite_is_played(tmp_path: Path) -> None:
    with open_results(tmp_path) as results:
        results.add(made_row())
        assert len(read_results(tmp_path)) == 1
    with pytest.raises(UsageError, match="holds no results of a suite"):
        read_results(tmp_path / "parts")


def test_a_row_keeps_the_options_and_the_trace_of_its_episode(plan: SuitePlan, tmp_path: Path) -> None:
    play(plan, tmp_path / "a", AnsweringExecutor(), keep=True)
    row = read_results(tmp_path / "a")[0]
    assert msgspec.structs.replace(row.options, seed=5) != row.options
    assert (row.options.mission, row.options.seed, row.options.policy_seed) == (row.mission, row.seed, row.policy_seed)
    assert row.report.trace.startswith("runs/") and (tmp_path / "a" / row.report.trace).parent.is_dir()
    assert isinstance(ResultsFolder, type) and os.listdir(tmp_path / "a" / "runs")
