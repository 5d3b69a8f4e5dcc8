"""Scripts of the real client package fly in our city."""

from __future__ import annotations

import asyncio
import importlib.util
import io
import math
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from lingjing.testing import instantiate, mission_file, run_command
from lingjing.trace.records import GROUNDED
from tests.serve.conftest import Serve, Served, thoughts

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    airsim: Any = pytest.importorskip("cosysairsim", reason="the client is not installed: `make setup` installs it")
rpc_error: Any = pytest.importorskip("msgpackrpc.error").RPCError


@pytest.fixture(autouse=True)
def loop() -> Iterator[None]:
    """The client takes the thread's event loop, which pytest-asyncio closes."""
    made = asyncio.new_event_loop()
    asyncio.set_event_loop(made)
    yield
    made.close()
    asyncio.set_event_loop(None)


def connected(served: Served, *vehicles: str) -> Any:
    client = airsim.MultirotorClient(port=served.port)
    client.confirmConnection()
    for name in vehicles or ("",):
        client.enableApiControl(True, name)
        assert client.armDisarm(True, name)
    return client


def leave(client: Any) -> None:
    client.client.close()


def place(client: Any, vehicle: str = "") -> tuple[float, float, float]:
    at = client.simGetVehiclePose(vehicle).position
    return at.x_val, at.y_val, at.z_val


def seconds(client: Any) -> float:
    return float(client.getMultirotorState().timestamp) / 1e9


def test_a_drone_takes_off_hovers_turns_and_lands_and_the_trace_replays(serve: Serve) -> None:
    served = serve("--scene", "bay")
    client = connected(served)
    assert client.listVehicles() == ["drone1"]
    assert client.getMultirotorState().landed_state == airsim.LandedState.Landed
    client.takeoffAsync().join()
    assert client.getMultirotorState().landed_state == airsim.LandedState.Flying
    assert math.dist(place(client), (0.0, 0.0, -3.0)) < 0.8
    client.hoverAsync().join()
    before = seconds(client)
    assert seconds(client) == before, "at this pace, time advances only during a call that waits"
    client.simContinueForTime(5.0)
    assert seconds(client) - before == pytest.approx(5.0)
    assert client.simIsPause()
    client.simPause(False)
    assert math.dist(place(client), (0.0, 0.0, -3.0)) < 1.0, "the drone holds its place"
    client.rotateToYawAsync(90.0, margin=2.0).join()
    turn = client.simGetVehiclePose().orientation
    assert math.degrees(2.0 * math.atan2(turn.z_val, turn.w_val)) == pytest.approx(90.0, abs=4.0)
    assert client.getDistanceSensorData("down").distance == pytest.approx(-place(client)[2], abs=0.4)
    force = client.getImuData().linear_acceleration
    assert force.z_val == pytest.approx(-9.8, abs=1.0)
    client.landAsync().join()
    assert client.getMultirotorState().landed_state == airsim.LandedState.Landed
    assert abs(place(client)[2]) < 0.2
    client.takeoffAsync().join()
    assert place(client)[2] < -2.0, "a landed drone flies again"
    leave(client)
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success
    assert any("takeoff(20, '')" in line for _, line in thoughts(trace))
    assert run_command(["replay", str(trace.path)]) == 0


@pytest.mark.parametrize("overview", [True, False])
def test_an_overview_is_drawn_unless_an_option_prevents_it(serve: Serve, overview: bool) -> None:
    served = serve("--scene", "bay", overview=overview)
    client = connected(served)
    leave(client)
    assert served.finish().complete
    assert (served.folder / "overview.png").is_file() is overview


