"""Hostile clients: they are rejected with a message, and the episode continues."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import msgpack
import pytest

from lingjing.serve.airsim import methods, protocol, server
from lingjing.testing import run_command
from tests.serve.conftest import Serve, Served


class Wire:
    """A client that writes bytes."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        self.answers = msgpack.Unpacker()

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def call(self, method: str, *arguments: object, number: int = 1) -> Any:
        self.send(msgpack.packb([0, number, method, list(arguments)]))
        return self.answer()

    def answer(self) -> Any:
        while True:
            for frame in self.answers:
                return frame
            data = self.socket.recv(65_536)
            if not data:
                return None
            self.answers.feed(data)


def test_frames_that_break_the_protocol_end_only_their_own_connection(serve: Serve) -> None:
    served: Served = serve("--scene", "bay")
    good = Wire(served.port)
    assert good.call("ping") == [1, 1, None, True]
    for data, message in (
        (b"\xc1", "no MessagePack"),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "a frame must be a request"),
        (msgpack.packb([1, 7, None, None]), "a frame must be a request"),
        (msgpack.packb([0, -1, "ping", []]), "32 bits"),
        (msgpack.packb([0, 1, 5, []]), "must be a name"),
        (msgpack.packb([0, 1, "ping", {}]), "must be an array"),
        (b"\xdd\xff\xff\xff\xff", "no MessagePack"),
        (b"\x91" * 5000, "no MessagePack"),
    ):
        bad = Wire(served.port)
        bad.send(data)
        answer = bad.answer()
        assert message in answer[2], (data[:20], answer)
        assert bad.answer() is None, "the connection is closed"
    huge = Wire(served.port)
    with contextlib.suppress(OSError):
        huge.send(b"\xc6\x7f\xff\xff\xff" + bytes(protocol.MOST_BYTES + 100_000))
    silent = Wire(served.port)  # never sends a frame
    mute = Wire(served.port)
    mute.send(b"\x94\x00")  # never ends its frame
    assert good.call("ping", number=2) == [1, 2, None, True]
    assert good.call("noSuchMethod", number=3)[2].startswith("`noSuchMethod` is not served")
    good.send(msgpack.packb([2, "ping", []]))  # a notification has no answer
    assert good.call("ping", number=4) == [1, 4, None, True]
    flood = Wire(served.port)
    flood.send(msgpack.packb([0, 1, "takeoff", [20, ""]]) * 1000)
    refusals = [flood.answer()[2] for _ in range(1000)]
    assert {refusal[:11] for refusal in refusals} <= {"256 calls o", "API control"}
    for wire in (silent, mute, flood, huge, good):
        wire.socket.close()
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success


def test_a_client_with_endless_calls_does_not_stop_the_flight_of_another(serve: Serve) -> None:
    served = serve("--scene", "bay")
    flier, chatter = Wire(served.port), Wire(served.port)
    flier.call("enableApiControl", True, "")
    ended = threading.Event()

    def chat() -> None:
        with contextlib.suppress(OSError):
            while not ended.is_set():
                chatter.call("ping")

    thread = threading.Thread(target=chat)
    thread.start()
    assert flier.call("takeoff", 20, "", number=9) == [1, 9, None, True]
    ended.set()
    thread.join(60)
    flier.socket.close()
    chatter.socket.close()
    served.finish()


def test_a_run_of_a_year_ends_when_its_client_disconnects(serve: Serve) -> None:
    served = serve("--scene", "bay")
    watcher, sleeper = Wire(served.port), Wire(served.port)
    watcher.call("ping")
    sleeper.send(msgpack.packb([0, 1, "simContinueForTime", [3e7]]))
    sleeper.socket.close()
    assert watcher.call("ping", number=5) == [1, 5, None, True]
    watcher.socket.close()
    assert len(served.finish().boundaries) < 70_000


