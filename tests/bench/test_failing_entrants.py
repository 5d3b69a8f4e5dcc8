"""Failing entrants lose their own episodes: they do not end the suite, and no error gives them an advantage."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from lingjing.bench.exports import to_markdown
from lingjing.bench.unresolved import unresolved_entrants
from lingjing.cli.bench import KINDS
from lingjing.errors import ExitCode
from lingjing.play.policy_processes.barrier import LOAD_VARIABLE
from lingjing.processes.descendants import children
from lingjing.testing import run_command
from tests.bench.suite_kit import TRIP, SuiteRow, leaderboard, make_tables, read_results
from tests.play.report_kit import POLICY_FAILED

ENTRANTS = """\
import os
import time
from pathlib import Path
from lingjing.plugins.policy import Action, Decision, InfrastructureError, UsageError


class Drives:
    def __init__(self):
        self.build()

    def build(self): ...
    def begin(self): ...

    async def reset(self, brief):
        self.begin()

    async def act(self, observation, inbox):
        return Decision(command=Action(verb="moveTo", arguments={"x": 12.4, "y": -1299.8}))


class Blames(Drives):
    async def act(self, observation, inbox):
        raise InfrastructureError("the network is gone")


class BuildHangs(Drives):
    def build(self):
        time.sleep(3600)


class BuildExits(Drives):
    def build(self):
        os._exit(3)


class BuildRaises(Drives):
    def build(self):
        raise RuntimeError("no weights")


class BuildRefuses(Drives):
    def build(self):
        raise UsageError("not with me")


class BuildBlames(Drives):
    def build(self):
        raise InfrastructureError("the network is gone")


class ResetHangs(Drives):
    def begin(self):
        time.sleep(3600)


class ResetExits(Drives):
    def begin(self):
        os._exit(4)


class ResetBlames(Drives):
    def begin(self):
        raise InfrastructureError("the network is gone")


class SecondReset(Drives):
    def begin(self):
        mark = Path(__file__).with_name("begun")
        if mark.exists():
            raise RuntimeError("once is enough")
        mark.touch()
"""

SECOND_IMPORT = """\
import os
from pathlib import Path

mark = Path(__file__).with_name("read")
if mark.exists():
    os._exit(6)
mark.touch()


class SecondImport:
    async def reset(self, brief): ...
    async def act(self, observation, inbox): ...
"""

DETAILS = {
    "BuildHangs": r"the policy `.*:BuildHangs` of `skipper` was not loaded within 2 s",
    "BuildExits": r"the policy `.*:BuildExits` of `skipper` could not be loaded: its process ended \(exit code 3\)",
    "BuildRaises": r"policy `entrants.py:BuildRaises` cannot be built: .*no weights",
    "BuildRefuses": r"not with me",
    "BuildBlames": r"the network is gone",
    "ResetHangs": r"the policy of `skipper` failed in `reset`: no answer within 8 s",
    "ResetExits": r"the policy of `skipper` failed in `reset`: its process ended \(exit code 4\)",
    "ResetBlames": r"the policy of `skipper` failed in `reset`: InfrastructureError: the network is gone",
    "SecondImport": r"policy `.*second.py` could not be loaded: its process ended \(exit code 6\)",
}
"""The entrants that prevent the start of their episodes, and the details of their rows."""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "trip.ljs").write_text(TRIP)
    (tmp_path / "entrants.py").write_text(ENTRANTS)
    (tmp_path / "second.py").write_text(SECOND_IMPORT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(LOAD_VARIABLE, "2")
    return tmp_path


def test_entrants_that_fail_lose_their_own_episodes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["Blames", *DETAILS, "Drives"]
    suite = 'suite = 1\nname = "trips"\nmissions = ["trip.ljs"]\nseeds = 1\n'
    for name in names:
        spec = "second.py" if name == "SecondImport" else f"entrants.py:{name}"
        suite += f'[[entrants]]\nname = "{name}"\npolicy = "{spec}"\n'
    (folder / "suite.toml").write_text(suite)
    known = set(children())
    assert run_command(["bench", "suite.toml", "-o", "out", "--no-isolate"]) == ExitCode.OK
    assert set(children()) == known
    shown = capsys.readouterr()
    rows = {row.entrant: row for row in read_results(folder / "out")}
    assert set(rows) == set(names)
    assert {(row.standing, row.tries) for row in rows.values()} == {("counted", 1)}
    assert rows["Drives"].report.reason == "success"
    assert _ending(rows["Blames"]) == ("budget", False)
    for name, detail in DETAILS.items():
        report = rows[name].report
        assert _ending(rows[name]) == (POLICY_FAILED, False), name
        assert re.match(detail, report.detail), report.detail
        assert (report.trace, report.metrics, report.family) == ("", None, "unattributed")
        assert f"{name}, trip-broadcast, seed 0: policy-failure: {report.detail}\n" in shown.err
    assert "| Drives | **100** | **100** |" in shown.out
    assert f"{len(DETAILS)} did not begin, because a policy failed, and count as failures: BuildBlames" in shown.out
    assert run_command(["bench", "table", "out", "--kind", *KINDS]) == ExitCode.OK
    page = leaderboard(tuple(rows.values()))
    assert page.index("Drives") < min(page.index(name) for name in names if name != "Drives")
    capsys.readouterr()
    (folder / "read").unlink()
    assert run_command(["bench", "suite.toml", "-o", "out", "--no-isolate"]) == ExitCode.OK
    assert f"trips: {len(names)} episodes done, 0 to play" in capsys.readouterr().err


STRIKING = """\
import os
import signal
from pathlib import Path
from lingjing.plugins.policy import Action, Decision


