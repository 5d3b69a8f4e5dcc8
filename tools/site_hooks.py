"""Hooks of mkdocs: they make pages of the site from files that are not pages, and adapt links of GitHub's kind.

- Pages from the root of the repository: the changelog, contributing, security and conduct.
- Pages that list things: error codes, verbs of the command line, decisions (ADRs), the modules of the contract, and the
  missions as a gallery.
- A link out of `docs/` leads to the page of that file, else to a copy of the file, else it becomes plain text: the site
  can be read from a folder, without the repository.
- Words after the language of a block of code are for the tests; Python-Markdown takes such a block as text.
- A list without an empty line before it is a list on GitHub; Python-Markdown needs the line.

mkdocs loads this file (`hooks:` in `mkdocs.yml`). It imports mkdocs alone, not this project.
The page of the command line is printed by the interpreter of `.venv`.
"""

from __future__ import annotations

import importlib
import posixpath
import re
import subprocess
import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "tools"))
importlib.import_module("ljs_lexer").register()
ROOT_PAGES = {
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CODE_OF_CONDUCT.md": "conduct.md",
    "plugins/airsim/README.md": "airsim-plugin.md",
}
"""Files outside of `docs/` that are pages of the site, with the place of the page."""
LINK = re.compile(r"(?P<text>!?\[[^\]\n]*\])\((?P<target>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")
FENCE = re.compile(r"^ {0,3}(```|~~~)")
ITEM = re.compile(r"(?:- |\* |\d+\. )")
FILMS = ROOT / "build" / "films"
"""Films that `make films` makes. They are too large for the repository; the gallery shows those that exist."""
COPIED = (".py", ".ljs", ".toml", ".ipynb")
"""Endings of linked files that are copied into the site."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    for source, place in ROOT_PAGES.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text(encoding="utf-8")))
    docs = Path(config.docs_dir)
    files.append(File.generated(config, "errors/index.md", content=_error_index(docs / "errors")))
    files.append(File.generated(config, "adr/index.md", content=_decision_index(docs / "adr")))
    files.append(File.generated(config, "api/plugins.md", content=_contract(ROOT / "lingjing/plugins/contract.py")))
    files.append(File.generated(config, "commands.md", content=_commands()))
    files.append(File.generated(config, "gallery.md", content=_gallery(docs / "missions")))
    for film in FILMS.glob("*.mp4"):
        files.append(File.generated(config, f"films/{film.name}", abs_src_path=str(film)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Adapt the text of a page."""
    origin = _origin(page.file.src_uri)
    lines: list[str] = []
    fenced, before = False, ""
    for line in markdown.splitlines():
        if FENCE.match(line):
            fenced = not fenced
            if not fenced or "=" not in line:
                line = re.sub(r"^( *```\w+) .*", r"\1", line)  # `ljs beside rescue`: words for the tests
        elif not fenced:
            line = LINK.sub(lambda match: _link(match, origin, page.file.src_uri, files, config), line)
            if ITEM.match(line) and before.strip() and not ITEM.match(before) and not before.startswith("  "):
                lines.append("")
        lines.append(line)
        before = line
    return "\n".join(lines)


def _origin(page: str) -> str:
    """The path in the repository of the text of a page."""
    return next((source for source, place in ROOT_PAGES.items() if place == page), f"docs/{page}")


def _link(match: re.Match[str], origin: str, page: str, files: Files, config: MkDocsConfig) -> str:
    """The link as the site needs it."""
    target, anchor = match["target"], match["anchor"] or ""
    if re.match(r"[a-z]+:", target):
        return match[0]
    path = posixpath.normpath(posixpath.join(posixpath.dirname(origin), target))
    if path == "docs/adr":
        path = "docs/adr/index.md"
    place = ROOT_PAGES.get(path) or (path.removeprefix("docs/") if path.startswith("docs/") else None)
    if place is None and (ROOT / path).is_file() and path.endswith(COPIED):
        place = f"files/{path}"
        if files.get_file_from_path(place) is None:
            files.append(File.generated(config, place, abs_src_path=str(ROOT / path)))
    if place is None:
        if not (ROOT / path).exists():
            return match[0]  # mkdocs reports it
        return f"{match['text'].strip('![]')} (`{path}`)" if path not in match["text"] else match["text"].strip("![]")
    return f"{match['text']}({posixpath.relpath(place, posixpath.dirname(page) or '.')}{anchor})"


