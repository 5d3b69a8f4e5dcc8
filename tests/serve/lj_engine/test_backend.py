"""The backend with clients of the paper's protocol, and with our own engines in another process."""

from __future__ import annotations

import io
import itertools
import json
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest

import lingjing
from lingjing.testing import run_command
from tests.serve.lj_engine.conftest import WAIT_S, Backend, ReferenceClient, Serve
from tools.python_forks import PipedFork

NORTH = '{0: ("setDestination", {"x": 306.6, "y": -500.0, "z": 20.0})}'


@pytest.mark.parametrize("profile", ["open_vocab", "delivery", "fire_rescue"])
def test_a_mission_flown_by_a_client_of_each_profile_replays_without_the_client(serve: Serve, profile: str) -> None:
    uavs = 1 if profile == "open_vocab" else 2
    served = serve("--deadline", "2", "--observe", "tick", verbs=NORTH, uavs=uavs)
    client = ReferenceClient(served.url(), profile)
    client.start()
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.reason == "success", client.received[-3:]
    assert client.kinds()[-1] == "complete"
    reset, observe, act = ReferenceClient.NAMES[profile][:3]
    expected = [reset] if profile == "open_vocab" else ["resetScenario", "resetDeliveryScenario", reset]
    kinds = client.kinds()
    assert [kind for kind in kinds if "reset" in kind] == list(dict.fromkeys(expected))
    assert kinds.index(observe) < kinds.index(act)
    scenario = next(f["data"]["scenario"] for f in client.received if f["data"].get("commandType") == reset)
    assert scenario["taskId"] == client.task and scenario["scenarioId"] and scenario["taskType"]
    north = [
        state.position[1] for record in trace.boundaries for state in record.snapshots[-1].states if "1" in state.id
    ]
    steps = [after - before for before, after in itertools.pairwise(north)]
    assert max(steps) <= 30.01, "an offset in a tick of 2 s is at most 30 m: 15 m/s"
    assert sum(steps) > 90.0
    statuses = [receipt.status for record in trace.boundaries for receipt in record.receipts]
    assert "accepted" in statuses and "running" in statuses
    assert trace.header.remote_engines[0].session == "LJ-ENGINE_airsim"
    replayed = lingjing.replay(trace, world="inline")
    assert replayed.difference is None and replayed.confirmed == len(trace.boundaries)


def test_a_backend_and_an_engine_in_two_processes_give_the_digest_of_a_local_run(serve: Serve, tmp_path: Path) -> None:
    served = serve("--world", "process", verbs=NORTH, uavs=2)
    command = [sys.executable, "-m", "lingjing.cli.main", "engine", "--connect", served.url(), "--once"]
    engine = PipedFork(command, cwd=tmp_path)
    trace = served.finish()
    _, text = engine.communicate(timeout=WAIT_S)
    assert engine.returncode == 0, text
    assert run_command(
        ["run", str(tmp_path / "ferry.ljs"), "--policy", f"{tmp_path / 'pilot.py'}:Pilot", "--no-overview",
         "--world", "inline", "-o", str(tmp_path / "local")]
    ) == 0  # fmt: skip
    local = lingjing.read(tmp_path / "local")
    assert trace.outcome is not None and local.outcome is not None
    assert trace.outcome.success and len(trace.boundaries) > 3
    assert trace.outcome.digest == local.outcome.digest
    assert any('"lingjing"' in frame.text for frame in trace.engine_frames if frame.use == "reply")
    replayed = lingjing.replay(trace, world="inline")
    assert replayed.difference is None and replayed.confirmed == len(trace.boundaries)


def test_a_script_engine_reports_the_ends_of_commands_as_events(serve: Serve) -> None:
    served = serve("--profile", "script", "--pace", "fast", verbs=VERBS_OF_A_SCRIPT)
    client = ScriptEngine(served.url())
    client.start()
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success
    sent = [frame["data"]["dronesAction"][0] for frame in client.received if "dronesAction" in frame.get("data", {})]
    assert [action["instructionType"] for action in sent] == ["takeoff", "backword", "setDestination"]
    assert sent[0]["command"]["mile"] == 8.0 and sent[1]["command"]["mile"] == 5.0
    assert sent[2]["command"]["y"] == pytest.approx(50000.0), "north is minus Y, in centimetres"
    done = [receipt for record in trace.boundaries for receipt in record.receipts if receipt.status == "completed"]
    assert len(done) == 3

    assert lingjing.replay(trace, world="inline").difference is None


def test_a_script_engine_without_observation_requests_keeps_its_last_pose(serve: Serve) -> None:
    served = serve("--profile", "script", "--observe", "hold", ticks=4)
    client = ScriptEngine(served.url())
    client.start()
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.reason == "budget"
    assert client.kinds() == ["resetScenario", "resetScenario", "complete"], "sent again without ids after no answer"
    assert [("request_id" in f["data"]) for f in client.received[:2]] == [True, False]
    (binding,) = trace.header.remote_engines
    assert (binding.profile, binding.asks) == ("script", False)
    assert lingjing.replay(trace, world="inline").difference is None


