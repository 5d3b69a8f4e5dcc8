"""The reference transcripts: `lingjing calls` opens them, and every request and answer in them is read."""

import json
from pathlib import Path

import pytest

from lingjing.testing import run_command

PLACE = Path(__file__).parents[2] / "examples" / "transcripts"
MOST_KB = 400
COLUMNS = {
    "bi-single",
    "cd-broadcast",
    "cd-star",
    "cr-star",
    "idf-broadcast",
    "ld-star",
    "ssr-broadcast",
    "ssr-star",
    "ufr-broadcast",
    "ufr-star",
    "upr-star",
    "vdn-single",
}


def test_there_is_a_transcript_of_each_column() -> None:
    assert {file.parent.name for file in PLACE.glob("*/calls.sqlite.xz")} == COLUMNS


@pytest.mark.parametrize("column", sorted(COLUMNS))
def test_a_transcript_is_small_and_every_request_and_answer_is_read(
    column: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (PLACE / column / "calls.sqlite.xz").stat().st_size <= MOST_KB * 1000
    pictures = tmp_path / "pictures"
    command = ["calls", str(PLACE / column), "--output-format", "json", "--pictures", str(pictures)]
    assert run_command(command) == 0
    calls = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert len(calls) >= 5
    for call in calls:
        system, *_, last = call["request"]["messages"]
        assert "RULES OF THIS MISSION" in system["content"]
        parts = last["content"] if isinstance(last["content"], list) else [{"type": "text", "text": last["content"]}]
        (state,) = [json.loads(part["text"]) for part in parts if part["type"] == "text"]
        assert state["tick"] == call["tick"]
        assert json.loads(call["result"]["text"]).keys() >= {"thought", "command", "messages"}
    for file in pictures.glob("*") if pictures.is_dir() else ():
        assert file.read_bytes().startswith(b"\xff\xd8"), "a JPEG file"


def test_the_command_opens_a_transcript_by_its_file_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["calls", str(PLACE / "upr-star"), "--agent", "pilot", "--tick", "5", "--full"]) == 0
    assert "You are `pilot`" in capsys.readouterr().out
    page = tmp_path / "calls.html"
    assert run_command(["calls", str(PLACE / "upr-star" / "calls.sqlite.xz"), "--html", str(page)]) == 0
    assert page.stat().st_size > 10_000