def test_velocities_and_paths_are_north_east_down(serve: Serve) -> None:
    served = serve("--scene", "bay")
    client = connected(served)
    client.takeoffAsync().join()
    client.moveToZAsync(-10, 3).join()
    assert place(client)[2] == pytest.approx(-10.0, abs=0.8)
    start = place(client)
    client.moveByVelocityAsync(0, 4, 0, 5).join()
    north, east, _ = (b - a for a, b in zip(start, place(client), strict=True))
    assert east == pytest.approx(18.0, abs=3.0) and abs(north) < 1.0
    speed = client.getMultirotorState().kinematics_estimated.linear_velocity
    assert speed.y_val == pytest.approx(4.0, abs=0.5)
    gps = client.getGpsData().gnss.geo_point
    corners = [airsim.Vector3r(0, 20, -12), airsim.Vector3r(30, 20, -12), airsim.Vector3r(30, 0, -12)]
    client.moveOnPathAsync(corners, 6, 120, airsim.DrivetrainType.ForwardOnly, airsim.YawMode(False, 0)).join()
    assert math.dist(place(client), (30.0, 0.0, -12.0)) < 1.2
    later = client.getGpsData().gnss.geo_point
    assert later.latitude > gps.latitude and later.longitude < gps.longitude
    heading = client.simGetVehiclePose().orientation
    assert math.degrees(2.0 * math.atan2(heading.z_val, heading.w_val)) % 360 == pytest.approx(270.0, abs=15.0)
    start = place(client)
    client.moveByRollPitchYawZAsync(
        0, 0.2, 0, -12, 2
    ).join()  # the client's positive pitch is nose down: forwards, north
    north, east, down = (b - a for a, b in zip(start, place(client), strict=True))
    assert north > 1.0 and abs(down) < 1.0, (north, east, down)
    client.simPlotLineStrip(corners)
    task = client.moveToPositionAsync(0, 0, -12, 3)
    client.cancelLastTask()
    task.join()
    assert task.get() is False
    client.goHomeAsync().join()
    assert math.hypot(*place(client)[:2]) < 1.0
    leave(client)
    served.finish()


def test_a_client_receives_images_of_each_served_type(serve: Serve) -> None:
    served = serve("--scene", "bay", "--camera", "160x90")
    client = connected(served)
    client.takeoffAsync().join()
    client.moveToPositionAsync(15, 20, -20, 8).join()
    types = airsim.ImageType
    scene, planar, perspective, classes, raw = client.simGetImages(
        [
            airsim.ImageRequest("3", types.Scene),
            airsim.ImageRequest("bottom_center", 1, True, False),
            airsim.ImageRequest("nadir", 2, True, False),
            airsim.ImageRequest("nadir", types.Segmentation, False, False),
            airsim.ImageRequest("0", types.Scene, False, False),
        ]
    )
    picture = np.asarray(Image.open(io.BytesIO(scene.image_data_uint8)))
    assert picture.shape == (90, 160, 3)
    depth = np.array(planar.image_data_float).reshape(90, 160)
    along = np.array(perspective.image_data_float).reshape(90, 160)
    below = client.getDistanceSensorData("down").distance  # from the city's terrain, not from the picture
    assert np.median(depth) == pytest.approx(below, abs=0.5)
    assert np.all(along >= depth - 1e-3) and along[0, 0] > 1.2 * depth[0, 0]
    assert len(classes.image_data_uint8) == len(raw.image_data_uint8) == 90 * 160 * 3
    assert scene.camera_position.z_val == pytest.approx(place(client)[2], abs=0.5)
    assert client.simGetImage("0", types.Scene)[:4] == b"\x89PNG"
    info = client.simGetCameraInfo("0")
    assert info.fov == 90.0
    with pytest.raises(rpc_error, match="no camera `back_center`: front, nadir"):
        client.simGetImage("back_center", types.Scene)
    with pytest.raises(rpc_error, match="image type 8 is not served"):
        client.simGetImages([airsim.ImageRequest("0", types.OpticalFlow)])
    leave(client)
    trace = served.finish()
    assert sum(len(record.frames) for record in trace.boundaries) == 3


