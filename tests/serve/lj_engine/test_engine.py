"""Our engines for a backend that is not ours, written from the description of the protocol alone."""

from __future__ import annotations

import http.server
import json
import queue
import sys
import threading
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.server import serve as listen

from tools.python_forks import PipedFork

WAIT_S = 120.0


class ReferenceBackend:
    """A backend for one session: greets it, sends commands, awaits replies and events."""

    def __init__(self) -> None:
        self.frames: queue.Queue[dict[str, Any]] = queue.Queue()
        self.events: list[dict[str, Any]] = []
        self.uploads: list[tuple[dict[str, str], bytes]] = []
        self.connection: Any = None
        self.path = ""
        self.connected = threading.Event()
        self._server = listen(self._talk, "127.0.0.1", 0, max_size=2**26)
        self.port = self._server.socket.getsockname()[1]
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def _talk(self, connection: Any) -> None:
        self.connection, self.path = connection, connection.request.path
        address = self.path.rpartition("/")[2]
        connection.send(json.dumps({"type": "SYSTEM", "data": {"code": 0, "message": f"Hello,{address}"}}))
        self.connected.set()
        for text in connection:
            self.frames.put(json.loads(text))

    def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Send a command with an id and return the message that answers it."""
        identity = str(uuid.uuid4())
        self.send(kind, request_id=identity, requestId=identity, **fields)
        while True:
            message = self.frames.get(timeout=WAIT_S)
            if message.get("request_id") == identity or message.get("requestId") == identity:
                assert message["request_id"] == message["requestId"]
                return message
            self.events.append(message)

    def send(self, kind: str, **fields: Any) -> None:
        data = {"commandType": kind, "taskId": "T-1", **fields}
        self.connection.send(json.dumps({"type": "COMMAND", "data": data}))

    def event(self, kind: str) -> dict[str, Any]:
        """Wait for an event of this kind and return it."""
        for message in self.events:
            if message.get("commandType") == kind:
                self.events.remove(message)
                return message
        while True:
            message = self.frames.get(timeout=WAIT_S)
            if message.get("commandType") == kind:
                return message
            self.events.append(message)

    def close(self) -> None:
        self._server.shutdown()


Dial = Callable[..., ReferenceBackend]


@pytest.fixture
def dial(tmp_path: Path) -> Iterator[Dial]:
    running: list[tuple[ReferenceBackend, PipedFork]] = []

    def start(*options: str, address: str = "airsim") -> ReferenceBackend:
        backend = ReferenceBackend()
        url = f"ws://127.0.0.1:{backend.port}/ws/LJ-ENGINE/{address}"
        command = [sys.executable, "-m", "lingjing.cli.main", "engine", "--connect", url, "--once", *options]
        process = PipedFork(command, cwd=tmp_path)
        running.append((backend, process))
        assert backend.connected.wait(WAIT_S)
        assert backend.path == f"/ws/LJ-ENGINE/{address}"
        return backend

    yield start
    for backend, process in running:
        if backend.connection is not None and process.poll() is None:
            backend.send("complete", success=True, result="done", message="bye")
        _, text = process.communicate(timeout=WAIT_S)
        backend.close()
        assert process.returncode == 0 and "Traceback" not in text, text


def scenario(task: str = "open_vocab", drones: int = 1) -> dict[str, Any]:
    """A scenario as the paper's system sends it: drones on the pier of the bay, a goal 60 m north of it."""
    return {
        "sceneName": "pier", "collaborationType": "single", "taskId": "T-1", "scenarioId": "S-1",
        "lingjing": {"mission": "goals", "unit": "cm"},
        "equipmentList": {
            "droneEntityList": [
                {"equipmentCode": f"UAV-{k}", "name": f"UAV-{k}", "raw": 0.0,
                 "data": {"X": 30660.0, "Y": 62020.0 - 600.0 * k, "Z": 190.0}}
                for k in range(1, drones + 1)
            ]
        },
        "taskMatrix": [
            {
                "task_id": "T-1", "goal": "fly there",
                "initial_state": {"goalPosition": [
                    {"targetId": f"G-{k}", "uav_id": f"UAV-{k}", "X": 30660.0, "Y": 56000.0 - 600.0 * k, "Z": 1500.0}
                    for k in range(1, drones + 1)
                ]},
            }
        ],
    }  # fmt: skip


def query(phase: str, **more: Any) -> dict[str, Any]:
    return {"task_id": "T-1", "phase": phase, "modalities": ["pose"], **more}