def _title(path: Path) -> str:
    return path.read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# ")


def _error_index(folder: Path) -> str:
    rows = [f"- [{_title(path)}]({path.name})" for path in sorted(folder.glob("LJ*.md"))]
    head = "`lingjing explain CODE` prints the same pages. Each has a failing text and its correction."
    return "\n".join(["# Error codes", "", head, "", *rows, ""])


def _decision_index(folder: Path) -> str:
    paths = [path for path in sorted(folder.glob("[0-9]*.md")) if not path.name.startswith("0000")]
    rows = [f"- [{_title(path)}]({path.name})" for path in paths]
    head = "Decisions that are costly to reverse, one page each (ADR)."
    return "\n".join(["# Decisions", "", head, "", *rows, ""])


def _commands() -> str:
    """The page of the command line, from the project's own interpreter."""
    command = [str(ROOT / ".venv" / "bin" / "python"), str(ROOT / "tools" / "command_page.py")]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def _contract(module: Path) -> str:
    """The modules that a plug-in may import, each with its docstrings."""
    (modules,) = re.findall(r"^CONTRACT_MODULES = \((.*?)^\)", module.read_text(encoding="utf-8"), re.M | re.S)
    head = (
        "The modules that a plug-in may import, made from their docstrings. [Plug-ins](../plugins.md) introduces them "
        "and says what may change between versions."
    )
    lines = ["# The contract of plug-ins", "", head, ""]
    for name in re.findall(r'"([\w.]+)"', modules):
        if name == "lingjing.testing":
            continue  # a page of its own
        options = "show_root_heading: false, show_root_toc_entry: false"
        lines += [f"## {name}", ""]
        if name == "lingjing.errors":
            errors = ("LingjingError", "UsageError", "MissionError", "PluginError", "InfrastructureError")
            lines += [f"{', '.join(errors)} are on [the page of `lingjing`](lingjing.md#errors).", ""]
            options += f', filters: ["!^_", "!^({"|".join(errors)})$"]'
        lines += [f"::: {name}", f"    options: {{ {options} }}", ""]
    return "\n".join(lines)


def _gallery(folder: Path) -> str:
    """One card for each mission: the best pictures of two cameras, the map, and the goal."""
    head = (
        "The shipped missions: what cameras of the agents see, and the map with the trails of all bodies. Each title "
        "leads to the page of the mission, with its rules and its results."
    )
    lines = ["# Gallery", "", head, ""]
    for path in sorted(folder.glob("*.md")):
        if path.name == "README.md":
            continue
        text = path.read_text(encoding="utf-8")
        goal = re.search(r"^> (.*)$", text, flags=re.MULTILINE)
        pictures = re.findall(r"!\[(.*?)\]\(([^)]+\.(?:jpg|png))\)", text)
        views = [picture for picture in pictures if picture[1].endswith(".jpg")][:2]
        maps = [picture for picture in pictures if "-map" in picture[1]][:1]
        images = " ".join(
            f"[![{re.sub(r'[][]', '', alt)}](missions/{name})](missions/{path.name})" for alt, name in views + maps
        )
        lines += [f"## [{_title(path)}](missions/{path.name})", "", goal[1] if goal else "", ""]
        lines += ['<div class="gallery" markdown>', "", images, "", "</div>", ""]
        if (FILMS / f"{path.stem}.mp4").is_file():
            lines += [f'<video controls preload="none" width="100%" src="films/{path.stem}.mp4"></video>', ""]
        lines += [f"`lingjing run {path.stem}`", ""]
    return "\n".join(lines)
