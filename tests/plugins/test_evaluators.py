"""Evaluators of plug-ins: what they are given, how several count, and one that is installed beside the project."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing.engines import builtin
from lingjing.errors import PluginError, UsageError
from lingjing.play.episode import Session
from lingjing.plugins.evaluator import Evaluation, EvaluatorPlugin, Standing
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.trace.reader import read_trace

MISSION = """\
ljs 1
use std.air { quadrotor }

mission hover "Hover" {
  goal    "Take off."
  scene   bay
  clock   { tick = 5 s, sync = 500 ms }
  budget  { ticks <= 4, policy <= 20 s, engine <= 60 s, capture <= 60 s }
  mode    single
  asset uav : quadrotor { position = (0 m, -700 m, 20 m), band = 10 m..60 m, actions { takeoff, stop } }
  agent pilot as flyer controls uav { observes uav.* }
  adjudicate aloft() { when uav.position.z >= 5000 m }
  success when aloft()
}
"""

PLUGIN = '''
"""An evaluator that ends the episode as a success at the second boundary."""

from lingjing.plugins.evaluator import Evaluation, EvaluatorPlugin
from lingjing.plugins.hookspecs import hookimpl


class Patience:
    def __init__(self, instance):
        self.uav = instance.entities[0].id

    def evaluate(self, standing, events):
        assert self.uav in standing.states and not standing.achieved and not events
        done = standing.tick >= 2
        return Evaluation(standing.tick / 2, done, "success" if done else "", "patience paid")


@hookimpl
def lingjing_evaluators():
    yield EvaluatorPlugin(name="patience", build=Patience, summary="Waits for two ticks.")
'''


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    file = tmp_path / "hover.ljs"
    file.write_text(MISSION)
    return file


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """The environment of a process in which the plug-in is a distribution with an entry point."""
    site = tmp_path / "site"
    (site / "patience-1.0.dist-info").mkdir(parents=True)
    (site / "patience_plugin.py").write_text(PLUGIN)
    (site / "patience-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: patience\nVersion: 1.0\n")
    (site / "patience-1.0.dist-info" / "entry_points.txt").write_text("[lingjing]\npatience = patience_plugin\n")
    return {**os.environ, "PYTHONPATH": str(site)}


def lingjing(environment: dict[str, str], *arguments: object) -> str:
    command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


def test_an_installed_evaluator_is_listed_and_scores_episodes(
    installed: dict[str, str], mission: Path, tmp_path: Path
) -> None:
    listed = json.loads(lingjing(installed, "plugins", "--output-format", "json"))
    offered = [(one["name"], one["source"]) for one in listed if one["kind"] == "evaluator"]
    assert offered == [("mission", "builtin"), ("patience", "patience")]
    run = ("run", mission, "--policy", "random", "--no-overview", "--json", "--world", "inline")
    report = json.loads(lingjing(installed, *run, "--evaluator", "patience", "-o", tmp_path / "a"))
    assert (report["success"], report["ticks"], report["score"]) == (True, 2, 1.0)
    assert read_trace(report["trace"]).header.evaluators == ("patience",)
    both = ("--evaluator", "mission", "--evaluator", "patience", "--seeds", "0-1", "-j", "2")
    several = json.loads(lingjing(installed, *run, *both, "-o", tmp_path / "b"))
    assert [(one["ticks"], one["score"]) for one in several["episodes"]] == [(2, 0.5), (2, 0.5)]


class _Constant:
    @staticmethod
    @hookimpl
    def lingjing_evaluators() -> list[EvaluatorPlugin]:
        return [EvaluatorPlugin(name="constant", build=lambda instance: _Half())]


class _Half:
    def evaluate(self, standing: Standing, events: object) -> Evaluation:
        return Evaluation(0.5, standing.tick == 1)


def test_an_episode_that_an_evaluator_ends_without_a_reason_is_no_success(mission: Path, tmp_path: Path) -> None:
    with Session(PluginHost(extra=(_Constant,))) as session:
        options = {"policy": "random", "evaluators": ["constant"], "world": "inline", "overview": False}
        report = session.run(mission, out=tmp_path / "run", **options)
    assert (report.reason, report.ticks, report.score) == ("failure", 1, 0.5)


def test_an_unknown_evaluator_is_named_and_two_of_one_name_are_refused(mission: Path, tmp_path: Path) -> None:
    with Session() as session, pytest.raises(UsageError, match="no evaluator is called `nobody`"):
        session.run(mission, evaluators=["nobody"], world="inline", out=tmp_path / "run")
    with pytest.raises(PluginError, match="`constant` is offered twice by lingjing_evaluators"):
        PluginHost(entry_points=False, extra=(builtin, _Constant, type("Other", (), vars(_Constant).copy())))
