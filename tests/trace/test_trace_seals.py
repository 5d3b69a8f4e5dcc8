"""Seals: every change of a trace's bytes is detected, and the first changed record is named."""

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import mcap.reader
import mcap.records
import mcap.writer
import msgspec
import pytest
from mcap.data_stream import ReadDataStream, RecordBuilder

import lingjing
from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.testing.traces import scan
from lingjing.trace.records import Outcome
from lingjing.trace.seal_check import check_seals
from lingjing.trace.seals import MAGIC, RECORD, SEAL, SealedFile, is_seal, read_key
from lingjing.trace.topics import HEADER, OUTCOME
from lingjing.trace.verification import Verification

KEY = b"a key of sufficient length"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("small") / "trace.mcap"
    sea_rescue.write_episode(path, ticks=6, depth=True, width=32, height=18)
    return path


@pytest.fixture(scope="module")
def signed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("signed") / "trace.mcap"
    records = list(sea_rescue.episode(3, width=32, height=18))
    with TraceWriter(path, sea_rescue.header(32, 18), KEY) as writer:
        for record, pictures in records:
            writer.boundary(record, pictures)
        writer.finish(sea_rescue.outcome_of([record for record, _ in records]))
    return path


def raw_records(data: bytes) -> Iterator[bytes]:
    """Return the top-level records of a file."""
    at = len(MAGIC)
    while at + RECORD.size < len(data):
        end = at + RECORD.size + RECORD.unpack_from(data, at)[1]
        yield data[at:end]
        at = end


def rewritten(data: bytes, change: Callable[[int, bytes], bytes | None]) -> bytes:
    """Return the file with each top-level record replaced by `change(number, record)`, or left out for None."""
    kept = (change(number, record) for number, record in enumerate(raw_records(data)))
    return MAGIC + b"".join(record for record in kept if record is not None) + MAGIC


