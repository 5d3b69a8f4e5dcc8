"""An exception of a plug-in in one line: its type, its text, and the file and line of the plug-in's own code."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from lingjing.errors import PluginError
from lingjing.plugins.engine import EnginePlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.options import PluginOptions, declared_model
from lingjing.testing import PluginHost, play

ACME = """\
import json
from lingjing.errors import UsageError
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


def load():
    import acme.broken


def report():
    raise UsageError("no such file")
"""


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], str]]:
    """A function that calls a function of the package `acme` as a hook and returns the error."""
    (tmp_path / "acme" / "deep").mkdir(parents=True)
    for file, text in {"__init__.py": "", "deep/__init__.py": "", "deep/work.py": ACME, "broken.py": "x = (\n"}.items():
        (tmp_path / "acme" / file).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))

    def raised(name: str) -> str:
        function = getattr(importlib.import_module("acme.deep.work"), name)
        plugin = type("Acme", (), {"lingjing_engines": staticmethod(hookimpl(function, specname="lingjing_engines"))})
        with pytest.raises(PluginError) as caught:
            PluginHost(entry_points=False, extra=(plugin(),))
        return str(caught.value).removeprefix("plug-in `Acme` failed in lingjing_engines: ")

    yield raised
    for name in [name for name in sys.modules if name.partition(".")[0] == "acme"]:
        del sys.modules[name]


READ = '    return json.loads("{")'


def line_of(text: str) -> int:
    return ACME.splitlines().index(text) + 1


def test_an_error_has_the_file_and_line_of_the_plugins_own_code(acme: Callable[[str], str]) -> None:
    divided = f"acme/deep/work.py:{line_of('    return 1 / 0')}"
    assert acme("divide") == f"ZeroDivisionError: division by zero ({divided})"
    assert acme("read").endswith(f"(acme/deep/work.py:{line_of(READ)})"), "the call of the library"
    assert acme("refuse").startswith("Refused (acme/deep/work.py:")
    assert acme("quiet").startswith("ValueError (acme/deep/work.py:")


def test_a_syntax_error_has_its_own_file_and_line(acme: Callable[[str], str]) -> None:
    assert acme("load") == "SyntaxError: '(' was never closed (acme/broken.py:1)"


def test_an_error_of_this_project_is_reported_by_its_text_alone(acme: Callable[[str], str]) -> None:
    assert acme("report") == "no such file"


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
    acme: Callable[[str], str], tmp_path: Path
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


def test_the_error_for_a_wrong_reference_to_options_has_its_cause_and_a_hint(acme: Callable[[str], str]) -> None:
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
def test_the_error_of_a_misused_hook_has_its_cause(plugin: type, message: str, hint: str) -> None:
    with pytest.raises(PluginError, match=f"plug-in `{plugin.__name__}` failed in {message}") as caught:
        PluginHost(entry_points=False, extra=(plugin(),))
    assert re.search(hint, caught.value.hint)
