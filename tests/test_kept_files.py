"""Kept files: a read returns the written bytes or nothing, and the oldest files are removed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from lingjing.kept_files import READ_AGAIN_S, prune, read_kept, write_kept


def test_written_bytes_are_read_back(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "one"
    write_kept(str(file), b"what is kept")
    read = read_kept(str(file))
    assert read is not None and bytes(read) == b"what is kept"
    assert os.listdir(file.parent) == ["one"]


@pytest.mark.parametrize("place", [0, 31, 32, -1])
def test_a_file_with_a_flipped_bit_or_a_cut_end_is_not_read(tmp_path: Path, place: int) -> None:
    file = tmp_path / "one"
    write_kept(str(file), b"what is kept")
    whole = bytearray(file.read_bytes())
    whole[place] ^= 1
    file.write_bytes(whole)
    assert read_kept(str(file)) is None
    file.write_bytes(whole[:20])
    assert read_kept(str(file)) is None


def test_a_read_file_is_marked_as_read(tmp_path: Path) -> None:
    file = tmp_path / "one"
    write_kept(str(file), b"")
    long_ago = file.stat().st_mtime - 2 * READ_AGAIN_S
    os.utime(file, (long_ago, long_ago))
    read_kept(str(file))
    assert file.stat().st_mtime > long_ago + READ_AGAIN_S


def test_a_failed_write_leaves_no_new_file(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    with pytest.raises(OSError):
        write_kept(str(tmp_path / "one"), b"what is kept")
    assert os.listdir(tmp_path) == ["one"]


def test_the_oldest_files_are_removed_when_the_limit_is_exceeded(tmp_path: Path) -> None:
    for number in range(6):
        file = tmp_path / f"{number}.mesh"
        file.write_bytes(bytes(100))
        os.utime(file, (1000 * number, 1000 * number))
    left = tmp_path / ".new-left"
    left.write_bytes(bytes(100))
    prune(str(tmp_path), most_bytes=250, most_files=100)
    assert sorted(os.listdir(tmp_path)) == [".new-left", "4.mesh", "5.mesh"]
    os.utime(left, (0, 0))
    prune(str(tmp_path), most_bytes=250, most_files=1)
    assert sorted(os.listdir(tmp_path)) == ["5.mesh"]
