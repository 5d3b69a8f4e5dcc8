"""Pictures of branches: each is rendered once, and only if the trace does not hold it."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from lingjing import Trace, run
from lingjing import read as read_trace
from lingjing.analysis.played_city import rebuilt_city
from lingjing.causal.branch_pictures import BranchPictures
from lingjing.causal.picture_memory import PictureMemory
from lingjing.causal.shared_camera import SharedCamera
from lingjing.errors import InfrastructureError
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.sensor import Sensor
from lingjing.plugins.engine import CaptureRequest
from lingjing.testing import PluginHost, decode_jpeg, mission_file, shortened
from lingjing.trace.records import BodyState, FrameInfo
from tests.engines.camera_town import WHY_NOT

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)

replace = msgspec.structs.replace


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Twelve ticks of a sea search by an oracle, with pictures."""
    short = shortened(mission_file("ssr"), 12)
    folder = tmp_path_factory.mktemp("search") / "episode"
    return read_trace(run(short, policy="oracle", seed=1, out=folder, overview=False).trace)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record the ids of the pictures that a sensor renders from now on."""
    names: list[str] = []
    draw = Sensor.picture

    def noted(sensor: Sensor, request: CaptureRequest, *, pixels: bool) -> StoredFrame | None:
        names.append(request.frame)
        return draw(sensor, request, pixels=pixels)

    monkeypatch.setattr(Sensor, "picture", noted)
    return names


@pytest.fixture(scope="module")
def pictures(search: Trace) -> Iterator[BranchPictures]:
    host = PluginHost()
    engine = host.engine("camera").factory()
    sensor = Sensor("camera", engine)
    sensor.reset(search.header.instance, rebuilt_city(search, host))
    yield BranchPictures(search, sensor)
    engine.close()


def request_of(frame: FrameInfo) -> CaptureRequest:
    return CaptureRequest(
        frame=frame.id, entity=frame.entity, camera=frame.camera, tick=frame.tick, time_s=frame.time_s
    )


def nameless(info: FrameInfo) -> FrameInfo:
    """Return a picture without the hashes of its pixels."""
    return replace(info, sha256="", channels_sha256="")


def states_at(trace: Trace, tick: int) -> dict[str, BodyState]:
    snapshot = trace.boundaries[tick].snapshots[-1]
    return {state.id: state for state in snapshot.states + snapshot.ambient}


def test_a_picture_is_rendered_once_and_only_if_a_visible_body_moved(
    search: Trace, pictures: BranchPictures, drawn: list[str]
) -> None:
    frame = next(iter(search.frames.values()))
    states = states_at(search, frame.tick)

    def taken(**changed: tuple[float, float, float]) -> StoredFrame:
        shown = {**states, **{name: replace(states[name], position=place) for name, place in changed.items()}}
        got = pictures.picture(request_of(frame), frame.time_s, list(shown.values()))
        assert got is not None
        return got

    east, north, _ = frame.pose.position
    recorded = search.picture(frame.id)
    for same in (taken(), taken(boat=(east + 5000.0, north, states["boat"].position[2]))):
        assert (same.info, same.jpeg) == (frame, search.jpeg(frame.id))
        for layer, held in ((same.depth, recorded.depth), (same.semantic, recorded.semantic)):
            assert layer is not None and held is not None and np.array_equal(layer, held)
    assert drawn == []
    under = (east, north, states["boat"].position[2])
    first, again = taken(boat=under), taken(boat=under)
    assert first.jpeg != search.jpeg(frame.id) and first.info.id == frame.id
    assert (first.info, first.jpeg) == (again.info, again.jpeg)
    for layer, held in ((first.depth, again.depth), (first.semantic, again.semantic)):
        assert layer is not None and held is not None and np.array_equal(layer, held)
    assert drawn == [frame.id]


def test_a_request_without_pixels_returns_the_same_labels_and_no_pixels(
    search: Trace, pictures: BranchPictures
) -> None:
    frame = next(iter(search.frames.values()))
    states = states_at(search, frame.tick)
    place = (*frame.pose.position[:2], states["boat"].position[2])
    moved = {**states, "boat": replace(states["boat"], position=place)}
    for shown in (states, moved):
        request, stand = request_of(frame), list(shown.values())
        whole = pictures.picture(request, frame.time_s, stand)
        known = pictures.picture(request, frame.time_s, stand, pixels=False)
        assert whole is not None and known is not None and whole.depth is not None
        assert nameless(known.info) == nameless(whole.info)
        assert decode_jpeg(known.jpeg).shape == (1, 1, 3) and known.depth is None and known.semantic is None
        again = pictures.picture(request, frame.time_s, stand)
        assert again is not None and (again.info, again.jpeg) == (whole.info, whole.jpeg)


def test_an_ended_camera_process_is_reported(search: Trace) -> None:
    host = PluginHost()
    camera = SharedCamera(search, rebuilt_city(search, host), host)
    os.kill(camera._process, signal.SIGKILL)
    os.waitpid(camera._process, 0)
    frame = next(iter(search.frames.values()))
    with pytest.raises(InfrastructureError, match="the camera of the branches has ended"):
        camera.capture(frame.tick, [request_of(frame)], list(states_at(search, frame.tick).values()))


def test_the_least_recently_used_picture_is_evicted_first(search: Trace) -> None:
    frame = next(iter(search.frames.values()))
    held = StoredFrame(frame, bytes(1000))
    memory = PictureMemory(room=2500)
    memory.keep(b"a", held)
    memory.keep(b"b", held)
    assert memory.find(b"a") == held
    memory.keep(b"c", held)
    assert [memory.find(key) is not None for key in (b"a", b"b", b"c")] == [True, False, True]


def test_packed_pictures_use_less_than_twice_the_memory_of_their_data() -> None:
    """In a separate process, where the allocator holds no free blocks from earlier tests."""
    ran = subprocess.run([sys.executable, "-c", PACKED], capture_output=True, text=True, check=True)
    held, grown = map(int, ran.stdout.split())
    assert grown < 2 * held


PACKED = """
from pathlib import Path
import numpy as np
from lingjing.causal.picture_memory import _PackedArray

def resident():
    (line,) = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS")]
    return int(line.split()[1]) << 10

depth = np.repeat(np.random.default_rng(1).random((1080, 240), dtype=np.float32), 8, axis=1)
for _ in range(3):  # from here on the allocator gives large blocks from its heap, as it does after some pictures
    block = bytearray(24 << 20)
    del block
before, packed = resident(), []
for _ in range(40):
    farther = depth * 1.5
    packed += [_PackedArray.of(farther)]
    classes = (farther > 1.0).astype(np.uint8)
    packed += [_PackedArray.of(classes)]
print(sum(len(array.data) for array in packed), resident() - before)
"""
