"""Policies of this project find their modules, and the models of their options, in the process that they are forked
from."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

SCRIPT = """
import json, sys
from importlib import import_module
from lingjing.play.policy_processes.preloading import SERVES, policy_host, preload
for module in SERVES:
    import_module(module)
name, arguments = sys.argv[1], json.loads(sys.argv[2])
preload(json.dumps([name]))
import numpy as np
from lingjing.plugins.loading import build_policy, options_model
from lingjing_agents.llm import models
before, host = set(sys.modules), policy_host(("agents",))
model = options_model(host.policy(name))
build_policy(host.policy(name), arguments, host=host)
if name in ("heuristic", "react"):
    np.unique([1])  # these policies call it, and its first call imports `numpy.ma`
print(json.dumps({
    "imported": sorted(set(sys.modules) - before),
    "is_model_kept": options_model(policy_host(("agents",)).policy(name)) is model,
    "lists_read": models._shipped.cache_info().misses,
}))
"""

ARGUMENTS = {
    "random": {},
    "heuristic": {},
    "oracle": {},
    "react": {"base_url": "http://127.0.0.1:9/v1", "model": "one"},
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_a_policy_is_built_without_imports_in_its_own_process(name: str) -> None:
    """Each agent has such a process, so an import there counts once for each agent of each episode."""
    call = [sys.executable, "-c", SCRIPT, name, json.dumps(ARGUMENTS[name])]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["is_model_kept"]
    assert report["imported"] == []
    assert report["lists_read"] == (1 if name == "react" else 0)
