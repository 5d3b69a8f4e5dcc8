"""Seals: whatever is done to a trace's bytes is found, and the first record that it was done to is named."""

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import mcap.reader
import mcap.records
import mcap.writer
import msgspec
import pytest
from mcap.data_stream import ReadDataStream, RecordBuilder

from lingjing.errors import UsageError
from lingjing.trace.container import scan
from lingjing.trace.reader import read_trace
from lingjing.trace.records import Outcome
from lingjing.trace.seal_check import check_seals
from lingjing.trace.seals import MAGIC, RECORD, SEAL, SealedFile, is_seal, read_key
from lingjing.trace.topics import HEADER, OUTCOME
from lingjing.trace.verification import Verification, verify_file
from lingjing.trace.writer import TraceWriter

KEY = b"a key of sufficient length"


@pytest.fixture(scope="module")
def small(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("small") / "trace.mcap"
    synthetic.write_episode(path, ticks=6, depth=True, width=32, height=18)
    return path


@pytest.fixture(scope="module")
def signed(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("signed") / "trace.mcap"
    records = list(synthetic.episode(3, width=32, height=18))
    with TraceWriter(path, synthetic.header(32, 18), KEY) as writer:
        for record, pictures in records:
            writer.boundary(record, pictures)
        writer.finish(synthetic.outcome_of([record for record, _ in records]))
    return path


def raw_records(data: bytes) -> Iterator[bytes]:
    """Every top-level record of a file."""
    at = len(MAGIC)
    while at + RECORD.size < len(data):
        end = at + RECORD.size + RECORD.unpack_from(data, at)[1]
        yield data[at:end]
        at = end


def rewritten(data: bytes, change: Callable[[int, bytes], bytes | None]) -> bytes:
    """The file with every top-level record changed by its number, or left out."""
    kept = (change(number, record) for number, record in enumerate(raw_records(data)))
    return MAGIC + b"".join(record for record in kept if record is not None) + MAGIC


def repacked(chunk: bytes, change: Callable[[bytes], bytes]) -> bytes:
    """A chunk whose unpacked bytes are changed, with a good sum of its own."""
    import zstandard

    record = mcap.records.Chunk.read(ReadDataStream(io.BytesIO(chunk[RECORD.size :])))
    inside = change(zstandard.decompress(record.data, record.uncompressed_size))
    record.data, record.uncompressed_size = zstandard.compress(inside), len(inside)
    record.uncompressed_crc = zlib.crc32(inside)
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def in_chunks(data: bytes, old: bytes, new: bytes) -> bytes:
    """The file with a text replaced inside of its chunks."""

    def change(number: int, record: bytes) -> bytes:
        return repacked(record, lambda inside: inside.replace(old, new)) if record[0] == 6 else record

    return rewritten(data, change)


def verdict(path: Path, data: bytes, key: bytes | None = None) -> Verification:
    path.write_bytes(data)
    return verify_file(path, key)


def test_a_whole_trace_is_ok(small: Path, signed: Path) -> None:
    assert verify_file(small).state == "ok" and "not signed" in verify_file(small).said
    told = verify_file(signed)
    assert (told.state, told.signature) == ("ok", "unchecked")
    told = verify_file(signed, KEY)
    assert (told.state, told.signature) == ("ok", "good")


def test_another_key_or_no_signature_is_told(small: Path, signed: Path) -> None:
    told = verify_file(signed, b"another key of such a length")
    assert (told.state, told.signature) == ("wrong", "bad") and "the header" in told.said
    told = verify_file(small, KEY)
    assert told.state == "wrong" and "not signed" in told.said


def test_every_seal_stands_behind_what_it_covers(small: Path) -> None:
    seals = [record for record in raw_records(small.read_bytes()) if is_seal(record)]
    assert len(seals) == 1 + len(read_trace(small).boundaries) + 1
    report = check_seals(small)
    assert (report.seals, report.fault, report.ended, report.loose) == (len(seals), "", True, 0)


@pytest.mark.parametrize("step", [997, pytest.param(11, marks=pytest.mark.study)])
def test_every_flipped_bit_is_found(small: Path, tmp_path: Path, step: int) -> None:
    """Each byte of the file, or one of `step`, with one of its bits flipped."""
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


def test_every_flipped_bit_of_a_signature_is_found(signed: Path, tmp_path: Path) -> None:
    """The last hmac is the only thing that the chain cannot cover: it is found with the key."""
    data, path = signed.read_bytes(), tmp_path / "t.mcap"
    last = data.rindex(b"\x04\0\0\0hmac") + 12
    for at in range(last, last + 64):
        broken = bytearray(data)
        broken[at] ^= 1 << (at % 7)
        told = verdict(path, bytes(broken), KEY)
        assert told.state == "wrong" and told.signature == "bad"
    first = data.index(b"\x04\0\0\0hmac") + 12
    broken = bytearray(data)
    broken[first] ^= 1
    assert verdict(path, bytes(broken)).state == "wrong"  # an earlier one is under the next chain


def test_cut_anywhere_it_is_no_whole_trace(small: Path, tmp_path: Path) -> None:
    data, path, states = small.read_bytes(), tmp_path / "t.mcap", set()
    for at in range(0, len(data), 1201):
        path.write_bytes(data[:at])
        try:
            states.add(told := verify_file(path).state)
        except UsageError as error:
            assert at == 0 and "it is empty" in str(error)
            continue
        assert told in ("cut", "unreadable", "wrong"), at
    assert "cut" in states


def test_what_is_cut_is_said_with_what_is_left(small: Path, tmp_path: Path) -> None:
    data = small.read_bytes()
    third = [at for at in range(len(data)) if data.startswith(b"\x0d\0\0\0" + SEAL.encode(), at)][2]
    told = verdict(tmp_path / "t.mcap", data[: third + 400])
    assert told.state == "cut" and told.said.startswith("2 boundaries") and "no outcome" in told.said


def test_a_file_cut_in_its_summary_is_cut_and_its_outcome_not_vouched_for(small: Path, tmp_path: Path) -> None:
    data = small.read_bytes()
    for end in (len(data) - 3000, len(data) - 9, len(data) - 1):
        told = verdict(tmp_path / "t.mcap", data[:end])
        assert told.state == "cut" and "no seal covers the outcome" in told.said, told.said
    changed = in_chunks(data, b'"score":0.0', b'"score":0.1')
    assert verdict(tmp_path / "t.mcap", changed[:-1]).state == "wrong"


def test_pictures_that_are_none_are_named_though_they_are_sealed(
    synthetic: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lingjing.trace.foxglove._image", lambda *_: b"\xff" * 50)
    synthetic.write_episode(tmp_path / "trace.mcap", ticks=3)
    told = verify_file(tmp_path / "trace.mcap")
    assert told.state == "wrong" and "is no foxglove.CompressedImage" in told.said


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
def test_an_edit_is_found_where_it_was_made(name: str, small: Path, tmp_path: Path) -> None:
    """By somebody who writes good chunks, but not the chain."""
    data, (old, new, words) = small.read_bytes(), EDITS[name]
    changed = in_chunks(data, old, new)
    assert changed != in_chunks(data, b"", b"")
    told = verdict(tmp_path / "t.mcap", changed)
    assert told.state == "wrong" and words in told.said, told.said


def test_pictures_swapped_dropped_repeated_or_moved_are_found(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    records = list(raw_records(data))
    chunks = [number for number, record in enumerate(records) if record[0] == 6]
    one, other = chunks[3], chunks[4]
    swapped = {one: records[other], other: records[one]}
    for change in (
        lambda number, record: swapped.get(number, record),
        lambda number, record: None if number == one else record,
        lambda number, record: record + record if number == one else record,
    ):
        told = verdict(path, rewritten(data, change))
        assert told.state == "wrong" and told.said.startswith("boundary 2"), told.said
    gone = verdict(path, rewritten(data, lambda n, record: None if n >= one and n < other else record))
    assert gone.state == "wrong" and "number 5 instead of 4: seals or sealed records are missing" in gone.said


def test_a_message_changed_within_a_chunk_is_named(small: Path, tmp_path: Path) -> None:
    log = next(stored for stored in scan(small) if stored.topic == "/geo/uav_2" and stored.time_ns)
    changed = log.data[:-1] + bytes([log.data[-1] ^ 1])
    told = verdict(tmp_path / "t.mcap", in_chunks(small.read_bytes(), log.data, changed))
    assert told.state == "wrong"
    assert told.said.startswith("boundary 1: the message on /geo/uav_2 at 10 s"), told.said
    assert "is not as it was sealed" in told.said


def test_a_dropped_message_is_told_from_a_changed_one(small: Path, tmp_path: Path) -> None:
    wanted = [stored for stored in scan(small) if stored.topic.startswith("/geo/") and stored.time_ns == 2 * 10**10]
    first = wanted[0]
    head = struct.pack("<HIQQ", first.channel, first.sequence, first.time_ns, first.time_ns) + first.data
    whole = RECORD.pack(5, len(head)) + head
    told = verdict(tmp_path / "t.mcap", in_chunks(small.read_bytes(), whole, b""))
    assert told.state == "wrong" and "the record before it is missing" in told.said, told.said
    told = verdict(tmp_path / "t.mcap", in_chunks(small.read_bytes(), whole, whole + whole))
    assert told.state == "wrong" and "it was added, repeated or moved" in told.said, told.said


def test_bytes_added_anywhere_are_found(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    told = verdict(path, data + b"more")
    assert told.state == "wrong" and "4 bytes were added behind the end" in told.said
    builder = RecordBuilder()
    mcap.records.Attachment(0, 0, "x", "text/plain", b"x").write(builder)
    extra = bytes(builder.end())
    for place in range(1, 40, 7):
        told = verdict(path, rewritten(data, lambda n, record, at=place: extra + record if n == at else record))
        assert told.state == "wrong", place


def test_an_edited_index_is_found(small: Path, tmp_path: Path) -> None:
    data, path = small.read_bytes(), tmp_path / "t.mcap"
    for opcode in (0x07, 0x08, 0x0B, 0x0D, 0x0E, 0x02, 0x0F):
        number = max(n for n, record in enumerate(raw_records(data)) if record[0] == opcode)
        told = verdict(path, rewritten(data, lambda n, record, at=number: record[:-1] + b"\x7f" if n == at else record))
        assert told.state == "wrong", hex(opcode)


def test_a_file_written_anew_by_another_program_is_told(small: Path, tmp_path: Path) -> None:
    """Every message is the same, the file is not: it is read, and not called the one that was sealed."""
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
    told = verify_file(path)
    assert told.state == "wrong" and "its seals are missing" in told.said
    assert read_trace(path).boundaries == read_trace(small).boundaries


@pytest.mark.parametrize("other", ["1", "7"])
def test_a_trace_of_another_version_is_told_by_its_name(small: Path, tmp_path: Path, other: str) -> None:
    """The first format: the same file without seals and the index of them."""
    data = rewritten(small.read_bytes(), lambda n, record: None if is_seal(record) or record[0] == 0x0D else record)
    assert verdict(tmp_path / "t.mcap", data).state == "wrong"
    told = verdict(tmp_path / "t.mcap", in_chunks(data, b"trace/2", f"trace/{other}".encode()))
    assert told.state == "unreadable" and f"format `lingjing-trace/{other}`" in told.said
    with pytest.raises(UsageError, match=f"format `lingjing-trace/{other}`"):
        read_trace(tmp_path / "t.mcap")


def test_a_sealed_trace_of_tomorrow_is_unreadable_and_not_wrong(synthetic: ModuleType, tmp_path: Path) -> None:
    """Nothing in it is wrong, as far as a version of today can tell."""
    records = [record for record, _ in synthetic.episode(2)]
    writer = TraceWriter(tmp_path / "t.mcap", msgspec.structs.replace(synthetic.header(), format="lingjing-trace/7"))
    for record in records:
        writer.boundary(msgspec.structs.replace(record, frames=()))
    told = verify_file(writer.finish(synthetic.outcome_of(records)))
    assert told.state == "unreadable" and "format `lingjing-trace/7`" in told.said


def test_another_programs_file_is_unreadable(tmp_path: Path) -> None:
    path = tmp_path / "t.mcap"
    with path.open("wb") as out:
        writer = mcap.writer.Writer(out)
        writer.start()
        channel = writer.register_channel("/x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    told = verify_file(path)
    assert told.state == "unreadable" and "holds no episode" in told.said


def test_who_computes_the_chain_anew_is_found_only_by_the_signature(
    synthetic: ModuleType, signed: Path, tmp_path: Path
) -> None:
    """The limit of a chain without a key: a forger writes a whole new trace."""
    trace = read_trace(signed)
    forged = msgspec.structs.replace(
        trace.header, bindings=tuple(msgspec.structs.replace(one, policy="mine") for one in trace.header.bindings)
    )
    path = tmp_path / "trace.mcap"
    with TraceWriter(path, forged, b"the forger's own key") as writer:
        for record, pictures in synthetic.episode(3, width=32, height=18):
            writer.boundary(record, pictures)
        assert trace.outcome is not None
        writer.finish(trace.outcome)
    assert verify_file(path).state == "ok"
    assert verify_file(path, KEY).state == "wrong"


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
def test_an_outcome_that_does_not_follow_is_told_even_if_sealed(
    synthetic: ModuleType, tmp_path: Path, change: dict[str, object], words: str
) -> None:
    records = list(synthetic.episode(3, width=32, height=18))
    outcome: Outcome = msgspec.structs.replace(synthetic.outcome_of([one for one, _ in records]), **change)
    path = tmp_path / "trace.mcap"
    with TraceWriter(path, synthetic.header(32, 18)) as writer:
        for record, pictures in records:
            writer.boundary(record, pictures)
        writer.finish(outcome)
    told = verify_file(path)
    assert told.state == "wrong" and words in told.said


def test_a_key_is_read_or_refused(tmp_path: Path) -> None:
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


def test_what_passes_a_sealed_file_is_what_is_written() -> None:
    out = io.BytesIO()
    out.close = lambda: None  # type: ignore[method-assign]
    file = SealedFile(out)
    file.write(MAGIC)
    file.write(RECORD.pack(1, 3) + b"abc")
    assert out.getvalue() == MAGIC + RECORD.pack(1, 3) + b"abc" and file.tell() == 20
    assert file.fields()["records"] == f"{zlib.crc32(RECORD.pack(1, 3) + b'abc'):08x}"