def test_a_client_moves_a_camera_changes_its_lens_and_the_trace_has_its_pose(serve: Serve) -> None:
    served = serve("--scene", "bay", "--camera", "160x90")
    client = connected(served)
    client.takeoffAsync().join()
    client.moveToPositionAsync(0, 0, -20, 8).join()
    client.hoverAsync().join()
    wide = client.simGetCameraInfo("0")
    downwards = airsim.euler_to_quaternion(0, -math.pi / 2, 0)
    client.simSetCameraPose("0", airsim.Pose(airsim.Vector3r(0, 0, 0.1), downwards))
    client.simSetCameraFov("0", 40)
    info = client.simGetCameraInfo("0")
    assert (wide.fov, info.fov) == (90.0, 40.0) and client.simGetCurrentFieldOfView("0") == "40.000000"
    assert info.proj_mat.matrix[0][0] == pytest.approx(1.0 / math.tan(math.radians(20)))
    moved, mounted = client.simGetImages(
        [airsim.ImageRequest("0", 1, True, False), airsim.ImageRequest("nadir", 1, True, False)]
    )
    down, below = (np.array(image.image_data_float).reshape(90, 160) for image in (moved, mounted))
    assert np.median(down) == pytest.approx(np.median(below), abs=0.6), "both look straight down"
    pitch = airsim.quaternion_to_euler_angles(moved.camera_orientation)[1]
    assert math.degrees(pitch) == pytest.approx(-90.0, abs=3.0), "the camera is fixed to the body, which hovers"
    ideal = client.simGetImages([airsim.ImageRequest("0", airsim.ImageType.Scene, False, False)])[0]
    client.simSetDistortionParams("0", {"K1": -0.3, "K2": 0.1})
    assert client.simGetDistortionParams("0") == [-0.3, 0.1, 0.0, 0.0, 0.0]
    bent = client.simGetImages([airsim.ImageRequest("0", 1, True, False)])[0]
    assert np.array(bent.image_data_float).reshape(90, 160)[45, 80] == pytest.approx(down[45, 80], abs=0.2)
    assert (ideal.width, ideal.height) == (160, 90)
    for call, message in (
        (lambda: client.simSetCameraFov("0", 179), "`hfov` is 179 deg: 1 to 170"),
        (lambda: client.simSetDistortionParams("0", {"K9": 0.1}), "no parameter `K9`: K1, K2, K3, P1, P2"),
        (lambda: client.simSetDistortionParams("0", {"K1": 9.0}), "`K1` is 9: -1 to 1"),
        (lambda: client.simSetCameraPose("0", airsim.Pose(airsim.Vector3r(), airsim.Quaternionr(w_val=0))), "length"),
        (lambda: client.simSetCameraPose("0", airsim.Pose(airsim.Vector3r(0, 0, 400))), "`above` is -400 m: -100 to"),
    ):
        with pytest.raises(rpc_error, match=message):
            call()
    leave(client)
    trace = served.finish()
    poses = [frame.pose for record in trace.boundaries for frame in record.frames if frame.camera == "front"]
    assert [pose.hfov_deg for pose in poses] == [40.0] * 3 and all(abs(pose.tilt_deg - 90.0) < 3.0 for pose in poses)
    assert run_command(["replay", str(served.folder / "trace.mcap"), "--pictures"]) == 0


def test_no_command_moves_a_camera_of_a_mission() -> None:
    for entity in instantiate("ssr", tier=1).entities:
        for verb in entity.verbs:
            assert not {argument.name for argument in verb.arguments} & {"hfov", "ahead", "pitch"}


def test_two_drones_fly_at_once_and_a_reset_begins_another_episode(serve: Serve) -> None:
    served = serve("--scene", "bay", "--drones", "2")
    client = connected(served, "Drone1", "drone2")
    assert client.listVehicles() == ["drone1", "drone2"]
    both = [client.takeoffAsync(vehicle_name=name) for name in ("Drone1", "Drone2")]
    for task in both:
        task.join()
    before = seconds(client)
    both = [
        client.moveToPositionAsync(-40, 0, -8, 5, vehicle_name="Drone1"),
        client.moveToPositionAsync(40, 0, -8, 5, vehicle_name="Drone2"),
    ]
    for task in both:
        task.join()
    assert seconds(client) - before < 16.0, "both fly in the same time: one after the other would take 20 s"
    assert place(client, "Drone1")[0] == pytest.approx(-40.0, abs=1.0)
    assert place(client, "Drone2")[0] == pytest.approx(40.0, abs=1.0)
    client.reset()
    assert place(client, "Drone1") == (0.0, 0.0, 0.0)
    assert not client.isApiControlEnabled("Drone1")
    with pytest.raises(rpc_error, match="API control of `drone1` is off"):
        client.takeoffAsync(vehicle_name="Drone1").get()
    with pytest.raises(rpc_error, match="there is no vehicle `Ghost`: drone1, drone2"):
        client.getMultirotorState("Ghost")
    leave(client)
    assert served.finish().outcome is not None
    assert (served.folder.with_name("run0-2") / "trace.mcap").is_file()


