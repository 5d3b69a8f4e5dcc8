"""Named streams: their guarantees and their pinned values."""

import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lingjing.mission.seeding import Stream, generator, integer

SEEDS = st.integers(min_value=-(2**63), max_value=2**63)
PATHS = st.text(min_size=1, max_size=30)


def test_stream_is_pinned() -> None:
    # Changing these numbers changes every drawn mission: it is a new format, not a clean-up.
    stream = Stream(7, "ssr/victim/position")
    assert stream.word() == int.from_bytes(_block(7, "ssr/victim/position", 0)[:8], "big")
    assert integer(7, "ssr/scene") == 5269232657353628


def _block(seed: int, path: str, number: int) -> bytes:
    import hashlib

    key = hashlib.sha256(f"{seed}\n{path}".encode()).digest()
    return hashlib.sha256(key + number.to_bytes(8, "big")).digest()


@given(SEEDS, PATHS, PATHS)
def test_streams_of_different_paths_differ(seed: int, path: str, other: str) -> None:
    same = [Stream(seed, path).word() for _ in range(2)]
    assert same[0] == same[1]
    if path != other:
        assert Stream(seed, other).word() != same[0]


@given(SEEDS, PATHS, st.integers(1, 10_000))
def test_below_returns_values_below_the_count(seed: int, path: str, count: int) -> None:
    stream = Stream(seed, path)
    assert all(0 <= stream.below(count) < count for _ in range(5))


def test_uniform_and_normal_draws_have_the_expected_moments() -> None:
    stream = Stream(1, "moments")
    flat = [stream.uniform(-1, 3) for _ in range(20_000)]
    bell = [stream.normal(5, 2) for _ in range(20_000)]
    assert statistics.fmean(flat) == pytest.approx(1, abs=0.03)
    assert statistics.pstdev(flat) == pytest.approx(4 / math.sqrt(12), rel=0.02)
    assert statistics.fmean(bell) == pytest.approx(5, abs=0.05)
    assert statistics.pstdev(bell) == pytest.approx(2, rel=0.02)
    assert min(flat) >= -1 and max(flat) <= 3


def test_generator_is_a_function_of_seed_and_path() -> None:
    first, again = generator(3, "waves").random(4), generator(3, "waves").random(4)
    assert np.array_equal(first, again)
    assert not np.array_equal(first, generator(4, "waves").random(4))


def test_the_number_of_bits_of_an_integer_is_limited() -> None:
    assert 0 <= integer(5, "x", bits=8) < 256
    with pytest.raises(ValueError, match="257"):
        integer(5, "x", bits=257)
