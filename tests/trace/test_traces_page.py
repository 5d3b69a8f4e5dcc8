"""`docs/traces.md`: its example reads the trace of an episode."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from lingjing.testing import mission_file
from tools.python_forks import run_python

PAGE = (Path(__file__).parents[2] / "docs" / "traces.md").read_text(encoding="utf-8")


def test_the_example_reads_a_trace(tmp_path: Path) -> None:
    (example,) = re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    whole = mission_file("queue").read_text(encoding="utf-8")
    short = re.sub(r"ticks <= \d+", "ticks <= 3", whole, count=1)  # whole, it plays half a minute
    (tmp_path / "queue.ljs").write_text(short, encoding="utf-8")
    assert short != whole and example.count('"queue"') == 1
    command = [sys.executable, "-c", example.replace('"queue"', '"queue.ljs"')]
    done = run_python(command, cwd=tmp_path, timeout=600)
    assert done.stdout == "queue True\n", done.stderr
