"""A user's file of version 1 compiles to the same mission as before the nine missions followed the paper row by row.

`golden/user_v1.mission.json` was written before. The nine missions changed presets of cameras and verbs of vehicles in
their own files, and not in the standard library that other missions use.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

import lingjing
from lingjing.testing.declarations import Origin
from lingjing.testing.documents import decode

HERE = Path(__file__).parent


def test_a_file_of_version_1_compiles_to_the_stored_mission() -> None:
    stored = HERE / "golden" / "user_v1.mission.json"
    before = decode(stored.read_text(encoding="utf-8"), str(stored))
    now = lingjing.compile(HERE / "data" / "user_v1.ljs")
    assert msgspec.structs.replace(now, origin=Origin()) == before
