"""`docs/plugins.md`: its plug-in registers, and it names every hook and the current version."""

from __future__ import annotations

import asyncio
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from lingjing.cli.new import KINDS
from lingjing.plugins import conformance, hookspecs
from lingjing.plugins.conformance import sample_brief, sample_observations
from lingjing.plugins.contract import API_VERSION
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.host import HOOKS, MAKERS
from lingjing.plugins.policy import Inbox, Observation
from lingjing.testing import PluginHost, build_policy, play

PAGE = (Path(__file__).parents[2] / "docs" / "plugins.md").read_text(encoding="utf-8")


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> PluginHost:
    code, _, _ = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    module = ModuleType("page_plugin")
    monkeypatch.setitem(sys.modules, "page_plugin", module)
    exec(compile(code, "docs/plugins.md", "exec"), module.__dict__)
    return PluginHost(entry_points=False, extra=(module,))


def test_the_plugin_of_the_page_offers_the_described_parts(host: PluginHost) -> None:
    assert [*host.policies, *host.evaluators, *host.scenes] == ["waiting", "patience", "field"]
    assert [*host.models, *host.detectors] == ["mine-7b", "nowhere"]
    policy = host.policy("waiting").factory()
    policy.role = "scout"
    decision = asyncio.run(policy.act(Observation(agent="scout", tick=3, time_s=30.0), None))
    assert decision.thought == "scout waits at tick 3"


def test_the_page_names_every_hook_and_the_version() -> None:
    assert f"now {API_VERSION})" in PAGE
    named = set(re.findall(r"`(lingjing_\w+)`", PAGE)) | set(re.findall(r"def (lingjing_\w+)", PAGE))
    every = {*HOOKS, *MAKERS, "lingjing_api_version"}
    assert named >= every
    assert {name for name in hookspecs.__all__ if name.startswith("lingjing_")} == every


def test_the_path_length_example_of_the_page_agrees_with_the_trace(tmp_path: Path) -> None:
    _, code, _ = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    page, ferry = ModuleType("page_path"), ModuleType("page_ferry")
    exec(compile(code, "docs/plugins.md", "exec"), page.__dict__)
    testing = (Path(__file__).parents[2] / "docs" / "testing.md").read_text(encoding="utf-8")
    (module,) = re.findall(r"^```python[^\n]*\n(.*?)^```", testing, flags=re.MULTILINE | re.DOTALL)
    exec(compile(module, "docs/testing.md", "exec"), ferry.__dict__)
    played = play(ferry.MISSION, tmp_path, policy=ferry.Skipper, plugins=[ferry.PLUGIN])
    assert page.path_length_m(played.report.trace, "raft") == pytest.approx(30.0)
    assert page.path_length_m(played.report.trace, "buoy") == 0.0


def test_the_wrapper_of_the_page_wraps_a_policy(capsys: pytest.CaptureFixture[str]) -> None:
    _, _, code = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    module = ModuleType("page_wrapper")
    exec(compile(code, "docs/plugins.md", "exec"), module.__dict__)
    wrapped = PluginHost(extra=(module,))
    policy = build_policy(wrapped.policy("random"), {}, host=wrapped)
    brief = sample_brief()
    asyncio.run(policy.reset(brief))
    asyncio.run(policy.act(sample_observations(brief)[0], Inbox()))
    assert re.fullmatch(r"pilot tick 0: \d+\.\d+ s\n", capsys.readouterr().out)


def test_lingjing_new_supports_each_kind_of_the_page() -> None:
    kinds = set(re.findall(r"`lingjing new (\w+) NAME`", PAGE))
    assert kinds - {"KIND"} == set(KINDS)
    checks = set(re.findall(r"`(check_\w+)`", PAGE))
    assert checks <= set(conformance.__all__)


def test_the_page_of_engines_names_each_member_that_a_fleet_engine_defines() -> None:
    page = (Path(__file__).parents[2] / "docs" / "engines.md").read_text(encoding="utf-8")
    section = page.partition("## An engine of your own")[2].partition("\n## ")[0]
    named = set(re.findall(r"^\| `(\w+)", section, re.MULTILINE))
    provided = {"reset", "submit", "advance", "capture", "close", "emit", "publish", "at_once"}
    assert named == {name for name in (*vars(FleetEngine), "step_s") if not name.startswith("_")} - provided
