"""Search for the first record between two seals that differs from its seal, and its description in words."""

from __future__ import annotations

import io
import mmap
import zlib
from collections.abc import Iterator
from typing import NamedTuple

import mcap.opcode
import mcap.records
from mcap.data_stream import ReadDataStream

from lingjing.trace.chunks import BROKEN, MESSAGE, UnpackLimits, channel_of, unpack
from lingjing.trace.seals import MAGIC, RECORD, definition_sum, message_sum, records_of, whole_records


class _Summed(NamedTuple):
    """A record between two seals, with its CRC-32 sum."""

    name: str
    """A description in words."""
    at: int
    """Byte offset of the record, or of its chunk, in the file."""
    total: int
    """The sum. -1 if the record cannot be read, -2 for an unexpected kind of record."""


def seal_fields(record: bytes) -> dict[str, str]:
    """Return the fields of a seal, or an empty mapping if its bytes are damaged."""
    try:
        return dict(mcap.records.Metadata.read(ReadDataStream(io.BytesIO(record[RECORD.size :]))).metadata)
    except BROKEN:
        return {}


def sealed_part(number: int, *, last: bool) -> str:
    """Return the name of the part that the seal with this number covers."""
    return "the outcome" if last else "the header" if number == 1 else f"boundary {number - 2}"


def first_difference(data: mmap.mmap, segment: tuple[int, int, int], number: int, fields: dict[str, str]) -> str:
    """Return the first record between two seals that differs from its seal, in words.

    `segment` is the end of the previous seal, the begin and the end of this one, as byte offsets. `number` is the
    expected number of this seal and `fields` are its fields. Returns "" if the file was only cut behind its last seal.
    """
    begin, at, end = segment
    place = sealed_part(number, last="end" in fields)
    stated = fields.get("number", "")[:20]
    if stated.isdecimal() and int(stated) != number:
        return (
            f"{place}: the seal at byte {at} has the number {stated} instead of {number}: seals or sealed records"
            f" {_LOST}"
        )
    records = list(_contents(data, begin, at))
    texts = fields.get("records", "")
    sealed = [int(texts[i : i + 8], 16) for i in range(0, len(texts), 8)] if _is_hex(texts) else []
    if not sealed:
        return f"{place}: the seal at byte {at} is damaged"
    for index, record in enumerate(records):
        if record.total == -1:
            return f"{place}: {record.name} at byte {record.at}"
        if index >= len(sealed) or record.total != sealed[index]:
            return f"{place}: {record.name} at byte {record.at} {_changed(records, sealed, index)}"
    if len(records) < len(sealed):
        return f"{place}: {len(sealed) - len(records)} records are missing before byte {at}"
    if "end" in fields:
        behind = _behind(data, end)
        return f"{place}: {behind}" if behind else ""
    return f"{place}: the seal at byte {at} was replaced"


_LOST = "are missing, repeated or in another order"


def _changed(records: list[_Summed], sealed: list[int], index: int) -> str:
    """Return the likely change at the first differing record: edited, removed before it, or inserted."""
    here, after = records[index].total, sealed[index + 1] if index + 1 < len(sealed) else None
    if (
        index < len(sealed)
        and here not in sealed
        and (index + 1 >= len(records) or records[index + 1].total != sealed[index])
    ):
        return "is not as it was sealed"
    if here == after and here not in sealed[:index]:
        return "is too early: the record before it is missing"
    return "is not in the seal: it was added, repeated or moved"


def _behind(data: mmap.mmap, end: int) -> str:
    """Return the damage behind the last seal, in words: to the summary, the footer, or the end of the file.

    Returns "" if the file was cut there.
    """
    at = end
    while at + RECORD.size <= len(data):
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size + length
        if opcode == mcap.opcode.Opcode.FOOTER:
            break
    whole = at + len(MAGIC) <= len(data)
    if data[at : at + len(MAGIC)] != MAGIC:
        if not whole and data[-len(MAGIC) :] != MAGIC:
            return ""
        return f"the file's summary, from byte {end} on, is damaged"
    added = len(data) - at - len(MAGIC)
    if added:
        return f"{added} bytes were added behind the end of the file, from byte {len(data) - added} on"
    return f"the last seal, or the summary for viewers between bytes {end} and {at}, was replaced"


def _contents(data: mmap.mmap, begin: int, end: int) -> Iterator[_Summed]:
    """Yield the records between two seals in the order of their sums, up to one that cannot be read (sum -1)."""
    topics, limits = _topics(data, begin), UnpackLimits(len(data))
    at = begin or len(MAGIC)
    while at < end:
        if at + RECORD.size > end:
            yield _Summed("a record that is cut in its head", at, -1)
            return
        opcode, length = RECORD.unpack_from(data, at)
        after = at + RECORD.size + length
        if after > end:
            yield _Summed(f"a record ({_kind(opcode)}) that is longer than the space before the seal", at, -1)
            return
        record = data[at:after]
        if opcode == mcap.opcode.Opcode.CHUNK:
            yield from _inside(record, at, topics, limits)
        yield _Summed(f"the file's record {_kind(opcode)}", at, zlib.crc32(record))
        at = after


def _inside(record: bytes, at: int, topics: dict[int, str], limits: UnpackLimits) -> Iterator[_Summed]:
    try:
        chunk = mcap.records.Chunk.read(ReadDataStream(io.BytesIO(record[RECORD.size :])))
        limits.take(chunk)
        for opcode, inner in records_of(unpack(chunk, checked=False)):
            limits.message()
            entry = _inner(opcode, inner[RECORD.size :], topics)
            if entry is not None:
                yield _Summed(entry[0], at, entry[1])
    except BROKEN as error:
        yield _Summed(f"a chunk that cannot be unpacked ({error})", at, -1)


def _inner(opcode: int, body: bytes, topics: dict[int, str]) -> tuple[str, int] | None:
    if opcode == mcap.opcode.Opcode.MESSAGE:
        channel, sequence, time_ns, _ = MESSAGE.unpack_from(body)
        topic = topics.get(channel, "")
        name = f"the message on {topic or f'channel {channel}'} at {time_ns / 1e9:g} s"
        return name, message_sum(topic, sequence, time_ns, body[MESSAGE.size :])
    if opcode == mcap.opcode.Opcode.CHANNEL:
        channel_record = channel_of(body)
        topics[channel_record.id] = channel_record.topic
        parts = (channel_record.topic, channel_record.message_encoding, str(channel_record.schema_id))
        return f"the channel {channel_record.topic[:80]}", definition_sum(*parts)
    if opcode == mcap.opcode.Opcode.SCHEMA:
        schema = mcap.records.Schema.read(ReadDataStream(io.BytesIO(body)))
        return f"the schema {schema.name[:80]}", definition_sum(schema.name, schema.encoding, schema.data)
    return f"a record of kind {opcode}", -2


def _topics(data: mmap.mmap, until: int) -> dict[int, str]:
    """Return the topics of the channels that are declared before byte `until`, by channel number."""
    topics: dict[int, str] = {}
    limits = UnpackLimits(len(data))
    for at, end in whole_records(data):
        if at >= until:
            break
        if data[at] == mcap.opcode.Opcode.CHUNK:
            for _ in _inside(data[at:end], at, topics, limits):
                pass
    return topics


def _kind(opcode: int) -> str:
    try:
        return f"{mcap.opcode.Opcode(opcode).name.lower().replace('_', ' ')}"
    except ValueError:
        return f"{opcode:#04x}"


def _is_hex(text: str) -> bool:
    return len(text) % 8 == 0 and set(text) <= set("0123456789abcdef")
