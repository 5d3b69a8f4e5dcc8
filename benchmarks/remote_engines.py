"""The cost of engines and clients in other programs.

- *tick*: wall-clock time of a tick (10 macro-steps of 0.1 s, two drones in the bay without commands): with our engine
  in the same process, with our engine in another process (exact session), and with a client of offsets.
- *calls*: calls a second of `lingjing serve --airsim` with the package `cosysairsim`, beside a stub that speaks the
  same protocol with `msgpackrpc` and only answers.
- *pictures*: pictures a second of `simGetImages` (256 by 144, PNG), and uploads a second of such pictures over HTTP.

Every part runs alone, and the median of three runs is printed. It needs `cosysairsim` and `websockets`.
"""

from __future__ import annotations

import asyncio
import io
import json
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lingjing
from lingjing.serve.lj_engine.hub import Hub
from lingjing.serve.lj_engine.posting import multipart
from lingjing.serve.lj_engine.server import EngineServer

TICKS = 60
RUNS = 3
CALLS_S = 3.0
"""Seconds for which calls are counted."""
PICTURES = 40
MISSION = f"""\
ljs 2
use std.air {{ quadrotor }}
use std.weather {{ clear }}

mission still "Two drones that stand" {{
  goal "Stand."
  scene bay
  clock {{ tick = 1 s, sync = 100 ms }}
  budget {{ ticks <= {TICKS}, policy <= 90 s, engine <= 60 s, capture <= 60 s }}
  weather clear
  mode broadcast
  asset uav[k in 1..2] : quadrotor {{
    position = (306.6 m, -620.2 m + 6 m * k, 1.875 m), heading = 0 deg, cruise = 15 m/s, band = 0 m..200 m
    actions {{ takeoff, setDestination, stop }}
  }}
  agent pilot[i in 1..2] as pilot controls uav[i] {{ observes uav[i].*, events }}
  success when forall u in uav: distance_xy(u, (0 m, 0 m)) <= 1 m
}}
"""
STUB = """
import msgpackrpc, sys
class Stub:
    def ping(self): return True
    def getMultirotorState(self, name): return STATE
STATE = {"collision": {}, "kinematics_estimated": {}, "timestamp": 1, "landed_state": 0, "rc_data": {}}
server = msgpackrpc.Server(Stub())
server.listen(msgpackrpc.Address("127.0.0.1", int(sys.argv[1])))
print("ready", flush=True)
server.start()
"""


def main() -> None:
    """Print all numbers."""
    with tempfile.TemporaryDirectory(prefix="lingjing-") as name:
        folder = Path(name)
        (folder / "still.ljs").write_text(MISSION)
        local = _median(lambda k: _local_ms(folder, k))
        exact = _median(lambda k: _remote_ms(folder, f"e{k}", _start_engine))
        offsets = _median(lambda k: _remote_ms(folder, f"o{k}", _start_client))
        print(f"tick, our engine in the same process      {local:8.2f} ms")
        more = (exact - local) / 10
        print(f"tick, our engine in another process       {exact:8.2f} ms  ({more:.2f} ms a macro-step more)")
        print(f"tick, a client of offsets                 {offsets:8.2f} ms")
        for call in ("ping", "getMultirotorState"):
            ours = _median(lambda k, c=call: _served_calls(folder, c, k))
            stub = _median(lambda k, c=call: _stub_calls(c))
            print(f"calls a second, {call:24s}  {ours:8.0f}     a stub: {stub:8.0f}")
        print(f"pictures a second, simGetImages           {_median(lambda k: _pictures(folder, k)):8.1f}")
        print(f"uploads a second over HTTP                {_median(lambda k: _uploads()):8.1f}")


def _median(measure: Callable[[int], float]) -> float:
    return statistics.median(measure(k) for k in range(RUNS))


def _local_ms(folder: Path, run: int) -> float:
    report = lingjing.run(
        folder / "still.ljs", policy="idle", world="inline", overview=False, out=folder / f"local{run}"
    )  # fmt: skip
    return _tick_ms(Path(report.trace))


def _tick_ms(path: Path) -> float:
    """Return the median wall-clock time of a tick in milliseconds."""
    return 1000.0 * statistics.median(record.wall_s for record in lingjing.read(path).boundaries[1:])


def _remote_ms(folder: Path, run: str, start: Callable[[str], Callable[[], None]]) -> float:
    command = [
        sys.executable, "-m", "lingjing.cli.main", "serve", "--lj-engine", str(folder / "still.ljs"),
        "--policy", "idle", "--port", "0", "--world", "inline", "-o", str(folder / run),
    ]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        assert server.stdout is not None
        wait = start(f"ws://{server.stdout.readline().strip()}/ws/LJ-ENGINE/airsim")
        server.communicate()
        wait()
    return _tick_ms(folder / run / "trace.mcap")


