"""Tests of `lingjing scene`: build, info, draw; messages, exit codes, and files after a kill."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from PIL import Image

from lingjing.errors import ExitCode
from lingjing.play.rendered_view import pose_over
from lingjing.scene.camera_geometry import in_image, world_to_pixel
from lingjing.testing import run_command
from tests.scene.osm_maps import Map, convert, square, town


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("LINGJING_NO_CACHE", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_map_is_built_into_a_city_and_the_second_build_is_cached(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    town().write(folder / "town.osm")
    assert run_command(["scene", "build", "town.osm", "-o", "city"]) == ExitCode.OK
    captured = capsys.readouterr()
    assert captured.err == ""  # no terminal: no progress
    assert captured.out.startswith("built: city\n")
    assert "4 buildings" in captured.out
    assert "© OpenStreetMap contributors, ODbL 1.0" in captured.out
    assert sorted(item.name for item in (folder / "city").iterdir()) == [
        "city.msgpack", "road.net.xml", "scene.json", "tiles"
    ]  # fmt: skip
    assert run_command(["scene", "build", "town.osm", "-o", "city"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith("cached: city\n")
    assert run_command(["scene", "info", "city"]) == ExitCode.OK
    assert "road.net.xml" in capsys.readouterr().out


def test_a_city_without_an_output_folder_is_stored_in_the_cache(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    town().write(folder / "town.osm")
    assert run_command(["scene", "build", "town.osm", "--seed", "3"]) == ExitCode.OK
    where = capsys.readouterr().out.splitlines()[0].removeprefix("built: ")
    assert Path(where).is_relative_to(folder / "cache" / "lingjing" / "cities")
    assert run_command(["scene", "build", "town.osm", "--seed", "3"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith(f"cached: {where}\n")


def test_options_of_the_build_change_the_city(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    town().write(folder / "town.osm")
    assert (
        run_command(["scene", "build", "town.osm", "--bbox", "121.495,31.1955,121.4999,31.1999", "-o", "a"])
        == ExitCode.OK
    )
    assert "1 building," in capsys.readouterr().out
    assert run_command(["scene", "build", "town.osm", "--water-level", "-4", "-o", "b"]) == ExitCode.OK
    assert run_command(["scene", "build", "town.osm", "--water-level", "1", "-o", "c"]) == ExitCode.USAGE
    assert "the ground is at 0" in capsys.readouterr().err
    # a box in the west begins with a minus sign and is still a value
    assert run_command(["scene", "build", "town.osm", "--bbox", "-0.13,51.5,-0.12,51.51"]) == ExitCode.USAGE
    assert "error: the bounding box -0.13,51.5,-0.12,51.51 lies outside the map" in capsys.readouterr().err


def test_the_sources_of_heights_are_counted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = Map()
    for number in range(6):
        made.way(square(-300 + 100 * number, 0, 14.0, 30.0), {"building": "yes"})
    made.way(square(0, 100, 20), {"building": "yes", "height": "33 m"})
    made.write(folder / "houses.osm")
    assert run_command(["scene", "build", "houses.osm", "-o", "city"]) == ExitCode.OK
    built = capsys.readouterr().out
    assert "heights   1 tagged, 0 inferred from neighbours, 6 drawn (largest " in built
    assert run_command(["scene", "info", "city"]) == ExitCode.OK
    line = next(line for line in built.splitlines() if line.startswith("heights"))
    assert line in capsys.readouterr().out
    assert run_command(["scene", "build", "houses.osm", "--default-levels", "7", "-o", "seven"]) == ExitCode.OK
    assert "heights   1 tagged, 0 inferred from neighbours, 0 drawn, 6 by --default-levels" in capsys.readouterr().out
    for wrong in ("0", "-3", "101"):
        assert run_command(["scene", "build", "houses.osm", "--default-levels", wrong, "-o", "none"]) == ExitCode.USAGE
        assert f"buildings of {wrong} storeys by default" in capsys.readouterr().err
    assert not (folder / "none").exists()


def test_a_city_without_roads_is_reported(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = Map()
    made.way(square(0, 0, 30), {"building": "yes"})
    made.write(folder / "houses.osm")
    assert run_command(["scene", "build", "houses.osm", "-o", "city"]) == ExitCode.OK
    output = capsys.readouterr().out
    assert "note      no roads in this part of the map" in output
    assert "network   none: no traffic" in output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["build", "no.osm"], "error: no map at `no.osm`"),
        (["build", "zero.osm"], "error: `zero.osm` is empty: 0 bytes"),
        (["build", "text.osm"], "error: `text.osm` is not OpenStreetMap data"),
        (["build", "town.osm", "--bbox", "1,2,3"], "error: `1,2,3` is not a bounding box"),
        (["build", "town.osm", "-o", "text.osm"], "error: cannot write `text.osm`: it is a file"),
        (["build", "town.osm", "-o", "full"], "error: cannot write `full`: it holds something that is no city"),
        (["info", "full"], "error: no city in `full`"),
        (["draw", "full", "-o", "a.png"], "error: no city in `full`"),
        (["draw", "full", "-o", "a.doc"], "error: `a.doc` has no suffix of a picture"),
        (["draw", "full", "-o", "nowhere/a.png"], "its folder does not exist"),
        (["draw", "nowhere", "-o", "a.png"], "error: there is no mission `nowhere`"),
        (["info", "ssr", "--seed", "x"], "is not a seed"),
        (["info", "town.osm"], "hint: build it first: lingjing scene build town.osm -o FOLDER"),
        (["draw", "town.osm", "-o", "a.png"], "error: `town.osm` is a map, not a city"),
    ],
)
def test_mistakes_give_one_message(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    town().write(folder / "town.osm")
    (folder / "zero.osm").touch()
    (folder / "text.osm").write_text("hello")
    (folder / "full").mkdir()
    (folder / "full" / "mine.txt").write_text("mine")
    before = sorted(folder.rglob("*"))
    assert run_command(["scene", *arguments]) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert message in errors
    assert len(errors.splitlines()) == 2
    after = [path for path in sorted(folder.rglob("*")) if not path.is_relative_to(folder / "cache")]
    assert after == before


def test_a_city_is_drawn(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    town().write(folder / "town.osm")
    assert run_command(["scene", "build", "town.osm", "-o", "city"]) == ExitCode.OK
    assert run_command(["scene", "draw", "city", "-o", "plan.png"]) == ExitCode.OK
    with Image.open(folder / "plan.png") as picture:
        wide, high = picture.size
        pixels = picture.convert("RGB")
        side = wide / 1000.0  # pixels a metre; the plan begins at the top left
        river = pixels.getpixel((round(200 * side), round((500 - 240) * side)))
        house = pixels.getpixel((round(555 * side), round((500 - 55) * side)))
        park = pixels.getpixel((round(610 * side), round((500 + 290) * side)))
    assert river == (169, 207, 224)
    assert max(house) < 190
    assert park[1] > park[0] > park[2]
    assert high > wide
    assert run_command(["scene", "draw", "city", "-o", "plan.svg"]) == ExitCode.OK
    assert "OpenStreetMap" in (folder / "plan.svg").read_text(encoding="utf-8")


def test_a_city_with_a_chinese_name_is_drawn_without_stray_lines(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    town().write(folder / "陆家嘴.osm")
    assert run_command(["scene", "build", "陆家嘴.osm", "-o", "city"]) == ExitCode.OK
    assert run_command(["scene", "draw", "city", "-o", "PLAN.PNG"]) == ExitCode.OK
    lines = capfd.readouterr().err.splitlines()
    assert all(line.startswith("note: no font here has") for line in lines)
    assert len(lines) <= 1


def test_a_picture_that_cannot_be_written_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    town().write(folder / "town.osm")
    assert run_command(["scene", "build", "town.osm", "-o", "city"]) == ExitCode.OK
    (folder / "plan.png").mkdir()
    assert run_command(["scene", "draw", "city", "-o", "plan.png"]) == ExitCode.USAGE
    assert "error: cannot write `plan.png`: Is a directory" in capsys.readouterr().err
    assert not list(folder.glob("*.partial")) + list(folder.glob(".*.partial"))


def test_the_scene_of_a_mission_is_described_and_drawn(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["scene", "info", "vdn", "--seed", "3"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith("city      residential-")
    assert run_command(["scene", "draw", "vdn", "-o", "plan.png"]) == ExitCode.OK
    with Image.open(folder / "plan.png") as picture:
        assert len(picture.convert("RGB").resize((64, 64)).getcolors(64 * 64) or ()) > 20


class _InterruptedWhileLoading:
    """An `ImportError` caused by an interrupt, as a compiled module raises it while it loads."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name.partition(".")[0] == "osmium":
            raise ImportError("initialization failed") from KeyboardInterrupt()


