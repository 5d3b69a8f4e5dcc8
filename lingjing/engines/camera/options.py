"""The options of the camera engine, as the model that the plug-in declares (ADR 0016)."""

from __future__ import annotations

from lingjing.plugins.options import Field, PluginOptions
from lingjing.trace.images import JPEG_QUALITY


class CameraOptions(PluginOptions):
    """The options of the engine `camera`."""

    quality: int = Field(
        JPEG_QUALITY,
        ge=50,
        le=100,
        description="JPEG quality of the pictures; values far below 90 hide visible targets (ADR 0012)",
    )
