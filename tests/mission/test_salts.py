"""Salts of sealed splits: drawn seeds, and every fault of the file."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from lingjing.errors import UsageError
from lingjing.mission.salts import instance_seed, public_seed, read_salt, salt_fault, salt_fingerprint


@pytest.fixture
def salt(tmp_path: Path) -> Path:
    path = tmp_path / "split.salt"
    path.write_text(f"{'5a' * 32}\n")
    path.chmod(0o600)
    return path


def test_a_salt_gives_seeds_that_differ_from_the_public_seeds(salt: Path) -> None:
    drawn = [instance_seed(str(salt), seed) for seed in range(100)]
    assert len({*drawn, *range(100)}) == 200
    assert all(0 <= seed < 2**63 for seed in drawn)
    assert drawn == [instance_seed(str(salt), seed) for seed in range(100)]
    assert instance_seed("", 7) == 7
    other = salt.with_name("other")
    other.write_text("5b" * 32)
    other.chmod(0o600)
    assert instance_seed(str(other), 0) != drawn[0]


def test_the_hash_is_that_of_the_file(salt: Path) -> None:
    assert read_salt(salt).sha256 == hashlib.sha256(salt.read_bytes()).hexdigest()


def test_a_trace_is_checked_against_the_published_salt(salt: Path, tmp_path: Path) -> None:
    header, seed = salt_fingerprint(str(salt), 3), instance_seed(str(salt), 3)
    assert public_seed(header, seed) == 3
    assert salt_fault(read_salt(salt), header, seed) == ""
    assert "is not the one that the salt draws for seed 3" in salt_fault(read_salt(salt), header, seed + 1)
    assert "is not the one" in salt_fault(read_salt(salt), {**header, "salt.seed": "x"}, seed)
    assert "without a salt" in salt_fault(read_salt(salt), {}, 3)
    salt.write_text("another secret of some length")
    assert "it names another salt: SHA-256" in salt_fault(read_salt(salt), header, seed)


@pytest.mark.parametrize(
    ("content", "mode", "message"),
    [
        (None, 0o600, "there is no salt file"),
        ("short", 0o600, "it has 5 bytes, and 16 to 4096 are required"),
        ("x" * 5000, 0o600, "is no salt"),
        ("5a" * 32, 0o644, "is not secret: its mode is 644"),
        ("5a" * 32, 0o640, "is not secret: its mode is 640"),
    ],
)
def test_a_faulty_salt_is_refused(tmp_path: Path, content: str | None, mode: int, message: str) -> None:
    path = tmp_path / "split.salt"
    if content is not None:
        path.write_text(content)
        path.chmod(mode)
    with pytest.raises(UsageError, match=message):
        read_salt(path)


def test_a_published_salt_may_be_readable(salt: Path) -> None:
    salt.chmod(0o644)
    assert read_salt(salt, published=True).text


def test_a_folder_is_no_salt(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot read the salt file"):
        read_salt(tmp_path)