VERBS_OF_A_SCRIPT = (
    '{0: ("takeoff", {"altitude": 8.0}), 2: ("backward", {"distance": 5.0}),'
    ' 4: ("setDestination", {"x": 306.6, "y": -500.0, "z": 20.0})}'
)


class ScriptEngine(ReferenceClient):
    """A simulator of the run scripts: no acknowledgements, `isReady`, one event for each finished action."""

    def take(self, frame: dict[str, Any]) -> None:
        self.received.append(frame)
        data = frame.get("data")
        if frame.get("type") != "COMMAND" or not isinstance(data, dict):
            return
        if data["commandType"] == "resetScenario":
            if not self.poses:
                self.reset(data["scenario"])
                self.send({"engine": "airsim", "isReady": "ready"})
                self.completed("initialize_scenario")
        elif data["commandType"] == "getObservation":
            self.reply(data, "observationResponse", self.observation())
        elif data["commandType"] == "executeAction":
            (action,) = data["dronesAction"]
            place, command = self.poses[action["dronesId"]], action["command"]
            kind = action["instructionType"]
            if kind == "setDestination":
                place[:] = [command["x"], command["y"], command["z"]]
            elif kind == "takeoff":
                place[2] += 100.0 * command["mile"]
            self.completed(kind)

    def completed(self, action: str) -> None:
        (name,) = self.poses
        position = dict(zip("XYZ", self.poses[name], strict=True)) | {"yaw": 0.0}
        judgment = {"action": action, "success": False, "reason": ""}
        self.send(
            {"commandType": "executionCompleted", "taskId": self.task, "droneID": name, "position": position,
             "judgment": judgment}
        )  # fmt: skip


def test_the_pixels_and_boxes_of_a_picture_session_are_in_the_trace(serve: Serve) -> None:
    served = serve(
        "--session", "multirotor=airsim", "--pictures", "engine", "--deadline", "20",
        verbs='{0: ("takePhoto", {}), 2: ("setDestination", {"x": 306.6, "y": -500.0, "z": 20.0})}',
    )  # fmt: skip
    ReferenceClient(served.url()).start()
    photographer = Photographer(served.url("image"))
    photographer.start()
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success
    (picture,) = trace.pictures()
    assert picture.rgb.shape == (48, 64, 3)
    assert picture.rgb[..., 0].mean() > 200 and picture.rgb[..., 1].mean() < 60, "the pixels are the session's red"
    assert [(box.entity, box.box) for box in picture.info.boxes] == [("uav[1]", (0.25, 0.25, 0.5, 0.75))]
    (upload,) = [frame for frame in trace.engine_frames if frame.use == "upload"]
    assert json.loads(upload.text)["fields"]["viewType"] == "topdown"
    assert photographer.statuses == [200]
    replayed = lingjing.replay(trace, world="inline")
    assert replayed.difference is None and replayed.confirmed == len(trace.boundaries)


class Photographer(ReferenceClient):
    """The session `image`: a red picture for each `takePhoto`, over HTTP."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.statuses: list[int] = []

    def take(self, frame: dict[str, Any]) -> None:
        self.received.append(frame)
        data = frame.get("data")
        if not isinstance(data, dict) or data.get("commandType") != "takePhoto":
            return
        (row,) = data["modelIdList"]
        assert row["droneId"] and not row["carId"] and not row["dogId"]
        form = row["uploadSpec"]["fields"] | {"boxes": json.dumps([{"id": "uav[1]", "box": [0.25, 0.25, 0.5, 0.75]}])}
        self.statuses.append(post(row["uploadSpec"]["url"], form, "shot.png", red_picture()))


def red_picture() -> bytes:
    import PIL.Image

    out = io.BytesIO()
    PIL.Image.new("RGB", (128, 96), (250, 10, 10)).save(out, "PNG")
    return out.getvalue()


def post(url: str, form: dict[str, str], filename: str, content: bytes) -> int:
    parts = [
        f'--frontier\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{value}\r\n'.encode()
        for name, value in form.items()
    ]
    head = f'--frontier\r\nContent-Disposition: form-data; name="file"; filename="{filename}"\r\n'
    parts.append(head.encode() + b"Content-Type: image/png\r\n\r\n" + content + b"\r\n--frontier--\r\n")
    request = urllib.request.Request(url, b"".join(parts), {"Content-Type": "multipart/form-data; boundary=frontier"})
    try:
        with urllib.request.urlopen(request, timeout=30) as response:
            return int(response.status)
    except urllib.error.HTTPError as error:
        return int(error.code)


def test_a_lost_session_aborts_the_episode_and_the_trace_replays_to_the_loss(serve: Serve) -> None:
    served = serve(verbs=NORTH, ticks=400)

    class Disconnecting(ReferenceClient):
        def move(self, action: dict[str, Any]) -> None:
            super().move(action)
            if self.step >= 3:
                self.socket.socket.close()

    Disconnecting(served.url()).start()
    trace = served.finish(code=3)
    assert trace.outcome is not None and trace.outcome.reason == "infrastructure-abort"
    assert "LJ-ENGINE_airsim was lost" in trace.outcome.detail
    assert lingjing.replay(trace, world="inline").difference is None


def test_a_session_that_never_answers_aborts_the_episode_with_a_reason(serve: Serve) -> None:
    served = serve("--deadline", "1", verbs=NORTH)
    silent = ReferenceClient(served.url())
    _, text = served.process.communicate(timeout=WAIT_S)
    assert served.process.returncode == 3
    assert "has not acknowledged `resetScenario`, `resetDeliveryScenario`, `resetFireRescueScenario`" in text
    assert "--profile script" in text and "Traceback" not in text
    assert "within 1 s" in " ".join(text.split())  # the deadline of the command line, not the default
    silent.socket.close()


def test_late_answers_are_dropped_and_recorded(serve: Serve) -> None:
    served = serve("--deadline", "1", verbs=NORTH)

    class Slow(ReferenceClient):
        def take(self, frame: dict[str, Any]) -> None:
            data = frame.get("data")
            if isinstance(data, dict) and data.get("commandType") == "executeAction" and self.step == 1:
                self.received.append(frame)
                self.held = data  # answered later
                self.step += 1
                return
            if getattr(self, "held", None) and isinstance(data, dict) and data.get("commandType") == "getObservation":
                held, self.held = self.held, None
                self.reply(held, "actionAck", {"status": "ok"})
            super().take(frame)

    Slow(served.url(), "open_vocab").start()
    trace = served.finish()
    assert [frame.use for frame in trace.engine_frames].count("late") == 1
    reasons = [receipt.reason for record in trace.boundaries for receipt in record.receipts]
    assert "timed_out" in reasons
    assert lingjing.replay(trace, world="inline").difference is None


def connection(backend: Backend, address: str = "airsim") -> ReferenceClient:
    return ReferenceClient(backend.url(address))


REMOTE = """\
ljs 2
use std.air { quadrotor }
use std.weather { clear }

