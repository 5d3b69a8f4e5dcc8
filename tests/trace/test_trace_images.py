"""The picture codecs: fidelity, size and errors."""

import numpy as np
import pytest
import zstandard

from lingjing.errors import LingjingError
from lingjing.trace import images


def sea_depth(height: int = 1080, width: int = 1920) -> np.ndarray:
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    waves = sum(0.15 * np.sin(columns * a + rows * b) for a, b in ((0.03, 0.05), (0.11, -0.06), (0.2, 0.17)))
    return (100.0 + waves).astype(np.float32)


def sea_colour(height: int = 540, width: int = 960) -> np.ndarray:
    rows, columns = np.mgrid[0:height, 0:width]
    shade = 12 * np.sin(columns / 13 + rows / 29)
    return np.clip(np.stack([shade + 30, shade + 80, shade + 110], -1), 0, 255).astype(np.uint8)


def test_a_jpeg_is_close_to_its_input_and_deterministic() -> None:
    rgb = sea_colour()
    data = images.encode_jpeg(rgb)
    back = images.decode_jpeg(data)
    assert back.shape == rgb.shape and back.dtype == np.uint8 and back.flags.writeable
    assert np.abs(back.astype(int) - rgb).mean() < 2.0
    assert images.encode_jpeg(rgb) == data
    assert len(images.encode_jpeg(rgb, quality=40)) < len(data)


def test_stored_depth_is_exact_to_half_a_centimetre_and_small() -> None:
    depth = sea_depth()
    depth[:50] = np.inf
    depth[50, :3] = (655.33, 4321.123, 0.0)
    data = images.encode_depth(images.quantise_depth(depth))
    back = images.decode_depth(data, 1920, 1080)
    near = np.isfinite(depth)
    assert np.abs(back[near] - depth[near]).max() <= 0.00505
    assert np.isinf(back[~near]).all()
    assert np.array_equal(back, images.quantise_depth(depth))
    assert (
        len(zstandard.compress(data)) < 2_500_000
    )  # waves with full detail; the sea of the renderer is flat and takes 1 kB


@pytest.mark.parametrize(
    ("value", "expected"), [(np.nan, np.inf), (np.inf, np.inf), (-1.0, 0.0), (-np.inf, 0.0), (550e3, 550e3)]
)
def test_extreme_depths_do_not_wrap_around(value: float, expected: float) -> None:
    back = images.decode_depth(images.encode_depth(images.quantise_depth(np.full((3, 4), value, np.float32))), 4, 3)
    assert (back == np.float32(expected)).all()


def test_random_depth_is_the_same_after_encoding_and_decoding() -> None:
    depth = np.random.default_rng(1).uniform(0, 700, (37, 53)).astype(np.float32)
    assert np.array_equal(
        images.decode_depth(images.encode_depth(images.quantise_depth(depth)), 53, 37), images.quantise_depth(depth)
    )


def test_class_ids_are_stored_exactly_as_a_png() -> None:
    ids = np.random.default_rng(2).integers(0, 256, (31, 47)).astype(np.uint8)
    data = images.encode_semantic(ids)
    assert data.startswith(b"\x89PNG")
    assert np.array_equal(images.decode_semantic(data), ids)


@pytest.mark.parametrize("decode", [images.decode_jpeg, images.decode_semantic])
def test_invalid_picture_bytes_are_an_error(decode) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(LingjingError, match="broken"):
        decode(b"nonsense")


def test_truncated_pictures_are_an_error() -> None:
    jpeg = images.encode_jpeg(sea_colour(64, 64))
    with pytest.raises(LingjingError, match="broken JPEG"):
        images.decode_jpeg(jpeg[: len(jpeg) // 2])
    ids = images.encode_semantic(np.arange(4096, dtype=np.uint8).reshape(64, 64))
    with pytest.raises(LingjingError, match="broken PNG"):
        images.decode_semantic(ids[: len(ids) // 2])
    with pytest.raises(LingjingError, match="has 16384 bytes, not 8192"):
        images.decode_depth(images.encode_depth(images.quantise_depth(sea_depth(64, 64)))[:8192], 64, 64)


def test_a_small_file_with_too_many_pixels_is_rejected() -> None:
    import io

    import PIL.Image

    for side in (8200, 20_000):
        out = io.BytesIO()
        PIL.Image.new("L", (side, side)).save(out, "PNG", compress_level=9)
        with pytest.raises(LingjingError, match="broken PNG"):
            images.decode_semantic(out.getvalue())
