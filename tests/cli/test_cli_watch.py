"""Tests of `run --watch`: the state of the episode, its drawing at any size, and the terminal afterwards."""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import select
import struct
import sys
import termios
import time
from pathlib import Path

import msgspec
import pytest
from rich.console import Console
from rich.live import Live

import lingjing
from lingjing import PlayOptions, Trace
from lingjing import read as read_trace
from lingjing.cli import console, watch
from lingjing.cli.watch.chart import TARGET_SIGNS, Chart, window_around
from lingjing.cli.watch.displays import SHARE, EpisodeDisplay
from lingjing.cli.watch.screen import Screen
from lingjing.errors import UsageError
from lingjing.kernel.episode import Progress
from lingjing.scene.city import City
from lingjing.testing import PluginHost, mission_file, sea_rescue
from lingjing.trace.records import BodyState, TaskEvent
from lingjing.viewer.state import EpisodeState
from tools.python_forks import run_python

EpisodeDisplays = watch.EpisodeDisplays
RUN = (sys.executable, "-m", "lingjing.cli.main", "run")


@pytest.fixture(scope="module")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """The trace of the sea rescue of the kit."""
    target = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(target, ticks=60)
    return read_trace(target)


@pytest.fixture(scope="module")
def city(trace: Trace) -> City:
    return PluginHost().scene("bay").build(trace.header.instance.scene)


def boundaries(trace: Trace, until: int) -> list[Progress]:
    ticks = trace.boundaries[-1].tick
    return [
        Progress(tick=r.tick, ticks=ticks, time_s=r.time_s, wall_s=r.tick / 10, last_event="", record=r)
        for r in trace.boundaries
        if r.tick <= until
    ]


def watched(trace: Trace, until: int, *, truth: bool = False) -> EpisodeState:
    state = EpisodeState(trace.header.instance, truth=truth)
    for boundary in boundaries(trace, until):
        state.take(boundary.record, boundary.wall_s)
    return state


def test_events_name_hidden_targets_only_when_the_truth_is_shown(trace: Trace) -> None:
    front = TaskEvent(kind="weather", name="front", entities=(), time_s=10.0, values={"rain": 0.5})
    appeared = TaskEvent(kind="appeared", name="late", entities=("victim[1]", "boat"), time_s=10.0)
    for truth, names in ((False, "? boat"), (True, "victim[1] boat")):
        state = EpisodeState(trace.header.instance, truth=truth)
        (first, *_) = boundaries(trace, 0)
        state.take(msgspec.structs.replace(first.record, task_events=(front, appeared)))
        assert [line.text for line in state.events][:2] == ["weather front: rain 0.5", f"appeared late: {names}"]


def screen_text(
    state: EpisodeState, city: City, width: int, height: int, colours: str | None = "truecolor"
) -> list[str]:
    console = Console(force_terminal=True, color_system=colours, width=width, height=height)  # type: ignore[arg-type]
    screen = Screen(state, Chart(city), "ssr · seed 7 · broadcast · heuristic", "map: © Somebody")
    lines = console.render_lines(screen, console.options.update(height=height))
    assert {sum(segment.cell_length for segment in line) for line in lines} == {width}
    return ["".join(segment.text for segment in line) for line in lines]


def test_hidden_targets_are_visible_once_found_or_always_with_the_truth(trace: Trace) -> None:
    first = min(record.tick for record in trace.boundaries if record.events)
    assert list(watched(trace, first - 1).visible_targets()) == []
    assert {sight for *_, sight in watched(trace, first - 1, truth=True).visible_targets()} == {"truth"}
    targets = [(entity.id, sight) for entity, _, sight in watched(trace, first).visible_targets()]
    assert targets and {sight for _, sight in targets} <= {"found", "completed"}
    assert {sight for *_, sight in watched(trace, 60).visible_targets()} == {"completed"}


def test_the_state_is_that_of_the_last_boundary(trace: Trace) -> None:
    state, last = watched(trace, 60), trace.boundaries[-1]
    assert (state.tick, state.score, state.time_s) == (last.tick, last.reward, last.time_s)
    assert state.states == {body.id: body for body in last.snapshots[-1].states}
    sent = {edge.id for record in trace.boundaries for edge in record.messages}
    assert len(state.messages) == min(64, len(sent))
    assert sum(done for _, done, _ in state.stage_counts()) == sum(len(r.stages) for r in trace.boundaries)


def test_the_state_of_an_agent_has_its_command_and_status(trace: Trace) -> None:
    made = next(
        (record.tick, decided.agent, decided.decision.command)
        for record in trace.boundaries
        for decided in record.decisions
        if decided.decision.command is not None
    )
    doing = watched(trace, made[0]).agents[made[1]]
    assert made[2] is not None and made[2].verb in doing.command
    assert doing.status