asset foreign : quadrotor { engine = remote }

mission hop "Hop" {
  goal "Fly north."
  scene bay
  clock { tick = 2 s, sync = 500 ms }
  budget { ticks <= 12, policy <= 90 s, engine <= 30 s, capture <= 30 s }
  weather clear
  mode broadcast
  asset uav[k in 1..1] : foreign {
    position = (306.6 m, -620.2 m, 1.875 m), heading = 0 deg, cruise = 15 m/s, band = 0 m..200 m
    actions { takeoff, setDestination, stop }
  }
  agent pilot[i in 1..1] as pilot controls uav[i] { observes uav[i].*, events }
  success when forall u in uav: distance_xy(u, (306.6 m, -500 m)) <= 20 m
}
"""


def test_a_type_of_the_engine_remote_requires_a_session(
    serve: Serve, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "hop.ljs").write_text(REMOTE)
    assert (
        run_command(
            ["run", str(tmp_path / "hop.ljs"), "--policy", "idle", "--world", "inline", "-o", str(tmp_path / "alone")]
        )
        == 3
    )
    assert "lingjing serve --lj-engine MISSION" in capsys.readouterr().err
    served = serve("--policy", "pilot.py:Pilot", mission="hop.ljs", verbs=NORTH)
    ReferenceClient(served.url()).start()
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success
    assert lingjing.replay(trace, world="inline").difference is None


def test_a_scenario_document_of_the_papers_keeps_its_own_names(serve: Serve, tmp_path: Path) -> None:
    drone = {"equipmentCode": "UAV-7", "name": "scout", "data": {"X": 30660.0, "Y": 62020.0, "Z": 190.0}, "raw": 0.0}
    goal = {"targetId": "G-1", "uav_id": "UAV-7", "X": 30660.0, "Y": 58000.0, "Z": 1500.0}
    document = {
        "lingjing": {"mission": "goals", "unit": "cm"}, "taskType": "open_vocab", "extras": {"note": "kept"},
        "equipmentList": {"droneEntityList": [drone]},
        "taskMatrix": [{"task_id": "T", "goal": "fly", "initial_state": {"goalPosition": [goal]}}],
    }  # fmt: skip
    (tmp_path / "goal.json").write_text(json.dumps({"commandType": "resetScenario", "scenario": document}))
    served = serve("--profile", "script", "--pace", "fast", "--policy", "heuristic", mission="goal.json")

    class Simulator(ScriptEngine):
        def reset(self, scenario: dict[str, Any]) -> None:
            self.scenario = scenario
            self.task = scenario["taskId"]
            (row,) = scenario["equipmentList"]["droneEntityList"]
            self.poses = {row["equipmentCode"]: [row["data"][axis] for axis in "XYZ"]}

    client = Simulator(served.url())
    client.start()
    trace = served.finish()
    assert list(client.poses) == ["UAV-7"] and client.scenario["extras"] == {"note": "kept"}
    assert client.scenario["taskType"] == "open_vocab"
    actions = [frame["data"] for frame in client.received if "dronesAction" in frame.get("data", {})]
    assert {row["dronesId"] for action in actions for row in action["dronesAction"]} <= {"UAV-7"}
    assert trace.outcome is not None and trace.outcome.reason in ("success", "budget")
    assert lingjing.replay(trace, world="inline").difference is None
