"""A cache that cannot be written gives way to a temporary folder, or ends a run before it begins."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from lingjing import data
from lingjing.cli import doctor
from lingjing.data import cache_folder, choose_cache, kept_path
from lingjing.scene.network import Network, StreetEdge, StreetNode, build_network
from lingjing.testing import mission_file

NODES = (StreetNode(id="a", east=0.0, north=0.0), StreetNode(id="b", east=100.0, north=0.0))
EDGES = (StreetEdge(id="ab", start="a", end="b"),)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that XDG_CACHE_HOME names; temporary files go beside it."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", None)
    monkeypatch.delenv("LINGJING_CACHE_TOLD", raising=False)
    return tmp_path / "home"


def temporary(home: Path) -> str:
    return str(home.parent / "tmp" / f"lingjing-cache-{os.geteuid()}")


def network() -> Network:
    return build_network(NODES, EDGES)


def test_the_users_own_folder_is_chosen_if_it_can_be_created(home: Path) -> None:
    assert choose_cache() == (str(home / "lingjing"), "", True)
    assert not home.exists() and not list((home.parent / "tmp").iterdir())


def test_a_relative_folder_is_ignored(home: Path, monkeypatch) -> None:
    """Regression: a relative path named another folder in each process with its own working folder."""
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("XDG_CACHE_HOME", "caches")
    assert choose_cache().folder == str(home / ".cache" / "lingjing")


@pytest.mark.slow
def test_a_plan_is_drawn_with_a_single_note_if_a_file_blocks_the_cache_folder(home: Path, tmp_path: Path) -> None:
    """Regression: Matplotlib looks for its folder at the same place, and printed four lines about a missing folder."""
    a_file(home)
    call = [sys.executable, "-m", "lingjing.cli.main", "scene", "draw", "upr", "-o", str(tmp_path / "plan.png")]
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    assert done.stderr.startswith("note: ") and done.stderr.count("\n") == 1
    assert (tmp_path / "plan.png").exists()


def a_file(home: Path) -> None:
    home.write_text("mine")


def a_file_within(home: Path) -> None:
    home.mkdir()
    (home / "lingjing").write_text("mine")


def a_file_of_one_kind(home: Path) -> None:
    (home / "lingjing").mkdir(parents=True)
    (home / "lingjing" / "networks").write_text("mine")


def a_link_to_nothing(home: Path) -> None:
    home.symlink_to(home.parent / "gone")


@pytest.mark.parametrize("spoil", [a_file, a_file_within, a_file_of_one_kind, a_link_to_nothing])
def test_a_temporary_folder_is_used_if_a_file_blocks_the_cache_folder(home: Path, spoil) -> None:
    spoil(home)
    choice = choose_cache()
    assert (choice.folder, choice.is_usable) == (temporary(home), True) and choice.refused.endswith("is no folder")
    assert (Path(choice.folder).stat().st_mode & 0o777) == 0o700
    finding = doctor.check_cache()
    assert finding.ok and choice.folder in finding.found and "XDG_CACHE_HOME" in finding.advice
    assert Path(network().path).is_relative_to(choice.folder)


class _FullDisk:
    f_flag, f_bavail, f_frsize, f_files, f_favail = 0, 10, 4096, 0, 0


class _NoInodes:
    f_flag, f_bavail, f_frsize, f_files, f_favail = 0, 10**9, 4096, 100, 0


class _ReadOnly:
    f_flag, f_bavail, f_frsize, f_files, f_favail = os.ST_RDONLY, 10**9, 4096, 0, 0


@pytest.mark.parametrize(
    ("state", "reason"),
    [(_FullDisk, "no space is left"), (_NoInodes, "no space is left"), (_ReadOnly, "read-only file system")],
)
def test_a_full_or_read_only_disk_is_not_written_to(home: Path, monkeypatch, state: object, reason: str) -> None:
    home.mkdir()
    real = os.statvfs
    monkeypatch.setattr(data.os, "statvfs", lambda path: state if str(path).startswith(str(home)) else real(path))
    assert reason in choose_cache().refused and cache_folder() == temporary(home)
    monkeypatch.setattr(data.os, "statvfs", lambda path: state)
    assert not choose_cache().is_usable and cache_folder() == str(home / "lingjing")
    assert not doctor.check_cache().ok


def test_a_folder_that_another_user_may_change_is_not_used(home: Path, monkeypatch) -> None:
    home.write_text("mine")
    Path(temporary(home)).mkdir()
    Path(temporary(home)).chmod(0o777)
    (home.parent / "elsewhere").mkdir()
    Path(f"{temporary(home)}-1").symlink_to(home.parent / "elsewhere")
    assert cache_folder() == f"{temporary(home)}-2"


def test_kept_files_on_a_read_only_disk_are_still_read(home: Path, monkeypatch) -> None:
    made = network()
    assert Path(made.path).is_relative_to(home)
    real = os.statvfs
    monkeypatch.setattr(data.os, "statvfs", lambda path: _ReadOnly if str(path).startswith(str(home)) else real(path))
    assert network() == made
    assert kept_path("networks", "other.net.xml") == f"{temporary(home)}/networks/other.net.xml"


# -- the command


def run(*arguments: str, cwd: Path, user: int | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lingjing.cli.main", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=900, user=user)


TINY = """ljs 1
use std.air { quadrotor }

