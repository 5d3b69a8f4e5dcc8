"""Branches of a trace: null forks, repairs by the truth, changed messages, reasons against branching, and no processes
left.
"""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

import lingjing
from lingjing import Trace, run
from lingjing import read as read_trace
from lingjing.causal.blame import Blame, BlameOptions, blame
from lingjing.causal.branch_host import BranchHost
from lingjing.causal.branching import BranchResult, NullFork
from lingjing.causal.interventions import BranchPlan, check
from lingjing.causal.message_value import message_values
from lingjing.causal.redriven import BranchOptions
from lingjing.causal.result_texts import blame_text, branch_text, window_text
from lingjing.errors import ExitCode, InfrastructureError, UsageError
from lingjing.testing import mission_file, run_command, shortened
from lingjing.trace.records import Action, Decision, Faculty, MessageChange, Substitution
from tests.causal.erring import ASTRAY_FROM
from tools.python_forks import true_starts

replace = msgspec.structs.replace
ERRING = str(Path(__file__).parent / "erring.py")
PATIENCE_S = 300.0


def played(folder: Path, policy: str, ticks: int = 24) -> Trace:
    short = shortened(mission_file("ssr"), ticks)
    options: dict[str, Any] = {"seed": 1, "mode": "star", "settings": {"uavs": 1, "victims": 2}, "overview": False}
    return read_trace(run(short, policy=f"{ERRING}:{policy}", out=folder, **options).trace)


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """A sea rescue that was lost because the boat left its route."""
    return played(tmp_path_factory.mktemp("lost") / "episode", "Astray")


@pytest.fixture(scope="module")
def host(lost: Trace) -> Iterator[BranchHost]:
    with BranchHost(lost, BranchOptions(trace=str(lost.path), files=(f"{ERRING}:Astray",))) as opened:
        yield opened


def of(faculty: Faculty, agent: str, first: int, last: int | None = None) -> Substitution:
    return Substitution(faculty=faculty, agent=agent, first=first, last=last)


def onset(trace: Trace) -> int:
    """The boundary of the skipper's first command from `ASTRAY_FROM` on."""
    made = ((record.tick - 1, decision) for record in trace.boundaries[1:] for decision in record.decisions)
    return next(
        at for at, decision in made if decision.agent == "skipper" and at >= ASTRAY_FROM and decision.decision.command
    )


def test_a_null_fork_from_any_boundary_equals_the_episode(host: BranchHost, lost: Trace) -> None:
    before = lost.path.read_bytes()
    last = len(lost.boundaries) - 1
    for result in host.play([BranchPlan(at=at) for at in (0, 7, last - 1, last)]):
        assert (result.differs, result.pictures, result.replaced) == (None, 0, ())
        assert lost.outcome is not None and result.digest == lost.outcome.digest
        assert 0.0 < result.fork_s < result.cpu_s
    assert lost.path.read_bytes() == before


def test_only_the_planted_fault_departs_from_the_reference(host: BranchHost, lost: Trace) -> None:
    departures = host.departures()
    assert list(departures) == [("waypoint", "skipper")]
    assert departures["waypoint", "skipper"][0] == onset(lost)


def test_only_an_early_replacement_of_the_faulty_agent_wins(host: BranchHost, lost: Trace) -> None:
    at = onset(lost)
    plans = [
        BranchPlan(at=at, substitutions=(of("waypoint", "skipper", at),)),
        BranchPlan(at=at, substitutions=(of("waypoint", "scout[1]", at), of("execution", "skipper", at))),
        BranchPlan(at=len(lost.boundaries) - 3, substitutions=(of("waypoint", "skipper", len(lost.boundaries) - 3),)),
    ]
    right, other, late = host.play(plans)
    assert right.success and right.score == 1.0 and right.differs == at + 1
    assert {(part.agent, part.faculty) for part in right.replaced} == {("skipper", "waypoint")}
    assert not other.success and other.differs is None and other.replaced == ()
    assert not late.success


