"""Run the examples of documentation pages: a part of `make docs`.

A page is run in a new folder, from top to bottom, as a reader would do it. Blocks of code mean:

- `sh`: run by bash; it must end with exit code 0. `console`: the same, with or without `$ ` before the commands.
- any language with `title="FILE"`: written to that file. `diff` with a title changes the file: the lines that begin
  with a space or `-` are replaced by those that begin with a space or `+`.
- `python` without a title: run in one interpreter for the whole page.
- `text` after one of these: the expected output. `…` stands for any text, and on a line of its own for any lines.

A comment before a block changes this: `<!-- skip: REASON -->` leaves the block out, `<!-- background -->` starts a
server and goes on when it has printed its first line, `<!-- exit: 1 -->` expects another exit code, and
`<!-- needs: MODULE -->` leaves the block out if the module is not installed.

A block may be indented, as in a list or a tab. A page with the comment `<!-- installs -->` gets an environment of its
own, which `pip` may change.

Every page of `docs` with such blocks is run, except those of `OTHERS`. A line for each page says how long it took.
`--list` prints the blocks without running them.

Exit codes: 0 every block did what its page says, 1 one did not, 2 the arguments are wrong.
"""

from __future__ import annotations

import argparse
import fcntl
import itertools
import os
import re
import shlex
import signal
import subprocess
import sys
import sysconfig
import tempfile
import textwrap
import time
import venv
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parent.parent
FENCE = re.compile(
    r"(?P<comments>(?:^ *<!--[^\n]*-->\n+)*)^(?P<indent> *)```(?P<language>\w+)(?P<info>[^\n]*)\n"
    r"(?P<body>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
RUNNABLE = ("sh", "console", "python")
"""Languages of blocks that are run."""
SHOWN = ("text", "ljs", "json", "toml", "yaml", "diff", "mermaid", "xml")
"""Languages of blocks that are only shown, unless they have a title."""
OTHERS = {
    "adversaries.md": "a suite of hours",
    "metrics.md": "its example needs a transformer model",
    "models.md": "its examples need services of models",
    "remote-engines.md": "a server and an engine that run until they are ended",
    "sensors.md": "its example needs the trace of a mission with instance masks",
    "studies.md": "suites of hours; `tests/bench/test_studies_page.py` parses its commands",
}
"""Pages without comments of their own that are not run: path in `docs` → reason."""
COMMENT = re.compile(r"<!-- (skip|background|exit|needs)(?:: (.*?))? -->")
TITLE = re.compile(r'title="([^"]+)"')
LONGEST_S = 900.0
"""Most seconds of one block (chosen): a block that takes longer is no example."""
STEADY_S = 1.0
"""Time after its first line in which a server must not end, seconds (chosen)."""
MOST_LINES = 25
"""Lines of a message that are printed from its beginning and from its end (chosen)."""
SESSION = """
import sys, traceback
names = {"__name__": "__main__"}
while size := sys.stdin.readline():
    try:
        exec(compile(sys.stdin.read(int(size)), "page", "exec"), names)
        print("\\x00ok", flush=True)
    except BaseException:
        traceback.print_exc(file=sys.stdout)
        print("\\x00failed", flush=True)
"""
"""The interpreter of the Python blocks of a page: it reads each as its length and its text."""


class ExampleError(Exception):
    """A block that did not do what its page says."""


@dataclass(frozen=True)
class Block:
    """A block of code of a page."""

    page: Path
    line: int
    """Number of its first line, from 1."""
    language: str
    title: str
    """The file that it is written to, or ""."""
    body: str
    marks: dict[str, str]
    """Its comments: `skip`, `background`, `exit`, `needs`, with their texts."""

    @property
    def place(self) -> str:
        """Page and line, for messages."""
        return f"{self.page}:{self.line}"

    @property
    def commands(self) -> str:
        """The text for bash."""
        return re.sub(r"^\$ ", "", self.body, flags=re.MULTILINE) if self.language == "console" else self.body

    @property
    def is_run(self) -> bool:
        """True if the runner writes or runs the block."""
        return "skip" not in self.marks and bool(self.title or self.language in RUNNABLE)


def blocks_of(page: Path) -> list[Block]:
    """The blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    blocks = []
    for match in FENCE.finditer(text):
        title = TITLE.search(match["info"])
        blocks.append(
            Block(
                page=page.relative_to(ROOT) if page.is_relative_to(ROOT) else page,
                line=text.count("\n", 0, match.start("body")) + 1,
                language=match["language"],
                title=title[1] if title else "",
                body=textwrap.dedent(match["body"]) if match["indent"] else match["body"],
                marks={name: words or "" for name, words in COMMENT.findall(match["comments"])},
            )
        )
    return blocks


def matches(expected: str, output: str) -> bool:
    """True if the output is the expected text; `…` stands for any text."""
    parts = []
    for line in expected.strip("\n").splitlines():
        if line.strip() == "…":
            parts.append(r"(?:[^\n]*\n)*")
        else:
            parts.append("[^\n]*".join(re.escape(part) for part in line.rstrip().split("…")) + r"[ ]*\n")
    return re.fullmatch("".join(parts), output.strip("\n") + "\n") is not None


def changed(text: str, diff: str) -> str:
    """The text after a change. Raises `ExampleError` if the lines to replace are not there exactly once."""
    old = "".join(line[1:] + "\n" for line in diff.splitlines() if line[:1] in (" ", "-"))
    new = "".join(line[1:] + "\n" for line in diff.splitlines() if line[:1] in (" ", "+"))
    if text.count(old) != 1:
        raise ExampleError(f"the lines to change are in the file {text.count(old)} times:\n{old}")
    return text.replace(old, new)


def own_environment(folder: Path) -> Path:
    """Make a virtual environment that has everything of this interpreter's, and return the folder of its programs.

    What a page installs is gone with the folder. No package is copied: each is a link, and the programs are written
    again with the new interpreter. A page must not install another version of a package that is here already. Walls
    around policies do not let them read through the links.
    """
    venv.create(folder, symlinks=True)
    packages = next(folder.glob("lib/python*/site-packages"))
    for package in Path(sysconfig.get_paths()["purelib"]).iterdir():
        if not (packages / package.name).exists():
            (packages / package.name).symlink_to(package)
    programs = folder / "bin"
    for program in Path(sys.executable).parent.iterdir():
        target = programs / program.name
        if not program.is_file() or target.exists():
            continue
        if program.read_bytes()[:2] == b"#!":
            lines = program.read_text(encoding="utf-8").split("\n", 1)
            target.write_text(f"#!{programs / 'python'}\n{lines[1]}", encoding="utf-8")
            target.chmod(0o755)
        else:
            target.symlink_to(program)
    return programs


class PageRun:
    """The run of one page in a folder: its files, its interpreter and its servers."""

    def __init__(self, folder: Path, *, installs: bool) -> None:
        self.folder = folder
        kept = {name: value for name, value in os.environ.items() if not re.search("LINGJING|API_KEY", name)}
        programs = own_environment(folder.with_name("environment")) if installs else Path(sys.executable).parent
        self.environment = {**kept, "PATH": f"{programs}:{kept['PATH']}", "COLUMNS": "80", "PIP_QUIET": "1"}
        self.python = programs / "python"
        self.session: subprocess.Popen[str] | None = None
        self.servers: list[subprocess.Popen[str]] = []

    def run(self, block: Block) -> str | None:
        """Run a block and return its output, or None if it has none. Raises `ExampleError`."""
        if block.title:
            self._write(block)
            return None
        if block.language == "python":
            return self._python(block.body)
        if "background" in block.marks:
            self._serve(block.commands)
            return None
        return self._shell(block)

    def _write(self, block: Block) -> None:
        path = self.folder / block.title
        path.parent.mkdir(parents=True, exist_ok=True)
        text = block.body
        if block.language == "diff":
            text = changed(path.read_text(encoding="utf-8"), text)
        path.write_text(text, encoding="utf-8")

    def _shell(self, block: Block) -> str:
        with tempfile.TemporaryFile("w+") as output:
            process = self._start(block.commands, output)
            try:
                code = process.wait(LONGEST_S)
            except subprocess.TimeoutExpired:
                end(process)
                raise ExampleError(f"it does not end within {LONGEST_S:.0f} s") from None
            output.seek(0)
            text = output.read()
        if code != int(block.marks.get("exit", 0)):
            raise ExampleError(f"exit code {code}:\n{text}")
        return text

    def _serve(self, command: str) -> None:
        process = self._start(command, subprocess.PIPE)
        self.servers.append(process)
        assert process.stdout is not None
        line = process.stdout.readline()
        if not line:
            raise ExampleError("the server ended without a line of output")
        with suppress(subprocess.TimeoutExpired):  # the line may say that its port is in use
            code = process.wait(STEADY_S)
            raise ExampleError(f"the server ended with exit code {code}:\n{line}{process.stdout.read()}")

    def _start(self, command: str, output: IO[str] | int) -> subprocess.Popen[str]:
        return subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", command], cwd=self.folder, env=self.environment, text=True,
            stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip

    def _python(self, code: str) -> str:
        if self.session is None:
            self.session = subprocess.Popen(
                [self.python, "-c", SESSION], cwd=self.folder, env=self.environment, stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
            )  # fmt: skip
        assert self.session.stdin is not None and self.session.stdout is not None
        self.session.stdin.write(f"{len(code)}\n{code}")
        self.session.stdin.flush()
        lines: list[str] = []
        for line in self.session.stdout:
            if line.startswith("\0"):
                if line != "\0ok\n":
                    raise ExampleError("".join(lines))
                return "".join(lines)
            lines.append(line)
        raise ExampleError("the interpreter ended:\n" + "".join(lines))

    def close(self) -> None:
        """End the servers and the interpreter."""
        for process in (*self.servers, *([self.session] if self.session else [])):
            end(process)


def end(process: subprocess.Popen[str]) -> None:
    """End a process and the processes of its session."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, number)
            process.wait(20)
            return
        except ProcessLookupError:
            process.wait()
            return
        except subprocess.TimeoutExpired:
            continue


def steps(page: Path) -> Iterator[tuple[Block, str | None]]:
    """The blocks of a page to run, with the expected output of each, or None."""
    blocks = blocks_of(page)
    for block, after in itertools.zip_longest(blocks, blocks[1:]):
        if not block.is_run:
            continue
        is_output = after is not None and after.language == "text" and not after.title and "skip" not in after.marks
        yield block, after.body if after is not None and is_output else None


@contextmanager
def alone_on_this_machine() -> Iterator[None]:
    """Wait until no other page is run here: servers of pages have fixed ports, as a reader would type them."""
    with Path(tempfile.gettempdir(), f"lingjing-pages-{os.getuid()}.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def run_page(page: Path) -> float:
    """Run a page and return the seconds that it took. Raises `ExampleError` with the place of a faulty block."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="page-") as folder:
        (working := Path(folder, "page")).mkdir()
        run = PageRun(working, installs="<!-- installs -->" in page.read_text(encoding="utf-8"))
        try:
            for block, expected in steps(page):
                missing = [name for name in block.marks.get("needs", "").split() if find_spec(name) is None]
                if missing:
                    print(f"  {block.place}: left out, because {', '.join(missing)} is not installed")
                    continue
                try:
                    output = run.run(block)
                    if expected is not None and output is not None and not matches(expected, output):
                        raise ExampleError(f"it printed\n{output}\nwhere the page says\n{expected}")
                except (ExampleError, OSError) as error:
                    raise ExampleError(f"{block.place}: {block.language} {block.title}\n{error}") from error
        finally:
            run.close()
    return time.monotonic() - started


def pages() -> list[Path]:
    """The pages with examples that are run."""
    docs = ROOT / "docs"
    written = (page for page in sorted(docs.rglob("*.md")) if page.relative_to(docs).as_posix() not in OTHERS)
    return [page for page in written if any(block.is_run for block in blocks_of(page))]


def main() -> int:
    """Run the pages of the command line. Exit codes are in the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", type=Path, metavar="PAGE", help="pages (default: all with examples)")
    parser.add_argument("--list", action="store_true", help="print the blocks and run none")
    args = parser.parse_args()
    absent = [str(page) for page in args.pages if not page.is_file()]
    if absent:
        parser.error(f"there is no page {', '.join(absent)}")
    failed, started = 0, time.monotonic()
    for page in [page.resolve() for page in args.pages] or pages():
        if args.list:
            for block, expected in steps(page):
                first = block.title or shlex.quote(block.body.splitlines()[0])
                print(f"{block.place}: {block.language} {first}{' -> output' if expected is not None else ''}")
            continue
        print(f"{page.relative_to(ROOT)}: ", end="", flush=True)
        try:
            with alone_on_this_machine():
                print(f"done in {run_page(page):.0f} s")
        except ExampleError as error:
            failed += 1
            lines = str(error).splitlines()
            left_out = len(lines) - 2 * MOST_LINES
            if left_out > 0:
                lines[MOST_LINES:-MOST_LINES] = [f"[{left_out} lines]"]
            print("failed", *lines, sep="\n")
    if not args.list:
        print(f"all pages: {time.monotonic() - started:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
