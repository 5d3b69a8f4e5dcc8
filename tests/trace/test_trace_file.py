"""The trace file: whole, cut, of a killed process, abandoned, read by the plain MCAP reader, and invalid."""

import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import jsonschema
import mcap.exceptions
import mcap.reader
import msgspec
import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.unknown_fields import UnknownFieldSet

import lingjing
from lingjing import Trace
from lingjing import read as read_trace
from lingjing.errors import ExitCode, LingjingError, UsageError
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.testing.traces import part_path, scan, verify
from lingjing.trace.records import CUT_SHORT, Outcome, Reason
from lingjing.trace.topics import CAMERAS

WORDS = {
    "$schema", "$defs", "$ref", "title", "description", "type", "properties", "required", "additionalProperties",
    "anyOf", "enum", "items", "prefixItems", "minItems", "maxItems", "default", "minimum", "maximum",
}  # fmt: skip
"""The JSON Schema keywords in our schemas. A strict validator rejects keywords that JSON Schema 2020-12 lacks."""


def test_all_records_are_read_back(trace: Trace) -> None:
    records = [record for record, _ in sea_rescue.episode(60, depth=True)]
    assert trace.header == sea_rescue.header()
    assert list(trace.boundaries) == records
    assert trace.outcome == sea_rescue.outcome_of(records)
    assert trace.complete
    assert verify(trace, pixels=True) is None
    assert not part_path(trace.path).exists()


def test_pictures_are_read_back_with_all_channels(trace: Trace) -> None:
    pictures = [picture for _, some in sea_rescue.episode(60, depth=True) for picture in some]
    assert list(trace.frames) == [info.id for info, _, _, _ in pictures]
    for info, jpeg, depth, semantic in (pictures[0], pictures[-1]):
        back = trace.picture(info.id)
        assert trace.jpeg(info.id) == jpeg and back.info == info
        assert back.rgb.shape == (info.pose.height, info.pose.width, 3)
        assert np.allclose(back.depth, depth, atol=0.0051) and np.array_equal(back.semantic, semantic)


def test_the_depth_of_a_picture_without_depth_is_none(tmp_path: Path) -> None:
    sea_rescue.write_episode(tmp_path / "t.mcap", ticks=4)
    back = read_trace(tmp_path / "t.mcap")
    assert back.picture("f3-uav[1]-nadir").depth is None and back.picture("f3-uav[1]-nadir").semantic is None


def test_the_error_for_an_unknown_picture_has_its_name(trace: Trace) -> None:
    with pytest.raises(UsageError, match="no picture f99"):
        trace.picture("f99")


def test_a_cut_file_is_read_to_its_last_complete_boundary(trace: Trace, tmp_path: Path) -> None:
    data, part = trace.path.read_bytes(), tmp_path / "trace.mcap.part"
    lengths = set()
    for at in sorted(random.Random(3).sample(range(len(data)), 80)):
        part.write_bytes(data[:at])
        try:
            cut = read_trace(part)
        except UsageError as error:
            assert "not a trace" in str(error) or "holds no episode" in str(error)
            assert at < 40_000
            continue
        assert cut.boundaries == trace.boundaries[: len(cut.boundaries)]
        assert not cut.complete
        if len(cut.boundaries) not in lengths:
            assert verify(cut, pixels=True) is None
        lengths.add(len(cut.boundaries))
    assert len(lengths) > 20


def test_a_damaged_file_raises_only_declared_errors(trace: Trace, tmp_path: Path) -> None:
    data, path, chance = trace.path.read_bytes(), tmp_path / "t.mcap", random.Random(5)
    for _ in range(60):
        broken = bytearray(data)
        at = chance.randrange(len(broken))
        broken[at : at + 4] = chance.randbytes(4)
        path.write_bytes(broken)
        try:
            back = read_trace(path)
        except LingjingError:
            continue
        assert back.boundaries == trace.boundaries[: len(back.boundaries)]