@pytest.mark.parametrize("size", [(80, 24), (200, 60), (57, 16), (40, 10), (133, 17)])
@pytest.mark.parametrize("colours", ["truecolor", "standard", None])
def test_a_screen_fills_any_terminal_exactly(
    trace: Trace, city: City, size: tuple[int, int], colours: str | None
) -> None:
    lines = screen_text(watched(trace, 30), city, *size, colours)
    assert len(lines) == size[1]
    assert "tick 30/" in lines[1]
    assert "scout[1]" in "\n".join(lines)


def test_the_map_shows_headings_trails_targets_and_ground(trace: Trace, city: City) -> None:
    lines = screen_text(watched(trace, 60), city, 120, 40)
    chart = "\n".join(line[:74] for line in lines[3:30])
    assert "boat" in chart and "uav[1]" in chart
    assert TARGET_SIGNS["completed"][0] in chart
    assert any("⠁" <= sign <= "⣿" for sign in chart)
    assert "▀" in chart
    assert "map: © Somebody" in lines[2]
    bare = "\n".join(screen_text(watched(trace, 60), city, 120, 40, None))
    assert "▀" not in bare


def test_a_window_holds_all_its_points_and_keeps_dots_square() -> None:
    points = [(-300.0, 40.0), (900.0, 75.0), (12.0, -800.0)]
    window = window_around(points, 50, 15)
    assert all(window.holds(point) for point in points)
    west, south, east, north = window.bounds
    assert (east - west) / 100 == pytest.approx((north - south) / 60) == pytest.approx(window.dot_m)


def test_a_window_grows_when_something_leaves_it(trace: Trace, city: City) -> None:
    chart, state = Chart(city), watched(trace, 5)
    chart.lines(state, 40, 12, coloured=True)
    first = chart._window
    asset = state.assets[0].id
    state.states[asset] = BodyState(id=asset, position=(9000.0, 0.0, 0.0))
    chart.lines(state, 40, 12, coloured=True)
    assert first is not None and not first.holds((9000.0, 0.0))
    assert chart._window is not None and chart._window.holds((9000.0, 0.0))


def test_drawing_keeps_to_its_share_of_the_time(trace: Trace, city: City, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("lingjing.cli.watch.displays.time.perf_counter", lambda: clock[0])
    drawn: list[int] = []
    watching = EpisodeDisplay(trace.header.instance, city, "heuristic", truth=False)

    def draw() -> None:
        clock[0] += 0.05
        drawn.append(watching._watched.tick)

    monkeypatch.setattr(watching, "_draw", draw)
    for boundary in boundaries(trace, 60):
        clock[0] += 0.2
        watching(boundary)
    assert drawn[0] == 0 and drawn[-1] == trace.boundaries[-1].tick
    assert 5 < len(drawn) < len(trace.boundaries) / 2
    assert watching._spent_s <= SHARE * clock[0] + 3 * 0.05


def test_watch_without_a_terminal_is_refused_with_a_hint(tmp_path: Path) -> None:
    done = run_python([*RUN, "ssr", "--watch", "--policy", "random"], cwd=tmp_path)
    assert done.returncode == 2
    assert "error: --watch draws on the terminal" in done.stderr and "hint: remove --watch" in done.stderr
    assert "Traceback" not in done.stderr and done.stdout == "" and list(tmp_path.iterdir()) == []


def test_parallel_episodes_cannot_be_watched(tmp_path: Path) -> None:
    done = run_python([*RUN, "ssr", "--watch", "--seeds", "0-1", "-j", "2"], cwd=tmp_path)
    assert done.returncode == 2 and "one episode at a time" in done.stderr


def test_a_dumb_terminal_gets_a_note_and_the_progress_line(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    path = mission_file("ssr")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "dumb")
    displays = EpisodeDisplays(lingjing.compile(path), PlayOptions(mission=str(path), policy="random"), truth=False)
    assert type(displays("ssr seed 0")).__name__ == "LiveProgress"
    assert capsys.readouterr().err == "note: this terminal has no cursor control (TERM=dumb): only progress is shown\n"
    monkeypatch.setattr(sys.stderr, "isatty", lambda: False)
    with pytest.raises(UsageError, match="--watch draws on the terminal"):
        EpisodeDisplays(lingjing.compile(path), PlayOptions(mission=str(path), policy="random"), truth=False)


def test_each_of_several_episodes_is_watched_with_its_own_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    path = mission_file("ssr")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm-256color")
    displays = EpisodeDisplays(
        lingjing.compile(path), PlayOptions(mission=str(path), policy="random", mode="star"), truth=True
    )
    seen = []
    for seed, _ in displays.follow([(3, None), (5, None)]):
        watching = displays(f"ssr seed {seed}")
        assert isinstance(watching, EpisodeDisplay)
        seen.append((watching._watched.instance.seed, watching._watched.instance.mode, watching._watched.truth))
    assert seen == [(3, "star", True), (5, "star", True)]


def _resize(terminal: int, rows: int, columns: int) -> None:
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))


