"""Pictures in memory that crosses the process border."""

import os
import resource

import numpy as np
import pytest

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.shared import load_frame, store_frame
from lingjing.trace.records import CameraPose, FrameInfo

POSE = CameraPose(
    position=(0.0, 0.0, 50.0), heading_deg=0.0, tilt_deg=90.0, roll_deg=0.0, hfov_deg=84.0, width=4, height=3
)
INFO = FrameInfo(id="f1-uav-nadir", entity="uav", camera="nadir", tick=1, time_s=10.0, pose=POSE, channels=("rgb",))


def test_a_picture_arrives_unchanged_and_read_only() -> None:
    depth, semantic = np.arange(12, dtype=np.float32).reshape(3, 4), np.ones((3, 4), np.uint8)
    numbers = np.arange(12, dtype=np.uint16).reshape(3, 4)
    layout, memory = store_frame(StoredFrame(INFO, b"jpeg", depth, semantic, numbers))
    got = load_frame(INFO, layout, memory)
    os.close(memory)
    assert got.jpeg == b"jpeg" and got.depth is not None and got.semantic is not None and got.instance is not None
    for layer, sent in ((got.depth, depth), (got.semantic, semantic), (got.instance, numbers)):
        assert np.array_equal(layer, sent)
        with pytest.raises(ValueError, match="read-only"):
            layer[0, 0] = 7


def test_a_lack_of_file_descriptors_is_an_infrastructure_error() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        with pytest.raises(InfrastructureError, match=r"`f1-uav-nadir` cannot be passed .*: Too many open files"):
            store_frame(StoredFrame(INFO, b"jpeg"))
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
