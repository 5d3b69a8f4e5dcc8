"""Instance masks: what the camera draws, policies receive and the trace holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lingjing.engines.camera.classes import FIRST_ENTITY, instance_numbers, instance_picture
from lingjing.testing import play
from tests.engines.camera_town import WHY_NOT, entity

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)

MISSION = """
ljs 2
use std.air { quadrotor }
use std.fire { fire_source }
use std.logistics { delivery_point }

mission masks "Masks" {
  goal "Look."
  scene residential { extent = 300 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 3 }
  region yard = box((90 m, 90 m), (120 m, 120 m))
  target secret : fire_source { hidden position = (4 m, -60 m) }
  target yards : delivery_point { position = (-4 m, -60 m) }
  asset uav : quadrotor {
    position = (0 m, -60 m, 30 m)
    camera nadir { size = 160 by 120, hfov = 84 deg, channels = [rgb, instance], capture = each_tick }
  }
  agent pilot as pilot controls uav { observes uav.*, events }
  success when uav in yard
}
"""

LOOKER = """
from lingjing.plugins.policy import Decision

class Looker:
    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        (picture,) = observation.pictures
        try:
            picture.instance[0, 0] = 1
        except ValueError:
            counts = {name: int((picture.instance == number).sum()) for name, number in picture.instance_ids.items()}
            return Decision(thought=f"{counts} {picture.instance.dtype} {picture.instance.max()}")
"""


def test_the_mask_for_policies_and_traces_omits_hidden_entities(tmp_path: Path) -> None:
    (tmp_path / "looker.py").write_text(LOOKER, encoding="utf-8")
    (tmp_path / "masks.ljs").write_text(MISSION, encoding="utf-8")
    trace = play(tmp_path / "masks.ljs", tmp_path, policy=f"{tmp_path / 'looker.py'}:Looker", seed=1).trace
    (frame,) = trace.boundaries[0].frames
    mask = trace.picture(frame.id).instance
    assert mask is not None and mask.dtype == np.uint16 and mask.shape == (120, 160)
    assert {seen.entity for seen in frame.boxes} == {"secret", "yards"}
    assert frame.instance_ids == {"yards": 1} and frame.channels_sha256
    pixels = int((mask == 1).sum())
    assert pixels > 10 and set(np.unique(mask).tolist()) == {0, 1}
    (made,) = trace.boundaries[1].decisions
    assert made.decision.thought == f"{{'yards': {pixels}}} uint16 1"


def test_hidden_entities_have_no_number_and_leave_no_gap() -> None:
    bodies = [entity("a", "car", (0.0, 0.0, 0.0)), entity("b", "car", (0.0, 0.0, 0.0), hidden=("position",)),
              entity("c", "car", (0.0, 0.0, 0.0))]  # fmt: skip
    assert instance_numbers(bodies) == {"a": 1, "c": 2}
    ids = np.array([[0, 12, FIRST_ENTITY], [FIRST_ENTITY + 1, FIRST_ENTITY + 2, 255]], np.uint16)
    assert instance_picture(ids, bodies).tolist() == [[0, 0, 1], [0, 2, 0]]
