"""A scene or an engine that is not installed is a warning at its name. Built-in names are known."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.errors import ExitCode
from lingjing.mission.kinds import builtin_engines, builtin_scenes
from lingjing.testing import PluginHost, run_command
from lingjing.testing.missions import SourceText, compile_source


def warned(text: str, *offered: str) -> list[tuple[str, int, int, str, str]]:
    compilation = compile_source(SourceText(text, "m.ljs"), offers=lambda kind: offered)
    assert compilation.mission is not None
    return [
        (item.severity, item.span.line, item.span.column, item.message, item.hint) for item in compilation.diagnostics
    ]


def test_an_unknown_scene_gives_a_warning(small: str) -> None:
    line = small[: small.index("scene bay")].count("\n") + 1
    (diagnostic,) = warned(small.replace("scene bay", "scene baay"), "bay", "moon")
    assert diagnostic == ("warning", line, 9, "no scene called `baay` is installed", "did you mean `bay`?")


def test_a_scene_of_a_plug_in_gives_no_warning(small: str) -> None:
    assert warned(small.replace("scene bay", "scene moon"), "moon") == []


def test_an_unknown_engine_is_reported_once(small: str) -> None:
    type_ = "asset hovercraft {\n  engine = airboat\n  speed = 9 m/s\n  verb moveTo(x: length, y: length)\n}\n"
    two = "".join(f"  asset {name} : hovercraft {{ position = (9 m, 9 m) }}\n" for name in ("one", "other"))
    text = small.replace("mission ", type_ + "mission ", 1).replace("  asset boat", f"{two}  asset boat")
    assert [item[3] for item in warned(text)] == ["no engine called `airboat` is installed"]


def test_a_missing_map_gives_a_warning(small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    line = small[: small.index("scene bay")].count("\n") + 1
    scene = small[small.index("scene bay") :].partition("\n")[0]
    for option in ("folder", "file", "map"):
        (diagnostic,) = warned(small.replace(scene, f'scene map {{ {option} = "town" }}'))
        hint = f"a path begins in the working folder, `{tmp_path}`"
        assert diagnostic == ("warning", line, 9, "scene `map`: there is no `town`", hint)
    Path("town").mkdir()
    assert warned(small.replace(scene, 'scene map { map = "town" }')) == []


def test_commands_report_a_missing_map(
    small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    scene = small[small.index("scene bay") :].partition("\n")[0]
    Path("m.ljs").write_text(small.replace(scene, 'scene map { file = "town.osm" }'))
    Path("s.toml").write_text(
        'suite = 1\nname = "s"\nmissions = ["m.ljs"]\nseeds = "1"\n[[entrants]]\npolicy = "random"\n'
    )
    message = "there is no `town.osm`"
    for there in (False, True, False):  # no cached result may be used
        if there:
            Path("town.osm").write_text("<osm/>")
        else:
            Path("town.osm").unlink(missing_ok=True)
        assert run_command(["validate", "m.ljs"]) == ExitCode.OK
        assert (message in capsys.readouterr().out) != there
        assert run_command(["compile", "m.ljs", "-o", "m.json"]) == ExitCode.OK
        assert (message in capsys.readouterr().err) != there
        assert run_command(["validate", "m.json"]) == ExitCode.OK
        assert (message in capsys.readouterr().out) != there
        assert run_command(["bench", "s.toml", "--check"]) == (ExitCode.OK if there else ExitCode.USAGE)
        assert (f"missions[0]: `m.ljs`: scene `map`: {message}" in capsys.readouterr().err) != there


def test_the_built_in_names_are_those_that_are_installed() -> None:
    host = PluginHost()
    assert (host.scenes.keys(), host.engines.keys()) == (builtin_scenes().keys(), builtin_engines().keys())


def test_validate_repeats_the_warning_of_a_cached_mission(
    small: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    file = tmp_path / "m.ljs"
    file.write_text(small.replace("scene bay", "scene baay"))
    for _ in range(2):
        assert run_command(["validate", str(file)]) == ExitCode.OK
        assert "warning[LJ0505]" in capsys.readouterr().out
