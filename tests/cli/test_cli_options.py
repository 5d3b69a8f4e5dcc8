"""Parsing of the command line: pairs, seeds, folders and missions."""

from __future__ import annotations

import os
import threading
import types
from pathlib import Path
from typing import cast

import pytest

from lingjing import Mission
from lingjing.cli.arguments import parse_pairs, parse_seeds, parse_settings, whole_number
from lingjing.dsl.loading.shipped import find_mission, shipped_missions
from lingjing.errors import UsageError
from lingjing.play.folders import claim_folder, claim_run_folder
from lingjing.testing.declarations import Parameter
from lingjing.testing.expressions import Number


def mission_with_altitude() -> Mission:
    altitude = Parameter(name="altitude", default=Number(100.0, unit="m"))
    return cast("Mission", types.SimpleNamespace(parameters=(altitude,)))


def test_pairs_keep_everything_after_the_first_equals_sign() -> None:
    assert parse_pairs("--policy-arg", ["url=http://x/?a=b", " k = v "]) == {"url": "http://x/?a=b", "k": "v"}


@pytest.mark.parametrize("texts", [["novalue"], ["=3"], ["a=1", "a=2"]])
def test_the_message_about_a_bad_pair_quotes_the_pair(texts: list[str]) -> None:
    with pytest.raises(UsageError, match=f"--set {texts[-1]}"):
        parse_pairs("--set", texts)


@pytest.mark.parametrize(("text", "value"), [("80", 80), ("8e1", 80), ("80 m", 80), ("0.08km", 80), ("-.5", -0.5)])
def test_settings_are_numbers_with_or_without_unit(text: str, value: float) -> None:
    assert parse_settings({"altitude": text}, mission_with_altitude()) == {"altitude": pytest.approx(value)}


@pytest.mark.parametrize("text", ["high", "nan", "inf", "", "80 s", "80 parsec", "1e999", "1 2"])
def test_the_message_about_a_setting_of_a_wrong_quantity_names_the_setting(text: str) -> None:
    with pytest.raises(UsageError, match=f"--set altitude={text}"):
        parse_settings({"altitude": text}, mission_with_altitude())


def test_seed_ranges_include_both_ends() -> None:
    assert parse_seeds("0-19") == tuple(range(20))
    assert parse_seeds("7") == (7,)


@pytest.mark.parametrize("text", ["", "-", "3-1", "a-b", "1-", "-3", "1.5", "0-1-2", "٣", "0-999999999", "1" * 5000])
def test_bad_seed_ranges_are_usage_errors(text: str) -> None:
    with pytest.raises(UsageError):
        parse_seeds(text)


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("0007", 7), ("99", 99), ("0" * 5000 + "9", 9)])
def test_a_whole_number_has_plain_digits_and_is_at_most_the_limit(text: str, number: int) -> None:
    assert whole_number(text, 99) == number


@pytest.mark.parametrize("text", ["", "100", "-1", "+1", "1.0", "1_0", " 1", "1\n", "²", "٣", "9" * 5000])
def test_a_text_that_is_no_whole_number_in_the_range_gives_none(text: str) -> None:
    assert whole_number(text, 99) is None


def test_run_folders_are_never_shared(tmp_path: Path) -> None:
    claimed: list[Path] = []
    threads = [
        threading.Thread(target=lambda: claimed.append(claim_run_folder("ssr", "star", 7, tmp_path))) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(path.name for path in claimed) == [f"ssr-star-7-{n}" for n in range(1, 9)]


def test_a_folder_that_is_not_empty_is_refused(tmp_path: Path) -> None:
    assert claim_folder(tmp_path / "new" / "deep").is_dir()
    (tmp_path / "new" / "deep" / "trace.mcap").touch()
    with pytest.raises(UsageError, match="not empty"):
        claim_folder(tmp_path / "new" / "deep")


def test_a_place_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot write"):
        claim_folder(tmp_path / "file" / "run")
    with pytest.raises(UsageError, match="file"):
        claim_run_folder("ssr", "star", 7, tmp_path / "file")


def test_a_shipped_mission_is_found_by_name_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "ssr" in shipped_missions()
    assert find_mission("ssr") == find_mission("scenarios/ssr.ljs") == find_mission("ssr.ljs")
    assert find_mission("ssr").is_file()


def test_an_existing_file_has_priority_over_a_shipped_mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("ssr.ljs").write_text("ljs 1\n")
    assert find_mission("ssr.ljs") == Path("ssr.ljs")


@pytest.mark.parametrize("word", ["no-such", "../ssr", "/nowhere/ssr.ljs", "scenarios", "std/../../pyproject.toml"])
def test_the_message_about_a_missing_mission_lists_the_shipped_missions(
    word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError) as caught:
        find_mission(word)
    assert word in str(caught.value)
    assert "ssr" in caught.value.hint
    assert os.listdir(tmp_path) == []