def test_a_branch_is_written_as_a_trace_that_equals_the_episode_up_to_its_start(
    host: BranchHost, lost: Trace, tmp_path: Path
) -> None:
    at = onset(lost)
    plan = BranchPlan(at=at, substitutions=(of("waypoint", "skipper", at),), out=str(tmp_path / "branch"))
    (result,) = host.play([plan])
    branch = read_trace(result.path)
    assert lingjing.verify(branch.path).state == "ok"
    assert branch.complete and branch.outcome is not None and branch.outcome.success
    assert branch.outcome.digest == result.digest
    assert branch.boundaries[: at + 1] == lost.boundaries[: at + 1]
    origin = branch.header.branch
    assert origin is not None and lost.header.branch is None
    assert (origin.at, origin.digest) == (at, lost.boundaries[at].digest)
    assert origin.substitutions == plan.substitutions and origin.reference == "oracle"
    assert all(branch.picture(frame).rgb.shape == (1080, 1920, 3) for frame in branch.frames)
    with pytest.raises(UsageError, match="exists already"):
        host.play([plan])


def test_pixels_of_a_written_branch_do_not_change_its_digest(host: BranchHost, tmp_path: Path) -> None:
    look = Decision(command=Action(verb="takePhoto"))
    plan = BranchPlan(at=0, replacements=(("scout[1]", 0, look),), out=str(tmp_path / "branch"))
    written, unwritten = host.play([plan, replace(plan, out="")])
    assert (unwritten.failed, unwritten.digest, unwritten.pictures) == ("", written.digest, written.pictures)
    assert written.pictures > 0
    branch = read_trace(written.path)
    assert branch.picture("f1-uav[1]-nadir").rgb.shape == (1080, 1920, 3)


def test_a_change_of_a_message_affects_only_this_message(host: BranchHost, lost: Trace, tmp_path: Path) -> None:
    edges = [edge for record in lost.boundaries for edge in record.messages]
    edge = next(message for message in edges if message.category == "report" and "position" in message.body)
    body = {"position": (1.0, 2.0, 3.0)}
    changes = {
        "drop": MessageChange(message=edge.id, act="drop"),
        "delay": MessageChange(message=edge.id, act="delay", ticks=2),
        "repeat": MessageChange(message=edge.id, act="repeat", ticks=1),
        "forge": MessageChange(message=edge.id, act="forge", body=body),
        "withhold": MessageChange(message=edge.id, act="withhold"),
    }
    plans = [
        BranchPlan(at=edge.tick - 1, messages=(change,), out=str(tmp_path / name)) for name, change in changes.items()
    ]
    branches = {name: read_trace(message.path) for name, message in zip(changes, host.play(plans), strict=True)}

    def read_at(trace: Trace) -> list[int]:
        boxes = ((record.tick, box) for record in trace.boundaries for box in record.inboxes)
        return [tick for tick, box in boxes if box.agent == edge.recipient and edge.id in box.messages]

    def adjudicated(trace: Trace) -> bool:
        return any(edge.id in event.bindings for record in trace.boundaries for event in record.events)

    assert read_at(lost) == [edge.deliver_at]
    assert read_at(branches["drop"]) == []
    assert read_at(branches["delay"]) == [edge.deliver_at + 2]
    assert read_at(branches["repeat"]) == [edge.deliver_at, edge.deliver_at + 1]
    forged = [
        message for record in branches["forge"].boundaries for message in record.messages if message.id == edge.id
    ]
    assert [message.body["position"] for message in forged] == [body["position"]]
    assert adjudicated(lost) and adjudicated(branches["drop"]) and not adjudicated(branches["withhold"])
    others = [message.id for message in lost.boundaries[edge.tick].messages if message.id != edge.id]
    assert [message.id for message in branches["withhold"].boundaries[edge.tick].messages] == others
    for branch in branches.values():
        assert branch.boundaries[: edge.tick] == lost.boundaries[: edge.tick]


def without_cost(result: Blame) -> Blame:
    return replace(result, cpu_s=0.0, driven_s=0.0, camera_s=0.0)


