"""The examination of policies in files: once in a run for each state of the files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from lingjing import PlayOptions
from lingjing import read as read_trace
from lingjing.errors import ForeignCodeError, InfrastructureError
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.policy_processes.examination import examine
from lingjing.play.policy_processes.messages import PoliciesExamined
from lingjing.play.policy_processes.preloading import SERVES
from lingjing.play.policy_processes.servers import OpenServer
from lingjing.processes import kept_results
from lingjing.processes.fork_client import ForkServer, ForkServerClient
from tests.play.test_policy_options import MISSION

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

POLICY = """\
import os
from pathlib import Path
from lingjing.plugins.policy import Decision

with Path(__file__).with_name("imports").open("a") as file:
    file.write("x")


class Waiting:
    privileged = {privileged}

    def __init__(self, word: str = "") -> None: ...

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        return Decision()
"""


@pytest.fixture(autouse=True)
def empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_results, "_results", {})


@pytest.fixture(scope="module")
def server() -> Iterator[ForkServerClient]:
    with ForkServer(SERVES) as started:
        client = started.client()
        yield client
        client.close()


@pytest.fixture
def policy(tmp_path: Path) -> Path:
    file = tmp_path / "waiting.py"
    file.write_text(POLICY.format(privileged=False))
    return file


def imports(folder: Path) -> int:
    """Return the number of processes that have executed the policy's file."""
    return len((folder / "imports").read_text())


def examined(policy: Path, server: ForkServerClient, **arguments: str) -> PoliciesExamined:
    return examine([str(policy)], arguments, OpenServer(server), whole=True)


def test_the_episodes_of_a_run_share_an_examination(policy: Path, tmp_path: Path) -> None:
    """The second of three episodes starts one process fewer; the third one finds another file."""
    (tmp_path / "boat.ljs").write_text(MISSION)
    options = PlayOptions(mission=str(tmp_path / "boat.ljs"), policy=str(policy), overview=False)

    def tasks() -> Iterator[EpisodeTask]:
        for number in range(3):
            if number == 2:
                policy.write_text(POLICY.format(privileged=True))
            yield EpisodeTask(options, tmp_path / str(number))

    counts, privileged, digests = [], [], []
    for _, report in play_apart(tasks(), jobs=1):
        assert report.reason == "budget", report.detail
        counts.append(imports(tmp_path))
        (binding,) = read_trace(report.trace).header.bindings
        privileged.append(binding.privileged)
        digests.append(report.digest)
    assert counts == [2, 3, 5]
    assert privileged == [False, False, True]
    assert digests[0] == digests[1]


def test_an_examination_is_reused_only_for_equal_options(policy: Path, server: ForkServerClient) -> None:
    first = examined(policy, server, word="sesame")
    assert examined(policy, server, word="sesame") == first
    assert imports(policy.parent) == 1
    assert first.found[str(policy)].arguments == {"word": "sesame"}
    assert examined(policy, server, word="other").found[str(policy)].arguments == {"word": "other"}
    assert imports(policy.parent) == 2


def test_a_kept_examination_holds_no_value_of_an_option(policy: Path, server: ForkServerClient) -> None:
    """The processes of all policies of a run can read kept results, and an option may be a secret."""
    examined(policy, server, word="sesame")
    (kept,) = kept_results._results.items()
    assert b"word" in kept[1] and b"sesame" not in kept[0] + kept[1]


def test_an_examination_with_errors_is_repeated(policy: Path, server: ForkServerClient, tmp_path: Path) -> None:
    assert examined(policy, server, wrod="x").errors
    policy.write_text(f"open({str(tmp_path / 'there')!r})\n" + policy.read_text())
    (error,) = examined(policy, server).errors
    assert error.kind == ForeignCodeError.__name__
    (tmp_path / "there").touch()
    assert not examined(policy, server).errors
    assert len(kept_results._results) == 1


def test_a_missing_file_is_examined_and_refused(server: ForkServerClient, tmp_path: Path) -> None:
    (error,) = examined(tmp_path / "missing.py", server).errors
    assert error.message.startswith("there is no policy file")


def test_an_examination_that_cannot_be_kept_is_used(
    policy: Path, server: ForkServerClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(key: bytes, result: bytes) -> None:
        raise InfrastructureError("no memory")

    monkeypatch.setattr(server, "keep_result", fail)
    assert [*examined(policy, server).found] == [str(policy)]
