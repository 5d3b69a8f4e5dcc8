"""An exception of a plug-in in one line: its type, its text, and the file and line of the plug-in's own code."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lingjing.errors import InfrastructureError, PluginError, UsageError
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.foreign_errors import one_line, place_of
from lingjing.plugins.hook_faults import called_hook
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.options import PluginOptions, declared_model
from lingjing.testing import PluginHost, play

ACME = """\
import json
from lingjing.plugins.fleet import FleetEngine


class Refused(Exception):
    def __str__(self):
        raise RuntimeError("no text")


class Fleet(FleetEngine):
    step_s = 0.5

    def build(self, spec, city, seed):
        self.heights = {entity.id: 1.0 / entity.position[2] for entity in spec.owned()}

    def start(self, command):
        pass

    def step(self):
        pass

    def states(self):
        return ()


def divide():
    return 1 / 0


def read():
    return json.loads("{")


def refuse():
    raise Refused


def quiet():
    raise ValueError
"""


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], BaseException]]:
    """A function that calls a function of the package `acme` and returns its exception."""
    (tmp_path / "acme" / "deep").mkdir(parents=True)
    for file, text in {"__init__.py": "", "deep/__init__.py": "", "deep/work.py": ACME, "broken.py": "x = (\n"}.items():
        (tmp_path / "acme" / file).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))

    def raised(name: str) -> BaseException:
        function = getattr(importlib.import_module("acme.deep.work"), name)
        with pytest.raises(PluginError) as caught:
            called_hook("lingjing_engines", function, "acme")
        assert caught.value.__cause__ is not None
        return caught.value.__cause__

    yield raised
    for name in [name for name in sys.modules if name.partition(".")[0] == "acme"]:
        del sys.modules[name]


READ = '    return json.loads("{")'


def line_of(text: str) -> int:
    return ACME.splitlines().index(text) + 1


def test_the_place_is_the_line_of_the_plugins_own_code(acme: Callable[[str], BaseException]) -> None:
    divided = f"acme/deep/work.py:{line_of('    return 1 / 0')}"
    assert one_line(acme("divide")) == f"ZeroDivisionError: division by zero ({divided})"
    assert place_of(acme("read")) == f"acme/deep/work.py:{line_of(READ)}"
    assert one_line(acme("refuse")).startswith("Refused (acme/deep/work.py:")
    assert one_line(acme("quiet")).startswith("ValueError (acme/deep/work.py:")


def test_a_syntax_error_has_its_own_file_and_line(acme: Callable[[str], BaseException]) -> None:
    acme("divide")
    with pytest.raises(SyntaxError) as caught:
        importlib.import_module("acme.broken")
    assert one_line(caught.value) == "SyntaxError: '(' was never closed (acme/broken.py:1)"


def test_an_error_of_this_project_is_its_text_alone() -> None:
    assert one_line(UsageError("no such file\nand more")) == "no such file"
    assert place_of(UsageError("x")) == ""
    with pytest.raises(ZeroDivisionError) as caught:
        exec("1 / 0", {"__name__": "lingjing.mine"})
    assert one_line(caught.value).startswith("ZeroDivisionError: division by zero")


MISSION = """\
ljs 2
asset raft { engine = drifter, verb drift(distance: length) }
mission ferry "A ferry" {
  goal "Drift."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 2 }
  asset raft : raft { position = (0 m, -900 m, 0 m) }
  agent skipper as skipper controls raft { observes raft.* }
  adjudicate east() { when raft.position.x >= 1 m }
  success when east()
}
"""


def test_an_engine_that_raises_is_named_with_its_plugin_and_its_line(
    acme: Callable[[str], BaseException], tmp_path: Path
) -> None:
    acme("divide")
    work = sys.modules["acme.deep.work"]

    class Ferries:
        @hookimpl
        def lingjing_engines(self) -> list[EnginePlugin]:
            return [EnginePlugin(name="drifter", factory=lambda: work.Fleet())]  # type: ignore[attr-defined]

    line = line_of("        self.heights = {entity.id: 1.0 / entity.position[2] for entity in spec.owned()}")
    report = play(MISSION, tmp_path, policy="random", plugins=[Ferries()]).report
    assert report.reason == "infrastructure-abort"
    problem = f"failed in reset: ZeroDivisionError: float division by zero (acme/deep/work.py:{line})"
    assert report.detail == f"engine `drifter` of plug-in `Ferries` {problem}"


def test_a_wrong_reference_to_options_names_the_line_and_the_way_out(acme: Callable[[str], BaseException]) -> None:
    acme("divide")
    with pytest.raises(PluginError, match=r"`acme.deep.work:Nope`: AttributeError: .*no attribute 'Nope'") as caught:
        declared_model("acme.deep.work:Nope", "engine `drifter`")
    assert caught.value.hint == "correct `options` in its declaration: package.module:Class"
    with pytest.raises(PluginError, match=r"`acme.broken:Own`: SyntaxError: .* \(acme/broken.py:1\)"):
        declared_model("acme.broken:Own", "engine `drifter`")
    assert declared_model(PluginOptions, "engine `drifter`") is PluginOptions


class _Configured:
    @hookimpl
    def lingjing_engines(self, config: object) -> list[EnginePlugin]:
        return []


class _NoGenerator:
    @hookimpl(wrapper=True)
    def lingjing_make_policy(self) -> int:
        return 1


class _Asynchronous:
    @hookimpl
    async def lingjing_engines(self) -> list[EnginePlugin]:
        return []


class _NoVersion:
    @hookimpl
    def lingjing_api_version(self) -> str:
        raise ValueError("no number")


@pytest.mark.parametrize(
    ("plugin", "message", "hint"),
    [
        (_Configured, r"lingjing_engines: it takes `config`, and the hook has the parameters: none", r"engines\(\):"),
        (_NoGenerator, r"lingjing_make_policy: .*function is not a generator function", "docs/plugins.md"),
        (_Asynchronous, r"lingjing_engines: it returned a coroutine, and a list of EnginePlugin is due", "`def`"),
        (_NoVersion, r"lingjing_api_version: ValueError: no number \(.*test_foreign_errors.py:\d+\)", "^$"),
    ],
)
def test_a_misused_hook_keeps_its_cause(plugin: type, message: str, hint: str) -> None:
    with pytest.raises(PluginError, match=f"plug-in `{plugin.__name__}` failed in {message}") as caught:
        PluginHost(entry_points=False, extra=(plugin(),))
    assert re.search(hint, caught.value.hint)


def test_an_engine_error_names_no_plugin_of_this_project() -> None:
    from lingjing.kernel.world.guarded_calls import engine_error, name_plugin

    error = engine_error("vessel", "advance", "it sank")
    name_plugin(error, PluginHost())
    assert str(error) == "engine `vessel` failed in advance: it sank"
    name_plugin(bare := InfrastructureError("the disk is full"), PluginHost())
    assert str(bare) == "the disk is full"
