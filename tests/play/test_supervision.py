"""What a policy does to its process ends its episode and nothing else; what it started ends with it."""

from __future__ import annotations

import atexit
import errno
import faulthandler
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lingjing.analysis.metrics import StageMetric
from lingjing.errors import InfrastructureError, LingjingError, MissionError, UsageError
from lingjing.play import supervised_child
from lingjing.play.child_messages import ChildMessage
from lingjing.play.descendants import _children_by_parent, adopting, children
from lingjing.play.raw_output import RawOutput
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.play.supervised_child import SeedFolder
from lingjing.play.supervision import play_supervised
from tests.play.report_kit import blank_metrics, made_report

METRICS = blank_metrics(kilobytes=1.5, stages=(StageMetric(name="detect", done=1, required=3, cumulative=False),))


def report(seed: int, reason: str = "success", detail: str = "") -> EpisodeReport:
    return made_report(seed=seed, success=reason == "success", reason=reason, detail=detail, metrics=METRICS)


def played(act: Callable[[int], object], folder: Path, seeds: tuple[int, ...] = (0, 1, 2)) -> dict[int, EpisodeReport]:
    """The reports by seed of episodes that are nothing but `act`, each in a folder of its own."""

    def claim(seed: int) -> Path:
        made = folder / str(seed)
        made.mkdir()
        return made

    def play(places: Iterator[SeedFolder]) -> Iterator[EpisodeReport]:
        for seed, _ in places:
            act(seed)
            yield report(seed)

    def abort(seed: int, folder: Path, why: str) -> EpisodeReport:
        return report(seed, ABORTED, f"{folder.name}: {why}")

    found = play_supervised(seeds, claim, play, abort)
    return {each.seed: each for each in found}


def exhaust() -> None:
    kept = []
    while True:
        kept.append(os.dup(0))


def forget() -> None:
    sys.modules.clear()
    sys.path.clear()
    __import__("colorsys")


def give_up() -> None:
    faulthandler.disable()  # pytest's would print the stacks of a death that is wanted
    os.abort()


HOSTILE: list[tuple[str, Callable[[], object], str]] = [
    ("exit", lambda: os._exit(0), "its process ended without a result (exit code 0)"),
    ("exit_3", lambda: os._exit(3), "its process ended without a result (exit code 3)"),
    ("kill", lambda: os.kill(os.getpid(), signal.SIGKILL), "its process was killed by signal 9"),
    ("abort", give_up, "its process was killed by signal 6"),
    ("close", lambda: (os.closerange(0, 4096), os._exit(0)), "its process ended without a result (exit code 0)"),
    ("unload", forget, "a policy left its process unable to go on: ModuleNotFoundError: No module named 'colorsys'"),
    ("exhaust", exhaust, "a policy left its process unable to go on: OSError: [Errno 24] Too many open files"),
]


@pytest.mark.parametrize(("act", "why"), [case[1:] for case in HOSTILE], ids=[case[0] for case in HOSTILE])
def test_a_ruined_process_is_an_abort_of_its_episode(act: Callable[[], object], why: str, tmp_path: Path) -> None:
    """Seed 1 ruins the process it is played in; what was played before stays, and what comes later is played."""
    found = played(lambda seed: act() if seed == 1 else None, tmp_path)
    assert [found[seed].reason for seed in (0, 1, 2)] == ["success", ABORTED, "success"]
    assert found[1].detail.startswith(f"1: {why}")
    assert found[1].crashed == (why != "its process was killed by signal 9"), "a kill may come from outside"
    assert found[2].metrics == METRICS and not found[2].crashed
    assert not (tmp_path / "1").exists()  # nothing had been written into it


