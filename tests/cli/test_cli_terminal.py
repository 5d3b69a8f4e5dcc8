"""Text of missions, policies, models and file names never controls the terminal."""

import fcntl
import json
import os
import pty
import re
import subprocess
import sys
import termios
from pathlib import Path

import pytest

import lingjing
from lingjing.terminal import aligned, visible
from tools.python_forks import start_python

EVIL = [
    "\x1b]0;EVIL\x07",
    "\x1b[31mEVIL",
    "\x1bPEVIL",
    "\x9b31mEVIL",
    "\x9d0;EVIL",
    "\u202eEVIL",
    "\u2066EVIL",
    "\rEVIL",
    "\x08EVIL",
]
LINE = "".join(EVIL) + "DONE"

POLICY = f"""
import logging, sys, warnings
from lingjing.plugins.policy import Action, Decision, Outgoing

EVIL = {LINE!r}

class Evil:
    async def reset(self, brief):
        self.brief = brief
        print("reset", EVIL)

    async def act(self, observation, inbox):
        print("stdout", EVIL)
        print("stderr", EVIL, file=sys.stderr)
        logging.getLogger("evil").error("log " + EVIL)
        warnings.warn("warn " + EVIL)
        sys.__stderr__.write("original " + EVIL + "\\n")
        if observation.tick == 1:
            raise ValueError("raised " + EVIL)
        kinds = [message.kind for message in self.brief.messages]
        body = {{"task": EVIL, "state": EVIL, EVIL: EVIL}}
        messages = tuple(Outgoing(kind=kind, body=body) for kind in (*kinds, EVIL))
        command = Action(verb=EVIL, arguments={{EVIL: EVIL}}, resource=EVIL)
        return Decision(command=command, messages=messages, thought=EVIL)
"""

PAST_STREAMS = f"""
import os, subprocess
from lingjing.plugins.policy import Decision

EVIL = {LINE!r}

def to_terminal():
    with open("/dev/tty", "w") as terminal:
        terminal.write(EVIL)

def to_input():
    os.write(0, EVIL.encode())

class Evil:
    async def reset(self, brief):
        self.first = brief.agent == "skipper[1]"

    async def act(self, observation, inbox):
        if self.first and observation.tick == 1:
            os.write(1, ("first " + EVIL + "\\n").encode())
            os.write(2, ("second " + EVIL + "\\n").encode())
            subprocess.run(["printf", "%s\\n", "started " + EVIL], check=True)
            for name, write in (("terminal", to_terminal), ("descriptor", to_input)):
                try:
                    write()
                except OSError as error:
                    print(name, error.strerror)
        return Decision()
"""

MISSION = """ljs 1
mission tiny "T" {
  goal "Nothing."
  scene bay {}
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 3 }
  asset boat : no_such_%s { position = (0 m, 0 m) }
}
"""


def on_terminal(*arguments: str, cwd: Path, stdin: bytes | None = None, controlling: bool = False) -> str:
    """Return the output of `lingjing …` on a terminal, both streams, with its newlines as written; `controlling`: it
    is the process's own, `/dev/tty`."""
    primary, secondary = pty.openpty()
    reading, writing = os.pipe() if stdin is not None else (os.dup(secondary), -1)
    command = [sys.executable, "-m", "lingjing.cli.main", *arguments]
    variables = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "40"}
    try:
        process = (
            subprocess.Popen(
                command, stdin=reading, stdout=secondary, stderr=secondary, cwd=cwd, env=variables,
                start_new_session=True, preexec_fn=lambda: fcntl.ioctl(1, termios.TIOCSCTTY, 0),
            )
            if controlling
            else start_python(command, (reading, secondary, secondary), cwd=cwd, env=variables)
        )  # fmt: skip
        os.close(reading)
        os.close(secondary)
        if stdin is not None:
            os.write(writing, stdin)
            os.close(writing)
        shown = b""
        while piece := _read(primary):
            shown += piece
        process.wait()
    finally:
        os.close(primary)
    return shown.decode("utf-8", "surrogateescape").replace("\r\n", "\n")


def _read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 65536)
    except OSError:  # the other side is closed
        return b""


def harmless(shown: str) -> bool:
    return not any(evil in shown for evil in EVIL) and not any("\x80" <= letter <= "\x9f" for letter in shown)


def test_control_characters_are_escaped_and_other_text_is_unchanged():
    assert visible("a\tb\nc\r\nd é 中 👩\u200d🚀") == "a\tb\nc\nd é 中 👩\u200d🚀"
    assert visible("\x1b[2J\x07\x7f\x85\u202e\ufeff\U000e0041") == r"\x1b[2J\x07\u007f\u0085\u202e\ufeff\udb40\udc41"
    assert json.loads(visible(json.dumps("\x9b\u202e\U000e0041\x7f", ensure_ascii=False))) == "\x9b\u202e\U000e0041\x7f"
    for code in range(0x110000):
        shown = visible(chr(code))
        assert len(shown) == 1 or shown.isascii()


@pytest.fixture
def here(tmp_path: Path) -> Path:
    (tmp_path / "evil.py").write_text(POLICY)
    (tmp_path / f"{LINE}.ljs").write_text(MISSION % "type")
    (tmp_path / "inside.ljs").write_text((MISSION % "type").replace("Nothing.", LINE).replace("{}", "{} # " + LINE))
    (tmp_path / "names.json").write_text(json.dumps({"taskType": LINE, "lingjing": {"mission": LINE}, LINE: LINE}))
    return tmp_path


