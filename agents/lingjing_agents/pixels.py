"""OpenCV, imported when the first picture comes, on one thread: results must not depend on a thread pool."""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def opencv() -> Any:
    """The cv2 module."""
    import cv2

    cv2.setNumThreads(1)
    return cv2