KILLED = """
import os, signal, sys
from pathlib import Path
from lingjing.testing import sea_rescue
from lingjing.testing import TraceWriter
writer = TraceWriter(Path(sys.argv[1]), sea_rescue.header())
for record, pictures in sea_rescue.episode(60):
    writer.boundary(record, pictures)
    if record.tick == 9:
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_file_of_a_killed_process_is_read_to_its_last_boundary(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert not path.exists()
    back = read_trace(part_path(path))
    assert [record.tick for record in back.boundaries] == list(range(10))
    assert back.outcome is None and not back.complete and verify(back, pixels=True) is None
    assert _plain_boundaries(part_path(path)) == 10


def _plain_boundaries(path: Path) -> int:
    """Return the boundaries that the plain reader returns before the cut."""
    count = 0
    with path.open("rb") as file, contextlib.suppress(mcap.exceptions.McapError):
        for _, channel, _ in mcap.reader.NonSeekingReader(file).iter_messages(log_time_order=False):
            count += channel.topic == "/lingjing/boundary"
    return count


@pytest.mark.parametrize("reason", CUT_SHORT)
def test_the_file_of_an_abandoned_episode_keeps_its_suffix_and_is_read_completely(
    tmp_path: Path, reason: Reason
) -> None:
    path = tmp_path / "trace.mcap"
    outcome = Outcome(success=False, reason=reason, scr=0.0, ticks=4, digest="", frames_digest="")
    with TraceWriter(path, sea_rescue.header()) as writer:
        records = []
        for record, pictures in sea_rescue.episode(4):
            writer.boundary(record, pictures)
            records.append(record)
        outcome = msgspec.structs.replace(sea_rescue.outcome_of(records), reason=reason, detail="camera died")
        assert writer.abandon(outcome) == part_path(path)
    back = read_trace(part_path(path))
    assert not path.exists() and back.outcome == outcome and not back.complete
    assert list(back.boundaries) == records and verify(back) is None


def test_an_exception_leaves_a_closed_part_file(tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    with pytest.raises(ZeroDivisionError), TraceWriter(path, sea_rescue.header()) as writer:
        writer.boundary(*next(sea_rescue.episode(4)))
        1 / 0  # noqa: B018
    assert len(read_trace(part_path(path)).boundaries) == 1 and not path.exists()
    with pytest.raises(LingjingError, match="closed"):
        writer.boundary(*next(sea_rescue.episode(4)))


def test_an_existing_file_is_not_overwritten(tmp_path: Path) -> None:
    for existing in (tmp_path / "trace.mcap", tmp_path / "trace.mcap.part"):
        existing.write_text("mine")
        with pytest.raises(UsageError, match="exists already"):
            TraceWriter(tmp_path / "trace.mcap", sea_rescue.header())
        assert existing.read_text() == "mine"
        existing.unlink()


def test_a_path_that_cannot_be_written_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write the trace") as caught:
        TraceWriter(tmp_path / "missing" / "trace.mcap", sea_rescue.header())
    assert caught.value.exit_code == ExitCode.USAGE


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_a_usage_error(tmp_path: Path) -> None:
    writer = TraceWriter(tmp_path / "trace.mcap", sea_rescue.header())
    full = os.open("/dev/full", os.O_WRONLY)
    os.dup2(full, writer._container._file._file.fileno())
    os.close(full)
    with pytest.raises(UsageError, match="No space left"):
        writer.boundary(*next(sea_rescue.episode(4)))


@pytest.mark.parametrize("content", [None, b"", b"hello", b"\x89MCAP0\r\n", b"\x89PNG" * 100, b"\0" * 10_000])
def test_the_error_for_a_file_that_is_no_trace_names_the_path(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UsageError) as caught:
        read_trace(path)
    assert str(path) in str(caught.value)


def test_a_pipe_is_rejected_before_it_is_opened(trace: Trace, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)  # without a writer, opening it would block for ever
    for read in (read_trace, lingjing.verify):
        with pytest.raises(UsageError, match="it is a pipe or a device") as caught:
            read(pipe)
        assert "write it into a file first" in caught.value.hint
    with pytest.raises(UsageError) as caught:
        read_trace("-")
    assert "not from standard input" in caught.value.hint


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs a file whose first bytes cannot be read")
def test_a_read_error_is_not_reported_as_a_write_error() -> None:
    with pytest.raises(UsageError, match="cannot read the trace /proc/self/mem"):
        read_trace("/proc/self/mem")


def test_a_folder_without_a_trace_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot read the trace"):
        read_trace(tmp_path)


def words(schema: object) -> set[str]:
    """Yield the keywords of a schema. Names under `properties`, `$defs` and in defaults are no keywords."""
    if isinstance(schema, list):
        return set().union(*map(words, schema))
    if not isinstance(schema, dict):
        return set()
    inner = [
        list(value.values()) if key in ("properties", "$defs") else value
        for key, value in schema.items()
        if key not in ("default", "enum", "required")
    ]
    return set(schema).union(*map(words, inner))


def test_the_plain_reader_decodes_every_message(trace: Trace) -> None:
    seen: dict[str, int] = {}
    validators: dict[int, jsonschema.Draft202012Validator] = {}
    classes: dict[int, type] = {}
    with trace.path.open("rb") as file:
        for schema, channel, message in mcap.reader.make_reader(file).iter_messages():
            assert schema is not None
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
            if schema.encoding == "jsonschema":
                if schema.id not in validators:
                    text = json.loads(schema.data)
                    jsonschema.Draft202012Validator.check_schema(text)
                    assert text["type"] == "object" and words(text) <= WORDS
                    validators[schema.id] = jsonschema.Draft202012Validator(text)
                validator = validators[schema.id]
                if seen[channel.topic] <= 3:
                    validator.validate(json.loads(message.data))
            else:
                cls = classes.setdefault(schema.id, _message_class(schema.name, schema.data))
                decoded = cls.FromString(message.data)  # type: ignore[attr-defined]
                assert not len(UnknownFieldSet(decoded))
    assert {"/agent/scout_1/thought", "/agent/scout_1/command", "/agent/scout_1/receipt", "/score"} <= set(seen)
    assert {"/lingjing/header", "/lingjing/boundary", "/lingjing/frame", "/lingjing/outcome"} <= set(seen)
    assert {
        "/tf",
        "/scene",
        "/scene/hidden",
        "/log",
        "/geo/uav_1",
        "/camera/uav_1/nadir",
        "/camera/uav_1/nadir/depth",
    } <= set(seen)
    assert seen["/lingjing/boundary"] == len(trace.boundaries)
    assert seen["/camera/uav_2/nadir"] == sum(frame.entity == "uav[2]" for frame in trace.frames.values())


def test_every_topic_is_in_time_order(trace: Trace) -> None:
    last: dict[str, int] = {}
    with trace.path.open("rb") as file:
        for _, channel, message in mcap.reader.make_reader(file).iter_messages(log_time_order=False):
            assert message.log_time >= last.get(channel.topic, 0), channel.topic
            last[channel.topic] = message.log_time
    assert last["/tf"] == round(trace.boundaries[-1].time_s * 1e9)


def test_two_equal_episodes_are_equal_files(tmp_path: Path) -> None:
    hashes = set()
    for name in ("a.mcap", "b.mcap"):
        sea_rescue.write_episode(tmp_path / name, ticks=8, depth=True)
        hashes.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(hashes) == 1


def _message_class(name: str, data: bytes) -> type:
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def test_records_are_read_without_unpacking_pictures(trace: Trace) -> None:
    """Pictures are in their own chunks, which are not unpacked, except for the first one of each camera."""
    passed = [stored for stored in scan(trace.path, passed_over=CAMERAS) if stored.topic.startswith(CAMERAS)]
    whole = [stored for stored in scan(trace.path) if stored.topic.startswith(CAMERAS)]
    key = [(stored.topic, stored.time_ns, stored.chunk_at) for stored in whole]
    assert sorted((stored.topic, stored.time_ns, stored.chunk_at) for stored in passed) == sorted(key)
    assert sum(not stored.data for stored in passed) > len(whole) / 2
    records = [stored.data for stored in scan(trace.path) if not stored.topic.startswith(CAMERAS)]
    again = [stored.data for stored in scan(trace.path, passed_over=CAMERAS) if not stored.topic.startswith(CAMERAS)]
    assert records == again


def test_a_damaged_picture_is_an_error_only_when_it_is_read(trace: Trace, tmp_path: Path) -> None:
    last = list(trace.frames)[-1]
    place = next(iter(trace.places[last].values())).chunk_at
    broken = bytearray(trace.path.read_bytes())
    broken[place + 60] ^= 0xFF
    path = tmp_path / "t.mcap"
    path.write_bytes(broken)
    back = read_trace(path)
    assert back.boundaries == trace.boundaries
    with pytest.raises(UsageError, match="cannot be read"):
        back.jpeg(last)
