"""Write the reference transcripts: `python tools/transcripts.py RUNS [--columns …]`, from played episodes.

`RUNS` holds a folder for each column, `upr-star`, of an episode that `sighted-reader` played at tier 1. Its record of
calls is written to `examples/transcripts`, compressed and with small pictures, so that a reader can see what a model is
sent and what answers win. `lingjing calls examples/transcripts/upr-star` opens it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from lingjing.decoding import from_json
from lingjing.trace.call_store import CALLS_NAME, PACKED_NAME, CallReader, CallStore, pack
from lingjing.trace.calls import CallRequest, RecordedCall, sha256

PLACE = Path(__file__).parents[1] / "examples" / "transcripts"
SIDE, QUALITY = 128, 30
"""The longer side of a picture in pixels and its JPEG quality: some 2 kB. Chosen: a reader recognises the scene."""


class _Thinner:
    """Replaces the pictures of a record by small ones."""

    def __init__(self, reader: CallReader) -> None:
        self._reader = reader
        self._small: dict[str, bytes] = {}

    def request(self, call: RecordedCall) -> CallRequest:
        """Return the request of a call with small pictures."""
        decoded = [from_json(message) for message in call.messages]
        pictures: dict[bytes, None] = {}
        for message in decoded:
            for part in message["content"] if isinstance(message["content"], list) else ():
                if part.get("type") == "picture":
                    small = self._thumbnail(part["sha256"])
                    pictures[small] = None
                    part["sha256"] = sha256(small).hex()
        messages = tuple(msgspec.json.encode(message) for message in decoded)
        return CallRequest(
            tick=call.tick, number=call.number, head=call.head, messages=messages, pictures=tuple(pictures)
        )

    def _thumbnail(self, name: str) -> bytes:
        if name not in self._small:
            data = np.frombuffer(self._reader.content(bytes.fromhex(name)), np.uint8)
            whole: Any = cv2.imdecode(data, cv2.IMREAD_COLOR)
            scale = SIDE / max(whole.shape[:2])
            size = (max(1, round(whole.shape[1] * scale)), max(1, round(whole.shape[0] * scale)))
            small = cv2.resize(whole, size, interpolation=cv2.INTER_AREA)
            self._small[name] = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()
        return self._small[name]


def thin(record: Path, out: Path) -> None:
    """Write a record with small pictures to a new file."""
    with closing(CallReader(record)) as reader:
        thinner = _Thinner(reader)
        store = CallStore(out, reader.episode)
        try:
            for call in reader.calls():
                store.begin(call.agent, thinner.request(call), call.result)
        finally:
            store.close()


def main() -> int:
    """Write the transcripts and print their sizes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path)
    parser.add_argument("--columns", nargs="+", metavar="MISSION-MODE")
    args = parser.parse_args()
    for folder in sorted(args.runs.iterdir()):
        if not (folder / CALLS_NAME).is_file() or (args.columns and folder.name not in args.columns):
            continue
        out = PLACE / folder.name / PACKED_NAME
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as place:
            small = Path(place) / CALLS_NAME
            thin(folder / CALLS_NAME, small)
            pack(small, out)
        print(f"{folder.name}: {out.stat().st_size / 1000:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
