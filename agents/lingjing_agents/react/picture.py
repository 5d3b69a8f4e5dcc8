"""Pixels to the JPEG a model receives."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lingjing_agents.perception.images import opencv

JPEG_QUALITY = 85


def jpeg(rgb: npt.NDArray[np.uint8], longest_side: int) -> bytes:
    """`rgb` (height, width, 3) as a JPEG whose longer side is at most `longest_side` pixels."""
    cv2 = opencv()
    height, width = rgb.shape[:2]
    scale = min(1.0, longest_side / max(height, width))
    if scale < 1.0:
        size = (max(1, round(width * scale)), max(1, round(height * scale)))
        rgb = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    ok, data = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    assert ok
    return bytes(data)
