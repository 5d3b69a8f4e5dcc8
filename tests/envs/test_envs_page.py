"""The page on environments: its examples run, and its tables name all keys of the spaces."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing.envs import parallel_env
from tools.python_forks import run_python

PAGE = (Path(__file__).parents[2] / "docs" / "envs.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_examples_run(tmp_path: Path) -> None:
    examples = re.findall(r"^```python\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    assert len(examples) == 4
    shown = [example for example in examples if "stable_baselines3" not in example]  # `make learners` runs that one
    done = run_python([sys.executable, "-c", "\n".join(shown)], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, second, flat = done.stdout.splitlines()
    assert flat.startswith("5 True (480, 480, 3) ")
    assert first.startswith("5 ")
    assert second == "(36, 64, 3)"


def test_an_id_with_its_module_needs_no_import_of_ours() -> None:
    code = (
        "import sys, gymnasium\n"
        "assert not any(name.split('.')[0] == 'lingjing' for name in sys.modules)\n"
        "env = gymnasium.make('lingjing.envs:lingjing/ssr-broadcast-v0', agent='skipper', picture_width=0)\n"
        "print(env.spec.id, 'skipper' == env.unwrapped.agent)\n"
        "env.close()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=900)
    assert done.stdout.split() == ["lingjing/ssr-broadcast-v0", "True"], done.stderr


def test_the_tables_name_every_key_of_the_spaces() -> None:
    *_, observed, done = re.split(r"^## .*$", PAGE, flags=re.MULTILINE)
    env = parallel_env("ssr", mode="star", world="inline")
    keys = {key for agent in env.possible_agents for key in env.observation_space(agent).spaces}
    assert keys == set(re.findall(r"^\| `(\w+)` \| `", observed, flags=re.MULTILINE))
    keys = {key for agent in env.possible_agents for key in env.action_space(agent).spaces}
    assert keys == set(re.findall(r"^\| `(\w+)` \| `", done, flags=re.MULTILINE))
