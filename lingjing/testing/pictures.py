"""JPEG pictures as cameras store them, for tests of policies and detectors that receive pictures."""

from lingjing.trace.images import decode_jpeg, encode_jpeg

__all__ = ["decode_jpeg", "encode_jpeg"]
