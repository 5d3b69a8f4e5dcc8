"""`lingjing plugins`: faults with file and line, tracebacks on request, packages of types, and one plug-in alone."""

from __future__ import annotations

import json

import pytest

from lingjing.testing import compile_text, run_command
from tests.installed_plugins.conftest import Site

OFFER = """\
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.evaluator import EvaluatorPlugin
@hookimpl
def lingjing_evaluators():
    return [EvaluatorPlugin(name="patience", build=lambda instance, options=None: None, options={options!r})]
"""

RAISING = """\
from lingjing.plugins.hookspecs import hookimpl
def path():
    raise ValueError("no licence")
@hookimpl
def lingjing_scenes():
    return path()
"""


def test_a_fault_has_a_file_a_line_and_one_hint(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    site.add("acme", RAISING)
    assert run_command(["plugins"]) == 2
    fault = "error: plug-in `acme` (lingjing-acme 1.0): failed in lingjing_scenes: ValueError: no licence (acme.py:3)"
    assert capsys.readouterr().err.splitlines() == [
        fault, "hint: repair or uninstall it; episodes that do not use it can be played",
    ]  # fmt: skip


def test_a_traceback_is_shown_on_request(
    site: Site, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LINGJING_TRACEBACK", "1")
    site.add("acme", RAISING)
    assert run_command(["plugins"]) == 2
    printed = capsys.readouterr().err
    assert "Traceback (most recent call last)" in printed and 'acme.py", line 3, in path' in printed
    assert run_command(["run", "no-such-mission"]) == 2
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_a_plugin_for_a_newer_contract_gives_one_hint(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    code = (
        "from lingjing.plugins.hookspecs import hookimpl\n@hookimpl\ndef lingjing_api_version():\n    return '99.0'\n"
    )
    site.add("acme", code)
    assert run_command(["plugins"]) == 2
    error, hint = capsys.readouterr().err.splitlines()
    assert error.startswith("error: plug-in `acme` (lingjing-acme 1.0): does not load: it is written for version 99.0")
    assert hint == "hint: install a newer lingjing-sim"


def test_options_that_do_not_load_are_named_in_the_list(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    site.add("acme", OFFER.format(options="acme:Nope"))
    for arguments in (["plugins"], ["plugins", "patience"]):
        assert run_command(arguments) == 2
        printed = capsys.readouterr()
        assert "patience" in printed.out
        assert "the options of evaluator `patience` cannot be loaded from `acme:Nope`: AttributeError" in printed.err
        assert "hint: correct `options` in its declaration" in printed.err


def test_the_list_of_one_plugin_has_its_items_and_its_faults(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    site.add("acme", OFFER.format(options=None) + RAISING)
    site.add("other", RAISING)
    for name in ("acme", "patience"):
        assert run_command(["plugins", name]) == 2
        printed = capsys.readouterr()
        assert printed.out.splitlines()[0].split() == ["evaluator", "patience", "acme"]
        assert "`acme`" in printed.err and "`other`" not in printed.err
    assert run_command(["plugins", "other"]) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and "no licence" in printed.err


def test_packages_of_types_are_listed(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("acme", "empty", "lost"):
        site.add(name, None, entry_points=f"[lingjing.std]\n{name} = {name}.types\n".encode())
    for name in ("acme", "empty"):
        (site.folder / name / "types").mkdir(parents=True)
    for file in ("bodies.ljs", "goods.ljs"):
        (site.folder / "acme" / "types" / file).write_text("ljs 2\n")
    assert run_command(["plugins", "--output-format", "json"]) == 2
    printed = capsys.readouterr()
    (offer,) = [offer for offer in json.loads(printed.out) if offer["kind"] == "types"]
    assert (offer["name"], offer["source"], offer["notes"], offer["summary"]) == (
        "acme", "acme.types", "acme.bodies, acme.goods", "use acme.bodies { … }",
    )  # fmt: skip
    assert "error: the types `empty`: `empty.types` holds no .ljs file" in printed.err
    assert "error: the types `lost` name `lost.types`, which is no package" in printed.err
    assert run_command(["plugins", "acme"]) == 0
    assert "acme.bodies, acme.goods" in capsys.readouterr().out
    hints = {"acme.bodys": "did you mean `acme.bodies`?", "empty.bodies": "the installed types `empty` hold no .ljs"}
    for path, hint in hints.items():
        faults = {fault.code: fault.hint for fault in compile_text(f"ljs 2\nuse {path} {{ a }}\n").diagnostics}
        assert faults["LJ0118"].startswith(hint)