def test_an_interrupt_while_a_library_loads_ends_the_command_as_interrupted(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    convert(town().write(folder / "town.osm"), folder / "town.osm.pbf")
    for name in [name for name in sys.modules if name.partition(".")[0] == "osmium"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [_InterruptedWhileLoading(), *sys.meta_path])
    assert run_command(["scene", "build", "town.osm.pbf", "-o", "city"]) == ExitCode.INTERRUPTED
    assert "interrupted" in capsys.readouterr().err
    assert not (folder / "city").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_killed_build_leaves_no_partial_city(folder: Path, number: int) -> None:
    town().write(folder / "town.osm")
    command = [sys.executable, "-m", "lingjing.cli.main", "scene", "build", "town.osm", "-o", "city"]
    for delay in (0.25, 0.5, 0.75):
        build = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=dict(os.environ))
        time.sleep(delay)
        build.send_signal(number)
        code = build.wait(timeout=900)
        if (folder / "city").exists():
            assert run_command(["scene", "info", "city"]) == ExitCode.OK  # it had been finished
            break
        assert code in (ExitCode.INTERRUPTED, -number, -signal.SIGINT)
    assert run_command(["scene", "build", "town.osm", "-o", "city"]) == ExitCode.OK
    assert sorted(item.name for item in folder.iterdir()) == ["cache", "city", "town.osm"]


