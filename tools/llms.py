"""Write `llms.txt`: the pages of the documentation in one list, for readers that are language models.

The list follows the navigation of `mkdocs.yml`. A page has its title and the first sentence of its text. `--check`
writes nothing.

Exit codes: 0 written or already right, 1 `--check` found a difference, 2 the arguments are wrong.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "llms.txt"
HEAD = """# Lingjing

> Missions for drones, robot dogs, cars and boats are written in one file, played in one city with physics engines,
> scored, and explained from their traces. Python 3.11+, Linux, no GPU. The command and the module are `lingjing`, the
> distributions are `lingjing-sim` and `lingjing-sim-agents`.

To play a mission: `lingjing run ssr`. To write one: `lingjing new mission first`. The whole language on one card:
`lingjing docs --card`. Every page below is Markdown in this repository.
"""


class _Loader(yaml.SafeLoader):
    """A loader that reads tags of Python as nothing: the navigation has none."""


_Loader.add_multi_constructor("", lambda loader, suffix, node: None)


def navigation() -> Iterator[tuple[str, str, str]]:
    """Section, title and path of each page of the navigation that is a file of `docs`."""
    config = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), _Loader)
    yield from _entries(config["nav"], "")


def _entries(items: list[Any], section: str) -> Iterator[tuple[str, str, str]]:
    for item in items:
        if isinstance(item, str):
            yield section, "", item
            continue
        for title, content in item.items():
            if isinstance(content, str):
                yield section, title, content
            else:
                yield from _entries(content, section or title)


def described(path: Path) -> tuple[str, str]:
    """The title of a page and the first sentence of its text."""
    text = re.sub(r"<!--.*?-->|^```.*?^```|^!\[.*?$", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
    title, _, rest = text.strip().partition("\n")
    for paragraph in re.split(r"\n\s*\n", rest.strip()):
        if re.match(r"[A-Za-z`*\[\"]", paragraph):
            plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", " ".join(paragraph.split()))
            sentence = re.match(r".*?[.:?](?=\s|$)", plain)
            return title.lstrip("# "), (sentence[0] if sentence else plain).rstrip(":")
    return title.lstrip("# "), ""


def text() -> str:
    """The text of the file."""
    lines, current = [HEAD.rstrip()], None
    for section, name, place in navigation():
        path = ROOT / "docs" / place
        if not path.is_file():  # made by the site from other files
            continue
        if section != current:
            lines += ["", f"## {section or 'Start'}", ""]
            current = section
        title, sentence = described(path)
        lines.append(f"- [{name or title}](docs/{place}){': ' + sentence if sentence else ''}")
    lines += ["", "## Optional", ""]
    lines.append("- [Shipped missions](docs/missions/README.md): one page each, with pictures and results.")
    lines.append("- [Contributing](CONTRIBUTING.md): where things are added, and the rules of the code.")
    lines.append("- [Changelog](CHANGELOG.md): changes that users see.")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write or check the file. Exit codes are in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 if the file differs")
    args = parser.parse_args()
    new = text()
    if TARGET.is_file() and TARGET.read_text(encoding="utf-8") == new:
        return 0
    if args.check:
        print("llms.txt differs from the pages: run `python tools/llms.py`", file=sys.stderr)
        return 1
    TARGET.write_text(new, encoding="utf-8")
    print("wrote llms.txt")
    return 0


if __name__ == "__main__":
    sys.exit(main())
