"""The distributions' names come from the metadata, and another party's `lingjing` is never advised, required or run."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from lingjing.cli import doctor
from lingjing.installation import CORE, EarlierRequirement, earlier_requirements, name_of, requirements
from lingjing.testing import run_command

ROOT = Path(__file__).resolve().parents[1]
BUILTIN = "[lingjing]\nbuiltin = lingjing.builtin\n"
SOURCE_FOLDERS = ("lingjing", "agents", "docs", "editors", "tools", "scenarios", "suites", "benchmarks")
ADVICE = re.compile(r"pip install[^\n`]*?[ \t'\"]lingjing(?:[-_]agents)?(?=[\s'\"`\[\].,;=)]|$)", re.MULTILINE)


def add_metadata(
    site: Path, name: str, *, entry_points: str = "", requires: tuple[str, ...] = (), url: str = ""
) -> None:
    """Write the metadata of an installed distribution, version 1.0.0, into a folder of Python's path."""
    folder = site / f"{name.replace('-', '_')}-1.0.0.dist-info"
    folder.mkdir(parents=True)
    lines = (f"Requires-Dist: {line}" for line in requires)
    head = f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0.0\n"
    (folder / "METADATA").write_text(head + "".join(f"{line}\n" for line in lines))
    (folder / "entry_points.txt").write_text(entry_points)
    if url:
        (folder / "direct_url.json").write_text(json.dumps({"url": url, "dir_info": {"editable": True}}))


def answer(site: Path, expression: str) -> object:
    """The value of an expression about `lingjing.installation` where `site` alone holds metadata."""
    code = (
        f"import sys; sys.path[:0] = [{str(ROOT)!r}, {str(site)!r}]\n"
        f"import json; from lingjing.installation import *; print(json.dumps({expression}))"
    )
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


NAMES = "[name_of(CORE), version_of(CORE), name_of(AGENTS), version_of(AGENTS), install_line('road')]"
BY_SETUP = "run `make setup` in the checkout of this project"


def test_without_metadata_the_names_are_known_and_make_setup_is_advised(tmp_path: Path) -> None:
    assert answer(tmp_path, NAMES) == ["lingjing-sim", "absent", "lingjing-sim-agents", "absent", BY_SETUP]


def test_a_redistribution_has_a_name_of_its_own(tmp_path: Path) -> None:
    road = ("numpy>=1", "libsumo>=1.24; extra == 'road'", "sumo-tools; python_version > '3' and extra == \"road\"")
    add_metadata(
        tmp_path, "acme-lingjing", entry_points=BUILTIN, requires=(*road, "acme-lingjing[road]; extra == 'all'")
    )
    installs = "pip install 'libsumo>=1.24' sumo-tools"
    assert answer(tmp_path, NAMES) == ["acme-lingjing", "1.0.0", "lingjing-sim-agents", "absent", installs]
    assert answer(tmp_path, "requirements('all')") == []


def test_metadata_of_an_earlier_name_counts_as_ours_and_is_shown_under_the_present_name(tmp_path: Path) -> None:
    add_metadata(tmp_path, "lingjing", entry_points=BUILTIN, requires=("libsumo; extra == 'road'",))
    assert answer(tmp_path, NAMES)[:2] == ["lingjing-sim", "1.0.0"]
    assert answer(tmp_path, "[[one.name for one in earlier_left()], other_party() is None]") == [["lingjing"], True]


def test_another_partys_package_is_not_ours(tmp_path: Path) -> None:
    add_metadata(tmp_path, "lingjing")
    assert answer(tmp_path, NAMES)[:2] == ["lingjing-sim", "absent"]
    assert answer(tmp_path, "[other_party().name, len(earlier_left())]") == ["lingjing", 0]


def test_an_extra_names_its_packages_with_their_bounds() -> None:
    assert requirements("road") == ("eclipse-sumo>=1.24", "libsumo>=1.24")
    assert requirements("quadruped") == ("mujoco==3.17.0",)
    assert requirements("agents") == ()


def test_missing_metadata_of_the_projects_own_plugins_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "find_entries", lambda group: SimpleNamespace(points=(), broken=()))
    finding = doctor.check_installation()
    assert not finding.ok and "none of this project's engines" in finding.found and finding.advice