def test_the_plan_of_a_mission_shows_its_placed_bodies_and_marks_hidden_ones(folder: Path) -> None:
    assert run_command(["scene", "draw", "ssr", "--seed", "3", "--mode", "star", "-o", "plan.svg"]) == ExitCode.OK
    drawn = (folder / "plan.svg").read_text()
    for words in ("victim[1] (hidden)", "uav[2]", "boat", "search", "seed 3, star"):
        assert f"<!-- {words} -->" in drawn or words in drawn, words
    assert "boat (hidden)" not in drawn


def test_the_rendered_view_marks_hidden_targets(folder: Path) -> None:
    call = ["scene", "draw", "ssr", "--seed", "3", "--view", "rendered", "-o", "view.svg"]
    assert run_command(call) == ExitCode.OK
    drawn = (folder / "view.svg").read_text(encoding="utf-8")
    for words in ("victim[1] (hidden)", "victim[3] (hidden)", "uav[2]", "boat", "search", "seed 3, broadcast"):
        assert f"<!-- {words} -->" in drawn or words in drawn, words
    assert "<image" in drawn and "boat (hidden)" not in drawn


def test_a_rendered_view_needs_a_mission(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    town().write(folder / "town.osm")
    assert run_command(["scene", "build", "town.osm", "-o", "city"]) == ExitCode.OK
    assert run_command(["scene", "draw", "city", "--view", "rendered", "-o", "view.png"]) == ExitCode.USAGE
    assert "name a mission" in capsys.readouterr().err and not (folder / "view.png").exists()


@pytest.mark.parametrize("spread_m", [1.0, 300.0, 20_000.0])
def test_the_pose_over_some_points_shows_all_of_them(spread_m: float) -> None:
    points = [
        (spread_m * x, spread_m * y, z) for x, y, z in ((0, 0, 0.0), (1, 0.2, 30.0), (-2, 3, 100.0), (0.5, -1, 2.0))
    ]
    pose = pose_over(points)
    pixels = [world_to_pixel(pose, point) for point in points]
    assert all(pixel is not None and in_image(pose, *pixel[:2]) for pixel in pixels)


STROLL = """
ljs 2
use std.air { quadrotor }

mission stroll "A stroll" {
  goal "Look."
  scene map { file = "houses.osm", pedestrians = 5 }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 1 }
  region yard = box((0 m, -60 m), (40 m, -20 m))
  asset uav : quadrotor { position = (0 m, 0 m, 30 m) }
  agent pilot as pilot controls uav { observes uav.*, events }
  success when uav in yard
}
"""


def test_pedestrians_on_a_map_without_roads_give_one_message_and_no_episode(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    houses = Map(half_m=200.0)
    houses.way(square(-50, -50, 20), {"building": "house"})
    houses.write(folder / "houses.osm")
    (folder / "stroll.ljs").write_text(STROLL, encoding="utf-8")
    assert run_command(["run", "stroll.ljs", "--policy", "idle", "-o", "run"]) == ExitCode.USAGE
    first, *more = capsys.readouterr().err.splitlines()
    assert first == "error: the scene `map-houses` has no roads for `pedestrians`" and len(more) == 1
    assert not (folder / "run").exists()


def test_hints_for_a_map_at_a_pole_or_the_antimeridian_name_ways_to_choose_a_part(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = town().text()
    for name, old, new in (("pole", "31.", "89."), ("antimeridian", "121.4", "-179.")):
        (folder / f"{name}.osm").write_text(
            text.replace(f'lat="{old}', f'lat="{new}').replace(f'lon="{old}', f'lon="{new}')
        )
        assert run_command(["run", "ufr", "--scene", f"{name}.osm", "-o", "run"]) == ExitCode.USAGE
        error = capsys.readouterr().err
        assert "where one frame does not fit" in error or "beyond 85 one frame does not fit" in error
        assert "`lingjing scene build MAP --bbox=W,S,E,N`, or `bbox` of `scene map`" in error