@pytest.mark.slow
def test_blame_names_agent_faculty_and_boundary(lost: Trace) -> None:
    result = blame(lost, BlameOptions(placebos=3, files=(f"{ERRING}:Astray",), jobs=2))
    (repair,) = result.repairs
    (cause,) = repair.causes
    assert (cause.agent, cause.faculty, cause.boundary) == ("skipper", "waypoint", onset(lost))
    assert result.complete and not result.exhausted
    assert result.null is not None and result.null.identical
    (share,) = result.shares
    assert (share.agent, share.share, share.exact) == ("skipper", 1.0, True)
    assert result.placebos is not None
    assert (result.placebos.same, result.placebos.changed, result.placebos.repaired) == (2, 0, 0)
    text = blame_text(result)
    assert f"waypoint of skipper, from boundary {cause.boundary}" in text
    assert f"lingjing fork {lost.path} --substitute '{window_text(cause)}'" in text
    assert window_text(cause).startswith(f"waypoint:skipper@{cause.first}")


@pytest.mark.thorough
def test_the_result_of_blame_does_not_depend_on_the_number_of_jobs(lost: Trace) -> None:
    options = BlameOptions(placebos=3, files=(f"{ERRING}:Astray",))
    results = [without_cost(blame(lost, replace(options, jobs=jobs))) for jobs in (1, 3)]
    assert results[0] == results[1]


@pytest.mark.study  # opens a separate host for one branch
def test_an_insufficient_budget_is_reported(lost: Trace) -> None:
    result = blame(lost, BlameOptions(branches=1, files=(f"{ERRING}:Astray",)))
    assert result.branches == 1 and result.exhausted and result.repairs == ()
    assert "Nothing was replaced" in blame_text(result)


@pytest.mark.parametrize(
    ("policy", "words"),
    [("Moody", "policy of `scout[1]` makes another decision"), ("Threaded", "run 3 more threads")],
)
def test_irreproducible_and_threaded_policies_are_usage_errors(policy: str, words: str, tmp_path: Path) -> None:
    trace = played(tmp_path / "episode", policy, ticks=4.0)
    options = BranchOptions(trace=str(trace.path), files=(f"{ERRING}:{policy}",), referenced=())
    with pytest.raises(UsageError) as caught, BranchHost(trace, options) as host:
        host.play([BranchPlan(at=3)])
    assert words in str(caught.value)


def test_no_message_is_measured_if_the_null_fork_differs_from_the_episode(lost: Trace) -> None:
    others = {"rescuer": f"{ERRING}:Wavering"}
    values = message_values(lost, BranchOptions(trace=str(lost.path), files=(f"{ERRING}:Astray",), policies=others))
    assert (values.null, values.messages, values.branches) == (NullFork(identical=False, boundary=1), (), 1)