class Terminal:
    """A pseudo-terminal that runs a command."""

    def __init__(self, cwd: Path, *arguments: object) -> None:
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.chdir(cwd)
            _resize(0, 24, 80)
            os.environ.update(TERM="xterm-256color", COLORTERM="truecolor")
            os.execv(sys.executable, [*RUN, *map(str, arguments)])
        self.output = b""

    def resize(self, rows: int, columns: int) -> None:
        _resize(self.fd, rows, columns)

    def read_until(self, begun: Path, limit_s: float = 900.0) -> None:
        """Read until this file is there. What is drawn in between depends on the machine's pace."""
        deadline = time.monotonic() + limit_s
        while not begun.exists() and time.monotonic() < deadline:
            if select.select([self.fd], [], [], 0.2)[0]:
                self.output += os.read(self.fd, 65536)
        assert begun.exists(), self.output[-2000:]

    def end(self) -> int:
        while True:
            try:
                read = os.read(self.fd, 65536)
            except OSError:  # the other end is closed
                break
            if not read:
                break
            self.output += read
        os.close(self.fd)
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


NOISY = """
import sys
class Noisy:
    async def reset(self, brief): print("printed aloud", file=sys.stderr); print("and on stdout")
    async def act(self, observation, inbox):
        from lingjing.plugins.policy import Decision
        open("asked", "w").close()
        return Decision()
"""


def test_a_watched_run_restores_the_terminal_and_then_prints_the_output_of_policies(tmp_path: Path) -> None:
    text = mission_file("ssr").read_text(encoding="utf-8").replace("ticks <= 60", "ticks <= 3")
    (tmp_path / "short.ljs").write_text(text.replace("(12.4 m, -1351.8 m)", "(270 m, -920 m)"), encoding="utf-8")
    (tmp_path / "noisy.py").write_text(NOISY)
    terminal = Terminal(tmp_path, "short.ljs", "--watch", "--policy", "./noisy.py:Noisy", "-o", "out")
    terminal.read_until(tmp_path / "asked")
    terminal.resize(30, 100)
    assert terminal.end() == 0
    began, ended = terminal.output.index(b"\x1b[?1049h"), terminal.output.index(b"\x1b[?1049l")
    inside, after = terminal.output[began:ended], terminal.output[ended:].decode()
    assert b"printed aloud" not in inside and b"and on stdout" not in inside
    assert "printed aloud" in after and "and on stdout" in after
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", after)
    assert "tick 3/3" in plain  # the last picture stays
    assert "trace: out/trace.mcap" in plain.splitlines()
    assert terminal.output.count(b"\x1b[?25h") == terminal.output.count(b"\x1b[?25l") == 1


ENDLESS = """
import asyncio
class Endless:
    async def reset(self, brief): pass
    async def act(self, observation, inbox):
        open("asked", "w").close()
        await asyncio.sleep(1e6)
"""


def test_control_c_leaves_the_terminal_clean(tmp_path: Path) -> None:
    (tmp_path / "endless.py").write_text(ENDLESS)
    terminal = Terminal(tmp_path, "ssr", "--watch-truth", "--policy", "./endless.py:Endless", "-o", "out")
    terminal.read_until(tmp_path / "asked")
    os.write(terminal.fd, b"\x03")
    assert terminal.end() == 130
    after = terminal.output[terminal.output.index(b"\x1b[?1049l") :].decode()
    assert "Traceback" not in after and "interrupted: seed 0" in after
    assert terminal.output.count(b"\x1b[?25h") == 1
    assert sorted(os.listdir(tmp_path / "out")) == ["trace.mcap.part"]


def test_narrow_lines_leave_out_the_only_asset_an_agent_has(trace: Trace, city: City) -> None:
    state = watched(trace, 20)
    wide, narrow = ("\n".join(screen_text(state, city, width, 30)) for width in (160, 70))
    commands = [agent for agent in state.agents.values() if "." in agent.command]
    assert commands
    for agent in commands:
        assert f"{agent.agent} {agent.command}"[:50] in wide
        what = agent.command.partition(".")[2]
        fits = len(f"{agent.agent} {agent.command}") <= round(70 * 0.38)
        assert f"{agent.agent} {agent.command if fits else what}"[:24] in narrow


def test_a_console_of_rich_writes_control_characters_of_texts_as_escapes() -> None:
    shown = io.StringIO()
    console.console(shown).print("a\x1b[2Jb", markup=False)
    assert shown.getvalue() == "a\\x1b[2Jb\n"


def test_prints_during_a_display_of_rich_are_written_as_escapes() -> None:
    shown = io.StringIO()
    with Live(console=console.VisibleConsole(file=shown, force_terminal=True), auto_refresh=False):
        console.spell_proxies()
        print("said\x1b[2J\x1b[31m")
        print("warned\x1b]0;title\x07", file=sys.stderr)
    assert "said\\x1b[2J\\x1b[31m" in shown.getvalue()
    assert "warned\\x1b]0;title\\x07" in shown.getvalue()
