"""The page on environments: its tables name all keys of the spaces. `make docs` runs its examples."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from lingjing.envs import parallel_env

PAGE = (Path(__file__).parents[2] / "docs" / "envs.md").read_text(encoding="utf-8")


def test_an_id_with_its_module_needs_no_import_of_lingjing() -> None:
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
