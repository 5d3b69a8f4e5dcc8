"""A trace read by Foxglove's own reader packages (npm), with strict JSON Schema validation."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lingjing import Trace
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.trace.surroundings import CityMesh, Surroundings
from tests.readers import node, skip_without_node

skip_without_node()

MESH = CityMesh("road", np.eye(3), np.array([(0, 1, 2)], np.uint32), (0.1, 0.2, 0.3))


def test_foxgloves_reader_finds_every_message_and_strict_validation_passes(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    with TraceWriter(path, trace.header, surroundings=Surroundings(meshes=(MESH,))) as writer:
        for record in trace.boundaries:
            writer.boundary(record, [(frame, trace.jpeg(frame.id), None, None) for frame in record.frames])
        writer.finish(sea_rescue.outcome_of(list(trace.boundaries)))
    result = json.loads(node("read.mjs", path))
    counts = result["counts"]
    assert counts["/lingjing/boundary"] == counts["/score"] == len(trace.boundaries)
    assert counts["/camera/uav_1/nadir/reported"] == counts["/camera/uav_1/nadir/truth"] > 0
    assert counts["/tf"] >= sum(len(record.snapshots) for record in trace.boundaries)
    assert result["city"] == [{"id": "city/road/0", "points": 3, "indices": 3, "most": 2}]
    assert result["score"]["done"] is trace.boundaries[-1].done


def test_foxgloves_reader_rejects_a_field_that_the_schema_lacks(trace: Trace, tmp_path: Path) -> None:
    """The validation is effective: it rejects a record with an additional field."""
    from lingjing.trace.container import ContainerWriter
    from lingjing.trace.schemas import container_schema

    container = ContainerWriter(tmp_path / "wrong.mcap")
    container.add("/score", container_schema("score"), 0, b'{"tick": 0, "surprise": 1}')
    container.finish()
    with pytest.raises(subprocess.CalledProcessError) as caught:
        node("read.mjs", tmp_path / "wrong.mcap")
    assert "must NOT have additional properties" in caught.value.stderr
