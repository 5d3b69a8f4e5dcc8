"""The cache of good missions: equal results, no stale or damaged entry, and no error without a writable folder."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lingjing.dsl.loading import cache
from lingjing.testing.missions import SourceText, compile_source


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("LINGJING_NO_CACHE", raising=False)
    return tmp_path / "cache" / "lingjing" / "missions"


def test_a_cached_mission_equals_the_compiled_one_and_damaged_entries_are_ignored(small: str, folder: Path) -> None:
    source = SourceText(small, "m.ljs")
    assert cache.cached_warnings(source) is None
    first = cache.compile_cached(source)
    (entry,) = folder.iterdir()
    assert cache.cached_warnings(source) == ()
    assert cache.compile_cached(source) == first == compile_source(source)
    entry.write_bytes(entry.read_bytes()[:-1] + b"\x00")
    assert cache.cached_warnings(source) is None
    entry.write_bytes(b"")
    assert cache.compile_cached(source) == first


def test_faulty_missions_are_not_cached(small: str, folder: Path) -> None:
    source = SourceText(small.replace("boat, v)", "boot, v)"), "m.ljs")
    assert cache.compile_cached(source).mission is None
    assert not folder.exists()


def test_another_text_path_or_compiler_is_another_entry(small: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cache.compile_cached(SourceText(small, "m.ljs"))
    assert cache.cached_warnings(SourceText(small, "n.ljs")) is None
    assert cache.cached_warnings(SourceText(small + "\n", "m.ljs")) is None
    monkeypatch.setattr(cache, "_compiler", lambda: "another")
    assert cache.cached_warnings(SourceText(small, "m.ljs")) is None


def test_a_changed_library_makes_a_cache_entry_invalid(
    small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lingjing.dsl.checking import library

    std = tmp_path / "std"
    std.mkdir()
    for file in Path(library.shipped_folder("std")).glob("*.ljs"):
        (std / file.name).write_bytes(file.read_bytes())
    monkeypatch.setattr(library, "shipped_folder", lambda first: str(std))
    source = SourceText(small, "m.ljs")
    cache.compile_cached(source)
    assert cache.cached_warnings(source) == ()
    text = (std / "sea.ljs").read_text()
    (std / "sea.ljs").write_text(text + "# changed\n")
    assert cache.cached_warnings(source) is None
    (std / "sea.ljs").write_text(text)
    assert cache.cached_warnings(source) == ()
    (std / "air.ljs").unlink()
    assert cache.cached_warnings(source) is None


def test_an_unwritable_cache_causes_no_error(small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr("lingjing.data._temporary_cache", lambda: "")
    source = SourceText(small, "m.ljs")
    assert cache.compile_cached(source) == cache.compile_cached(source)
    assert cache.cached_warnings(source) is None


def test_the_cache_can_be_turned_off(small: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LINGJING_NO_CACHE", "1")
    cache.compile_cached(SourceText(small, "m.ljs"))
    assert not folder.exists()


def test_the_least_recently_read_entries_of_a_full_cache_are_removed(
    small: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Entries 0 to 2 fill the cache, the first is the oldest and is read again. Then two more are stored."""
    monkeypatch.setattr(cache, "MOST_ENTRIES", 3)
    sources = [SourceText(f"{small}# {number}\n", "m.ljs") for number in range(5)]
    for hours, source in zip((6, 5, 4), sources, strict=False):
        before = set(folder.iterdir()) if folder.exists() else set()
        cache.compile_cached(source)
        (entry,) = set(folder.iterdir()) - before
        stored_s = time.time() - 3600.0 * hours
        os.utime(entry, (stored_s, stored_s))
    assert cache.cached_warnings(sources[0]) == ()
    for source in sources[3:]:
        cache.compile_cached(source)
    kept = [number for number, source in enumerate(sources) if cache.cached_warnings(source) is not None]
    assert (kept, len(list(folder.iterdir()))) == ([0, 3, 4], 3)


def test_simultaneous_writers_leave_one_complete_entry(small: str, tmp_path: Path, folder: Path) -> None:
    file = tmp_path / "m.ljs"
    file.write_text(small)
    script = "import sys; from lingjing.cli.main import main; sys.exit(main(['validate', sys.argv[1]]))"
    running = [subprocess.Popen([sys.executable, "-c", script, str(file)], env=os.environ) for _ in range(4)]
    assert [process.wait() for process in running] == [0, 0, 0, 0]
    assert [path.name.startswith(".new-") for path in folder.iterdir()] == [False]
    assert cache.cached_warnings(SourceText(small, str(file))) == ()
