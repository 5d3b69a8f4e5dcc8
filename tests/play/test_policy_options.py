"""Options of policies in files: the factory receives the same values with and without a model of its parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from lingjing import PlayOptions
from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.plugins.loading import policy_of, takes_as_given
from lingjing.plugins.options import PluginOptions
from lingjing.testing import build_policy

MISSION = """\
ljs 1
use std.sea { lifeboat }
mission boat "A boat that waits" {
  goal "Wait."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 1, policy <= 600 s }
  asset boat : lifeboat { position = (0 m, -900 m) }
  agent skipper as skipper controls boat { observes boat.* }
  success when boat.status == "aground"
}
"""

POLICY = """\
from lingjing.plugins.policy import Decision


class Values:
    def __init__(self, count: int = 1, name: str = "none", **others):
        self.values = {"count": count, "name": name, **others}

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        return Decision(thought=repr(self.values))
"""


def no_options() -> None: ...


def plain(count: int = 1, name: str = "x", share: float = 0.5, tags: list[str] = []) -> None: ...  # noqa: B006


def converted(count: int = 1, pair: tuple[int, int] = (0, 0), place: Path = Path()) -> None: ...


def anything(first=1, **others: Any) -> None: ...


GIVEN: list[tuple[Callable[..., Any], dict[str, Any], bool]] = [
    (no_options, {}, True),
    (plain, {}, True),
    (plain, {"count": 3, "name": "y", "share": 0.25, "tags": ["a"]}, True),
    (plain, {"count": "3"}, False),
    (plain, {"count": 3.0}, False),
    (plain, {"share": 1}, False),
    (plain, {"option_0": 3}, False),
    (converted, {"pair": [1, 2]}, False),
    (converted, {"place": "a/b"}, False),
    (anything, {"first": {"a": [1, None]}, "other": True}, True),
]


@pytest.mark.parametrize(("factory", "arguments", "is_same"), GIVEN)
def test_a_factory_takes_options_as_given_if_its_model_changes_none(
    factory: Callable[..., Any], arguments: Mapping[str, Any], is_same: bool
) -> None:
    assert takes_as_given(policy_of(factory, "it"), arguments) is is_same


def test_options_that_a_model_refuses_are_an_error() -> None:
    with pytest.raises(UsageError, match="option `count`"):
        takes_as_given(policy_of(plain, "it"), {"count": "many"})


def test_a_declared_model_is_always_read() -> None:
    class Declared(PluginOptions):
        count: int = 1

    def factory(options: Declared) -> Declared:
        return options

    factory.options = Declared  # type: ignore[attr-defined]
    assert not takes_as_given(policy_of(factory, "it"), {"count": 3})  # type: ignore[arg-type]


def test_a_plugin_that_makes_policies_receives_the_model() -> None:
    """Options pass through a model, whatever an examination has found, if a plug-in may look at them."""

    class MakingHost:
        def makers(self, hook: str) -> tuple[str, ...]:
            return ("wrapper",)

        def make_policy(self, declaration: object, options: PluginOptions, calls: object) -> Any:
            return options

    made: Any = build_policy(policy_of(plain, "it"), {"count": 3}, host=MakingHost(), as_given=True)
    assert isinstance(made, PluginOptions) and made.model_fields_set == {"option_0"}


OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({}, "{'count': 1, 'name': 'none'}"),
    ({"count": 3, "name": "4"}, "{'count': 3, 'name': '4'}"),
    ({"count": "3", "more": "5"}, "{'count': 3, 'name': 'none', 'more': '5'}"),
]


def test_processes_of_policies_receive_the_options_as_read(tmp_path: Path) -> None:
    (tmp_path / "boat.ljs").write_text(MISSION)
    (tmp_path / "values.py").write_text(POLICY)
    shared = {"mission": str(tmp_path / "boat.ljs"), "policy": str(tmp_path / "values.py"), "overview": False}
    tasks = [
        EpisodeTask(PlayOptions(**shared, policy_args=arguments), tmp_path / str(number))
        for number, (arguments, _) in enumerate(OPTIONS)
    ]
    for task, report in play_apart(tasks, jobs=1):
        assert report.reason == "budget", report.detail
        (decision,) = [record for boundary in read_trace(report.trace).boundaries for record in boundary.decisions]
        assert decision.decision.thought == OPTIONS[int(task.folder.name)][1]
