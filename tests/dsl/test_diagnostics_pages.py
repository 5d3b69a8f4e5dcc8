"""Every code has a page; the page's example has exactly that error and the mended one does not; `explain` prints it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lingjing.cli.main import main
from lingjing.dsl import Source, compile_source, compile_text
from lingjing.dsl.codes import CODES
from lingjing.errors import ExitCode

PAGES = Path(__file__).parents[2] / "docs" / "errors"
BLOCK = re.compile(r"^```ljs(?P<file> file)?(?P<error> error)?\n(?P<text>.*?)\n?^```$", re.MULTILINE | re.DOTALL)
WITHOUT_EXAMPLE = {"LJ0008", "LJ0009", "LJ0119", "LJ0120", "LJ0124"}
"""A thousand errors, a JSON document, a second file: what no short text shows.

`test_codes`, `test_inputs` and `test_library` have examples of these."""


def test_the_example_mission_is_good() -> None:
    assert compile_text((PAGES / "example.ljs").read_text()).diagnostics == ()


def test_there_is_a_page_for_each_code_and_no_other() -> None:
    assert {file.stem for file in PAGES.glob("LJ*.md")} == set(CODES)


@pytest.mark.parametrize("code", sorted(CODES))
def test_a_page_says_what_the_code_says(code: str) -> None:
    text = (PAGES / f"{code}.md").read_text()
    assert text.startswith(f"# {code}: {CODES[code]}\n")
    assert "## How to mend it" in text


@pytest.mark.parametrize("code", sorted(CODES.keys() - WITHOUT_EXAMPLE))
def test_an_example_has_exactly_this_error_and_the_mended_one_has_not(code: str) -> None:
    blocks = list(BLOCK.finditer((PAGES / f"{code}.md").read_text()))
    broken = next(block for block in blocks if block["error"])
    mended = next((block for block in blocks if not block["error"]), None)
    if broken["file"]:
        assert {item.code for item in compile_text(broken["text"]).diagnostics} == {code}
        assert mended is None or compile_text(mended["text"]).diagnostics == ()
        return
    example = (PAGES / "example.ljs").read_text()
    assert mended is not None and example.count(mended["text"]) == 1
    text = example.replace(mended["text"], broken["text"])
    found = compile_source(Source(text, "example.ljs"), offers=lambda kind: ()).diagnostics
    assert [item.code for item in found] == [code]


def test_explain(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "LJ0101"]) == ExitCode.OK
    page = capsys.readouterr().out
    assert page == (PAGES / "LJ0101.md").read_text()
    assert main(["explain", "101"]) == ExitCode.OK
    assert capsys.readouterr().out == page
    assert main(["explain"]) == ExitCode.OK
    assert len(capsys.readouterr().out.splitlines()) == len(CODES)


def test_explain_what_is_no_code(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "LJ010l"]) == ExitCode.USAGE
    assert "no error has the code `LJ010l`" in capsys.readouterr().err
