"""One flight drawn by two renderers: Mesa's llvmpipe, and its softpipe, which shares no rasteriser with it.

No machine of the tests has a graphics card, so softpipe stands for another renderer.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import lingjing
from lingjing.engines.camera.context import DEVICE, open_context

FLIGHT = """\
ljs 2
use std.air { quadrotor }
use std.sea { lifeboat, person_in_water }
mission look "Look" {
  goal "Look."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 2 s, sync = 500 ms }
  budget { ticks <= 2 }
  target victim[1..3] : person_in_water { position = at(i, [(100 m, -850 m), (120 m, -860 m), (140 m, -830 m)]) }
  asset boat : lifeboat { position = (90 m, -845 m), heading = 30 deg }
  asset uav : quadrotor { position = (110 m, -900 m, 30 m), heading = 0 deg
    camera front { size = 320 by 180, hfov = 90 deg, channels = [rgb, depth, semantic], capture = each_tick }
    actions { takeoff, setDestination, takePhoto } }
  agent scout as searcher controls uav { observes uav.*, events }
  success when now > 3 s
}
"""


def command(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "lingjing.cli.main", *arguments]
    return subprocess.run(line, capture_output=True, text=True, env={**os.environ, **variables})


def softpipe() -> bool:
    probe = "import moderngl; print(moderngl.create_context(standalone=True, backend='egl').info['GL_RENDERER'])"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True,
                          env={**os.environ, "GALLIUM_DRIVER": "softpipe"})  # fmt: skip
    return done.stdout.startswith("softpipe")


@pytest.mark.thorough
def test_another_renderer_confirms_a_flight_within_the_tolerance(tmp_path: Path) -> None:
    if not softpipe():
        pytest.skip("Mesa has no softpipe here")
    (tmp_path / "look.ljs").write_text(FLIGHT)
    options = ("run", str(tmp_path / "look.ljs"), "--policy", "idle", "--no-overview", "-o")
    assert command(*options, str(tmp_path / "a"), LINGJING_GL_DEVICE="software").returncode == 0
    done = command("replay", str(tmp_path / "a"), "--pictures", GALLIUM_DRIVER="softpipe")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "pixels differ within the tolerance of two renderers" in done.stdout and "drawn with softpipe" in done.stdout
    assert command(*options, str(tmp_path / "b"), GALLIUM_DRIVER="softpipe").returncode == 0
    first, second = (lingjing.read(tmp_path / name / "trace.mcap") for name in ("a", "b"))
    for record, twin in zip(first.boundaries, second.boundaries, strict=True):
        assert record.snapshots == twin.snapshots, "engines do not depend on the renderer"
        for frame, again in zip(record.frames, twin.frames, strict=True):
            boxes, others = ({box.entity: box.box for box in each.boxes} for each in (frame, again))
            assert boxes.keys() == others.keys() and "boat" in boxes
            for entity, box in boxes.items():
                sizes = (320, 180, 320, 180)
                off = [abs(a - b) * size for a, b, size in zip(box, others[entity], sizes, strict=True)]
                assert max(off) <= 1.0 + 1e-6, (entity, off)


@pytest.mark.parametrize(
    ("device", "message"),
    [("gpu", "LINGJING_GL_DEVICE=gpu names no device"), ("99", "requested device index 99, but found")],
)
def test_a_device_that_does_not_exist_is_named(device: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(DEVICE, device)
    with pytest.raises(lingjing.UsageError, match=message):
        open_context()
