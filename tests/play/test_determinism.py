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
    """The sea rescue with five ticks, so that three whole episodes with pictures fit in a test."""
    text = (ROOT / "scenarios" / "ssr.ljs").read_text("utf-8").replace("ticks <= 60", "ticks <= 5")
    text = text.replace("(12.4 m, -1351.8 m)", "(270 m, -920 m)")  # else five ticks are proved too few
    text = text.replace("1920 by 1080", "480 by 270").replace("1280 by 720", "320 by 180")
    path = tmp_path_factory.mktemp("short") / "ssr.ljs"
    path.write_text(text, "utf-8")
    return path


def played(mission, folder, hash_seed, *options):
    command = [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--json", *options]
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
def test_the_digest_is_the_same_in_other_processes_folders_hash_seeds_and_worlds(short, tmp_path):
    """One scout draws at random and the other agents follow rules; another seed is another episode."""
    policies = ("--policy", "heuristic", "--policy-for", "scout[1]=random", "--no-overview")
    first = played(short, tmp_path, "1", "--seed", "7", *policies)
    elsewhere = tmp_path / "else" / "where"
    elsewhere.mkdir(parents=True)
    several = played(short, elsewhere, "2", "--seeds", "7-8", *policies, "--world", "inline")
    inline, other = several["episodes"]
    assert first["ticks"] == 5
    assert first["metrics"]["frames"] > 0
    assert first["digest"] == inline["digest"]
    assert first["frames_digest"] == inline["frames_digest"]
    assert first["digest"] != other["digest"]
