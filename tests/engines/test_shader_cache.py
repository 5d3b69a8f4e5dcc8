"""The cache of compiled shaders: it is kept where there is space, and a full disk costs an episode only time."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing.engines.camera import context
from tests.engines.camera_town import WHY_NOT

DRAW = """
from tests.engines.camera_town import CameraEngine, look, ready
engine = CameraEngine()
ready(engine)
print(look(engine, (0.0, -20.0, 120.0)).rgb.shape)
"""
ROOT = Path(__file__).parents[2]
FULL_DISK = ("unshare", "--mount", "sh", "-c", 'mount -t tmpfs -o size=64k none "$XDG_CACHE_HOME" && exec "$@"', "sh")

can_mount = pytest.mark.skipif(
    shutil.which("unshare") is None
    or subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode != 0,
    reason="mounting a small disk needs root",
)
drawing = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)


def drawn(cache: Path, *before: str, limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run a process that draws one picture with this cache folder, with a limit on the size of its files (bytes)."""
    variables = {name: value for name, value in os.environ.items() if not name.startswith("MESA_SHADER")}
    variables |= {"XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}
    text = (
        DRAW if limit is None else f"import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, ({limit},) * 2)\n{DRAW}"
    )
    line = [*before, sys.executable, "-c", text]
    return subprocess.run(line, env=variables, capture_output=True, text=True, check=False, timeout=900)


@drawing
@can_mount
@pytest.mark.thorough
def test_a_camera_draws_with_a_full_cache_disk(tmp_path: Path) -> None:
    done = drawn(tmp_path, *FULL_DISK)
    assert (done.returncode, done.stdout) == (0, "(270, 480, 3)\n"), (done.returncode, done.stderr)


@drawing
@pytest.mark.slow
def test_a_camera_draws_under_a_limit_on_the_size_of_files(tmp_path: Path) -> None:
    done = drawn(tmp_path, limit=64 * 1024)
    assert (done.returncode, done.stdout) == (0, "(270, 480, 3)\n"), (done.returncode, done.stderr)


def test_all_blocks_of_the_index_are_allocated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for name in ("MESA_SHADER_CACHE_DIR", "MESA_SHADER_CACHE_DISABLE"):
        monkeypatch.setenv(name, "")
    context.place_shader_cache()
    folder = Path(os.environ["MESA_SHADER_CACHE_DIR"])
    assert folder == tmp_path / "lingjing" / "shaders"
    assert not os.environ["MESA_SHADER_CACHE_DISABLE"]
    status = (folder / "mesa_shader_cache" / "index").stat()
    assert status.st_size == 1_310_728
    assert status.st_blocks * 512 >= status.st_size, "every block is there"


def test_the_users_folder_is_used_unless_it_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESA_SHADER_CACHE_DISABLE", "")
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path / "own"))
    context.place_shader_cache()
    assert (tmp_path / "own" / "mesa_shader_cache" / "index").exists()
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("MESA_SHADER_CACHE_DIR", str(tmp_path / "file"))
    context.place_shader_cache()
    assert os.environ["MESA_SHADER_CACHE_DISABLE"] == "true"
