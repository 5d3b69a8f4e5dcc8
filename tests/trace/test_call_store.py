"""The record of model calls: single storage of contents, the file of a killed process, and rejected files."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path

import pytest

from lingjing.errors import InfrastructureError, UsageError
from lingjing.testing import run_command
from lingjing.trace import call_store
from lingjing.trace.call_store import CALLS_NAME, PACKED_NAME, CallReader, CallStore, calls_of, pack
from lingjing.trace.calls import CalledEpisode, CallRequest, CallResult, sha256

EPISODE = CalledEpisode(mission="ssr", mode="star", seed=3)
PICTURE = b"\xff\xd8" + bytes(range(256)) * 40


def question(tick: int, *texts: str, number: int = 0, pictures: tuple[bytes, ...] = ()) -> CallRequest:
    messages = [{"role": "user", "content": text} for text in texts]
    shown = [{"type": "picture", "sha256": sha256(picture).hex()} for picture in pictures]
    if shown:
        messages.append({"role": "user", "content": [{"type": "text", "text": "look"}, *shown]})
    return CallRequest(
        tick=tick,
        number=number,
        head=b'{"model":"m"}',
        messages=tuple(json.dumps(message).encode() for message in messages),
        pictures=pictures,
    )


def test_stored_calls_are_read_back(tmp_path: Path) -> None:
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)
    request = question(1, "hello", pictures=(PICTURE,))
    store.begin("scout", request)
    store.end("scout", request, CallResult(text="hi", prompt_tokens=5, cost_usd=0.5))
    store.close()
    assert [path.name for path in tmp_path.iterdir()] == [CALLS_NAME]
    reader = CallReader(calls_of(tmp_path / "trace.mcap"))
    assert reader.episode == EPISODE
    (call,) = reader.calls()
    assert (call.agent, call.tick, call.number, call.head, call.messages) == (
        "scout",
        1,
        0,
        request.head,
        request.messages,
    )
    assert call.result == CallResult(text="hi", prompt_tokens=5, cost_usd=0.5)
    assert [reader.content(bytes.fromhex(name)) for name in call.pictures] == [PICTURE]
    assert reader.find("scout", 1, 0) == call
    assert reader.find("scout", 1, 1) is None
    assert list(reader.calls(agent="boat")) == list(reader.calls(tick=2)) == []


def test_each_content_is_stored_once(tmp_path: Path) -> None:
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)
    long = "the rules " * 10_000
    for tick in range(100):
        for agent in ("a", "b", "c"):
            request = question(tick, long, *(f"turn {turn}" for turn in range(tick)), pictures=(PICTURE,))
            store.begin(agent, request, CallResult(text="ok"))
    store.close()
    assert (tmp_path / CALLS_NAME).stat().st_size < 4 * len(long) + 2_000_000
    with sqlite3.connect(tmp_path / CALLS_NAME) as file:
        assert file.execute("SELECT count(*) FROM content").fetchone() == (1 + 1 + 99 + 1 + 1,)


def test_a_call_without_a_result_at_the_end_is_marked_as_abandoned(tmp_path: Path) -> None:
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)
    request = question(0, "are you there")
    store.begin("scout", request)
    store.close()
    store.end("scout", request, CallResult(text="too late"))
    (call,) = CallReader(tmp_path / CALLS_NAME).calls()
    assert call.result is not None
    assert (call.result.fault, call.result.text) == ("abandoned", "")


KILLED = """
import os, sys
from pathlib import Path
from tests.trace.test_call_store import EPISODE, question
from lingjing.trace.call_store import CallStore
from lingjing.trace.calls import CallResult
store = CallStore(Path(sys.argv[1]), EPISODE)
tick = 0
while True:
    request = question(tick, "x" * 5000, str(tick))
    store.begin("scout", request)
    print(tick, flush=True)
    store.end("scout", request, CallResult(text=str(tick)))
    tick += 1
