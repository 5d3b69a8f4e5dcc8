"""The calls of a service that episodes keep in flight: `python benchmarks/busy.py [EPISODES] [TICKS]` (64, 30).

A stub on loopback answers each call after 1 s with a no-op. A mission of one agent without pictures is played so many
times at once. Printed are the calls in flight on average while all episodes run, the CPU of a call (start of the
episodes apart), the memory of an episode (proportional set size), and the load of the machine, which decides the rest.
"""

from __future__ import annotations

import asyncio
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from lingjing.bench.memory_watch import tree_mb

MISSION = """\
ljs 2
use std.air {{ quadrotor }}

mission glance "One looks down" {{
  goal "Fly."
  scene bay
  clock {{ tick = 2 s, sync = 500 ms }}
  budget {{ ticks <= {ticks}, policy <= 90 s, engine <= 90 s }}
  mode single
  asset uav : quadrotor {{
    position = (100 m, -700 m), band = 20 m..60 m
    actions {{ takeoff, setDestination }}
  }}
  agent scout as scout controls uav {{ observes uav.*, events }}
  success when distance_xy(uav, (140 m, -700 m)) <= 1 m
}}
"""
SUITE = """\
suite = 1
name = "busy"
missions = ["glance.ljs"]
seeds = {episodes}

[[entrants]]
name = "stub"
policy = "react"
args = {{ model = "stub", base_url = "{url}", price_in = 0.0, price_out = 0.0 }}
"""
ANSWER_S = 1.0
NOOP = json.dumps({"thought": "", "command": None, "messages": []})
BODY = json.dumps(
    {"model": "stub", "choices": [{"message": {"role": "assistant", "content": NOOP}, "finish_reason": "stop"}],
     "usage": {"prompt_tokens": 1, "completion_tokens": 1}}
).encode()  # fmt: skip


class Stub:
    """The service, and its calls in flight over time."""

    def __init__(self) -> None:
        self.url = ""
        self.changes: list[tuple[float, int]] = []
        self._ready = threading.Event()

    def start(self) -> None:
        """Serve in a thread."""
        threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True).start()
        self._ready.wait()

    async def _serve(self) -> None:
        server = await asyncio.start_server(self._connected, "127.0.0.1", 0, backlog=1024)
        self.url = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}/v1"
        self._ready.set()
        async with server:
            await server.serve_forever()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while head := await reader.readuntil(b"\r\n\r\n"):
                fields = dict(line.lower().split(b": ", 1) for line in head.split(b"\r\n")[1:] if b": " in line)
                await reader.readexactly(int(fields.get(b"content-length", b"0")))
                self.changes.append((time.monotonic(), 1))
                await asyncio.sleep(ANSWER_S)
                self.changes.append((time.monotonic(), -1))
                head = f"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: {len(BODY)}\r\n\r\n"
                writer.write(head.encode() + BODY)
                await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError):
            writer.close()

    def in_flight(self, begin: float, end: float) -> float:
        """Return the calls in flight on average between two times."""
        total, now, at = 0.0, 0, begin
        for moment, change in self.changes:
            if begin < moment < end:
                total, at = total + now * (moment - at), moment
            now += change if moment < end else 0
        return (total + now * (end - at)) / (end - begin)


def main() -> None:
    """Play, and print the measures."""
    episodes, ticks = (int(text) for text in (*sys.argv[1:], *("64", "30")[len(sys.argv) - 1 :]))
    stub = Stub()
    stub.start()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "glance.ljs").write_text(MISSION.format(ticks=ticks))
        (folder / "suite.toml").write_text(SUITE.format(episodes=episodes, url=stub.url))
        command = [
            str(Path(sys.executable).with_name("lingjing")),
            "bench",
            "suite.toml",
            "-o",
            "results",
            "-j",
            str(episodes),
        ]
        process = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        peak, first_full, last_full = 0.0, 0.0, 0.0
        while process.poll() is None:
            open_now = sum(change for _, change in list(stub.changes))
            begun = sum(change > 0 for _, change in list(stub.changes))
            if begun >= episodes and first_full == 0.0:
                first_full = time.monotonic()
            if begun <= episodes * ticks - episodes:
                last_full = time.monotonic()
            peak = max(peak, tree_mb(process.pid)) if open_now else peak
            time.sleep(2.0)
        assert process.stderr is not None
        messages = process.stderr.read()
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    calls = sum(change > 0 for _, change in stub.changes)
    print(f"{episodes} episodes of {ticks} ticks, load {os.getloadavg()[0]:.0f} on {os.cpu_count()} processors")
    if process.returncode != 0 or last_full <= first_full:
        print(messages[-1500:])
        return
    flying = stub.in_flight(first_full, last_full)
    print(f"{flying:.1f} of {episodes} calls in flight, {flying / episodes:.0%}, over {last_full - first_full:.0f} s")
    print(f"{(used.ru_utime + used.ru_stime) / calls * 1000:.0f} ms of CPU a call, with the start ({calls} calls)")
    print(f"{peak / episodes:.0f} MB an episode")


if __name__ == "__main__":
    main()