mission tiny "A city with roads, for two ticks" {
  goal "Climb."
  scene residential { extent = 300 m, blocks = 2 by 2 }
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 2 }
  asset uav : quadrotor { position = (0 m, 0 m), actions { takeoff, up, stop } }
  agent pilot as searcher controls uav { observes uav.* }
  success when uav.position.z >= 1 m
}
"""


@pytest.mark.slow
def test_a_run_of_several_episodes_reports_the_temporary_folder_once(home: Path, tmp_path: Path) -> None:
    home.write_text("mine")
    (tmp_path / "tiny.ljs").write_text(TINY, encoding="utf-8")
    done = run("run", "tiny.ljs", "--policy", "random", "--seeds", "0-1", "-j", "2", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "infrastructure-abort" not in [episode["reason"] for episode in json.loads(done.stdout)["episodes"]]
    assert list(Path(temporary(home), "networks").glob("*.net.xml"))
    notes = [line for line in done.stderr.splitlines() if "cache" in line]
    assert notes == [f"note: `{home}` is no folder: the cache is `{temporary(home)}`; XDG_CACHE_HOME sets another"]
    assert home.read_text() == "mine"


@pytest.mark.parametrize(
    "verb", [("run", "ssr", "-o", "out"), ("bench", "main", "-o", "out"), ("frames", "export", "x", "-o", "out")]
)
def test_a_command_fails_before_it_starts_without_a_usable_folder(
    home: Path, tmp_path: Path, monkeypatch, verb
) -> None:
    home.write_text("mine")
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    (tmp_path / "sitecustomize.py").write_text(
        "import os; real = os.statvfs\n"
        "class Full: f_flag, f_bavail, f_frsize, f_files, f_favail = 0, 1, 4096, 0, 0\n"
        "os.statvfs = lambda path: Full\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    done = run(*verb, cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == ""
    assert f"error: no folder for the cache: `{home}` is no folder, and no folder for temporary files" in done.stderr
    assert "hint: make room, or set XDG_CACHE_HOME or TMPDIR" in done.stderr
    assert not (tmp_path / "out").exists() and not (tmp_path / "runs").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_another_users_folder_is_not_written(monkeypatch) -> None:
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        monkeypatch.setenv("XDG_CACHE_HOME", folder)
        ours, theirs = os.pipe()
        child = os.fork()
        if child == 0:
            os.setresuid(65534, 65534, 65534)
            os.write(theirs, choose_cache().refused.encode())
            os._exit(0)
        os.close(theirs)
        with open(ours) as pipe:
            assert pipe.read() == f"`{folder}` may not be written"
        os.waitpid(child, 0)


# -- hints cross the borders of processes


SCENE = """
from lingjing.errors import {kind}
from lingjing.plugins.hookspecs import ScenePlugin, hookimpl
def build(spec):
    raise {kind}("no river", hint="dig one")
@hookimpl
def lingjing_scenes():
    return [ScenePlugin("canyon", build)]
"""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "code"), [("InfrastructureError", 3), ("UsageError", 2)])
@pytest.mark.parametrize("several", [(), ("--seeds", "0-1", "-j", "2")], ids=["one episode", "several episodes"])
def test_the_hint_of_an_error_in_a_worker_process_is_printed_once(
    home: Path, tmp_path: Path, monkeypatch, kind: str, code: int, several
) -> None:
    info = tmp_path / "site" / "canyon-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: canyon\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing]\ncanyon = canyon\n")
    (tmp_path / "site" / "canyon.py").write_text(SCENE.format(kind=kind))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "site"))
    text = mission_file("ssr").read_text(encoding="utf-8")
    assert "scene bay" in text
    (tmp_path / "m.ljs").write_text(text.replace("scene bay", "scene canyon", 1), encoding="utf-8")
    done = run("run", "m.ljs", "--policy", "random", *several, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert "no river" in done.stderr and done.stderr.count("hint: dig one") == 1
    assert "its trace was removed" not in done.stderr
