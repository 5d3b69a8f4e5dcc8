"""One mission, seed and policy: one digest, wherever and however it is played."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The sea rescue with eight ticks, so that four whole episodes with pictures fit in a test."""
    text = (ROOT / "scenarios" / "ssr.ljs").read_text("utf-8").replace("ticks <= 60", "ticks <= 8")
    path = tmp_path_factory.mktemp("short") / "ssr.ljs"
    path.write_text(text, "utf-8")
    return path


def played(mission, folder, hash_seed, *options):
    command = [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--seed", "7", "--json", *options]
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, "PYTHONHASHSEED": hash_seed},
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["heuristic", "random"])
def test_the_digest_is_the_same_in_other_processes_folders_hash_seeds_and_worlds(short, tmp_path, policy):
    first = played(short, tmp_path, "1", "--policy", policy)
    elsewhere = tmp_path / "else" / "where"
    elsewhere.mkdir(parents=True)
    second = played(short, elsewhere, "2", "--policy", policy)
    inline = played(short, elsewhere, "3", "--policy", policy, "--world", "inline")
    assert first["ticks"] == 8
    assert first["digest"] == second["digest"] == inline["digest"]


@pytest.mark.slow
def test_another_seed_is_another_episode(short, tmp_path):
    one = played(short, tmp_path, "1", "--policy", "random")
    other = played(short, tmp_path, "1", "--policy", "random", "--seed", "8")
    assert one["digest"] != other["digest"]