def test_a_process_whose_interpreter_is_held_for_ever_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A regular expression that backtracks for years never lets go of the interpreter, so no deadline in it passes."""
    monkeypatch.setattr("lingjing.play.supervision.SILENCE_S", 2.0)
    found = played(lambda seed: re.match("(a+)+$", "a" * 60 + "b") if seed == 1 else None, tmp_path)
    assert [found[seed].reason for seed in (0, 1, 2)] == ["success", ABORTED, "success"]
    assert found[1].detail == "1: a policy let nothing else run for 2 s, in one call that held the interpreter"
    assert found[1].crashed


def test_a_process_that_closes_everything_and_stays_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lingjing.play.supervision.MUTE_S", 0.05)
    found = played(lambda seed: (os.closerange(3, 4096), time.sleep(3600)), tmp_path, (7,))
    assert found[7].detail == "7: its process closed what it reports through"
    assert found[7].crashed


def test_what_a_policy_leaves_for_the_end_of_its_process_keeps_nobody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lingjing.play.supervision.GRACE_S", 0.2)
    found = played(lambda seed: atexit.register(time.sleep, 3600), tmp_path, (3, 4))
    assert [found[seed].reason for seed in (3, 4)] == ["success", "success"]


def test_nonsense_in_the_pipe_is_no_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tell = supervised_child.tell

    def scribble(pipe: int, message: ChildMessage) -> None:
        tell(pipe, message)
        os.write(pipe, b"\x03\0\0\0\0\0\0\0{x}")

    monkeypatch.setattr(supervised_child, "tell", scribble)
    assert played(lambda seed: os._exit(0), tmp_path, (1,))[1].reason == ABORTED


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (UsageError("no such policy", hint="choose another"), UsageError),
        (MissionError("beyond the scene"), MissionError),
        (OSError(errno.ENOSPC, "No space left on device", "out/trace"), OSError),
        (ValueError("ours"), LingjingError),
    ],
)
def test_other_errors_are_the_callers(error: Exception, kind: type[Exception], tmp_path: Path) -> None:
    def fail(seed: int) -> None:
        raise error

    with pytest.raises(kind) as caught:
        played(fail, tmp_path)
    if isinstance(error, ValueError):
        assert type(caught.value) is LingjingError
        assert str(caught.value).startswith("ValueError: ours [test_supervision.py:")
    else:
        assert str(caught.value) == str(error)
    assert getattr(caught.value, "hint", "") == getattr(error, "hint", "")
    assert getattr(caught.value, "errno", None) == getattr(error, "errno", None)


def test_an_error_of_the_infrastructure_is_an_abort(tmp_path: Path) -> None:
    def fail(seed: int) -> None:
        if seed == 0:
            raise InfrastructureError("the trace is gone")

    found = played(fail, tmp_path)
    assert [found[seed].reason for seed in (0, 1, 2)] == [ABORTED, "success", "success"]
    assert found[0].detail == "0: the trace is gone"
    assert not found[0].crashed


def test_a_child_that_ends_before_an_episode_is_no_endless_story(tmp_path: Path) -> None:
    def claim(seed: int) -> Path:
        os._exit(5)

    with pytest.raises(InfrastructureError, match=r"no episode could begin: .*\(exit code 5\)"):
        list(play_supervised((1, 2), claim, lambda places: (report(seed) for seed, _ in places), lambda *_: report(0)))


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def settle(folder: Path) -> None:
    """Start a process in a session of its own below one that ends at once."""
    script = f"sleep 3600 & echo $! > {folder}/pid.part && mv {folder}/pid.part {folder}/pid"
    subprocess.run(["setsid", "sh", "-c", script], check=True, stdout=subprocess.DEVNULL)


def settled(folder: Path) -> int:
    await_file(folder / "pid")
    return int((folder / "pid").read_text())


def await_file(file: Path) -> None:
    while not file.exists():
        time.sleep(0.02)


@pytest.mark.parametrize("last", [lambda: None, lambda: os._exit(0), lambda: os.kill(os.getpid(), signal.SIGKILL)])
def test_what_a_policy_started_ends_with_it(last: Callable[[], object], tmp_path: Path) -> None:
    mine = subprocess.Popen(["sleep", "3600"])
    try:
        played(lambda seed: (settle(tmp_path), last()), tmp_path, (1,))
        assert not runs(settled(tmp_path))
        assert runs(mine.pid)  # what the caller had started is the caller's
    finally:
        mine.kill()
        mine.wait()


def test_only_what_is_new_is_ended() -> None:
    with subprocess.Popen(["sleep", "3600"]) as before:
        with adopting():
            later = subprocess.Popen(["sleep", "3600"])
            assert {before.pid, later.pid} <= set(children()) == set(_children_by_parent())
        assert later.pid not in children()
        assert before.poll() is None
        before.kill()
    later.wait()


@contextmanager
def shooting(folder: Path, number: signal.Signals) -> Iterator[None]:
    """Interrupt this process, however often, once the file `begun` is there; the file `shot` tells that all was sent:
    who plays must not end before, for what comes afterwards is everybody's."""

    def shoot() -> None:
        await_file(folder / "begun")
        for _ in range(5):
            os.kill(os.getpid(), number)
            time.sleep(0.01)
        (folder / "shot").touch()

    thread = threading.Thread(target=shoot)
    thread.start()
    try:
        yield
    finally:
        thread.join()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_the_episode_once(number: signal.Signals, tmp_path: Path) -> None:
    """However often it comes; here the episode answers with what it has."""

    def play(places: Iterator[SeedFolder]) -> Iterator[EpisodeReport]:
        for seed, _ in places:
            try:
                (tmp_path / "begun").touch()
                time.sleep(3600)
            except KeyboardInterrupt:
                await_file(tmp_path / "shot")
                yield report(seed, INTERRUPTED)
                return

    before = signal.getsignal(number)
    with shooting(tmp_path, number):
        found = list(play_supervised((1, 2), lambda seed: tmp_path, play, lambda *_: report(0)))
    assert [(each.seed, each.reason) for each in found] == [(1, INTERRUPTED)]
    assert signal.getsignal(number) == before