def test_calls_of_published_scripts_are_answered(serve: Serve) -> None:
    """Calls that AirSim answers and that published examples contain do not end a script."""
    served = serve("--scene", "bay", "--camera", "160x90")
    client = airsim.MultirotorClient(port=served.port)
    assert client.armDisarm(True) is False, "without control"
    client.enableApiControl(True)
    assert (client.armDisarm(False), client.armDisarm(True), client.armDisarm(False)) == (False, True, True)
    client.reset()
    assert client.armDisarm(False) is False, "`reset` has ended the control"
    least, most = client.simGetWorldExtents()
    here = client.getMultirotorState().gps_location
    assert least.latitude < here.latitude < most.latitude and least.longitude < here.longitude < most.longitude
    here.latitude -= 1.5
    assert client.simTestLineOfSightToPoint(here) in (True, False)
    here.altitude += 1e6
    assert client.simTestLineOfSightToPoint(here), "straight up"
    classes, red = (
        client.simGetImages([airsim.ImageRequest("0", airsim.ImageType.Segmentation, is_float, False)])[0]
        for is_float in (False, True)
    )
    colours = np.frombuffer(classes.image_data_uint8, np.uint8).reshape(90, 160, 3)
    assert np.array(red.image_data_float).reshape(90, 160) == pytest.approx(colours[..., 2] / 255.0)
    # Microsoft's client `airsim` sends `external` as the last argument
    requests = [airsim.ImageRequest("0", airsim.ImageType.Scene)]
    assert client.client.call("simGetImages", requests, "", False)[0]["width"] == 160
    assert len(client.client.call("simGetImage", "0", 0, "", False)) > 100
    assert client.client.call("simGetCameraInfo", "0", "", False)["fov"] == 90.0
    assert client.client.call("simGetDetections", "0", 0, "", False) == []
    with pytest.raises(rpc_error, match="`simGetCameraInfo` has no `external` cameras"):
        client.client.call("simGetCameraInfo", "0", "", True)
    leave(client)
    served.finish()


def test_a_wrong_or_unserved_call_is_answered_with_a_message(serve: Serve) -> None:
    served = serve("--scene", "bay")
    client = connected(served)
    for call, message in (
        (client.getEchoData, "`getEchoData` is not served"),
        (lambda: client.simSetWind(airsim.Vector3r(9, 0, 0)), "`simSetWind` is not served"),
        (lambda: client.moveToPositionAsync(float("nan"), 0, 0, 5).get(), "`x` of `moveToPosition` is a finite number"),
        (lambda: client.moveToPositionAsync("a", 0, 0, 5).get(), "`x` of `moveToPosition` is a number, not 'a'"),
        (lambda: client.moveToPositionAsync(1, 0, 0, 0).get(), "`velocity` is a speed above 0"),
        (lambda: client.moveOnPathAsync([], 5).get(), "`path` of `moveOnPath` is a list of 1 to"),
        (lambda: client.client.call("ping", 1), "`ping` has 0 arguments"),
        (lambda: client.simListSceneObjects("(a+)+b"), "without nested repetitions"),
    ):
        with pytest.raises(rpc_error, match=message.replace("(", r"\(").replace("`", "`")):
            call()
    assert client.ping()
    leave(client)
    served.finish()


