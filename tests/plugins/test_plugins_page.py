"""`docs/plugins.md`: its plug-in registers, and it names every hook and the current version."""

from __future__ import annotations

import asyncio
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from lingjing.plugins import hookspecs
from lingjing.plugins.contract import API_VERSION
from lingjing.plugins.host import HOOKS, PluginHost
from lingjing.plugins.policy import Observation

PAGE = (Path(__file__).parents[2] / "docs" / "plugins.md").read_text(encoding="utf-8")


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> PluginHost:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    module = ModuleType("page_plugin")
    monkeypatch.setitem(sys.modules, "page_plugin", module)
    exec(compile(code, "docs/plugins.md", "exec"), module.__dict__)
    return PluginHost(entry_points=False, extra=(module,))


def test_the_plugin_of_the_page_offers_what_the_page_says(host: PluginHost) -> None:
    assert [*host.policies, *host.evaluators, *host.scenes] == ["waiting", "patience", "field"]
    assert [*host.models, *host.detectors] == ["mine-7b", "nowhere"]
    policy = host.policy("waiting").factory()
    policy.role = "scout"
    decision = asyncio.run(policy.act(Observation(agent="scout", tick=3, time_s=30.0), None))
    assert decision.thought == "scout waits at tick 3"


def test_the_page_names_every_hook_and_the_version() -> None:
    assert f"now {API_VERSION})" in PAGE
    named = set(re.findall(r"`(lingjing_\w+)`", PAGE)) | set(re.findall(r"def (lingjing_\w+)", PAGE))
    assert named >= {*HOOKS, "lingjing_api_version"}
    assert {name for name in hookspecs.__all__ if name.startswith("lingjing_")} == {*HOOKS, "lingjing_api_version"}
