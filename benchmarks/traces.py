"""The cost of traces in CPU seconds: records per second beside the plain `mcap` writer, writing, metrics.

`python benchmarks/traces.py [--play MISSION] [TRACE...]`: the mission is played in this process by the oracle without
overview, and its records are written once more; the traces are read and their metrics computed.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mcap.writer
import msgspec

import lingjing
from lingjing.analysis.metrics import metrics
from lingjing.analysis.played_city import city_of
from lingjing.scene.surroundings import surroundings
from lingjing.trace.container import ContainerSchema, ContainerWriter
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import BodyState, Snapshot
from lingjing.trace.writer import TraceWriter

RECORDS = 50_000
EVERY = 100
"""Records between two flushes: those of a boundary with a few macro-steps."""


def main() -> None:
    """Print a line or two for each measure."""
    lingjing.pin()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("traces", nargs="*", type=Path, metavar="TRACE")
    parser.add_argument("--play", metavar="MISSION", help="for example cd, whose oracle takes no pictures")
    args = parser.parse_args()
    _compare_writers()
    if args.play:
        _share_of_writing(args.play)
    if args.traces:
        _read(args.traces)


def _compare_writers() -> None:
    state = BodyState(id="uav[1]", position=(1.5, 2.25, 100.0), status="hovering", resources={"battery": 0.5})
    record = Snapshot(time_s=12.5, states=(state,) * 6)
    data = msgspec.json.encode(record)
    own, signed = _own(record), _own(record, key=b"0123456789abcdef")
    bare = _plain(lambda: data)
    encoding = _plain(lambda: json.dumps(msgspec.to_builtins(record)).encode())
    print(f"records of {len(data)} bytes a second: {own:,.0f} encoded and sealed, {signed:,.0f} signed as well;")
    print(f"  `mcap` alone {bare:,.0f} ready-made ({own / bare:.2f}), {encoding:,.0f} with json ({own / encoding:.1f})")


def _own(record: Snapshot, key: bytes = b"") -> float:
    schema = ContainerSchema("x", "jsonschema", b"{}")
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        writer = ContainerWriter(Path(folder) / "t.mcap", key)
        for number in range(RECORDS):
            writer.add("/x", schema, number, msgspec.json.encode(record))
            if number % EVERY == 0:
                writer.flush()
        writer.finish()
        return RECORDS / (time.process_time() - began)


def _plain(encoded: Callable[[], bytes]) -> float:
    with tempfile.TemporaryDirectory() as folder, (Path(folder) / "t.mcap").open("wb") as file:
        began = time.process_time()
        writer = mcap.writer.Writer(file, chunk_size=4 * 1024 * 1024)
        writer.start()
        channel = writer.register_channel("/x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        for number in range(RECORDS):
            writer.add_message(channel, number, encoded(), number)
            if number % EVERY == 0:
                writer.flush()
        writer.finish()
        return RECORDS / (time.process_time() - began)


def _share_of_writing(mission: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        report = lingjing.run(
            mission, policy="oracle", seed=1, world="inline", overview=False, out=Path(folder) / "run"
        )
        played = time.process_time() - began
        trace = read_trace(report.trace)
        spent = _written(trace, Path(folder) / "t.mcap")
    pictures = f"{len(trace.frames)} pictures" if trace.frames else "no picture"
    print(f"{mission}: {len(trace.boundaries)} boundaries, {pictures}: played in {played:.2f} s,")
    print(f"  records written in {spent:.3f} s: {spent / played:.1%} of it")


def _written(trace: Trace, path: Path) -> float:
    city = city_of(trace)
    assert city is not None, "the city is no longer as it was"
    began = time.process_time()
    with TraceWriter(path, trace.header, surroundings=surroundings(city, trace.header.instance)) as writer:
        for record in trace.boundaries:
            writer.boundary(record)
    return time.process_time() - began


def _read(paths: list[Path]) -> None:
    for path in paths:
        began = time.process_time()
        trace = read_trace(path)
        read = time.process_time()
        metrics(trace)
        done = time.process_time()
        print(f"{path.parent.name}: read in {read - began:.3f} s, metrics in {done - read:.3f} s")
        print(f"  1,000 of these on two cores: {500 * (done - began):.0f} s")


if __name__ == "__main__":
    main()