def test_a_drone_holds_its_position_after_its_client_is_killed(serve: Serve) -> None:
    served = serve("--scene", "bay")
    watcher = connected(served)
    watcher.takeoffAsync().join()
    script = (
        "import cosysairsim, sys\n"
        f"client = cosysairsim.MultirotorClient(port={served.port})\n"
        "client.ping()\n"
        "task = client.moveToPositionAsync(300, 0, -10, 5)\n"
        "print('flies', flush=True)\n"
        "task.join()\n"
    )
    flier = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert flier.stdout is not None and flier.stdout.readline() == "flies\n"
    while not watcher.getMultirotorState().kinematics_estimated.linear_velocity.x_val > 1.0:
        pass
    flier.kill()
    flier.wait(60)
    watcher.simContinueForTime(10.0)
    reached = place(watcher)
    watcher.simContinueForTime(10.0)
    assert math.dist(place(watcher), reached) < 1.0
    leave(watcher)
    trace = served.finish()
    assert trace.boundaries[-1].snapshots[-1].states[0].status != GROUNDED


def test_the_drones_of_a_mission_fly_and_its_hidden_targets_stay_hidden(serve: Serve) -> None:
    served = serve("ssr", "--mode", "broadcast")
    client = connected(served)
    assert client.listVehicles() == ["uav1", "uav2", "uav3"]
    assert client.simListSceneObjects() == ["uav1", "uav2", "uav3", "boat"]
    assert math.isnan(client.simGetObjectPose("victim1").position.x_val)
    with pytest.raises(rpc_error, match="the mission declares the cameras of `uav1`"):
        client.simSetCameraFov("0", 20, "uav1")
    for change in (lambda: client.simEnableWeather(True), lambda: client.simSetTimeOfDay(True, "2018-02-12 12:00:00")):
        with pytest.raises(rpc_error, match="the mission declares its weather and its sun"):
            change()
    client.takeoffAsync().join()
    assert place(client)[2] < -2.0
    leave(client)
    served.process.communicate(timeout=120)
    assert (served.folder / "trace.mcap.part").is_file(), (
        "the trace of a mission is not complete after its client leaves"
    )
    assert served.process.returncode == 0