def below(pid):
    "The processes below a process."
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        yield int(child)
        yield from below(child)


def siblings():
    "The processes of the episode: the player, and the world below a process that forks worlds."
    return [pid for pid in below(os.getppid()) if pid != os.getpid()]


def players():
    "The processes that write a trace."
    for pid in siblings():
        if any("trace.mcap" in os.readlink(descriptor) for descriptor in Path(f"/proc/{pid}/fd").iterdir()):
            yield pid


class Strikes:
    "Wins but for the first time, when it ends its own episode."

    def __init__(self):
        self.strike_once("build")

    def strike_once(self, at):
        mark = Path(__file__).with_name(f"{type(self).__name__}-{at}")
        if at == getattr(self, "at", "act") and not mark.exists():
            mark.touch()
            self.strike()

    def strike(self): ...

    async def reset(self, brief):
        self.strike_once("reset")

    async def act(self, observation, inbox):
        self.strike_once("act")
        return Decision(command=Action(verb="moveTo", arguments={"x": 12.4, "y": -1299.8}))


class Interrupts(Strikes):
    def strike(self):
        for pid in list(players()):
            os.kill(pid, signal.SIGTERM)


class InterruptsEarly(Strikes):
    at = "build"

    def strike(self):
        for pid in siblings():
            os.kill(pid, signal.SIGTERM)


class Kills(Strikes):
    def strike(self):
        for pid in list(players()):
            os.kill(pid, signal.SIGKILL)


class KillsWorld(Strikes):
    def strike(self):
        for pid in set(siblings()) - set(players()):
            os.kill(pid, signal.SIGKILL)
"""

STOPPING = """

class Stops(Strikes):
    "Stops all processes of its episode, and those from which further ones are forked."
    def strike(self):
        server = os.getppid()
        for pid in [*siblings(), server]:
            os.kill(pid, signal.SIGSTOP)
"""

STRIKES = ("Interrupts", "InterruptsEarly", "Kills", "KillsWorld")


def test_an_entrant_that_ends_its_own_episode_gains_nothing_by_the_second_try(folder: Path) -> None:
    """Each episode is played again, none is left out, and the worst case counts the second try as a failure."""
    (folder / "striking.py").write_text(STRIKING)
    suite = 'suite = 1\nname = "trips"\nmissions = ["trip.ljs"]\nseeds = 1\n'
    for name in ("Strikes", *STRIKES):
        suite += f'[[entrants]]\nname = "{name}"\npolicy = "striking.py:{name}"\n'
    (folder / "suite.toml").write_text(suite)
    assert run_command(["bench", "suite.toml", "-o", "out", "--no-isolate"]) == ExitCode.OK
    rows = read_results(folder / "out")
    tries = {name: [row for row in rows if row.entrant == name] for name in ("Strikes", *STRIKES)}
    assert [row.standing for row in tries["Strikes"]] == ["counted"]
    for name in STRIKES:
        assert [row.standing for row in tries[name]] == ["aborted", "counted"], name
        alone = [*tries["Strikes"], *tries[name]]
        assert unresolved_entrants(alone) == {name}, tries[name][0].report.detail
        assert f"| {name} ‡ | 100 (0..100) |" in to_markdown(make_tables(alone, ("success",))[0])


def test_an_entrant_that_stops_the_processes_of_its_suite_does_not_end_it(folder: Path) -> None:
    """They are continued. Otherwise the user would have to interrupt the suite, and the episode would begin again."""
    (folder / "striking.py").write_text(STRIKING + STOPPING)
    suite = 'suite = 1\nname = "trips"\nmissions = ["trip.ljs"]\nseeds = 2\n'
    for name in ("Stops", "Strikes"):
        suite += f'[[entrants]]\nname = "{name}"\npolicy = "striking.py:{name}"\n'
    (folder / "suite.toml").write_text(suite)
    assert run_command(["bench", "suite.toml", "-o", "out", "--no-isolate"]) == ExitCode.OK
    assert (folder / "Stops-act").exists()
    rows = read_results(folder / "out")
    assert [(row.standing, row.tries, row.report.success) for row in rows] == [("counted", 1, True)] * 4


LATER_PRIVILEGED = """\
from pathlib import Path