def test_an_environment_gets_replies_to_reset_observation_and_action(dial: Dial) -> None:
    backend = dial()
    ack = backend.ask("resetScenario", scenario=scenario())
    assert ack["commandType"] == "sceneResetAck"
    assert ack["data"] == {"status": "reset", "taskId": "T-1", "agents": ["UAV-1"]}
    assert backend.event("subscribeScene")["command"] == {"taskId": "T-1"}
    ready = backend.event("isReady")
    assert ready["engine"] == "airsim" and ready["isReady"] == "ready"
    first = backend.ask("getObservation", query=query("reset"))
    assert first["commandType"] == "observationResponse"
    seen = first["data"]
    assert set(seen) >= {"pose", "goal_position", "distance", "camera_rgb", "step"}
    assert seen["pose"]["x"] == pytest.approx(30660.0, abs=20) and seen["pose"]["y"] == pytest.approx(61420.0, abs=20)
    done = backend.ask("executeAction", action={"task_id": "T-1", "offset": [0.0, -2000.0]})
    assert done["commandType"] == "actionAck" and done["data"]["status"] == "ok"
    after = backend.ask("getObservation", query=query("step"))["data"]
    assert after["pose"]["y"] == pytest.approx(59420.0, abs=150), "20 m to the north"
    assert after["distance"] < seen["distance"] and after["step"] == 1
    narrow = backend.ask("getObservation", query=query("step", observation_schema={"spaces": {"pose": {}}}))["data"]
    assert set(narrow) == {"pose"}
    failed = backend.ask("executeAction", action={"task_id": "T-1", "offset": ["a", None]})["data"]
    assert failed["status"] == "error" and "two numbers" in failed["error"]
    failed = backend.ask("executeAction", action={"task_id": "T-1", "drones": {"UAV-9": {"offset": [1, 1]}}})["data"]
    assert "no body `UAV-9`" in failed["error"]


def test_a_fire_is_reported_at_the_place_of_the_scenario(dial: Dial) -> None:
    """Our district places the fire on a facade; the backend knows only the place in its scenario."""
    backend = dial()
    fires = {"goalFirePosition": [{"fireId": "F-1", "X": 31000.0, "Y": 55000.0, "Z": 0.0, "scale": 1.0}]}
    document = scenario("fire_rescue", drones=2)
    document["taskMatrix"][0]["initial_state"] = fires
    del document["lingjing"]
    backend.ask("resetFireRescueScenario", scenario=document)
    (fire,) = backend.ask("getFireRescueObservation", query=query("reset"))["data"]["fires"]
    assert fire["position"] == pytest.approx({"x": 31000.0, "y": 55000.0, "z": 0.0})
    assert fire["status"] == "burning"
    order = {"dronesId": "UAV-2", "instructionType": "setDestination", "command": {"x": 31000, "y": 55000, "z": 2500}}
    backend.ask("executeAction", dronesAction=[order])
    assert backend.event("executionCompleted")["judgment"]["success"] is True
    assert backend.ask("getFireRescueObservation", query=query("step"))["data"]["all_extinguished"] is True


@pytest.mark.parametrize(
    ("profile", "commands", "acks"),
    [
        ("delivery", ("resetDeliveryScenario", "getFleetObservation", "dispatchFleetAction"),
         ("sceneResetAck", "observationResponse", "actionAck")),
        ("fire_rescue", ("resetFireRescueScenario", "getFireRescueObservation", "dispatchFireRescueAction"),
         ("fireRescueResetAck", "fireRescueObservationResponse", "fireRescueActionAck")),
    ],
)  # fmt: skip
def test_an_engine_of_a_fleet_profile_ignores_commands_of_other_profiles(
    dial: Dial, profile: str, commands: tuple[str, ...], acks: tuple[str, ...]
) -> None:
    backend = dial("--profile", profile)
    backend.send("resetScenario", request_id="never", requestId="never", scenario=scenario(drones=2))
    ack = backend.ask(commands[0], scenario=scenario(drones=2))
    assert ack["commandType"] == acks[0] and ack["data"]["agents"] == ["UAV-1", "UAV-2"]
    bodies = {"UAV-1": {"offset": [1000.0, 0.0]}, "UAV-2": {"offset": [0.0, -1000.0]}}
    group = "drones" if profile == "delivery" else "agents"
    before = backend.ask(commands[1], query=query("reset"))
    assert before["commandType"] == acks[1]
    done = backend.ask(commands[2], action={"task_id": "T-1", group: bodies})
    assert done["commandType"] == acks[2] and done["data"]["status"] == "ok"
    after = backend.ask(commands[1], query=query("step"))["data"]
    start = before["data"][group]
    assert after[group]["UAV-1"]["pose"]["x"] - start["UAV-1"]["pose"]["x"] == pytest.approx(1000.0, abs=150)
    assert after[group]["UAV-2"]["pose"]["y"] - start["UAV-2"]["pose"]["y"] == pytest.approx(-1000.0, abs=150)
    if profile == "delivery":
        assert after["all_delivered"] is False and after["drones"]["UAV-1"]["delivered"] is False
    else:
        assert [fire["status"] for fire in after["fires"]] == ["burning", "burning"]
    assert not any(event.get("request_id") == "never" for event in backend.events)