@pytest.mark.parametrize("method", sorted(methods.METHODS.keys() - {"reset"}))
def test_invalid_arguments_do_not_end_the_server(method: str, shared: Wire) -> None:
    for arguments in ([], [None] * 9, ["x"] * 3, [[]] * 8, [{}] * 5, [1e300] * 9, [-1] * 9, [2**63] * 4, [True] * 12):
        assert shared.call(method, *arguments)[1] == 1
    assert shared.call("ping") == [1, 1, None, True]


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder: Path = tmp_path_factory.mktemp("served")
    command = [
        sys.executable, "-m", "lingjing.cli.main", "serve", "--airsim", "--scene", "bay", "--port", "0", "--once",
        "--pace", "wait", "--world", "inline", "-o", str(folder / "run"), "--no-overview",
    ]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        wire = Wire(int(process.stdout.readline().strip().rpartition(":")[2]))
        yield wire
        wire.socket.close()
        process.communicate(timeout=120)
        assert process.returncode == 0


def test_a_frame_in_pieces_and_two_frames_in_one_piece_are_read() -> None:
    reader, frame = protocol.FrameReader(), msgpack.packb([0, 3, "ping", []])
    assert [list(reader.feed(frame[k : k + 1])) for k in range(len(frame))][-1] == [protocol.Request(3, "ping", [])]
    assert list(reader.feed(frame + frame)) == [protocol.Request(3, "ping", [])] * 2
    with pytest.raises(protocol.ProtocolError):
        list(reader.feed(msgpack.packb("ping")))


def test_a_server_with_a_token_answers_only_clients_with_the_token(serve: Serve, tmp_path: Path) -> None:
    (tmp_path / "token").write_text("correct-horse\n")
    served = serve("--scene", "bay", "--token-file", str(tmp_path / "token"))
    stranger = Wire(served.port)
    assert "needs its token" in stranger.call("ping")[2]
    guesser = Wire(served.port)
    assert "needs its token" in guesser.call("lingjing.token", "wrong")[2]
    friend = Wire(served.port)
    assert friend.call("lingjing.token", "correct-horse") == [1, 1, None, True]
    assert friend.call("ping") == [1, 1, None, True]
    friend.socket.close()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "no protocol is named"),
        (["--airsim"], "needs a MISSION or --scene CITY"),
        (["--airsim", "ssr", "--scene", "bay"], "needs a MISSION or --scene CITY"),
        (["--airsim", "--scene", "atlantis"], "there is no city `atlantis`"),
        (["--airsim", "--scene", "bay", "--tick", "33"], "a tick of 33 ms is not served"),
        (["--airsim", "--scene", "bay", "--camera", "big"], "a size is WIDTHxHEIGHT"),
        (["--airsim", "--scene", "bay", "--drones", "0"], "must be at least 1"),
        (["--airsim", "--scene", "bay", "--host", "0.0.0.0"], "can be reached from a network"),
        (["--airsim", "--scene", "bay", "--token-file", "/nowhere"], "cannot read /nowhere"),
        (["--airsim", "no_such_mission"], "no_such_mission"),
        (["--airsim", "ssr", "--mode", "telepathy"], "telepathy"),
        (["--airsim", "ssr", "--policy", "nobody", "--port", "0"], "nobody"),
    ],
)
def test_a_wrong_command_line_ends_with_one_message(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["serve", *options]) == 2
    error = capsys.readouterr().err
    assert message in error and "Traceback" not in error


def test_the_error_for_an_occupied_port_names_the_port(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as holder:
        port = str(holder.getsockname()[1])
        assert run_command(["serve", "--airsim", "--scene", "bay", "--port", port]) == 2
    assert f"cannot listen at 127.0.0.1 port {port}" in capsys.readouterr().err


def test_clients_without_a_token_or_beyond_the_limit_are_closed_with_a_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_TOKEN_S", 0.4)
    monkeypatch.setattr(server, "_MOST_CLIENTS", 2)
    listening = server.CallServer("127.0.0.1", 0, token="correct-horse")
    try:
        slow, friend = Wire(listening.port), Wire(listening.port)
        assert friend.call("lingjing.token", "correct-horse") == [1, 1, None, True]
        assert "2 clients are connected already" in Wire(listening.port).answer()[2]
        with contextlib.suppress(OSError):
            for byte in b"\x94\x00\x01\xa4pin":
                slow.send(bytes([byte]))
                time.sleep(0.1)
        assert "no token came within 0.4 s" in slow.answer()[2] and slow.answer() is None
        friend.send(msgpack.packb([0, 2, "ping", []]))
        while (call := listening.calls.get(timeout=30)) is None:
            pass
        call.succeed(True)
        assert friend.answer() == [1, 2, None, True], "a client with the token may be silent"
    finally:
        listening.close()