def _start_engine(url: str) -> Callable[[], None]:
    command = [sys.executable, "-m", "lingjing.cli.main", "engine", "--connect", url, "--once"]
    engine = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    return lambda: engine.wait() and None


def _start_client(url: str) -> Callable[[], None]:
    """Start a client of the profile `delivery` that stands still."""
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    poses: dict[str, dict[str, float]] = {}

    def answer(connection: Any, data: dict[str, Any]) -> None:
        if data["commandType"] == "resetDeliveryScenario":
            drones = data["scenario"]["equipmentList"]["droneEntityList"]
            poses.update({drone["name"]: {axis.lower(): drone["data"][axis] for axis in "XYZ"} for drone in drones})
            result: dict[str, Any] = {"status": "reset", "agents": list(poses)}
        elif data["commandType"] == "getFleetObservation":
            result = {"drones": {name: {"pose": pose} for name, pose in poses.items()}}
        else:
            return
        connection.send(json.dumps({"commandType": "ack", "request_id": data.get("request_id"), "data": result}))

    def run() -> None:
        with connect(url) as connection:
            try:
                for text in connection:
                    frame = json.loads(text)
                    if frame["type"] == "COMMAND":
                        answer(connection, frame["data"])
            except ConnectionClosed:
                pass

    thread = threading.Thread(target=run)
    thread.start()
    return thread.join


def _client(port: int) -> Any:
    asyncio.set_event_loop(asyncio.new_event_loop())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import cosysairsim

    return cosysairsim.MultirotorClient(port=port)


def _serve_airsim(folder: Path, run: str) -> tuple[subprocess.Popen[str], Any]:
    command = [
        sys.executable, "-m", "lingjing.cli.main", "serve", "--airsim", "--scene", "bay", "--port", "0", "--once",
        "--pace", "wait", "--world", "inline", "-o", str(folder / run),
    ]  # fmt: skip
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert server.stdout is not None
    return server, _client(int(server.stdout.readline().strip().rpartition(":")[2]))


def _served_calls(folder: Path, call: str, run: int) -> float:
    server, client = _serve_airsim(folder, f"{call}{run}")
    rate = _rate(client, call)
    client.client.close()
    server.communicate()
    return rate


def _stub_calls(call: str) -> float:
    port = 41_999
    with subprocess.Popen([sys.executable, "-c", STUB, str(port)], stdout=subprocess.PIPE, text=True) as stub:
        assert stub.stdout is not None
        stub.stdout.readline()
        client = _client(port)
        rate = _rate(client, call)
        client.client.close()
        stub.kill()
    return rate


def _rate(client: Any, call: str) -> float:
    """Return the calls a second, with the answer as the protocol carries it."""
    arguments = () if call == "ping" else ("",)
    began, count = time.perf_counter(), 0
    while time.perf_counter() - began < CALLS_S:
        client.client.call(call, *arguments)
        count += 1
    return count / (time.perf_counter() - began)


def _pictures(folder: Path, run: int) -> float:
    import cosysairsim

    server, client = _serve_airsim(folder, f"pictures{run}")
    wish = [cosysairsim.ImageRequest("front", cosysairsim.ImageType.Scene, False, True)]
    client.simGetImages(wish)  # the camera starts with the first picture
    began = time.perf_counter()
    for _ in range(PICTURES):
        client.simGetImages(wish)
    rate = PICTURES / (time.perf_counter() - began)
    client.client.close()
    server.communicate()
    return rate


def _uploads() -> float:
    import PIL.Image

    out = io.BytesIO()
    PIL.Image.effect_noise((256, 144), 60).convert("RGB").save(out, "JPEG")
    hub = Hub("benchmark")
    server = EngineServer(hub, "127.0.0.1", 0)
    began = time.perf_counter()
    for number in range(PICTURES * 5):
        photo = hub.pictures.expect(f"f{number}")
        body, kind = multipart({"photoid": photo}, "file", out.getvalue())
        request = urllib.request.Request(
            f"http://127.0.0.1:{server.port}/sim/vision/upload", body, {"Content-Type": kind}
        )
        with urllib.request.urlopen(request) as response:
            assert response.status == 200
        assert hub.pictures.take(photo, 5.0) is not None
    rate = PICTURES * 5 / (time.perf_counter() - began)
    server.close()
    return rate


if __name__ == "__main__":
    main()