def repacked(chunk: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """Return a chunk with changed content and a correct CRC-32."""
    import zstandard

    record = mcap.records.Chunk.read(ReadDataStream(io.BytesIO(chunk[RECORD.size :])))
    inside = change(zstandard.decompress(record.data, record.uncompressed_size))
    record.data, record.uncompressed_size = zstandard.compress(inside), len(inside)
    record.uncompressed_crc = zlib.crc32(inside)
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def in_chunks(data: bytes, old: bytes, new: bytes) -> bytes:
    """Return the file with a text replaced inside of its chunks."""

    def change(number: int, record: bytes) -> bytes:
        return repacked(record, lambda inside: inside.replace(old, new)) if record[0] == 6 else record

    return rewritten(data, change)


def verdict(path: Path, data: bytes, key: bytes | None = None) -> Verification:
    path.write_bytes(data)
    return lingjing.verify(path, key)


def test_a_complete_trace_passes_verification(small: Path, signed: Path) -> None:
    assert lingjing.verify(small).state == "ok" and "not signed" in lingjing.verify(small).said
    result = lingjing.verify(signed)
    assert (result.state, result.signature) == ("ok", "unchecked")
    result = lingjing.verify(signed, KEY)
    assert (result.state, result.signature) == ("ok", "good")


def test_another_key_or_a_missing_signature_is_reported(small: Path, signed: Path) -> None:
    result = lingjing.verify(signed, b"another key of such a length")
    assert (result.state, result.signature) == ("wrong", "bad") and "the header" in result.said
    result = lingjing.verify(small, KEY)
    assert result.state == "wrong" and "not signed" in result.said


def test_every_seal_follows_the_records_that_it_covers(small: Path) -> None:
    seals = [record for record in raw_records(small.read_bytes()) if is_seal(record)]
    assert len(seals) == 1 + len(read_trace(small).boundaries) + 1
    report = check_seals(small)
    assert (report.seals, report.fault, report.ended, report.loose) == (len(seals), "", True, 0)


@pytest.mark.parametrize("step", [997, pytest.param(11, marks=pytest.mark.study)])
def test_every_flipped_bit_is_detected(small: Path, tmp_path: Path, step: int) -> None:
    """Flip one bit of each byte of the file, or of every n-th byte."""
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    sealed = 0
    for at in range(0, len(data), step):
        broken = bytearray(data)
        broken[at] ^= 1 << (at * 5 % 8)
        path.write_bytes(broken)
        report = check_seals(path)
        assert report.fault, f"byte {at}"
        sealed += report.seals
    assert sealed > 0


def test_every_flipped_bit_of_a_signature_is_detected(signed: Path, tmp_path: Path) -> None:
    """The chain covers everything but the last hmac, which the key verifies."""
    data, path = signed.read_bytes(), tmp_path / "t.mcap"
    last = data.rindex(b"\x04\0\0\0hmac") + 12
    for at in range(last, last + 64):
        broken = bytearray(data)
        broken[at] ^= 1 << (at % 7)
        result = verdict(path, bytes(broken), KEY)
        assert result.state == "wrong" and result.signature == "bad"
    first = data.index(b"\x04\0\0\0hmac") + 12
    broken = bytearray(data)
    broken[first] ^= 1
    assert verdict(path, bytes(broken)).state == "wrong"  # the next chain covers an earlier hmac


def test_a_cut_file_never_passes_verification(small: Path, tmp_path: Path) -> None:
    data, path, states = small.read_bytes(), tmp_path / "t.mcap", set()
    for at in range(0, len(data), 1201):
        path.write_bytes(data[:at])
        try:
            states.add(state := lingjing.verify(path).state)
        except UsageError as error:
            assert at == 0 and "it is empty" in str(error)
            continue
        assert state in ("cut", "unreadable", "wrong"), at
    assert "cut" in states


def test_the_report_on_a_cut_file_names_the_remaining_part(small: Path, tmp_path: Path) -> None:
    data = small.read_bytes()
    third = [at for at in range(len(data)) if data.startswith(b"\x0d\0\0\0" + SEAL.encode(), at)][2]
    result = verdict(tmp_path / "t.mcap", data[: third + 400])
    assert result.state == "cut" and result.said.startswith("2 boundaries") and "no outcome" in result.said


def test_the_outcome_of_a_file_cut_in_its_summary_is_not_covered_by_a_seal(small: Path, tmp_path: Path) -> None:
    data = small.read_bytes()
    for end in (len(data) - 3000, len(data) - 9, len(data) - 1):
        result = verdict(tmp_path / "t.mcap", data[:end])
        assert result.state == "cut" and "no seal covers the outcome" in result.said, result.said
    changed = in_chunks(data, b'"score":0.0', b'"score":0.1')
    assert verdict(tmp_path / "t.mcap", changed[:-1]).state == "wrong"


def test_an_invalid_picture_in_a_sealed_trace_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lingjing.trace.foxglove._image", lambda *_: b"\xff" * 50)
    sea_rescue.write_episode(tmp_path / "trace.mcap", ticks=3)
    result = lingjing.verify(tmp_path / "trace.mcap")
    assert result.state == "wrong" and "is no foxglove.CompressedImage" in result.said


EDITS = {
    "the score": (b'"score":0.0,"p', b'"score":0.1,"p', f"the outcome: the message on {OUTCOME}"),
    "the score that viewers show": (b'"score":0.0,"scr"', b'"score":0.1,"scr"', "boundary 0: the message on /score"),
    "the outcome": (b'"reason":"budget"', b'"reason":"succes"', f"the outcome: the message on {OUTCOME}"),
    "the policy": (b'"policy":"', b'"polizy":"', f"the header: the message on {HEADER}"),
    "the clock": (b'"wall_s":12.5', b'"wall_s":10.5', f"the outcome: the message on {OUTCOME}"),
    "a clock of a policy": (b'"policy_wall_s":0.02', b'"policy_wall_s":0.01', "boundary 2: the message on /lingjing/b"),
    "a schema": (b"foxglove.LocationFix", b"foxglove.LocationFox", "the schema foxglove.LocationFox"),
    "a topic": (b"/geo/uav_1", b"/geo/uav_9", "the channel /geo/uav_9"),
}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_is_located(name: str, small: Path, tmp_path: Path) -> None:
    """The editor writes valid chunks, but does not recompute the chain."""
    data, (old, new, words) = small.read_bytes(), EDITS[name]
    changed = in_chunks(data, old, new)
    assert changed != in_chunks(data, b"", b"")
    result = verdict(tmp_path / "t.mcap", changed)
    assert result.state == "wrong" and words in result.said, result.said


def test_swapped_dropped_and_repeated_pictures_are_detected(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    records = list(raw_records(data))
    chunks = [number for number, record in enumerate(records) if record[0] == 6]
    first, second = chunks[3], chunks[4]
    swapped = {first: records[second], second: records[first]}
    for change in (
        lambda number, record: swapped.get(number, record),
        lambda number, record: None if number == first else record,
        lambda number, record: record + record if number == first else record,
    ):
        result = verdict(path, rewritten(data, change))
        assert result.state == "wrong" and result.said.startswith("boundary 2"), result.said
    dropped = verdict(path, rewritten(data, lambda n, record: None if n >= first and n < second else record))
    assert dropped.state == "wrong" and "number 5 instead of 4: seals or sealed records are missing" in dropped.said


def test_a_message_changed_within_a_chunk_is_named(small: Path, tmp_path: Path) -> None:
    log = next(stored for stored in scan(small) if stored.topic == "/geo/uav_2" and stored.time_ns)
    changed = log.data[:-1] + bytes([log.data[-1] ^ 1])
    result = verdict(tmp_path / "t.mcap", in_chunks(small.read_bytes(), log.data, changed))
    assert result.state == "wrong"
    assert result.said.startswith("boundary 1: the message on /geo/uav_2 at 10 s"), result.said
    assert "is not as it was sealed" in result.said


def test_a_dropped_message_and_an_added_one_are_distinguished(small: Path, tmp_path: Path) -> None:
    wanted = [stored for stored in scan(small) if stored.topic.startswith("/geo/") and stored.time_ns == 2 * 10**10]
    first = wanted[0]
    head = struct.pack("<HIQQ", first.channel, first.sequence, first.time_ns, first.time_ns) + first.data
    whole = RECORD.pack(5, len(head)) + head
    result = verdict(tmp_path / "t.mcap", in_chunks(small.read_bytes(), whole, b""))
    assert result.state == "wrong" and "the record before it is missing" in result.said, result.said
    result = verdict(tmp_path / "t.mcap", in_chunks(small.read_bytes(), whole, whole + whole))
    assert result.state == "wrong" and "it was added, repeated or moved" in result.said, result.said


def test_added_bytes_are_detected(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    result = verdict(path, data + b"more")
    assert result.state == "wrong" and "4 bytes were added behind the end" in result.said
    builder = RecordBuilder()
    mcap.records.Attachment(0, 0, "x", "text/plain", b"x").write(builder)
    extra = bytes(builder.end())
    for place in range(1, 40, 7):
        result = verdict(path, rewritten(data, lambda n, record, at=place: extra + record if n == at else record))
        assert result.state == "wrong", place


def test_an_edited_index_is_detected(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    for opcode in (0x07, 0x08, 0x0B, 0x0D, 0x0E, 0x02, 0x0F):
        number = max(n for n, record in enumerate(raw_records(data)) if record[0] == opcode)
        result = verdict(
            path, rewritten(data, lambda n, record, at=number: record[:-1] + b"\x7f" if n == at else record)
        )
        assert result.state == "wrong", hex(opcode)


def test_a_file_rewritten_by_another_program_lacks_its_seals(small: Path, tmp_path: Path) -> None:
    """All messages are equal, but the file differs. It is read, and reported as not sealed."""
    path = tmp_path / "t.mcap"
    with small.open("rb") as file, path.open("wb") as out:
        writer = mcap.writer.Writer(out)
        writer.start()
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for schema, channel, message in mcap.reader.make_reader(file).iter_messages(log_time_order=False):
            assert schema is not None
            if channel.id not in channels:
                if schema.id not in schemas:
                    schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id]
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()
    result = lingjing.verify(path)
    assert result.state == "wrong" and "its seals are missing" in result.said
    assert read_trace(path).boundaries == read_trace(small).boundaries


@pytest.mark.parametrize("other", ["1", "7"])
def test_a_trace_of_another_version_is_unreadable_and_its_version_named(
    small: Path, tmp_path: Path, other: str
) -> None:
    """The first format had no seals."""
    data = rewritten(small.read_bytes(), lambda n, record: None if is_seal(record) or record[0] == 0x0D else record)
    assert verdict(tmp_path / "t.mcap", data).state == "wrong"
    result = verdict(tmp_path / "t.mcap", in_chunks(data, b"trace/2", f"trace/{other}".encode()))
    assert result.state == "unreadable" and f"format `lingjing-trace/{other}`" in result.said
    with pytest.raises(UsageError, match=f"format `lingjing-trace/{other}`"):
        read_trace(tmp_path / "t.mcap")


def test_a_sealed_trace_of_a_later_version_is_unreadable_and_not_wrong(tmp_path: Path) -> None:
    """This version can detect no error in it."""
    records = [record for record, _ in sea_rescue.episode(2)]
    writer = TraceWriter(tmp_path / "t.mcap", msgspec.structs.replace(sea_rescue.header(), format="lingjing-trace/7"))
    for record in records:
        writer.boundary(msgspec.structs.replace(record, frames=()))
    result = lingjing.verify(writer.finish(sea_rescue.outcome_of(records)))
    assert result.state == "unreadable" and "format `lingjing-trace/7`" in result.said


def test_a_file_of_another_program_is_unreadable(tmp_path: Path) -> None:
    path = tmp_path / "t.mcap"
    with path.open("wb") as out:
        writer = mcap.writer.Writer(out)
        writer.start()
        channel = writer.register_channel("/x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    result = lingjing.verify(path)
    assert result.state == "unreadable" and "holds no episode" in result.said


def test_a_recomputed_chain_is_detected_only_by_the_signature(signed: Path, tmp_path: Path) -> None:
    """A chain without a key cannot detect a forgery of the whole trace."""
    trace = read_trace(signed)
    forged = msgspec.structs.replace(
        trace.header,
        bindings=tuple(msgspec.structs.replace(binding, policy="mine") for binding in trace.header.bindings),
    )
    path = tmp_path / "trace.mcap"
    with TraceWriter(path, forged, b"the forger's own key") as writer:
        for record, pictures in sea_rescue.episode(3, width=32, height=18):
            writer.boundary(record, pictures)
        assert trace.outcome is not None
        writer.finish(trace.outcome)
    assert lingjing.verify(path).state == "ok"
    assert lingjing.verify(path, KEY).state == "wrong"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"score": 3.0}, "score"),
        ({"scr": 0.9}, "subtask completion rate"),
        ({"success": True}, "success"),
        ({"ticks": 1}, "ticks"),
        ({"reason": "late"}, "the episode was not over"),
    ],
)
def test_a_sealed_outcome_that_contradicts_the_records_is_wrong(
    tmp_path: Path, change: dict[str, object], words: str
) -> None:
    records = list(sea_rescue.episode(3, width=32, height=18))
    outcome: Outcome = msgspec.structs.replace(sea_rescue.outcome_of([record for record, _ in records]), **change)
    path = tmp_path / "trace.mcap"
    with TraceWriter(path, sea_rescue.header(32, 18)) as writer:
        for record, pictures in records:
            writer.boundary(record, pictures)
        writer.finish(outcome)
    result = lingjing.verify(path)
    assert result.state == "wrong" and words in result.said


def test_a_key_is_read_and_a_key_of_invalid_length_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "trace.key"
    with pytest.raises(UsageError, match="cannot read the key"):
        read_key(path)
    path.write_bytes(b"0123456789abcdef\r\n")
    assert read_key(path) == b"0123456789abcdef"
    for key, words in ((b"", "has 0 bytes"), (b"k" * 15 + b"\r\n", "has 15 bytes"), (b"k" * 5000, "more than")):
        path.write_bytes(key)
        with pytest.raises(UsageError, match=words):
            read_key(path)
    path.write_bytes(b"short\n")
    with pytest.raises(UsageError, match="5 bytes"):
        read_key(path)
    path.write_bytes(KEY + b"\n")
    assert read_key(path) == KEY


def test_a_sealed_file_writes_its_input_unchanged() -> None:
    out = io.BytesIO()
    out.close = lambda: None  # type: ignore[method-assign]
    file = SealedFile(out)
    file.write(MAGIC)
    file.write(RECORD.pack(1, 3) + b"abc")
    assert out.getvalue() == MAGIC + RECORD.pack(1, 3) + b"abc" and file.tell() == 20
    assert file.fields()["records"] == f"{zlib.crc32(RECORD.pack(1, 3) + b'abc'):08x}"