def test_a_car_drives_along_its_road_turns_and_stops(serve: Serve, tmp_path: Path) -> None:
    if importlib.util.find_spec("libsumo") is None:
        pytest.skip("the extra `road` is not installed")
    text = mission_file("cd").read_text(encoding="utf-8")
    for long, short in (
        ("traffic = 80", "traffic = 0"),
        ("vans = 5 in", "vans = 2 in"),
        ("points = 20 in", "points = 2 in"),
    ):
        assert text.count(long) == 1
        text = text.replace(long, short)
    (tmp_path / "empty_streets.ljs").write_text(text, encoding="utf-8")
    served = serve("empty_streets.ljs")
    client = airsim.CarClient(port=served.port)
    client.confirmConnection()
    assert client.listVehicles()[0] == "van1"
    assert client.getCarState("van1").speed == 0.0
    go, halt = airsim.CarControls(throttle=0.5), airsim.CarControls(brake=1)
    with pytest.raises(rpc_error, match="API control of `van1` is off"):
        client.setCarControls(go, "van1")
    client.enableApiControl(True, "van1")
    client.setCarControls(go, "van1")
    client.simContinueForTime(4.0)
    client.simPause(False)
    state = client.getCarState("van1")
    assert state.speed > 4.0 and client.getCarControls("van1").throttle == 0.5
    client.setCarControls(halt, "van1")
    client.setCarControls(go, "van1")
    client.setCarControls(halt, "van1")  # both wait until the car has braked
    client.simContinueForTime(6.0)
    stood = client.getCarState("van1")
    assert stood.speed == pytest.approx(0.0, abs=0.05)
    start, end = state.kinematics_estimated.position, stood.kinematics_estimated.position
    assert math.hypot(end.x_val - start.x_val, end.y_val - start.y_val) > 2.0
    client.setCarControls(halt, "van1")  # in the pause that `simContinueForTime` has left; it does not wait
    client.simPause(False)
    before = client.simGetVehiclePose("van1").orientation
    for side in (1.0, -1.0):  # one of the turns exists at the next junction
        try:
            client.setCarControls(airsim.CarControls(throttle=0.5, steering=side), "van1")
        except rpc_error as error:
            assert "`setCarControls`: `van1`: no way leads" in str(error)
            continue
        break
    client.simContinueForTime(40.0)
    after = client.simGetVehiclePose("van1").orientation
    turned = airsim.quaternion_to_euler_angles(after)[2] - airsim.quaternion_to_euler_angles(before)[2]
    assert abs(math.degrees(turned)) > 30.0, "the car has turned"
    with pytest.raises(rpc_error, match="`setCarControls`: cars follow their lanes here, and do not reverse"):
        client.setCarControls(airsim.CarControls(throttle=-0.5), "van1")
    client.reset()
    assert client.isApiControlEnabled("van1"), "`reset` does not end the control of a car, as in AirSim"
    drone = airsim.MultirotorClient(port=served.port)
    with pytest.raises(rpc_error, match="`van1` is no multirotor"):
        drone.takeoffAsync(vehicle_name="van1").get()
    for each in (client, drone):
        leave(each)
    served.process.communicate(timeout=120)
    assert served.process.returncode == 0


ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["airsim_hover.py", "airsim_survey.py"])
def test_the_example_scripts_fly_to_success(serve: Serve, name: str, tmp_path: Path) -> None:
    served = serve("--scene", "bay")
    command = [sys.executable, str(ROOT / "examples" / name), "--port", str(served.port)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success


def tilt_deg(client: Any) -> tuple[float, float, float]:
    """Roll, pitch (nose up) and yaw of the drone in degrees."""
    turn = client.simGetVehiclePose().orientation
    w, x, y, z = turn.w_val, turn.x_val, turn.y_val, turn.z_val
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return math.degrees(roll), math.degrees(math.asin(2.0 * (w * y - z * x))), math.degrees(yaw)


def test_commands_of_angles_rates_throttle_and_sticks_tilt_the_drone(serve: Serve) -> None:
    served = serve("--scene", "bay")
    client = connected(served)
    client.moveToZAsync(-20, 3).join()
    client.moveByRollPitchYawZAsync(0.0, 0.2, 0.0, -20, 2).join()
    roll, pitch, _ = tilt_deg(client)
    assert (roll, pitch) == (pytest.approx(0.0, abs=2.0), pytest.approx(-math.degrees(0.2), abs=2.0))
    assert place(client)[0] > 1.5 and place(client)[2] == pytest.approx(-20.0, abs=1.0)
    client.hoverAsync().join()
    before = tilt_deg(client)[2]
    client.moveByRollPitchYawrateThrottleAsync(0.1, 0.0, -0.4, 0.55, 2).join()
    roll, _, yaw = tilt_deg(client)
    assert roll == pytest.approx(math.degrees(0.1), abs=2.0), "to the right"
    assert (yaw - before) % 360.0 == pytest.approx(math.degrees(0.8), abs=12.0), "the client's yaw rate is to the left"
    assert client.getMultirotorState().kinematics_estimated.linear_velocity.z_val < -0.5, "more thrust than weight"
    client.hoverAsync().join()
    start = tilt_deg(client)[0]
    client.moveByAngleRatesZAsync(0.1, 0.0, 0.0, -22, 1.5).join()
    assert tilt_deg(client)[0] - start == pytest.approx(math.degrees(0.15), abs=3.0), "angular rates are integrated"
    client.hoverAsync().join()
    with pytest.raises(rpc_error, match="no remote control"):
        client.moveByManualAsync(5, 5, -5, 1).get()
    with pytest.raises(rpc_error, match="share from 0 to 1"):
        client.moveByRollPitchYawThrottleAsync(0.0, 0.0, 0.0, 7.0, 1).get()
    client.moveByRC(airsim.RCData(pitch=-0.3, throttle=0.5, is_initialized=True, is_valid=True))
    client.simContinueForTime(1.5)
    client.simPause(False)
    assert tilt_deg(client)[1] == pytest.approx(-0.3 * 180.0 / 5.5, abs=3.0)
    client.moveByManualAsync(5, 5, -5, 3).join()
    assert math.hypot(*(client.getMultirotorState().kinematics_estimated.linear_velocity.to_numpy_array()[:2])) > 0.8
    client.moveByRC(airsim.RCData(is_valid=False))
    client.goHomeAsync().join()
    assert math.dist(place(client), (0.0, 0.0, 0.0)) < 1.0
    client.landAsync().join()
    assert client.getMultirotorState().landed_state == airsim.LandedState.Landed
    assert client.simGetDistortionParams("front") == [0.0] * 5
    leave(client)
    assert run_command(["replay", str(served.finish().path), "--world", "inline"]) == 0


def test_a_drone_gets_detections_and_segmentation_ids_of_the_other_drone(serve: Serve) -> None:
    served = serve("--scene", "bay", "--drones", "2")
    client = connected(served, "drone1", "drone2")
    assert sorted(client.simListInstanceSegmentationObjects()) == ["drone1", "drone2"]
    assert len(client.simListInstanceSegmentationPoses()) == 2
    client.moveToZAsync(-6, 3, vehicle_name="drone1").join()
    scene = airsim.ImageType.Scene
    assert client.simGetDetections("bottom_center", scene, "drone1") == [], "nothing is detected without a filter"
    client.simAddDetectionFilterMeshName("bottom_center", scene, "drone*", "drone1")
    client.simSetDetectionFilterRadius("bottom_center", scene, 2_000, "drone1")
    (detection,) = client.simGetDetections("bottom_center", scene, "drone1")
    assert detection.name == "drone2"
    low, high = detection.box2D.min, detection.box2D.max
    assert 0 <= low.x_val < high.x_val <= 256 and 0 <= low.y_val < high.y_val <= 144
    assert detection.relative_pose.position.x_val == pytest.approx(5.9, abs=0.8), "metres below, along the optical axis"
    assert detection.box3D.min.x_val < detection.relative_pose.position.x_val < detection.box3D.max.x_val
    segmentation = airsim.ImageRequest("bottom_center", airsim.ImageType.Infrared, False, False)
    own = client.simGetSegmentationObjectID("drone2")
    assert client.simSetSegmentationObjectID("drone2", 200) and client.simGetSegmentationObjectID("drone2") == 200
    assert not client.simSetSegmentationObjectID("Unicorn", 200) and client.simGetSegmentationObjectID("Unicorn") == -1
    assert client.simSetSegmentationObjectID("dro.*1", 201, True)
    (image,) = client.simGetImages([segmentation], "drone1")
    ids = np.frombuffer(image.image_data_uint8, np.uint8).reshape(image.height, image.width, 3)
    shown = ids[int(low.y_val) : int(high.y_val), int(low.x_val) : int(high.x_val), 0]
    assert own != 200 and (shown == 200).any()
    client.simSetDetectionFilterRadius("bottom_center", scene, 100, "drone1")
    assert client.simGetDetections("bottom_center", scene, "drone1") == []
    client.simClearDetectionMeshNames("bottom_center", scene, "drone1")
    with pytest.raises(rpc_error, match="0 to 255"):
        client.simSetSegmentationObjectID("drone2", 900)
    leave(client)
    served.finish()


def test_a_lidar_measures_the_ground_below_the_drone(serve: Serve) -> None:
    served = serve("--scene", "bay")
    client = connected(served)
    client.moveToZAsync(-6, 3).join()
    data = client.getLidarData()
    points = np.array(data.point_cloud).reshape(-1, 3)
    assert 20 < len(points) <= 8 * 45
    assert (np.linalg.norm(points, axis=1) < 40.0).all()
    below = points[points[:, 2] > 1.0][:, 2]
    height = -place(client)[2]
    assert np.median(below) == pytest.approx(height, abs=1.0), "most rays that look down meet the pier"
    leave(client)
    served.finish()
