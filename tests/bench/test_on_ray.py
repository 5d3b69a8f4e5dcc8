"""A suite on a real Ray cluster of two local nodes (`make ray`): the same rows; a killed worker costs one episode."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from lingjing import PlayOptions
from lingjing.bench.folder import open_results
from lingjing.bench.on_ray import RayExecutor, RayTask, play_on_node
from lingjing.bench.running import SuiteRun
from lingjing.errors import UsageError
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import SMALL, EpisodeTask, SuiteRow, read_plan, read_results

pytest.importorskip("ray", reason="Ray is installed by `make ray`")
pytestmark = [
    pytest.mark.ray,
    pytest.mark.skipif("'ray' not in config.getoption('markexpr')", reason="it takes minutes: `make ray`"),
]

SUITE = (
    SMALL.replace('"bi", "cd"', '"bi", "upr"').replace("seeds = 2", "seeds = [3]").replace('"random"', '"heuristic"')
)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A cluster of two nodes with one CPU each. Its workers have normal priority: Ray's niceness of 15 would make
    an episode take an hour beside other work."""
    import ray
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 1, "_system_config": {"worker_niceness": 0}}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    yield cluster.address
    ray.shutdown()
    cluster.shutdown()


def same(rows: list[SuiteRow]) -> dict[object, tuple[object, ...]]:
    """Return the part of a row that does not depend on the executor: all but times and places."""
    return {
        row.key: (
            msgspec.structs.replace(row, wall_s=0.0, policy_seed=0, salt_sha256="", report=None, options=None),
            row.report.digest, row.report.frames_digest, row.report.reason, row.report.scr, row.report.ticks,
            msgspec.structs.replace(row.report.metrics, wall_s=None),
        )
        for row in rows
    }  # fmt: skip


def test_ray_and_the_local_executor_give_the_same_rows(address: str, tmp_path: Path) -> None:
    suite = tmp_path / "small.toml"
    suite.write_text(SUITE)
    for name, more in (("local", ("-j", "2")), ("ray", ("--executor", "ray", "--ray-address", address))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "salt").write_text("the same\n")
        assert run_command(["bench", str(suite), "--entrants", "oracle", "-o", str(tmp_path / name), *more]) == 0
    local, ray = (read_results(tmp_path / name) for name in ("local", "ray"))
    assert len(ray) == 2 and same(ray) == same(local)
    assert {row.policy_seed for row in ray} == {row.policy_seed for row in local}


def ray_workers() -> list[int]:
    """The processes of this machine's Ray workers that play an episode."""
    pids = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if b"ray::play_on_node" in (place / "cmdline").read_bytes():
                pids.append(int(place.name))
        except OSError:
            continue
    return pids


def test_a_worker_killed_in_mid_episode_costs_that_episode_only(address: str, tmp_path: Path) -> None:
    suite = tmp_path / "small.toml"
    suite.write_text(SUITE)
    killed: list[int] = []
    over = threading.Event()

    def kill_one() -> None:
        runs = tmp_path / "out" / "runs"
        while not killed and not over.wait(0.1):
            started = list(runs.glob("heuristic-upr*/trace.mcap.part")) if runs.is_dir() else []
            if started and started[0].stat().st_size > 0:
                killed.extend(_workers_playing(started[0].parent))
        for pid in killed:
            os.kill(pid, signal.SIGKILL)

    plan = read_plan(suite, PluginHost())
    cells = [cell for cell in plan.cells if cell.column.mission == "upr"]
    with open_results(tmp_path / "out") as results:
        run = SuiteRun(plan, results, "code", RayExecutor(tmp_path / "out" / "lock", address))
        killer = threading.Thread(target=kill_one)
        killer.start()
        try:
            run.play(run.due((3,), cells))
        finally:
            over.set()
            killer.join()
    assert len(killed) == 1
    rows = read_results(tmp_path / "out")
    played = sorted((row.entrant, row.mission, row.tries, row.standing) for row in rows)
    assert played == [
        ("heuristic", "upr", 1, "aborted"), ("heuristic", "upr", 2, "counted"),
        ("oracle", "upr", 1, "counted"),
    ]  # fmt: skip
    (aborted,) = [row for row in rows if row.standing == "aborted"]
    assert aborted.report.detail.startswith("its Ray worker was lost: ")


def _workers_playing(folder: Path) -> list[int]:
    """Return the Ray workers with a descendant that has the episode's trace open."""
    parents = {}
    holder = 0
    for place in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(place.name)] = int((place / "stat").read_text().rpartition(")")[2].split()[1])
            if any(os.readlink(item).startswith(f"{folder}/") for item in (place / "fd").iterdir()):
                holder = int(place.name)
        except OSError:
            continue
    workers = set(ray_workers())
    while holder and holder not in workers:
        holder = parents.get(holder, 0)
    return [holder] if holder else []


def test_a_node_without_the_folder_or_with_other_code_reports_an_error(tmp_path: Path) -> None:
    (tmp_path / "lock").touch()
    options = PlayOptions(mission="bi")
    for lock, code, message in (
        (tmp_path / "none", "x", "cannot read"),
        (tmp_path / "lock", "x", "has other code"),
    ):
        answer = play_on_node(msgspec.json.encode(RayTask(options, str(tmp_path / "run"), str(lock), code)))
        assert message in msgspec.json.decode(answer)["message"]
    assert not (tmp_path / "run").exists()


def test_an_error_common_to_all_episodes_is_raised_with_its_message(address: str, tmp_path: Path) -> None:
    (tmp_path / "lock").touch()
    executor = RayExecutor(tmp_path / "lock", address)
    task = EpisodeTask(PlayOptions(mission="bi", policy="nobody"), tmp_path / "run")
    with pytest.raises(UsageError, match="no policy is called `nobody`"):
        list(executor.play([task]))


def test_a_missing_ray_cluster_is_a_usage_error(tmp_path: Path) -> None:
    import ray

    ray.shutdown()
    with pytest.raises(UsageError, match="there is no Ray cluster at"):
        RayExecutor(tmp_path / "lock", "127.0.0.1:1")
