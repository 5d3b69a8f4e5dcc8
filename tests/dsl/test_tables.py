"""The cached tables are those of the grammar; without any cache lark makes the same."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from lingjing.dsl.syntax import tables


def test_the_shipped_tables_are_those_of_the_grammar() -> None:
    shipped = msgspec.msgpack.decode(tables.PACKAGED_FILE.read_bytes(), type=tables.Tables)
    assert shipped == tables.build_tables(tables.GRAMMAR_FILE.read_text(), tables.load_tables().key)


def test_without_tables_they_are_made_and_cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "PACKAGED_FILE", tmp_path / "none")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    made = tables.load_tables()
    (cached,) = (tmp_path / "cache" / "lingjing").iterdir()
    assert tables.load_tables() == made
    cached.write_bytes(b"\x00broken")
    assert tables.load_tables() == made
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/nowhere")
    assert tables.load_tables() == made


def test_compiling_imports_nothing_heavy() -> None:
    script = (
        "import sys; from lingjing.dsl import compile_file; assert compile_file(sys.argv[1]).mission;"
        "heavy = {'lark', 'numpy', 'pluggy', 'rich', 'pydantic', 'mujoco', 'libsumo', 'jsbsim', 'mcap', 'cv2'};"
        "print(sorted(heavy & sys.modules.keys()))"
    )
    ssr = Path(__file__).parents[2] / "scenarios" / "ssr.ljs"
    done = subprocess.run([sys.executable, "-c", script, str(ssr)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
