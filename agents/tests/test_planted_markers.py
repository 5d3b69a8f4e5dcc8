"""Secrecy of planted markers: an episode is played with markers in all confidential places, and all outputs are
searched.

The outputs are every request, the trace, the record of calls, errors and the terminal.
"""

import json
import os
import pty
import re
import sqlite3
import sys
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from agents.tests.hostile_server import answered, completion, header_of, serve_raw
from lingjing.testing.traces import scan
from tools.python_forks import start_python

KEY = "sk-Planted4711-of-the-service"
OTHER_KEY = "sk-Planted0815-of-nobody-here"
LOGIN = "planned-user:Planted2718-password"
NORTH, EAST = "-866.37", "261.83"
EVIL = "\x1b]0;PWNED\x07\x9b31m\u202egnp.exe\u2066\r\x00"
MISSION = f"""\
ljs 1
use std.air {{ quadrotor }}
use std.messages {{ note }}
use std.sea {{ person_in_water }}
use std.sensors {{ nadir_hd }}

mission planted "Two search and one leads" {{
  goal "Find the person."
  scene bay
  clock {{ tick = 2 s, sync = 500 ms }}
  budget {{ ticks <= 4, policy <= 60 s, engine <= 60 s, capture <= 60 s }}
  mode star
  target victim[1..1] : person_in_water {{ hidden position = ({EAST} m, {NORTH} m) }}
  asset uav[1..2] : quadrotor {{
    position = at(i, [({EAST} m, -860 m, 40 m), (290 m, -700 m, 40 m)], spread 8 m), band = 20 m..60 m
    camera nadir : nadir_hd {{ size = 320 by 180 }}
    actions {{ takeoff, takePhoto }}
  }}
  agent scout[i in 1..2] as scout controls uav[i] {{ observes uav[i].*, events }}
  agent leader as leader {{ observes events }}
  message word : note from scout, leader to all
  comms {{ hub = leader, delay = 1 tick, payload <= 4 kB }}
  success when forall v in victim: distance_xy(uav[1], v) <= 1 m
}}
"""
SAID, THOUGHT = "Planted-message-of-scout-1", "Planted-thought-of-scout-1"


class EchoingService:
    """A service with answers that repeat its key, contain terminal escapes, and quote scout[1].

    Sometimes it returns an error with its key instead. It stores all requests.
    """

    def __init__(self) -> None:
        self.requests: list[tuple[str, dict[str, Any]]] = []
        self.sent: set[str] = set()

    def __call__(self, request: bytes) -> Iterator[bytes]:
        sent = header_of(request, "authorization")
        body = json.loads(request.partition(b"\r\n\r\n")[2])
        match = re.search(r"scout\[[12]\]|leader", body["messages"][0]["content"])
        assert match
        self.requests.append((match[0], body))
        self.sent.add(sent)
        plain = b64decode(sent.split()[1]).decode() if sent.startswith("Basic") else sent
        words = f"{EVIL} {plain} {sent}"
        count = sum(agent == match[0] for agent, _ in self.requests)  # alone: agents call in any order
        if match[0] == "scout[2]" and count % 3 == 2:
            yield answered("401 Unauthorized", json.dumps({"error": words}, ensure_ascii=False).encode(), f"x: {sent}")
            return
        first = match[0] == "scout[1]"
        note = {"kind": "word", "body": {"text": SAID if first else words}, "to": []}
        step = {"thought": f"{THOUGHT if first else ''} {words}", "command": None, "messages": [note] if first else []}
        yield completion(f"<think>{words}</think>" + json.dumps(step))


def on_terminal(folder: Path, environment: dict[str, str], *arguments: str) -> tuple[int, str]:
    """Return the exit code and the complete output on a terminal."""
    primary, secondary = pty.openpty()
    command = [sys.executable, "-m", "lingjing.cli.main", *arguments]
    process = start_python(command, (secondary,) * 3, cwd=folder, env={**os.environ, **environment})
    os.close(secondary)
    shown = b""
    while True:
        try:
            piece = os.read(primary, 65536)
        except OSError:  # the other side is closed
            break
        if not piece:
            break
        shown += piece
    os.close(primary)
    return process.wait(), shown.decode("utf-8", "surrogateescape")