def test_an_interrupt_without_a_report_is_one_for_the_caller(tmp_path: Path) -> None:
    def wait(seed: int) -> None:
        try:
            (tmp_path / "begun").touch()
            time.sleep(3600)
        finally:
            await_file(tmp_path / "shot")

    with shooting(tmp_path, signal.SIGINT), pytest.raises(KeyboardInterrupt):
        played(wait, tmp_path)


def test_an_interrupt_that_a_finaliser_swallows_comes_again(tmp_path: Path) -> None:
    """Where the interpreter cannot raise what a signal's handler raises, it prints it and goes on."""

    class Slow:
        def __del__(self) -> None:
            (tmp_path / "begun").touch()
            time.sleep(3600)

    def wait(seed: int) -> None:
        slow = Slow()
        del slow
        time.sleep(3600)

    with shooting(tmp_path, signal.SIGINT), pytest.raises(KeyboardInterrupt):
        played(lambda seed: stopped(lambda: wait(seed), tmp_path), tmp_path)
    assert (tmp_path / "stopped").exists()


def stopped(act: Callable[[], object], folder: Path) -> None:
    """Note in the file `stopped` that an interrupt ended what was done, once all of them have come."""
    try:
        act()
    except KeyboardInterrupt:
        await_file(folder / "shot")
        (folder / "stopped").touch()
        raise


def signals_waiting(pid: int) -> int:
    """The mask of what waits for a process or for its first thread."""
    fields = dict(
        line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines() if ":\t" in line
    )
    return int(fields["SigPnd"], 16) | int(fields["ShdPnd"], 16)


def test_an_interrupt_that_another_thread_hears_is_passed_on(tmp_path: Path) -> None:
    """A terminal's own interrupt waits for the main thread when the parent's comes: the system wakes another one."""

    def wait_for_a_lock(seed: int) -> None:
        held = threading.Lock()
        held.acquire()
        threading.Thread(target=time.sleep, args=(3600,), daemon=True).start()
        (tmp_path / "player").write_text(str(os.getpid()))
        try:
            (tmp_path / "begun").touch()  # from here on it may be interrupted
            held.acquire()
        except KeyboardInterrupt:
            (tmp_path / "told").touch()
            raise

    def shoot() -> None:
        await_file(tmp_path / "begun")
        child = int((tmp_path / "player").read_text())
        os.kill(child, signal.SIGSTOP)
        for pid, number in ((child, signal.SIGINT), (os.getpid(), signal.SIGINT)):
            before = signals_waiting(child)
            os.kill(pid, number)
            while signals_waiting(child) == before:
                time.sleep(0.02)
        os.kill(child, signal.SIGCONT)

    threading.Thread(target=shoot).start()
    with pytest.raises(KeyboardInterrupt):
        played(wait_for_a_lock, tmp_path)
    assert (tmp_path / "told").exists()


CALLER = """
import os, sys, time
from pathlib import Path
sys.path.insert(0, {root!r})
import tests.play.test_supervision as t
folder = Path({folder!r})
def act(seed):
    t.settle(folder)
    (folder / "player").write_text(str(os.getpid()))
    (folder / "begun").touch()
    time.sleep(3600)
t.played(act, folder, (1,))
"""


def test_nothing_outlives_a_killed_caller(tmp_path: Path) -> None:
    code = CALLER.format(root=str(Path(__file__).parents[2]), folder=str(tmp_path))
    caller = subprocess.Popen([sys.executable, "-c", code])
    await_file(tmp_path / "begun")
    below = [settled(tmp_path), int((tmp_path / "player").read_text())]
    assert all(map(runs, below))
    caller.kill()
    caller.wait()
    while any(map(runs, below)):  # for ever, if it did not hold
        time.sleep(0.02)


def test_who_writes_without_end_keeps_the_parent_from_nothing_else(monkeypatch, capsys):
    raw = RawOutput()
    raw.begin()
    monkeypatch.setattr("lingjing.play.raw_output.os.read", lambda descriptor, size: b"\x1b[2Jy\n")
    raw.pass_on()  # comes back though there is always more
    monkeypatch.undo()
    shown = capsys.readouterr().err
    assert shown.count("\\x1b[2Jy\n") > 1 and "\x1b" not in shown
    raw.pass_on()  # nobody writes any more: the end is seen, and nothing is waited for from then on
    assert raw.descriptor is None
