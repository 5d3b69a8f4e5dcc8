"""The documentation site: its navigation, its list for language models, and the runner of its examples.

`make docs` builds the site and runs the examples.
"""

from __future__ import annotations

import fnmatch
import re
import sys
from pathlib import Path

import pytest

import lingjing
from tools import ljs_lexer, llms, page_examples

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
NOT_IN_NAV = ("adr/*", "errors/*", "missions/*", "images/*")
"""Pages that index pages of the site lead to."""


def test_every_page_is_in_the_navigation_once() -> None:
    listed = [place for _, _, place in llms.navigation()]
    assert len(listed) == len(set(listed))
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    outside = {page for page in pages if any(fnmatch.fnmatch(page, pattern) for pattern in NOT_IN_NAV)}
    assert sorted(pages - outside - set(listed)) == [], (
        "name it in `nav` of mkdocs.yml, then run `python tools/llms.py`"
    )


def test_the_list_for_language_models_is_current() -> None:
    assert (ROOT / "llms.txt").read_text(encoding="utf-8") == llms.text(), "run `python tools/llms.py`"


def test_the_page_of_the_package_names_everything_public() -> None:
    package = (DOCS / "api" / "lingjing.md").read_text(encoding="utf-8")
    places = [place for name, place in lingjing._EXPORTS.items() if name != "__version__"]
    assert [name for module, name in places if f"::: {module}.{name}\n" not in package] == []


def test_missions_are_coloured() -> None:
    text = '# why\nmission a "A {b}" {\n  param n = 2 in 1..6\n}\n'
    tokens = [(str(kind), word) for kind, word in ljs_lexer.LjsLexer().get_tokens(text) if word.strip()]
    assert tokens[:4] == [
        ("Token.Comment", "# why"),
        ("Token.Keyword.Declaration", "mission"),
        ("Token.Name.Class", "a"),
        ("Token.Literal.String", '"A {b}"'),
    ]
    assert ("Token.Keyword.Declaration", "param") in tokens
    assert "".join(word for _, word in ljs_lexer.LjsLexer().get_tokens(text)) == text


PAGE = """# A page

```python title="count.py"
print(1 + 1)
```

```sh
python count.py
```

```text
2
```

```diff title="count.py"
-print(1 + 1)
+print(1 + 2, "and more")
```

<!-- exit: 3 -->
```sh
python count.py; exit 3
```

```text
3 …
```

<!-- skip: never -->
```sh
exit 1
```

```python
x = 4
```

```python
print(x)
```

```text
4
```
"""


def failure(tmp_path: Path, text: str) -> str:
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    with pytest.raises(page_examples.ExampleError) as caught:
        page_examples.run_page(page)
    return str(caught.value)


def test_a_page_is_run_from_top_to_bottom(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    page_examples.run_page(page)
    assert [block.line for block, _ in page_examples.steps(page)] == [4, 8, 16, 22, 35, 39]


def test_every_block_of_every_page_is_run_or_left_out_with_a_reason() -> None:
    """`make docs` runs them; a block of a language that it does not know would be passed over."""
    pages = [
        page for page in sorted(DOCS.rglob("*.md")) if page.relative_to(DOCS).as_posix() not in page_examples.OTHERS
    ]
    blocks = [block for page in pages for block in page_examples.blocks_of(page)]
    known = (*page_examples.RUNNABLE, *page_examples.SHOWN)
    assert [f"{block.place}: {block.language}" for block in blocks if block.language not in known] == []
    assert [block.place for block in blocks if block.marks.get("skip") == ""] == [], "`<!-- skip: REASON -->`"
    passed_over = [block for block in blocks if block.language in page_examples.RUNNABLE and not block.is_run]
    assert [block.place for block in passed_over if "skip" not in block.marks] == []
    assert {page for page in pages if any(block.is_run for block in page_examples.blocks_of(page))} == {
        *page_examples.pages()
    }
    assert all((DOCS / name).is_file() and reason for name, reason in page_examples.OTHERS.items())


def test_all_fenced_blocks_of_a_page_are_read() -> None:
    """A fence that is not read, such as one that is not closed as it is opened, would be passed over."""
    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        opened = re.findall(rf"^ *```(?:{'|'.join(page_examples.RUNNABLE)})\b", text, re.MULTILINE)
        read = [block for block in page_examples.blocks_of(page) if block.language in page_examples.RUNNABLE]
        assert len(read) == len(opened), page


LIST = re.compile(r"- |\d+\. |\|")


def test_lists_and_tables_begin_after_an_empty_line() -> None:
    """Without it the site shows them as lines of the paragraph before."""
    faulty = []
    for page in sorted(DOCS.rglob("*.md")):
        paragraph, fenced = False, False
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            fenced ^= line.lstrip().startswith("```")
            if not line.strip() or fenced or line.startswith(("#", "```", "<!--")):
                paragraph = False
            elif LIST.match(line):
                faulty += [f"{page.relative_to(DOCS)}:{number}"] if paragraph else []
                paragraph = False
            elif not line.startswith(" "):
                paragraph = True
    assert faulty == []


def test_commands_are_read_from_indented_console_blocks(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "- item\n\n    ```console\n    $ echo 1 > a\n    cat a\n    ```\n\n    ```text\n    1\n    ```\n",
        encoding="utf-8",
    )
    page_examples.run_page(page)
    ((block, expected),) = page_examples.steps(page)
    assert (block.commands, expected) == ("echo 1 > a\ncat a\n", "1\n")


def test_a_page_without_examples_is_no_error(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A page\n", encoding="utf-8")
    assert list(page_examples.steps(page)) == []


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("```sh\nexit 4\n```", "exit code 4"),
        ("```sh\necho 1\n```\n\n```text\n2\n```", "where the page says"),
        ("```python\nprint(y)\n```", "NameError"),
        ('```python title="a.py"\nx = 1\n```\n\n```diff title="a.py"\n-x = 2\n+x = 3\n```', "in the file 0 times"),
        ("<!-- background -->\n```sh\ntrue\n```", "without a line of output"),
        ("<!-- background -->\n```sh\necho the port is used; exit 2\n```", "exit code 2:\nthe port is used"),
    ],
)
def test_a_block_that_contradicts_its_page_is_reported_with_its_place(tmp_path: Path, block: str, message: str) -> None:
    text = failure(tmp_path, f"# A page\n\n{block}\n")
    assert message in text
    assert "page.md:" in text


def test_packages_installed_by_a_page_stay_in_its_own_environment(tmp_path: Path) -> None:
    programs = page_examples.own_environment(tmp_path / "environment")
    assert (programs / "lingjing").read_text(encoding="utf-8").startswith(f"#!{programs}/python\n")
    packages = next((tmp_path / "environment").glob("lib/python*/site-packages"))
    (packages / "added.py").write_text("")
    assert not any(Path(folder, "added.py").exists() for folder in sys.path)