def test_no_text_advises_to_install_another_partys_package() -> None:
    assert ADVICE.search("pip install 'lingjing[road]'") and ADVICE.search("pip install lingjing")
    assert not ADVICE.search("pip install lingjing-sim") and not ADVICE.search("pip install ./lingjing_scout")
    files = [path for folder in SOURCE_FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    files = [path for path in files if path.parent.name != "adr"]  # ADRs quote former advice
    texts = {path: path.read_text(encoding="utf-8", errors="replace") for path in (*files, ROOT / "README.md")}
    assert [str(path) for path, text in texts.items() if ADVICE.search(text)] == []


def test_no_project_file_requires_another_partys_package() -> None:
    for path in (
        ROOT / "pyproject.toml",
        ROOT / "agents" / "pyproject.toml",
        *(ROOT / "lingjing").rglob("pyproject.toml.txt"),
    ):
        required = re.findall(
            r'"lingjing(?:-agents)?(?:\[[\w,]*\])?"', path.read_text(encoding="utf-8").split("[tool")[0]
        )
        assert required == [], path


# -- plug-ins of an earlier scaffold


@pytest.fixture
def old_plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The source folder of an installed plug-in that was written when the project was called `lingjing`."""
    source, site = tmp_path / "hover craft", tmp_path / "site"
    point = "[lingjing]\nhovercraft = old_hovercraft\n"
    url = source.as_uri()
    add_metadata(site, "lingjing-hovercraft", entry_points=point, requires=("lingjing>=0.1",), url=url)
    (site / "old_hovercraft.py").write_text(
        "from lingjing.plugins.hookspecs import hookimpl\n\n\n@hookimpl\ndef lingjing_policies():\n    return []\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    return source


def test_a_plugin_that_requires_an_earlier_name_is_named_with_the_line_to_change(old_plugin: Path, capsys) -> None:
    change = f'write "{name_of(CORE)}" for "lingjing" in `dependencies`, then install it again'
    advice = f"in {old_plugin}/pyproject.toml {change}"
    expected = EarlierRequirement("hovercraft", "lingjing-hovercraft", "lingjing", advice)
    assert list(earlier_requirements()) == [expected]
    finding = doctor.check_installation()
    assert finding.ok and finding.advice.endswith(advice) and "plug-in `hovercraft` requires" in finding.advice
    assert run_command(["plugins"]) == 0
    printed = capsys.readouterr()
    assert "multirotor" in printed.out
    assert "plug-in `hovercraft` (lingjing-hovercraft) requires `lingjing`" in printed.err and advice in printed.err


def test_plugins_without_an_earlier_requirement_are_not_reported() -> None:
    assert list(earlier_requirements()) == []


def test_doctor_fails_where_another_partys_package_is_installed(tmp_path: Path, monkeypatch) -> None:
    add_metadata(tmp_path, "lingjing")
    monkeypatch.syspath_prepend(str(tmp_path))
    finding = doctor.check_installation()
    assert not finding.ok and "`lingjing` 1.0.0 of another project" in finding.found
    assert finding.advice.startswith("pip uninstall -y lingjing")


# -- the command


def command(tmp_path: Path, *path: Path) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path))}
    call = [sys.executable, "-m", "lingjing_command", "--version"]
    return subprocess.run(call, env=env, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=900)


def test_the_command_runs() -> None:
    done = command(ROOT.parent)
    assert (done.returncode, done.stdout.split()[0]) == (0, "lingjing"), done.stderr


def test_an_interrupt_during_the_import_of_the_package_prints_one_word(tmp_path: Path) -> None:
    """The site's module raises it where the import of `lingjing` reads its first own module."""
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "class Interrupts:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'lingjing.cli':\n"
        "            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupts())\n"
    )
    done = command(tmp_path, tmp_path, ROOT)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_the_command_names_a_package_that_hides_this_project(tmp_path: Path) -> None:
    other = tmp_path / "site" / "lingjing"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("raise SystemExit('foreign code runs')\n")
    done = command(tmp_path, tmp_path / "site")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: another package `lingjing` hides this project's: {other / '__init__.py'}\n")
    assert "hint: remove that package, or take its folder out of PYTHONPATH" in done.stderr
    add_metadata(tmp_path / "site", "lingjing")
    assert "hint: pip uninstall -y lingjing" in command(tmp_path, tmp_path / "site").stderr


@pytest.mark.parametrize(
    ("text", "fault"), [("__version__ = '1.0.0'\n", "was installed over this project's"), (None, "has lost its")]
)
def test_the_command_names_a_package_that_was_overwritten(tmp_path: Path, text: str | None, fault: str) -> None:
    package = tmp_path / "site" / "lingjing"
    (package / "cli").mkdir(parents=True)
    (package / "installed_plugins").mkdir()
    installed = [f"lingjing/installed_plugins/{name}.py" for name in ("__init__", "entry_points")]
    for name in ("lingjing_command.py", "lingjing/installation.py", "lingjing/cli/main.py", *installed):
        (tmp_path / "site" / name).write_bytes((ROOT / name).read_bytes())
    if text is not None:
        (package / "__init__.py").write_text(text)
    code = f"import sys; sys.path.insert(0, {str(package.parent)!r}); import lingjing_command as c; sys.exit(c.main())"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=900
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert fault in done.stderr and "hint: pip install --force-reinstall --no-deps WHEEL" in done.stderr
    assert "Traceback" not in done.stderr


def test_metadata_with_the_earlier_place_of_the_plugin_is_understood(tmp_path: Path) -> None:
    """An editable installation keeps it until it is installed again."""
    earlier = BUILTIN.replace("lingjing.builtin", "lingjing.engines.builtin")
    add_metadata(tmp_path, "lingjing-sim", entry_points=earlier)
    assert answer(tmp_path, "[name_of(CORE), version_of(CORE)]") == ["lingjing-sim", "1.0.0"]
    assert answer(tmp_path, "[[point.value, point.dist.version] for point in find_entries(PLUGINS).points]") == [
        ["lingjing.builtin", "1.0.0"]
    ]