def test_a_run_script_receives_events_telemetry_and_a_picture(dial: Dial) -> None:
    backend = dial("--telemetry", "0.05")
    uploads, url = upload_server()
    backend.ask("resetScenario", scenario=scenario())
    backend.send("executeAction", dronesAction=[drone("takeoff", mile=10.0, raw=0.0, speed=5.0)])
    event = backend.event("executionCompleted")
    assert event["taskId"] == "T-1" and event["droneID"] == "UAV-1"
    assert event["judgment"]["action"] == "takeoff" and event["judgment"]["success"] is False
    assert event["position"]["z"] == pytest.approx(1190.0, abs=150)
    assert backend.event("pushEngineTelemetry")["task_id"] == "T-1"
    backend.send("executeAction", dronesAction=[drone("backword", mile=5.0, speed=5.0)])
    assert backend.event("executionCompleted")["judgment"]["action"] == "backword"
    backend.send("executeAction", dronesAction=[drone("setDestination", x=30660.0, y=55400.0, z=1500.0)])
    event = backend.event("executionCompleted")
    assert event["judgment"]["success"] is True, "the only hidden place was reached"
    spec = {"url": url, "method": "POST", "contentType": "multipart/form-data", "fileField": "file",
            "fields": {"taskId": "T-1", "photoid": "p-7", "viewType": "topdown"}}  # fmt: skip
    backend.send("takePhoto", modelIdList=[photo("UAV-1", spec)])
    fields, picture = uploads.get(timeout=WAIT_S)
    assert b"p-7" in fields and picture
    elsewhere = {**spec, "url": "http://198.51.100.7/steal"}
    refused = backend.ask("takePhoto", modelIdList=[photo("UAV-1", elsewhere)])
    assert refused["data"]["status"] == "failed"
    backend.send("noSuchCommand")
    backend.connection.send("not JSON")
    backend.connection.send(json.dumps({"type": "DATA", "data": "a relay"}))
    assert backend.ask("getEngineLoc")["data"]["agents"]["UAV-1"]["pose"]


def drone(kind: str, **command: float) -> dict[str, Any]:
    return {"dronesId": "UAV-1", "instructionType": kind, "command": command}


def photo(name: str, spec: dict[str, Any]) -> dict[str, Any]:
    return {"droneId": name, "carId": "", "dogId": "", "viewType": "topdown", "photoid": "p-7", "uploadSpec": spec}


def upload_server() -> tuple[queue.Queue[tuple[bytes, bool]], str]:
    arrived: queue.Queue[tuple[bytes, bool]] = queue.Queue()

    class Upload(http.server.BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            arrived.put((body, b"\xff\xd8\xff" in body and b'name="file"' in body))
            self.send_response(200)
            self.end_headers()

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Upload)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return arrived, f"http://127.0.0.1:{server.server_port}/sim/vision/upload"


def test_invalid_commands_of_a_backend_are_acknowledged_with_errors(dial: Dial) -> None:
    backend = dial()
    assert "no scenario is loaded" in backend.ask("getObservation", query=query("reset"))["data"]["error"]
    assert "no `scenario`" in backend.ask("resetScenario")["data"]["error"]
    broken = scenario() | {"equipmentList": {"droneEntityList": [{"data": {"X": "east"}}]}}
    assert backend.ask("resetScenario", scenario=broken)["data"]["status"] == "error"
    ack = backend.ask("resetScenario", scenario=scenario())
    assert ack["data"]["status"] == "reset", "a valid scenario still works"
    assert "names no body" in backend.ask("executeAction")["data"]["error"]


def test_a_backend_that_closes_the_connection_in_an_episode_is_reported(tmp_path: Path) -> None:
    backend = ReferenceBackend()
    url = f"ws://127.0.0.1:{backend.port}/ws/LJ-ENGINE/airsim"
    process = PipedFork([sys.executable, "-m", "lingjing.cli.main", "engine", "--connect", url])
    assert backend.connected.wait(WAIT_S)
    backend.ask("resetScenario", scenario=scenario())
    backend.close()
    _, text = process.communicate(timeout=WAIT_S)
    assert process.returncode == 3 and "the backend has closed the connection" in text and "Traceback" not in text


def test_a_scenario_repeated_without_an_id_does_not_restart_the_episode(dial: Dial) -> None:
    backend = dial("--profile", "open_vocab")
    backend.ask("resetScenario", scenario=scenario())
    backend.ask("executeAction", action={"task_id": "T-1", "offset": [0.0, -1000.0]})
    before = backend.ask("getObservation", query=query("step"))["data"]
    backend.send("resetScenario", scenario=scenario())
    after = backend.ask("getObservation", query=query("step"))["data"]
    assert after["step"] == before["step"] == 1 and after["pose"] == before["pose"]
    backend.ask("resetScenario", scenario=scenario())
    assert backend.ask("getObservation", query=query("reset"))["data"]["step"] == 0, (
        "a scenario with an id restarts the episode"
    )