def stored(folder: Path) -> dict[str, bytes]:
    """Return all files of a run, with packed parts unpacked."""
    contents = {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for path in folder.rglob("*.mcap*"):
        contents[f"{path.name}, unpacked"] = b"\n".join(record.data for record in scan(path))
    for path in folder.rglob("*.sqlite"):
        with sqlite3.connect(path) as file:
            rows = [*file.execute("SELECT data, hash FROM content"), *file.execute("SELECT result, head FROM call")]
        contents[f"{path.name}, its rows"] = b"\n".join(bytes(part) for row in rows for part in row if part is not None)
    return contents


@pytest.mark.parametrize("secret", [KEY, LOGIN])
def test_planted_markers_leak_into_no_output(secret: str, tmp_path: Path) -> None:
    (tmp_path / "planted.ljs").write_text(MISSION)
    service = EchoingService()
    with serve_raw(service) as url:
        environment = {
            "SERVICE_KEY": KEY,
            "SERVICE_URL": url.replace("http://", f"http://{LOGIN}@"),
            "OPENAI_API_KEY": OTHER_KEY,
            "LINGJING_TRACEBACK": "1",
            "PYTHONFAULTHANDLER": "1",
            "TERM": "xterm-256color",
        }
        place = {"api_key_env": "SERVICE_KEY", "base_url": url} if secret == KEY else {"base_url_env": "SERVICE_URL"}
        options = [f"--policy-arg={name}={value}" for name, value in {"model": "m", "tries": "1", **place}.items()]
        code, shown = on_terminal(
            tmp_path, environment, "run", "planted.ljs", "--policy=react", *options, "-orun", "--watch"
        )
        listed = on_terminal(tmp_path, environment, "calls", "run", "--full")[1]
        listed += on_terminal(tmp_path, environment, "calls", "run")[1]
    assert code == 0, shown
    _nothing_leaks(service, stored(tmp_path / "run"), shown, listed)


def _nothing_leaks(service: EchoingService, left: dict[str, bytes], shown: str, listed: str) -> None:
    agents = {name for name, _ in service.requests}
    assert agents == {"scout[1]", "scout[2]", "leader"}
    assert len(service.sent) == 1  # the one secret was sent, as authorisation
    assert "calls.sqlite" in left
    assert "trace.mcap" in left

    secrets = ("Planted4711", "Planted0815", "Planted2718", "planned-user")
    bodies = [json.dumps(body, ensure_ascii=False) for _, body in service.requests]
    for place, text in {
        **{f"request {number}": body for number, body in enumerate(bodies)},
        **{name: data.decode("latin-1") for name, data in left.items()},
        "the terminal": shown,
        "the list of calls": listed,
    }.items():
        for planted in secrets:
            assert planted.lower() not in text.lower(), (place, planted)

    for (agent, _), body in zip(service.requests, bodies, strict=True):
        # By design uav[1] is at the hidden place's east. No agent may receive its north.
        assert NORTH.rstrip("0") not in body, agent
        assert "866.4" not in body, agent
        assert (SAID in body) <= (agent in ("leader", "scout[1]")), agent
        assert (THOUGHT in body) <= (agent == "scout[1]"), agent
    assert any(agent == "leader" and SAID in body for (agent, _), body in zip(service.requests, bodies, strict=True))
    assert NORTH not in left["calls.sqlite, its rows"].decode("latin-1")

    for text in (shown, listed):
        for evil in ("\x1b]0;", "\x07", "\x9b", "\u202e", "\u2066", "\x00", "\x1b]"):
            assert evil not in text, repr(evil)
    assert "\\x1b]0;PWNED" in listed