mark = Path(__file__).with_name("read")


class Later:
    privileged = mark.exists()

    async def reset(self, brief): ...
    async def act(self, observation, inbox): ...


mark.touch()
"""


def test_an_entrant_with_any_policy_that_sees_the_truth_is_marked_as_privileged(folder: Path) -> None:
    """Also by a policy for a single role, and by one that declares it after the suite was read."""
    (folder / "later.py").write_text(LATER_PRIVILEGED)
    (folder / "suite.toml").write_text(
        'suite = 1\nname = "trips"\nmissions = ["trip.ljs"]\nseeds = 1\n'
        '[[entrants]]\nname = "helped"\npolicy = "entrants.py:Drives"\npolicies_for = { rescuer = "oracle" }\n'
        '[[entrants]]\npolicy = "later.py"\n'
        '[[entrants]]\nname = "fair"\npolicy = "entrants.py:Drives"\n'
    )
    assert run_command(["bench", "suite.toml", "-o", "out", "--no-isolate"]) == ExitCode.OK
    marked = {row.entrant: row.privileged for row in read_results(folder / "out")}
    assert marked == {"helped": True, "later.py:Later": True, "fair": False}


def _ending(row: SuiteRow) -> tuple[str, bool]:
    return row.report.reason, row.report.success


def test_a_policy_file_that_cannot_be_loaded_is_reported_before_any_episode(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "read").touch()
    (folder / "suite.toml").write_text(
        'suite = 1\nname = "t"\nmissions = ["trip.ljs"]\nseeds = 1\n[[entrants]]\npolicy = "second.py"\n'
    )
    assert run_command(["bench", "suite.toml", "-o", "out", "--no-isolate"]) == ExitCode.USAGE
    assert f"entrants[0].policy: policy `{folder}/second.py` could not be loaded" in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_a_later_seed_that_does_not_begin_is_lost_and_the_other_seeds_count(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["run", "trip.ljs", "--policy", "entrants.py:SecondReset", "--no-overview"]
    assert run_command([*command, "--seeds", "1-2", "-o", "out"]) == ExitCode.USAGE
    shown = capsys.readouterr()
    assert "TSR 0.50 (1 of 2), SCR 0.50" in shown.out
    assert re.search(r"^\d\tno\tpolicy-failure\t0.00\t0\t-$", shown.out, re.M)
    (line,) = re.findall(r"^error: seed \d did not begin: (.*)$", shown.err, re.M)
    assert re.fullmatch(r"the policy of .* failed in `reset`: RuntimeError: once is enough \(entrants.py:\d+\)", line)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_the_first_seed_that_does_not_begin_ends_the_command(
    jobs: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["run", "trip.ljs", "--policy", "entrants.py:BuildRaises", "--no-overview", "-j", jobs]
    assert run_command([*command, "--seeds", "1-9", "-o", "out"]) == ExitCode.USAGE
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: policy `entrants.py:BuildRaises` cannot be built: ")
    assert not (folder / "out").exists()


def test_json_names_an_episode_that_did_not_begin(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["run", "trip.ljs", "--policy", "entrants.py:BuildBlames", "--no-overview", "--json"]
    assert run_command([*command, "-o", "out"]) == ExitCode.USAGE
    shown = capsys.readouterr()
    report = json.loads(shown.out)
    assert (report["reason"], report["success"], report["detail"]) == (POLICY_FAILED, False, "the network is gone")
    assert shown.err.startswith("error: the network is gone\n")
    assert not (folder / "out").exists()