"""


def test_a_killed_process_leaves_complete_records(tmp_path: Path) -> None:
    path = tmp_path / CALLS_NAME
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", KILLED, str(path)]
    here = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=root, env=here) as child:
        assert child.stdout is not None
        begun = -1
        for line in child.stdout:
            begun = int(line)
            if begun == 200:
                child.send_signal(signal.SIGKILL)
                break
        begun = max([begun, *map(int, child.stdout.read().split())])
    calls = list(CallReader(path).calls())
    assert [call.tick for call in calls] == list(range(len(calls)))
    assert len(calls) in (begun + 1, begun + 2)
    answered = [call for call in calls if call.result is not None]
    assert len(answered) >= begun
    assert all(call.result.text == str(call.tick) for call in answered if call.result)


def test_many_threads_can_store_calls(tmp_path: Path) -> None:
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)

    def ask(agent: str) -> None:
        for tick in range(50):
            store.begin(agent, question(tick, "same", agent))
            store.end(agent, question(tick, "same", agent), CallResult(text=f"{agent}{tick}"))

    threads = [threading.Thread(target=ask, args=(f"a{number}",)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    store.close()
    calls = list(CallReader(tmp_path / CALLS_NAME).calls())
    assert len(calls) == 400
    assert all(call.result and call.result.text == f"{call.agent}{call.tick}" for call in calls)


def test_a_call_that_cannot_be_stored_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InfrastructureError, match="cannot record a model call"):
        CallStore(tmp_path / "missing" / CALLS_NAME, EPISODE)
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)
    with pytest.raises(InfrastructureError, match="exists"):
        CallStore(tmp_path / CALLS_NAME, EPISODE)
    store.begin("scout", question(0, "hello"))
    with pytest.raises(InfrastructureError, match="UNIQUE") as refused:
        store.begin("scout", question(0, "again"))
    monkeypatch.setattr(call_store, "MOST_BYTES", 10_000)
    with pytest.raises(InfrastructureError, match="more than") as too_large:
        store.begin("scout", question(1, "x" * 20_000))
    assert (refused.value.cause, too_large.value.cause) == ("call-record", "call-record")  # a policy can do both
    store.close()
    (call,) = CallReader(tmp_path / CALLS_NAME).calls()
    assert (call.tick, call.messages) == (0, question(0, "hello").messages)


def test_a_full_disk_is_an_error_and_stored_calls_remain(tmp_path: Path) -> None:
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)
    store.begin("scout", question(0, "hello"), CallResult(text="hi"))
    store._file.execute("PRAGMA max_page_count = 64")  # SQLite then raises the error of a full disk
    with pytest.raises(InfrastructureError, match="full"):
        for tick in range(1, 100):
            store.begin("scout", question(tick, str(tick) * 10_000))
    store.close()
    assert next(iter(CallReader(tmp_path / CALLS_NAME).calls())).result == CallResult(text="hi")


@pytest.mark.parametrize("data", [b"", b"no database", b"SQLite format 3\0" + bytes(84), bytes(4096)])
def test_a_file_of_another_kind_is_an_error(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / CALLS_NAME
    path.write_bytes(data)
    with pytest.raises(UsageError, match="record of model calls"):
        CallReader(path)


def test_a_foreign_database_another_format_and_changed_contents_are_errors(tmp_path: Path) -> None:
    path = tmp_path / CALLS_NAME
    with sqlite3.connect(path) as file:
        file.execute("CREATE TABLE episode (about)")
    with pytest.raises(UsageError, match="is no record"):
        CallReader(path)
    path.unlink()
    store = CallStore(path, EPISODE)
    store.begin("scout", question(0, "hello"), CallResult(text="hi"))
    store.close()
    with sqlite3.connect(path) as file:
        file.execute(
            "UPDATE content SET data = ? WHERE data = ?", (b'{"role":"user"}', question(0, "hello").messages[0])
        )
    with pytest.raises(UsageError, match="changed or cut short"):
        list(CallReader(path).calls())
    with sqlite3.connect(path) as file:
        file.execute("PRAGMA user_version = 7")
    with pytest.raises(UsageError, match="format 7"):
        CallReader(path)


def test_only_pictures_within_the_content_of_a_message_count(tmp_path: Path) -> None:
    message = {"role": "user", "content": "{'type': 'picture'}", "type": "picture", "sha256": "00"}
    request = CallRequest(tick=0, number=0, head=b"{}", messages=(json.dumps(message).encode(), b"[1]", b"null"))
    store = CallStore(tmp_path / CALLS_NAME, EPISODE)
    store.begin("scout", request)
    store.close()
    (call,) = CallReader(tmp_path / CALLS_NAME).calls()
    assert call.pictures == ()


def _record(folder: Path) -> Path:
    store = CallStore(folder / "calls.sqlite", EPISODE)
    store.begin("a", question(0, "hello"))
    store.close()
    return folder / "calls.sqlite"


def test_a_packed_record_has_the_calls_of_the_record(tmp_path: Path) -> None:
    packed = tmp_path / "packed" / PACKED_NAME
    packed.parent.mkdir()
    pack(_record(tmp_path), packed)
    with closing(CallReader(packed)) as reader:
        (call,) = reader.calls()
    assert (call.agent, call.messages) == ("a", question(0, "hello").messages)


def test_a_damaged_packed_record_is_reported_in_one_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    packed = tmp_path / "packed" / PACKED_NAME
    packed.parent.mkdir()
    pack(_record(tmp_path), packed)
    whole = packed.read_bytes()
    for data, message in ((whole[:-20], "is cut short"), (b"no xz at all", "cannot be unpacked as a record")):
        packed.write_bytes(data)
        assert run_command(["calls", str(packed)]) == 2
        assert message in capsys.readouterr().err
    packed.write_bytes(whole)
    monkeypatch.setattr(call_store, "MOST_UNPACKED_BYTES", 1000)
    assert run_command(["calls", str(packed)]) == 2
    assert "larger than" in capsys.readouterr().err
