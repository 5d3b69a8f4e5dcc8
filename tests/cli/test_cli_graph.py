"""Tests of `lingjing graph`: formats by suffix, modes, messages, and imports."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import msgspec
import pytest

import lingjing
from lingjing.errors import ExitCode
from lingjing.mission.conditions.listing import ConditionList, list_conditions
from lingjing.mission.graph import MissionGraph
from lingjing.testing import run_command

SSR = str(Path(__file__).parents[2] / "scenarios" / "ssr.ljs")
UPR = str(Path(__file__).parents[2] / "scenarios" / "upr.ljs")
STARTS = {"svg": "<svg ", "mermaid": "---\ntitle:", "dot": "digraph ", "json": "{"}


def test_mermaid_goes_to_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["graph", SSR]) == ExitCode.OK
    captured = capsys.readouterr()
    assert "flowchart LR" in captured.out
    assert captured.out.endswith("\n")
    assert captured.err == ""


@pytest.mark.parametrize(
    ("name", "chosen"),
    [
        ("a.svg", "svg"), ("a.SVG", "svg"), ("a.mmd", "mermaid"), ("a.dot", "dot"), ("a.gv", "dot"),
        ("a.json", "json"), ("a", "mermaid"),
    ],
)  # fmt: skip
def test_the_file_suffix_chooses_the_format(tmp_path: Path, name: str, chosen: str) -> None:
    assert run_command(["graph", SSR, "-o", str(tmp_path / name)]) == ExitCode.OK
    assert (tmp_path / name).read_text(encoding="utf-8").startswith(STARTS[chosen])
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_the_format_option_has_priority_over_the_file_suffix(tmp_path: Path) -> None:
    out = tmp_path / "a.svg"
    assert run_command(["graph", SSR, "--format", "dot", "-o", str(out)]) == ExitCode.OK
    assert out.read_text(encoding="utf-8").startswith(STARTS["dot"])


@pytest.mark.parametrize("chosen", STARTS)
def test_each_format_goes_to_standard_output(chosen: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["graph", SSR, "--format", chosen, "-o", "-"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith(STARTS[chosen])


def test_the_graph_of_a_mode_has_only_the_agents_of_that_mode(capsys: pytest.CaptureFixture[str]) -> None:
    names_by_mode = {}
    for mode in ("star", "broadcast"):
        assert run_command(["graph", SSR, "--mode", mode, "--format", "json"]) == ExitCode.OK
        names_by_mode[mode] = msgspec.json.decode(capsys.readouterr().out, type=MissionGraph)
        assert names_by_mode[mode].modes == (mode,)
    assert "agent:commander" in {node.id for node in names_by_mode["star"].nodes}
    assert "agent:commander" not in {node.id for node in names_by_mode["broadcast"].nodes}


def test_a_compiled_mission_draws_the_same_graph(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["compile", SSR, "-o", str(tmp_path / "ssr.json")]) == ExitCode.OK
    assert run_command(["graph", str(tmp_path / "ssr.json"), "--format", "svg"]) == ExitCode.OK
    from_json = capsys.readouterr().out
    assert run_command(["graph", SSR, "--format", "svg"]) == ExitCode.OK
    assert capsys.readouterr().out == from_json
    assert ET.fromstring(from_json).tag.endswith("svg")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--mode", "mesh"], "no mode `mesh`"),
        (["-o", "graph.png"], "the suffix `.png` belongs to no format"),
        (["-o", "nowhere/at/all/graph.svg"], "cannot write `nowhere/at/all/graph.svg`"),
    ],
)
def test_a_wrong_argument_gives_one_message_and_a_hint(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["graph", SSR, *arguments]) == ExitCode.USAGE
    captured = capsys.readouterr()
    assert message in captured.err
    assert "hint: " in captured.err
    assert "Traceback" not in captured.err
    assert captured.out == ""


def test_conditions_are_lines_with_tabs_in_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["graph", UPR, "--conditions"]) == ExitCode.OK
    captured = capsys.readouterr()
    blocks = {block.partition("]")[0].lstrip("["): block.splitlines() for block in captured.out.split("\n\n")}
    assert captured.err == ""
    assert {"success", "rule/sealed", "unlock/seal", "permit/dog.forward"} <= set(blocks)
    permit = blocks["permit/dog.forward"]
    assert "decides: the command dog.forward" in permit
    assert any(line.startswith("declassified: dog.forward because ") for line in permit)
    assert any(line.startswith("hidden: ") and "leak.position" in line for line in permit)
    near = "distance_xy(dog, k) <= 5 m\tdog.position\tverb forward, left, right by executor\t\tpublic"
    assert near in blocks["rule/sealed"]
    assert "\tleak.position\tnothing\t\thidden" in blocks["rule/sealed"]
    assert any("\tnow\ttime\t0..1500\tpublic" in line for block in blocks.values() for line in block)


@pytest.mark.parametrize(("columns", "table"), [(120, True), (50, False)])
def test_conditions_are_a_table_on_a_terminal_that_is_wide_enough(
    columns: int, table: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert run_command(["graph", UPR, "--conditions"]) == ExitCode.OK
    shown = capsys.readouterr().out
    assert ("───" in shown) is table
    assert ("\t" in shown) is not table
    assert "verb forward, left, right by executor" in shown


@pytest.mark.parametrize("arguments", [["--format", "json"], ["-o", "OUT.json"]])
def test_conditions_are_json_by_the_format_option_or_by_the_file_suffix(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(["graph", SSR, "--conditions", "--mode", "star", *arguments]) == ExitCode.OK
    text = capsys.readouterr().out or (tmp_path / "OUT.json").read_text(encoding="utf-8")
    listed = msgspec.json.decode(text, type=ConditionList)
    assert (listed.mission, listed.modes) == ("ssr", ("star",))
    assert listed == list_conditions(lingjing.compile(SSR), "star")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--mode", "mesh"], "no mode 'mesh'"),
        (["--format", "svg"], "conditions are text or JSON, not svg"),
        (["-o", "nowhere/at/all/conditions.txt"], "cannot write `nowhere/at/all/conditions.txt`"),
    ],
)
def test_a_wrong_argument_with_conditions_gives_one_message(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["graph", SSR, "--conditions", *arguments]) == ExitCode.USAGE
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""


def test_a_faulty_mission_leaves_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "bad.ljs"
    bad.write_text("ljs 1\nmission bad { goal 3 }\n", encoding="utf-8")
    assert run_command(["graph", str(bad), "-o", str(tmp_path / "bad.svg")]) == ExitCode.MISSION
    assert "error" in capsys.readouterr().err
    assert not (tmp_path / "bad.svg").exists()


def test_nothing_heavy_is_imported(tmp_path: Path) -> None:
    heavy = (
        "mujoco",
        "libsumo",
        "jsbsim",
        "litellm",
        "mcap",
        "pydantic",
        "pluggy",
        "rich",
        "numpy",
        "cv2",
        "matplotlib",
    )
    code = (
        "import sys\nfrom lingjing.cli.main import main\n"
        f"code = main(['graph', {SSR!r}, '-o', {str(tmp_path / 'a.svg')!r}])\n"
        f"print(code, [name for name in {heavy!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=900, check=True)
    assert done.stdout.strip() == "0 []"
