"""Every code has a page. The page's example has exactly that error, and its correction has none. `explain` prints
it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lingjing.dsl.diagnostics.codes import CODES
from lingjing.errors import ExitCode
from lingjing.testing import compile_file, compile_text, run_command
from lingjing.testing.missions import SourceText, compile_source

PAGES = Path(__file__).parents[2] / "docs" / "errors"
BLOCK = re.compile(
    r"^```ljs(?: (?P<name>\w+)\.ljs)?(?P<file> file)?(?P<error> error)?(?P<mended> mended)?\n(?P<text>.*?)\n?^```$",
    re.MULTILINE | re.DOTALL,
)
OF_SEVERAL_FILES = {"LJ0119", "LJ0120", "LJ0124"}
NO_LJS = {"LJ0008", "LJ0009"}
"""A thousand lines, and a JSON document."""


def test_the_example_mission_is_good() -> None:
    assert compile_text((PAGES / "example.ljs").read_text()).diagnostics == ()


def test_there_is_a_page_for_each_code_and_no_other() -> None:
    assert {file.stem for file in PAGES.glob("LJ*.md")} == set(CODES)


@pytest.mark.parametrize("code", sorted(CODES))
def test_the_title_of_a_page_is_the_meaning_of_its_code(code: str) -> None:
    text = (PAGES / f"{code}.md").read_text()
    assert text.startswith(f"# {code}: {CODES[code]}\n")
    assert "## How to mend it" in text


@pytest.mark.parametrize("code", sorted(CODES.keys() - OF_SEVERAL_FILES - NO_LJS))
def test_the_example_of_a_page_has_exactly_its_error_and_the_corrected_one_has_none(code: str) -> None:
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
    diagnostics = compile_source(SourceText(text, "example.ljs"), offers=lambda kind: ()).diagnostics
    assert [item.code for item in diagnostics] == [code]


@pytest.mark.parametrize("code", sorted(OF_SEVERAL_FILES))
def test_an_example_of_several_files_has_its_error_and_the_corrected_one_has_none(code: str, tmp_path: Path) -> None:
    (tmp_path / "example.ljs").write_text((PAGES / "example.ljs").read_text())
    blocks = list(BLOCK.finditer((PAGES / f"{code}.md").read_text()))
    for block in blocks:
        if block["name"] and not block["mended"]:
            (tmp_path / f"{block['name']}.ljs").write_text(block["text"])
    (broken,) = (block for block in blocks if block["error"])
    file = tmp_path / f"{broken['name'] or 'page'}.ljs"
    file.write_text(broken["text"])
    assert [item.code for item in compile_file(str(file)).diagnostics] == [code]
    mended = blocks[-1]
    assert mended is not broken
    (tmp_path / f"{mended['name']}.ljs" if mended["name"] else file).write_text(mended["text"])
    assert compile_file(str(file)).diagnostics == ()


def test_the_example_documents_that_are_no_missions_have_their_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blocks = re.findall(r"^```json( error)?\n(.*?)^```$", (PAGES / "LJ0009.md").read_text(), re.MULTILINE | re.DOTALL)
    ends = []
    for error, text in blocks:
        file = tmp_path / "page.json"
        file.write_text(text)
        ends.append((bool(error), run_command(["validate", "--output-format", "json", str(file)])))
        assert ('"code": "LJ0009"' in capsys.readouterr().out) == bool(error)
    assert ends == [(True, ExitCode.MISSION), (False, ExitCode.OK)]


def test_the_example_of_a_thousand_faulty_lines_reports_the_limit_once() -> None:
    page = (PAGES / "LJ0008.md").read_text()
    match = re.search(r"^```text error (\d+) times\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert match is not None
    diagnostics = compile_text(match[2] * int(match[1])).diagnostics
    assert [item.code for item in diagnostics].count("LJ0008") == 1 and len(diagnostics) == 1000
    assert "LJ0008" not in {item.code for item in compile_text(match[2]).diagnostics}


def test_explain_prints_the_page_of_a_code_or_lists_all_codes(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["explain", "LJ0101"]) == ExitCode.OK
    page = capsys.readouterr().out
    assert page == (PAGES / "LJ0101.md").read_text()
    assert run_command(["explain", "101"]) == ExitCode.OK
    assert capsys.readouterr().out == page
    assert run_command(["explain"]) == ExitCode.OK
    assert len(capsys.readouterr().out.splitlines()) == len(CODES)


def test_explain_rejects_unknown_codes(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["explain", "LJ010l"]) == ExitCode.USAGE
    assert "there is no error code `LJ010l`" in capsys.readouterr().err
