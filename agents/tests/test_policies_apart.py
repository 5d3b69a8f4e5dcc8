"""The reference policies decide equally in processes of their own and in the caller's: one digest."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import pytest

from agents.tests.chat_server import serve
from agents.tests.test_recorded_calls import ARGUMENTS, TEXT, decisions, looking, play
from lingjing import EpisodeReport, Session
from lingjing.play.policy_processes.preloading import PRELOAD, SERVES
from lingjing.play.policy_processes.servers import OpenServer
from lingjing.processes.fork_client import ForkServer, ForkServerClient
from lingjing.testing import recorded_calls, shortened


@pytest.fixture(scope="module")
def server() -> Iterator[ForkServerClient]:
    with ForkServer(SERVES) as started:
        started.call(PRELOAD, json.dumps(["heuristic", "oracle", "random", "react", "scripted"]))
        client = started.client()
        yield client
        client.close()


@pytest.fixture(scope="module")
def apart(server: ForkServerClient) -> Iterator[Session]:
    """A session with policies in processes of their own. All episodes share its workers."""
    with Session(policy_server=OpenServer(server)) as session:
        yield session


@pytest.fixture(scope="module")
def here() -> Iterator[Session]:
    """A session with policies in the process of the tests. All episodes share its workers."""
    with Session() as session:
        yield session


@pytest.fixture(autouse=True)
def key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TEST_KEY", "sk-a-planted-key-4711-0815")


COLUMNS = [
    ("ssr", "star", "heuristic"),
    ("ssr", "broadcast", "random"),
    ("ssr", "broadcast", "oracle"),
    pytest.param("cd", "star", "oracle", marks=pytest.mark.thorough),
    pytest.param("ld", "star", "heuristic", marks=pytest.mark.thorough),
]
"""Each reference policy that draws or follows rules, and bodies in the air, on the water and on the ground."""


@pytest.mark.parametrize(("mission", "mode", "policy"), COLUMNS)
def test_the_digest_is_the_same_in_the_caller_and_in_own_processes(
    mission: str, mode: str, policy: str, apart: Session, here: Session, tmp_path: Path
) -> None:
    if mission in ("cd", "ld") and find_spec("libsumo") is None:
        pytest.skip("the road engine is an optional extra")
    text = shortened(mission, 6 if mission == "ssr" else 3)
    options = {"policy": policy, "mode": mode, "seed": 1, "overview": False}
    first = apart.run(text, out=tmp_path / "apart", **options)
    second = here.run(text, out=tmp_path / "here", **options)
    assert first.metrics is not None and first.metrics.substitutions == 0
    assert (first.digest, first.frames_digest, first.ticks) == (second.digest, second.frames_digest, second.ticks)


@pytest.fixture
def glance(tmp_path: Path) -> Path:
    mission = tmp_path / "glance.ljs"
    mission.write_text(TEXT)
    return mission


def test_a_script_decides_the_same_in_an_own_process(
    apart: Session, here: Session, glance: Path, tmp_path: Path
) -> None:
    script = tmp_path / "script.json"
    commands = {"0": {"command": {"verb": "takeoff"}}, "1": {"command": {"verb": "takePhoto"}}}
    script.write_text(json.dumps({"scout[1]": commands}))
    options = {"policy": "scripted", "policy_args": {"script": str(script)}, "overview": False, "seed": 1}
    first = apart.run(glance, out=tmp_path / "apart", **options)
    second = here.run(glance, out=tmp_path / "here", **options)
    assert (first.digest, first.frames_digest) == (second.digest, second.frames_digest)


@dataclass
class Asking:
    """A mission with an agent that calls a model, a session that plays it in processes, and the model's service."""

    mission: Path
    session: Session
    url: str
    close_service: Callable[[], None]

    def play(self, out: Path, **changes: object) -> EpisodeReport:
        options = {"policy": "react", "policy_args": {**ARGUMENTS, "base_url": self.url}, "overview": False}
        return self.session.run(self.mission, out=out, **{**options, **changes})  # type: ignore[arg-type]


@pytest.fixture
def asking(apart: Session, glance: Path) -> Iterator[Asking]:
    with ExitStack() as stack:
        service = stack.enter_context(serve(looking()))
        yield Asking(glance, apart, service.url, stack.close)


def test_recorded_calls_replay_in_the_caller_and_in_own_processes(asking: Asking, tmp_path: Path) -> None:
    """A record that is made in a policy process is replayed in the caller without a service, and vice versa."""
    apart = asking.play(tmp_path / "apart")
    asking.close_service()
    replaying = {"calls": "replay", "calls_from": tmp_path / "apart"}
    here = play(asking.mission, tmp_path / "here", asking.url, **replaying)
    again = asking.play(tmp_path / "again", calls="replay", calls_from=tmp_path / "here")
    assert apart.digest == here.digest == again.digest
    assert decisions(apart) == decisions(here) == decisions(again)
    assert again.warnings == here.warnings
    counts = [len(recorded_calls(tmp_path / name)) for name in ("apart", "here", "again")]
    assert len(set(counts)) == 1 and counts[0] > 8


def test_limits_of_spending_hold_for_all_processes(asking: Asking, tmp_path: Path) -> None:
    report = asking.play(tmp_path / "apart", max_tokens=1)
    assert report.reason == "infrastructure-abort"
    assert report.detail.startswith("tokens: the limit of 1 does not cover another call")