@pytest.mark.parametrize(
    "arguments",
    [
        ("validate", f"{LINE}.ljs"),
        ("validate", "inside.ljs"),
        ("validate", "names.json"),
        ("validate", f"no such {LINE}"),
        ("validate", "--diff", f"{LINE}.ljs"),
        ("run", f"{LINE}.ljs"),
        ("run", "ssr", "--policy", f"./{LINE}.py:X"),
        ("run", "ssr", "--set", f"{LINE}=1"),
        ("run", "ssr", "--mode", LINE),
        ("run", "ssr", "--policy-arg", LINE),
        ("run", "ssr", "-o", f"evil.py/{LINE}"),
        ("fmt", "--diff", "inside.ljs"),
        ("explain", LINE),
        ("graph", "inside.ljs"),
        ("compile", "--emit", "ljs", "ssr", "-o", f"{LINE}/x"),
        ("scene", "info", LINE),
        ("docs", "ssr", "--trace", LINE, "-o", LINE),
        ("new", "agent", LINE),
        (LINE,),
    ],
    ids=lambda arguments: " ".join(arguments).replace(LINE, "EVIL"),
)
def test_no_verb_prints_control_characters_of_a_mission_or_a_name(arguments: tuple[str, ...], here: Path):
    shown = on_terminal(*arguments, cwd=here)
    assert harmless(shown), shown
    assert shown


def test_formatted_text_is_escaped_on_a_terminal_and_exact_in_a_pipe(here: Path):
    comment = f"# {EVIL[0]} {EVIL[1]} {EVIL[3]}"  # others are errors of the language
    text = f'ljs 1\nmission tiny "T" {{\n  goal "Nothing."\n  {comment}\n}}\n'.encode()
    assert harmless(on_terminal("fmt", "-", cwd=here, stdin=text))
    piped = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", "fmt", "-"], input=text, capture_output=True, check=True
    )
    assert comment.encode() in piped.stdout


def test_colours_of_the_command_reach_the_terminal(here: Path):
    shown = on_terminal("validate", "inside.ljs", cwd=here)
    assert "\x1b[1;31merror" in shown


def short(folder: Path) -> None:
    """Write the mission of two boats, which has three ticks."""
    (folder / "short.ljs").write_text(Path(__file__).with_name("boats.ljs").read_text())


@pytest.mark.slow
def test_output_of_a_policy_never_controls_the_terminal(here: Path):
    short(here)
    command = ("run", "short.ljs", "--policy", "./evil.py:Evil", "--no-overview")
    for option in (["--watch"], []):
        shown = on_terminal(*command, *option, cwd=here)
        assert harmless(shown), shown
        for message in ("reset", "stdout", "stderr", "log", "warn", "original"):
            assert f"{message} \\x1b]0;EVIL\\x07" in shown.replace("\n", ""), (option, message)
        assert "raised \\x1b" in shown.replace("\n", "")
    piped = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", *command],
        cwd=here,
        capture_output=True,
        check=False,
    )
    assert harmless((piped.stdout + piped.stderr).decode())


@pytest.mark.slow
@pytest.mark.parametrize("option", [("--no-overview", "--watch"), ("--no-overview",)], ids=["watch", "plain"])
def test_output_of_a_policy_that_bypasses_its_streams_never_controls_the_terminal(option: tuple[str, ...], here: Path):
    """The output passes through another process than the drawing one, so simultaneous output of both may be mixed."""
    short(here)
    (here / "past.py").write_text(PAST_STREAMS)
    shown = on_terminal("run", "short.ljs", "--policy", "./past.py:Evil", *option, cwd=here, controlling=True)
    assert harmless(shown), shown
    for message in ("first", "second", "started"):
        assert f"{message} \\x1b]0;EVIL\\x07" in shown, message
    for message in ("terminal No such device or address", "descriptor Bad file descriptor"):
        assert message in shown.replace("\n", ""), message


@pytest.mark.slow
def test_the_screen_is_restored_after_a_policy_ends_its_process(here: Path):
    (here / "gone.py").write_text(
        "import os\n" + POLICY.replace("if observation.tick == 1:", "os._exit(0)\n        if 0:")
    )
    short(here)
    shown = on_terminal("run", "short.ljs", "--policy", "./gone.py:Evil", "--watch", "--no-overview", cwd=here)
    assert shown.count("\x1b[?1049h") == 1
    assert "\x1b[?1049l" in shown.split("\x1b[?1049h")[1]
    assert harmless(shown), shown


def test_only_one_module_creates_a_console_of_rich():
    sources = {path: path.read_text(encoding="utf-8") for path in Path(lingjing.__file__).parent.rglob("*.py")}
    drawing = {
        path.name for path, text in sources.items() if re.search(r"\bConsole\(", text.replace("VisibleConsole(", ""))
    }
    assert not drawing - {"console.py"}


def test_columns_are_aligned_for_wide_combining_and_control_characters() -> None:
    """Wide letters take two columns, combining accents none, and an escape takes the width of its text."""
    assert aligned([("名字", "1", "x"), ("e\u0301te", "2", ""), ("\x1b", "3", "z"), ("abcdef", "4", "")]) == [
        "名字    1  x",
        "e\u0301te     2",
        "\x1b    3  z",
        "abcdef  4",
    ]
    assert aligned([]) == []
