"""Pictures as bytes: JPEG for colour, an indexed PNG for class ids, metres for depth.

Pillow codes JPEG and PNG: as quick as OpenCV at 1080p (5.6 ms in, 7 ms out) without its thread pool, so the world
process may import this module before it forks. Everything here is single-threaded and deterministic for one set of
library versions.

Depth is metres in float32, as the tools that open a trace read it, rounded to whole centimetres: the rounding leaves
few different bytes, so that a chunk of a city takes a quarter to a ninth of what it would otherwise. Beyond 83 km
float32 itself is coarser. Where nothing is hit it is infinity. Policies receive what is stored (`quantise_depth`),
never the original.
"""

from __future__ import annotations

import io
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lingjing.errors import LingjingError

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

JPEG_QUALITY = 90
DEPTH_STEP_M = 0.01
MOST_PIXELS = 2**26
"""Of one picture: 8K has half as many. A few megabytes of JPEG can say that they are gigabytes of pixels."""

RgbPixels = npt.NDArray[np.uint8]
Depth = npt.NDArray[np.float32]
Semantic = npt.NDArray[np.uint8]


def encode_jpeg(rgb: RgbPixels, quality: int = JPEG_QUALITY) -> bytes:
    """`rgb` is (height, width, 3) uint8. Baseline JPEG with 4:2:0 chroma, no metadata."""
    import PIL.Image

    out = io.BytesIO()
    PIL.Image.fromarray(rgb).save(out, "JPEG", quality=quality)
    return out.getvalue()


def decode_jpeg(data: bytes) -> RgbPixels:
    """Pixels as (height, width, 3) uint8, writable and contiguous. Raises `LingjingError` for a broken image."""
    return np.array(_open(data, "JPEG").convert("RGB"))


def encode_depth(depth: Depth) -> bytes:
    """`depth` is (height, width) float32 metres, inf where nothing is hit. Little-endian float32, row by row,
    uncompressed: the file's chunks are compressed (0.1 to 0.5 MB for 1080p over a city)."""
    return quantise_depth(depth).astype("<f4", copy=False).tobytes()


def decode_depth(data: bytes, width: int, height: int) -> Depth:
    """The stored depth in metres, (height, width) float32. Raises `LingjingError` if it has another size."""
    if len(data) != 4 * width * height:
        raise LingjingError(f"a depth image of {width} by {height} has {4 * width * height} bytes, not {len(data)}")
    return np.frombuffer(data, "<f4").reshape(height, width).astype(np.float32)


def quantise_depth(depth: Depth) -> Depth:
    """Exactly `decode_depth(encode_depth(depth), …)`, without the bytes in between: whole centimetres, nothing less
    than 0, and infinity for what is no number."""
    metres: Depth = np.rint(depth * np.float32(1.0 / DEPTH_STEP_M))
    np.maximum(metres, np.float32(0.0), out=metres)
    metres *= np.float32(DEPTH_STEP_M)
    metres[np.isnan(metres)] = np.inf
    return metres


def encode_semantic(semantic: Semantic) -> bytes:
    """`semantic` is (height, width) uint8 class ids. A PNG whose palette tells neighbouring ids apart."""
    import PIL.Image

    image = PIL.Image.fromarray(semantic)
    image.putpalette(_palette())
    out = io.BytesIO()
    image.save(out, "PNG", compress_level=2)
    return out.getvalue()


def decode_semantic(data: bytes) -> Semantic:
    """The class ids, (height, width) uint8. Raises `LingjingError` for a broken image."""
    return np.array(_open(data, "PNG"))


def _open(data: bytes, kind: str) -> ImageFile:
    import PIL.Image

    try:
        image = PIL.Image.open(io.BytesIO(data), formats=(kind,))
        if image.width * image.height > MOST_PIXELS:
            raise ValueError(f"{image.width} by {image.height} pixels")
        image.load()
    except (OSError, SyntaxError, ValueError, PIL.Image.DecompressionBombError) as error:
        raise LingjingError(f"broken {kind} image of {len(data)} bytes: {error}") from error
    return image


@lru_cache(maxsize=1)
def _palette() -> bytes:
    """256 colours; golden-ratio hues keep consecutive ids far apart, 0 is black."""
    import colorsys

    colours = [(0.0, 0.0, 0.0)] + [colorsys.hsv_to_rgb(i * 0.618034 % 1.0, 0.65, 0.95) for i in range(1, 256)]
    return bytes(round(255 * channel) for colour in colours for channel in colour)