@pytest.fixture(scope="module")
def idle(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Four ticks without any action."""
    return played(tmp_path_factory.mktemp("idle") / "episode", "Unseeing", ticks=4.0)


def of_idle(idle: Trace, policy: str) -> BranchOptions:
    """Branches of the idle episode with other idle policies."""
    files = (f"{ERRING}:Unseeing",)
    return BranchOptions(trace=str(idle.path), files=files, policies={"rescuer": f"{ERRING}:{policy}"}, jobs=2)


def test_policies_that_fail_in_a_branch_are_reported(idle: Trace) -> None:
    plan = BranchPlan(at=1, substitutions=(of("execution", "skipper", 1, 1),))
    with BranchHost(idle, of_idle(idle, "Brittle")) as host:
        (result,) = host.play([plan])
    assert result.unanswered == {"policy_error": 2}
    assert "replaced by doing nothing: 2 answers (policy_error)" in branch_text(idle, plan, result)


def test_a_policy_that_ends_its_process_is_reported_with_the_exit_code(idle: Trace) -> None:
    ended = pytest.raises(InfrastructureError, match=r"has ended \(exit code 7\)")
    with ended as caught, BranchHost(idle, of_idle(idle, "Leaving")) as host:
        host.play([BranchPlan(at=2)])
    assert "a policy or an engine that runs in it may have ended it" in caught.value.hint


def test_a_failed_branch_is_reported_at_once_and_ends_the_other_branches(idle: Trace) -> None:
    with BranchHost(idle, of_idle(idle, "Vanishing")) as host:
        with pytest.raises(InfrastructureError, match="cut short: the process of the branch ended without a result"):
            host.play([BranchPlan(at=2), BranchPlan(at=0)])
        with pytest.raises(InfrastructureError, match="has ended"):
            host.play([BranchPlan(at=2)])
        wait_for(host._process.pid, [])


def test_output_of_policies_is_printed_once_to_standard_error(idle: Trace, capfd: pytest.CaptureFixture[str]) -> None:
    with BranchHost(idle, of_idle(idle, "Printing")) as host:
        host.play([BranchPlan(at=3)])
    output = capfd.readouterr()
    assert output.out == "" and [output.err.count(f"skipper at {tick}\n") for tick in range(4)] == [1, 1, 1, 1]


def test_a_branch_of_a_truncated_trace_is_reported_with_its_last_compared_boundary(idle: Trace) -> None:
    cut = Trace(idle.path, idle.header, idle.boundaries[:3], None, False, idle.places)
    assert "equal to boundary 2, where the trace ends;" in branch_text(cut, BranchPlan(at=1), BranchResult())


def test_two_changes_of_one_message_are_a_usage_error(lost: Trace) -> None:
    edge = next(edge for record in lost.boundaries for edge in record.messages)
    changes = MessageChange(message=edge.id, act="drop"), MessageChange(message=edge.id, act="delay", ticks=1)
    with pytest.raises(UsageError, match=f"`{edge.id}` is changed twice"):
        check(BranchPlan(at=0, messages=changes), lost)


def test_a_replacement_can_begin_after_the_end_of_the_trace_and_within_the_tick_budget(lost: Trace) -> None:
    budget = lost.header.instance.budget.ticks
    short = Trace(lost.path, lost.header, lost.boundaries[:11], lost.outcome, True, lost.places)
    for first in (11, budget):
        check(
            BranchPlan(at=3, substitutions=(of("waypoint", "skipper", 3, 9), of("execution", "skipper", first))), short
        )
    with pytest.raises(UsageError, match=f"no branch has a boundary {budget + 1}"):
        check(BranchPlan(at=3, substitutions=(of("execution", "skipper", budget + 1),)), short)


def test_only_the_reference_receives_the_truth(idle: Trace, tmp_path: Path) -> None:
    trace = idle
    options = BranchOptions(trace=str(trace.path), files=(f"{ERRING}:Unseeing",))
    plan = BranchPlan(at=1, substitutions=(of("execution", "skipper", 1),), out=str(tmp_path / "branch"))
    with BranchHost(trace, options) as host:
        (result,) = host.play([plan])
    assert {(part.agent, part.faculty) for part in result.replaced} == {("skipper", "execution")}
    branch = read_trace(result.path)
    assert not any(made.substituted for record in branch.boundaries for made in record.decisions)
    assert not any(seen.privileged for record in branch.boundaries for seen in record.observations)


def test_no_process_outlives_a_killed_driver(lost: Trace) -> None:
    options = BranchOptions(trace=str(lost.path), files=(f"{ERRING}:Astray",), referenced=())
    with true_starts():
        host = BranchHost(lost, options)
    host.play([BranchPlan(at=2)])
    group = host._process.pid
    assert len(members(group)) > 2  # the driver, the camera, the processes of held boundaries
    os.kill(group, signal.SIGKILL)
    wait_for(group, [])
    host.close()


def test_a_killed_process_of_a_held_boundary_is_reported(idle: Trace) -> None:
    with true_starts(), BranchHost(idle, of_idle(idle, "Unseeing")) as host:
        host.play([BranchPlan(at=2)])
        driver = host._process.pid
        for held in Path(f"/proc/{driver}/task/{driver}/children").read_text().split():
            os.kill(int(held), signal.SIGKILL)
        wait_for(driver, [driver])
        with pytest.raises(InfrastructureError, match="the process that holds boundary 2 for branches has ended"):
            host.play([BranchPlan(at=2)])


def wait_for(group: int, left: list[int]) -> None:
    """Wait until the processes of a group that are not in `left` have ended."""
    until = time.monotonic() + PATIENCE_S
    while members(group) != left and time.monotonic() < until:
        time.sleep(0.01)
    assert members(group) == left


def members(group: int) -> list[int]:
    """Return the living processes of a process group."""
    pids = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[2]) == group and fields[0] not in "ZX":
                pids.append(int(entry.name))
    return pids


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--at", "99"], "there is no boundary 99"),
        (["--at", "x"], "a boundary is a whole number"),
        ([], "the boundary of the branch is missing"),
        (["--at", "3", "--substitute", "perceptoin"], "did you mean `perception`?"),
        (["--at", "3", "--substitute", "perception:skipper"], "`skipper` has no perception"),
        (["--at", "3", "--substitute", "perception:nobody"], "there is no agent `nobody`"),
        (["--at", "24", "--substitute", "waypoint"], "the episode has ended at boundary 24"),
        (["--drop", "m99-1"], "there is no message `m99-1`"),
        (["--at", "3", "--substitute", "waypoint", "--reference", "random"], "this policy is not privileged"),
        (["--at", "3"], "there is no policy file `erring.py`"),
        (["--at", "3", "--substitute", "waypoint:"], "there is no agent ``"),
        (["--at", "3", "--substitute", "waypoint", "--until", "2"], "--until 2: no faculty is replaced there"),
        (["--at", "3", "--until", "5"], "--until 5: no faculty is replaced there"),
        (["--substitute", "waypoint@3", "--until", "5"], "--until 5: no faculty is replaced there"),
        (["--substitute", "waypoint@9-3"], "--substitute waypoint@9-3: `9-3` is not a range of boundaries"),
        (["--substitute", "waypoint@"], "--substitute waypoint@: `` is not a range of boundaries"),
        (["--at", "4", "--substitute", "waypoint@3-"], "--substitute waypoint@3-: the branch begins at boundary 4"),
        (["--at", "3", "--substitute", "waypoint@99"], "no branch has a boundary 99"),
        (["--at", "3", "--policy", "none.py:Astray"], "--policy none.py:Astray: there is no file `none.py`"),
        (["--at", "3", "-o", "."], "`.` is not empty"),
        (["--at", "3", "-o", "trace.mcap"], "`trace.mcap` is a file, not a folder"),
    ],
)
def test_wrong_fork_options_give_one_message(
    options: list[str], words: str, lost: Trace, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(lost.path.parent)
    policy = [] if "policy file" in words else ["--policy", f"{ERRING}:Astray"]
    assert run_command(["fork", str(lost.path), *options, *policy]) == ExitCode.USAGE
    message = capsys.readouterr().err
    assert words in message and message.count("error:") == 1


def test_the_value_command_has_no_reference_option(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        run_command(["value", "trace.mcap", "--reference", "random"])
    assert "unrecognized arguments: --reference" in capsys.readouterr().err


def test_the_fork_command_reports_both_outcomes_and_the_replacements(
    lost: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = onset(lost)
    windows = ["--substitute", f"waypoint:skipper@{at}-", "--substitute", f"execution:skipper@{at - 2}-{at - 1}"]
    options = ["--policy", f"{ERRING}:Astray", *windows, "-o", str(tmp_path / "out")]
    assert run_command(["fork", str(lost.path), *options]) == ExitCode.OK
    output = capsys.readouterr().out
    assert "lost (budget) after 24 ticks" in output
    assert f"boundary {at - 2}, waypoint of skipper from {at} on, execution of skipper until {at - 1}: won" in output
    assert f"replaced: waypoint of skipper at {at}" in output
    assert run_command(["verify", str(tmp_path / "out" / "trace.mcap")]) == ExitCode.OK


def test_an_older_trace_without_motions_of_verbs_is_rejected(lost: Trace) -> None:
    """Without motions, policies and faculties would take every command for a standstill."""
    instance = lost.header.instance
    silent = tuple(
        replace(entity, verbs=tuple(replace(verb, motion="") for verb in entity.verbs)) for entity in instance.entities
    )
    header = replace(lost.header, instance=replace(instance, entities=silent))
    older = Trace(lost.path, header, lost.boundaries, lost.outcome, False, lost.places)
    with pytest.raises(UsageError, match="an older version wrote it without the motion of `"):
        blame(older, BlameOptions(files=(f"{ERRING}:Astray",)))


def test_blame_rejects_an_episode_that_was_cut_short(lost: Trace) -> None:
    cut = Trace(lost.path, lost.header, lost.boundaries[:4], None, False, lost.places)
    with pytest.raises(UsageError, match="was cut short"):
        blame(cut)
