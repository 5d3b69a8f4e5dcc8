"""The shipped tables are those of the grammar, and loading them imports no large package."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing.dsl.syntax.tables import FILE

ROOT = Path(__file__).parents[2]


def test_the_shipped_tables_are_those_of_the_grammar() -> None:
    spec = importlib.util.spec_from_file_location("grammar_tables_tool", ROOT / "tools" / "grammar_tables.py")
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert Path(FILE).read_bytes() == tool.tables(), "run: python tools/grammar_tables.py"


def test_compiling_imports_nothing_heavy() -> None:
    script = (
        "import sys; from lingjing.dsl import compile_file; assert compile_file(sys.argv[1]).mission;"
        "heavy = {'lark', 'numpy', 'pluggy', 'rich', 'pydantic', 'mujoco', 'libsumo', 'jsbsim', 'mcap', 'cv2'};"
        "print(sorted(heavy & sys.modules.keys()))"
    )
    ssr = ROOT / "scenarios" / "ssr.ljs"
    done = subprocess.run([sys.executable, "-c", script, str(ssr)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("mission", ["bi", "cd"])  # bi has a region that is a buffer
def test_a_cold_check_imports_nothing_slow_of_the_standard_library(mission: str) -> None:
    """Each of them takes 2 to 10 ms of processor time, of the 150 ms that a cold `validate` may take; numpy 100."""
    script = (
        "import sys; before = set(sys.modules); from lingjing.cli.main import main;"
        "assert main(['validate', '--no-cache', sys.argv[1]]) == 0;"
        "slow = {'ast', 'dataclasses', 'hashlib', 'importlib.resources', 'inspect', 'numpy', 'pathlib', 'random',"
        "'shapely', 'tempfile', 'typing_extensions', 'urllib.parse'};"
        "print(sorted(slow & (sys.modules.keys() - before)))"
    )
    file = ROOT / "scenarios" / f"{mission}.ljs"
    done = subprocess.run([sys.executable, "-c", script, str(file)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_module_that_a_cold_check_hides_from_msgspec_can_be_imported_afterwards() -> None:
    script = (
        "import sys; from lingjing.cli.main import main;"
        "assert main(['validate', '--no-cache', sys.argv[1]]) == 0;"
        "import typing_extensions; print(typing_extensions.__name__)"
    )
    file = ROOT / "scenarios" / "queue.ljs"
    done = subprocess.run([sys.executable, "-c", script, str(file)], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "typing_extensions"
